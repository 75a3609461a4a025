//! OpenMVS: the interface file, which begins with `MVSI` (`libs/MVS/Interface.h`). Project files of OpenMVS itself are others.
//!
//! A pose holds R from world to platform and its centre; a camera stands in its platform the same way. Intrinsics are in units of
//! the longer side unless the camera says its size. Pixel centres are at whole numbers: half a pixel is added here. Newer
//! versions scale the principal point about the picture's corner and no longer about the first pixel's centre (`ScaleK`):
//! where it lies tells which, and pixels where a size is lacking.

use super::blended_mvs::files_of;
use super::bytes::Bytes;
use super::photo_index::PhotoIndex;
use super::posed::Posed;
use super::source::{SourceCamera, SourceScene};
use super::tool_folder::scene_of;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::folder_of;
use crate::image::file;
use crate::scene::lens::Lens;
use glam::{DMat3, DVec2, DVec3};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Versions whose layout is known.
const KNOWN_VERSIONS: std::ops::RangeInclusive<u32> = 0..=7;
/// Stands for no pose.
const NONE: u32 = u32::MAX;

/// The interface file of a folder, if it holds one.
pub fn file_of(folder: &Path) -> Option<PathBuf> {
    files_of(folder, &["mvs"]).ok()?.into_iter().find(|path| {
        let mut start = [0; 4];
        std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start)).is_ok() && &start == b"MVSI"
    })
}

struct Placed {
    rotation: DMat3,
    centre: DVec3,
}

struct Camera {
    size: (u32, u32),
    intrinsics: DMat3,
    in_platform: Placed,
}

struct Platform {
    cameras: Vec<Camera>,
    poses: Vec<Placed>,
}

fn matrix(bytes: &mut Bytes) -> Result<DMat3> {
    let mut values = [0.0; 9];
    for value in &mut values {
        *value = bytes.f64("a matrix")?;
    }
    Ok(DMat3::from_cols_array(&values).transpose())
}

fn vector(bytes: &mut Bytes) -> Result<DVec3> {
    Ok(DVec3::new(bytes.f64("a centre")?, bytes.f64("a centre")?, bytes.f64("a centre")?))
}

fn text(bytes: &mut Bytes) -> Result<String> {
    let length = bytes.count("the length of a name", 1)?;
    Ok(String::from_utf8_lossy(bytes.take(length, "a name")?).into_owned())
}

fn placed(bytes: &mut Bytes) -> Result<Placed> {
    Ok(Placed { rotation: matrix(bytes)?, centre: vector(bytes)? })
}

fn platform(bytes: &mut Bytes, version: u32) -> Result<Platform> {
    text(bytes)?;
    let mut cameras = Vec::new();
    for _ in 0..bytes.count("the number of cameras", 176)? {
        text(bytes)?;
        if version > 3 {
            text(bytes)?;
        }
        let size = if version > 0 { (bytes.u32("a width")?, bytes.u32("a height")?) } else { (0, 0) };
        cameras.push(Camera { size, intrinsics: matrix(bytes)?, in_platform: placed(bytes)? });
    }
    let mut poses = Vec::new();
    for _ in 0..bytes.count("the number of poses", 96)? {
        poses.push(placed(bytes)?);
    }
    Ok(Platform { cameras, poses })
}

/// Intrinsics whose pixel centres are at whole numbers, with centres at (0.5, 0.5).
fn half_added(mut intrinsics: DMat3) -> DMat3 {
    intrinsics.z_axis += DVec3::new(0.5, 0.5, 0.0);
    intrinsics
}

/// Intrinsics in pixels, centres at (0.5, 0.5), of a camera that does not say its size: in units of the longer side by
/// either rule, or in pixels all the same.
fn of_units(intrinsics: DMat3, (width, height): (usize, usize)) -> DMat3 {
    /// Further out than this, in longer sides, no principal point lies.
    const FURTHEST: f64 = 4.0;
    let unit = width.max(height) as f64;
    let centre = intrinsics.z_axis.truncate();
    if centre.abs().max_element() > FURTHEST {
        return half_added(intrinsics);
    }
    let middle = DVec2::new(width as f64, height as f64) * 0.5 / unit;
    let about_corner = centre + DVec2::splat(0.5);
    let mut scaled = DMat3::from_diagonal(DVec3::new(unit, unit, 1.0)) * intrinsics;
    if (about_corner - middle).length() < (centre - middle).length() {
        // (c + 0.5) / unit - 0.5 was written, where c + 0.5 is what is meant here.
        scaled.z_axis = (about_corner * unit).extend(1.0);
        return scaled;
    }
    half_added(scaled)
}

/// Lists an OpenMVS scene and reads its cameras.
pub fn read(path: &Path) -> Result<SourceScene> {
    let folder = folder_of(path);
    let mut bytes = Bytes::open(path)?;
    if bytes.take(4, "its first word")? != b"MVSI" {
        return Err(Error::new(ErrorKind::Unsupported, "this is not an interface file of OpenMVS")
            .at(Place::File(path.into()))
            .remedy("give the .mvs file that InterfaceCOLMAP or another interface wrote, or the COLMAP model itself"));
    }
    let version = bytes.u32("its version")?;
    if !KNOWN_VERSIONS.contains(&version) {
        return Err(Error::new(ErrorKind::Unsupported, format!("version {version} of the interface is not known"))
            .at(Place::File(path.into()))
            .remedy("export the scene as COLMAP (InterfaceCOLMAP)"));
    }
    bytes.u32("its header")?;
    let mut platforms = Vec::new();
    for _ in 0..bytes.count("the number of platforms", 24)? {
        platforms.push(platform(&mut bytes, version)?);
    }
    let photos = PhotoIndex::of_folders(&[folder.join("images"), folder.into()].map(|path: PathBuf| path))?;
    let mut findings = Vec::new();
    let (mut posed, mut unposed) = (Vec::new(), 0usize);
    for _ in 0..bytes.count("the number of images", 20)? {
        let place = bytes.place();
        let listed = text(&mut bytes)?;
        let mask = if version > 4 { text(&mut bytes)? } else { String::new() };
        let [platform, camera, pose] =
            [bytes.u32("a platform")?, bytes.u32("a camera")?, bytes.u32("a pose")?].map(|index| index as usize);
        if version > 2 {
            bytes.u32("the number of an image")?;
        }
        if version > 6 {
            bytes.skip(12, "depths")?;
            let scores = bytes.count("the number of scores", 24)?;
            bytes.skip(24 * scores, "scores")?;
        }
        if pose == NONE as usize {
            unposed += 1;
            continue;
        }
        let found = platforms.get(platform).and_then(|own| Some((own.cameras.get(camera)?, own.poses.get(pose)?)));
        let (camera, pose) = found.ok_or_else(|| {
            Error::new(ErrorKind::Malformed, format!("{listed} names a camera or pose that is not there"))
                .at(place.clone())
                .remedy("the file is damaged: export it again")
        })?;
        let size = match camera.size {
            (0, _) | (_, 0) => photos.find(&listed).map(|path| file::read_size(&path)).transpose()?,
            (width, height) => Some((width as usize, height as usize)),
        };
        let intrinsics = match (camera.size, size) {
            ((0, _) | (_, 0), Some(size)) => of_units(camera.intrinsics, size),
            _ => half_added(camera.intrinsics),
        };
        let rotation = camera.in_platform.rotation * pose.rotation;
        let centre = pose.centre + pose.rotation.transpose() * camera.in_platform.centre;
        let (own, mut noticed) = SourceCamera::new(intrinsics, rotation, -(rotation * centre), &place)?;
        findings.append(&mut noticed);
        let mask = Some(folder.join(mask)).filter(|path| path.is_file());
        posed.push(Posed { listed, camera: own, lens: Lens::default(), size, mask, place });
    }
    if unposed > 0 {
        let message = format!("{unposed} photos have no pose and are skipped");
        findings.push(Finding::new(Severity::Note, "camera-not-aligned", message).at(Place::File(path.into())));
    }
    scene_of(folder, posed, &photos, &[folder.into()], findings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    fn interface() -> Vec<u8> {
        let mut bytes = b"MVSI\x06\0\0\0\0\0\0\0".to_vec();
        let count = |bytes: &mut Vec<u8>, value: u64| bytes.extend(value.to_le_bytes());
        let name = |bytes: &mut Vec<u8>, text: &str| {
            bytes.extend((text.len() as u64).to_le_bytes());
            bytes.extend(text.as_bytes());
        };
        let doubles =
            |bytes: &mut Vec<u8>, values: &[f64]| values.iter().for_each(|own| bytes.extend(own.to_le_bytes()));
        const TURN: [f64; 9] = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        const SAME: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        count(&mut bytes, 1);
        name(&mut bytes, "platform");
        count(&mut bytes, 1);
        name(&mut bytes, "camera");
        name(&mut bytes, "RGB");
        bytes.extend([0; 8]);
        doubles(&mut bytes, &[1.25, 0.0, 0.4875, 0.0, 1.25, 0.3625, 0.0, 0.0, 1.0]);
        doubles(&mut bytes, &SAME);
        doubles(&mut bytes, &[0.0; 3]);
        count(&mut bytes, 1);
        doubles(&mut bytes, &TURN);
        doubles(&mut bytes, &[1.0, 2.0, 3.0]);
        count(&mut bytes, 2);
        for (photo, pose) in [("images/a.png", 0u32), ("images/b.png", NONE)] {
            name(&mut bytes, photo);
            name(&mut bytes, "");
            [0, 0, pose, 7].iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        }
        bytes
    }

    #[test]
    fn where_the_principal_point_lies_tells_how_intrinsics_are_written() {
        let written = |focal: f64, x: f64, y: f64| {
            DMat3::from_diagonal(DVec3::new(focal, focal, 1.0))
                + DMat3::from_cols(DVec3::ZERO, DVec3::ZERO, DVec3::new(x, y, 0.0))
        };
        let of_first_pixel = written(1.25, 20.1 / 40.0, 14.3 / 40.0);
        let of_corner = written(1.25, 20.6 / 40.0 - 0.5, 14.8 / 40.0 - 0.5);
        let in_pixels = written(50.0, 20.1, 14.3);
        for intrinsics in [of_first_pixel, of_corner, in_pixels] {
            let read = of_units(intrinsics, (40, 30));
            assert!((read - written(50.0, 20.6, 14.8)).to_cols_array().iter().all(|off| off.abs() < 1e-9), "{read}");
        }
    }

    #[test]
    fn normalised_intrinsics_become_pixels_with_centres_at_a_half() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        for name in ["a", "b"] {
            let path = folder.path().join(format!("images/{name}.png"));
            file::write_png_srgb8(&path, &Image::filled(40, 30, [9; 3])).unwrap();
        }
        let path = folder.path().join("scene.mvs");
        let bytes = interface();
        std::fs::write(&path, &bytes).unwrap();
        let scene = read(&file_of(folder.path()).unwrap()).unwrap();
        assert_eq!(scene.views.len(), 1);
        let camera = &scene.views[0].camera;
        assert_eq!(camera.pinhole().focal_pixels.to_array(), [50.0, 50.0]);
        assert_eq!(camera.pinhole().centre_pixels.to_array(), [20.0, 15.0]);
        assert!((camera.rotation.transpose() * -camera.translation - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        assert_eq!(scene.findings[0].code, "camera-not-aligned");
        for length in 4..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(read(&path).is_err(), "cut to {length}");
        }
    }
}
