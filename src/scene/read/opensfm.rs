//! OpenSfM: `reconstruction.json` (documentation, `geometry.rst`).
//!
//! World to camera, OpenCV axes, rotation as axis times angle. Coordinates are in units of the longer side from the middle of the
//! photo, so that in pixels whose first centre is at (0.5, 0.5) the middle is half of the size.

use super::camera_file::read_text;
use super::colmap_lens::matrix;
use super::photo_index::PhotoIndex;
use super::posed::Posed;
use super::source::{SourceCamera, SourceScene};
use super::tool_folder::scene_of;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::scene::lens::{Base, Lens, Model, Polynomial};
use glam::{DMat3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the file.
pub const FILE_NAME: &str = "reconstruction.json";

#[derive(serde::Deserialize)]
struct Reconstruction {
    cameras: BTreeMap<String, Camera>,
    shots: BTreeMap<String, Shot>,
}

#[derive(serde::Deserialize)]
struct Camera {
    projection_type: String,
    width: usize,
    height: usize,
    focal: Option<f64>,
    focal_x: Option<f64>,
    focal_y: Option<f64>,
    #[serde(default)]
    c_x: f64,
    #[serde(default)]
    c_y: f64,
    #[serde(default)]
    k1: f64,
    #[serde(default)]
    k2: f64,
    #[serde(default)]
    k3: f64,
    #[serde(default)]
    k4: f64,
    #[serde(default)]
    p1: f64,
    #[serde(default)]
    p2: f64,
}

#[derive(serde::Deserialize)]
struct Shot {
    rotation: [f64; 3],
    translation: [f64; 3],
    camera: String,
}

impl Camera {
    fn lens(&self, place: &Place) -> Result<(DMat3, Lens)> {
        let base = match self.projection_type.as_str() {
            "perspective" | "simple_radial" | "radial" | "brown" => Base::Plane,
            "fisheye" | "fisheye_opencv" => Base::Angle,
            other => {
                return Err(Error::new(ErrorKind::Unsupported, format!("the projection {other} is not supported"))
                    .at(place.clone())
                    .remedy("undistort the photos first (opensfm undistort)"));
            }
        };
        let side = self.width.max(self.height) as f64;
        let focal_x = self.focal_x.or(self.focal).ok_or_else(|| {
            Error::new(ErrorKind::Malformed, "the camera has no focal length")
                .at(place.clone())
                .remedy("export the reconstruction again")
        })?;
        let focal_y = self.focal_y.unwrap_or(focal_x);
        let centre = [0.5 * self.width as f64 + side * self.c_x, 0.5 * self.height as f64 + side * self.c_y];
        let numerator = [self.k1, self.k2, self.k3, self.k4, 0.0, 0.0];
        let polynomial = Polynomial { base, numerator, tangential: [self.p1, self.p2], ..Default::default() };
        Ok((matrix([side * focal_x, side * focal_y], centre), Lens::new(Model::Polynomial(polynomial))))
    }
}

fn reconstructions_of(path: &Path) -> Result<Vec<Reconstruction>> {
    serde_json::from_str(&read_text(path)?).map_err(|error| {
        Error::new(ErrorKind::Malformed, format!("not a list of reconstructions: {error}"))
            .at(Place::Line(path.into(), error.line().max(1)))
            .remedy("export the reconstruction again")
    })
}

/// Whether photos of a file of reconstructions are in a folder.
fn has_photos(reconstructions: &[Reconstruction], photos: &Path) -> bool {
    reconstructions.iter().flat_map(|own| own.shots.keys()).any(|name| photos.join(name).is_file())
}

/// Lists an OpenSfM scene and reads its cameras. Where only the undistorted photos are here, their cameras are read.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let (mut path, mut home) = (folder.join(FILE_NAME), folder.to_path_buf());
    let mut reconstructions = reconstructions_of(&path)?;
    let undistorted = folder.join("undistorted");
    if undistorted.join(FILE_NAME).is_file()
        && ![folder.join("images"), folder.into()].iter().any(|photos| has_photos(&reconstructions, photos))
    {
        let inner = reconstructions_of(&undistorted.join(FILE_NAME))?;
        if has_photos(&inner, &undistorted.join("images")) {
            (path, home, reconstructions) = (undistorted.join(FILE_NAME), undistorted, inner);
        }
    }
    let mut findings = Vec::new();
    let count = reconstructions.len();
    let largest = reconstructions.into_iter().max_by_key(|own| own.shots.len()).ok_or_else(|| {
        Error::new(ErrorKind::InvalidScene, "the file holds no reconstruction")
            .at(Place::File(path.clone()))
            .remedy("run the reconstruction again")
    })?;
    if count > 1 {
        let message =
            format!("of {count} reconstructions the one with the most photos is read: {}", largest.shots.len());
        findings.push(Finding::new(Severity::Warning, "reconstruction-chosen", message).at(Place::File(path.clone())));
    }
    let mut posed = Vec::new();
    for (name, shot) in largest.shots {
        let place = Place::View(format!("{name} of {}", path.display()));
        let camera = largest.cameras.get(&shot.camera).ok_or_else(|| {
            Error::new(ErrorKind::Malformed, format!("its camera '{}' is not there", shot.camera))
                .at(place.clone())
                .remedy("export the reconstruction again")
        })?;
        let (intrinsics, lens) = camera.lens(&place)?;
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::from_array(shot.rotation)));
        let translation = DVec3::from_array(shot.translation);
        let size = Some((camera.width, camera.height));
        let (camera, mut noticed) = SourceCamera::new(intrinsics, rotation, translation, &place)?;
        findings.append(&mut noticed);
        posed.push(Posed { listed: name, camera, lens, size, mask: None, place });
    }
    let photos = PhotoIndex::of_folders(&[home.join("images"), home])?;
    scene_of(folder, posed, &photos, &[folder.into(), folder.join("undistorted/depthmaps")], findings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Image, file};

    #[test]
    fn normalised_coordinates_become_pixels() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        file::write_png_srgb8(&folder.path().join("images/a.png"), &Image::filled(40, 30, [9; 3])).unwrap();
        let json = r#"[{"cameras":{"c":{"projection_type":"brown","width":40,"height":30,"focal_x":0.9,"focal_y":0.91,
            "c_x":0.01,"c_y":-0.02,"k1":0.1,"k2":0.02,"k3":0,"p1":0.001,"p2":0.002}},
            "shots":{"a.png":{"rotation":[0,0,1.5707963267948966],"translation":[1,2,3],"camera":"c"}}},{"cameras":{},"shots":{}}]"#;
        std::fs::write(folder.path().join(FILE_NAME), json).unwrap();
        let scene = read(folder.path()).unwrap();
        let pinhole = scene.views[0].camera.pinhole();
        assert!((pinhole.focal_pixels - glam::DVec2::new(36.0, 36.4)).length() < 1e-9);
        assert!((pinhole.centre_pixels - glam::DVec2::new(20.4, 14.2)).length() < 1e-9);
        assert!((scene.views[0].camera.rotation * DVec3::X - DVec3::Y).length() < 1e-9);
        assert_eq!(scene.findings[0].code, "reconstruction-chosen");
        std::fs::write(folder.path().join(FILE_NAME), json.replace("brown", "spherical")).unwrap();
        assert_eq!(read(folder.path()).unwrap_err().kind(), ErrorKind::Unsupported);
    }

    #[test]
    fn undistorted_photos_go_with_their_own_cameras() {
        let folder = tempfile::tempdir().unwrap();
        let put = |inner: &str, k1: f64, photo: &str| {
            let root = folder.path().join(inner);
            std::fs::create_dir_all(root.join("images")).unwrap();
            let json = format!(
                r#"[{{"cameras":{{"c":{{"projection_type":"perspective","width":40,"height":30,"focal":0.9,"k1":{k1}}}}},
                "shots":{{"{photo}":{{"rotation":[0,0,0],"translation":[1,2,3],"camera":"c"}}}}}}]"#
            );
            std::fs::write(root.join(FILE_NAME), json).unwrap();
        };
        let photo =
            |path: &str| file::write_png_srgb8(&folder.path().join(path), &Image::filled(40, 30, [9; 3])).unwrap();
        put("", 0.1, "a.png");
        put("undistorted", 0.0, "a.png");
        photo("undistorted/images/a.png");
        assert!(read(folder.path()).unwrap().views[0].lens.is_none());
        photo("images/a.png");
        let scene = read(folder.path()).unwrap();
        assert!(scene.views[0].lens.is_some() && scene.views[0].photo == folder.path().join("images/a.png"));
    }
}
