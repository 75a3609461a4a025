//! RealityCapture and RealityScan: an XMP file beside each photo.
//!
//! World to camera, OpenCV axes; `Position` is where the camera stands. The focal length is that of 35 mm film over the longer side,
//! the principal point an offset from the middle in units of the longer side. Photos with `InTexturing="0"` were rejected for
//! their colour by the user: they take no part. The order of the tangential pair is taken to be OpenCV's. Which side
//! `AspectRatio` and `Skew` stretch is told differently by different programs: other values than 1 and 0 are refused.

use super::blended_mvs::files_of;
use super::camera_file::read_text;
use super::colmap_lens::matrix;
use super::mesh_choice;
use super::metashape_project::parse;
use super::photo_index::{PhotoIndex, some_of};
use super::posed::{Posed, views_of};
use super::source::{SourceCamera, SourceScene};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::name_of;
use crate::image::file;
use crate::scene::lens::{Lens, Model, Polynomial};
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

/// Width of 35 mm film in millimetres.
const FILM_MILLIMETRES: f64 = 36.0;

/// Pixels whose sides differ by less than this share are square: it moves the edge of a photo by less than a pixel.
const SQUARE: f64 = 1e-4;

/// Folders below that of the side files that are looked into, how deep and how many.
const DEEPEST: usize = 3;
const MOST_FOLDERS: usize = 1000;

/// The folder of a scene that holds the side files: itself, or one of photos.
pub fn folder_of(folder: &Path) -> Option<PathBuf> {
    side_files(folder).map(|(inner, _)| inner)
}

/// The side files of a scene and the folder that they lie in or under: the scene's itself, one of photos, or any. Those that
/// other programs wrote, such as Lightroom, are none.
fn side_files(folder: &Path) -> Option<(PathBuf, Vec<PathBuf>)> {
    let places = [("", 0), ("images", DEEPEST), ("photos", DEEPEST), ("image", DEEPEST), ("", DEEPEST)];
    places.into_iter().map(|(inner, depth)| (folder.join(inner), depth)).find_map(|(inner, depth)| {
        let (mut files, mut looked_into) = (Vec::new(), 0);
        collect(&inner, depth, &mut looked_into, &mut files);
        (!files.is_empty()).then_some((inner, files))
    })
}

fn collect(folder: &Path, depth: usize, looked_into: &mut usize, files: &mut Vec<PathBuf>) {
    *looked_into += 1;
    let own = files_of(folder, &["xmp"]).unwrap_or_default();
    files.extend(own.into_iter().filter(|path| read_text(path).is_ok_and(|text| text.contains("xcr:"))));
    if depth == 0 {
        return;
    }
    let is_looked_into = |path: &PathBuf| path.is_dir() && !name_of(path).starts_with(['.', '_']);
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut folders: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_looked_into).collect();
    folders.sort();
    for folder in folders {
        if *looked_into < MOST_FOLDERS {
            collect(&folder, depth - 1, looked_into, files);
        }
    }
}

/// What a side file says.
struct Side {
    in_texturing: bool,
    /// What could not be connected is a component of its own, with a frame of its own.
    component: Option<String>,
    focal_film: f64,
    centre: [f64; 2],
    rotation: [f64; 9],
    position: [f64; 3],
    model: String,
    distortion: Vec<f64>,
}

fn side_of(path: &Path) -> Result<Option<Side>> {
    let text = read_text(path)?;
    let document = parse(&text, path)?;
    // A value is an attribute of the description or an element in it.
    let value = |name: &str| {
        document.descendants().find_map(|node| {
            let attribute = node.attributes().find(|attribute| attribute.name() == name).map(|own| own.value());
            attribute.or_else(|| node.text().filter(|_| node.tag_name().name() == name)).map(str::trim)
        })
    };
    // What is written but is no number is refused where it is used.
    let numbers = |name: &str| -> Option<Vec<f64>> {
        Some(value(name)?.split_whitespace().map(|word| word.parse().unwrap_or(f64::NAN)).collect())
    };
    let number = |name: &str| numbers(name).and_then(|values| values.first().copied());
    let (Some(rotation), Some(position), Some(focal_film)) =
        (numbers("Rotation"), numbers("Position"), number("FocalLength35mm"))
    else {
        return Ok(None);
    };
    let (Ok(rotation), Ok(position)) = (rotation.try_into(), position.try_into()) else {
        return Err(Error::new(ErrorKind::Malformed, "Rotation is not nine numbers or Position not three")
            .at(Place::File(path.into()))
            .remedy("export the metadata again"));
    };
    for (name, usual) in [("AspectRatio", 1.0), ("Skew", 0.0)] {
        if let Some(value) = number(name).filter(|value| !((value - usual).abs() <= SQUARE)) {
            return Err(Error::new(ErrorKind::Unsupported, format!("{name} is {value}: the pixels are not square"))
                .at(Place::File(path.into()))
                .remedy("align with square pixels, or export undistorted photos with their XMP"));
        }
    }
    Ok(Some(Side {
        in_texturing: !matches!(value("InTexturing"), Some("0" | "false")),
        component: value("ComponentId").map(str::to_owned),
        focal_film,
        centre: [number("PrincipalPointU").unwrap_or(0.0), number("PrincipalPointV").unwrap_or(0.0)],
        rotation,
        position,
        model: value("DistortionModel").unwrap_or("perspective").to_owned(),
        distortion: numbers("DistortionCoeficients").or_else(|| numbers("DistortionCoefficients")).unwrap_or_default(),
    }))
}

fn lens_of(side: &Side, place: &Place) -> Result<Lens> {
    let mut k = [0.0; 6];
    for (own, value) in k.iter_mut().zip(&side.distortion) {
        *own = *value;
    }
    let model = match side.model.as_str() {
        "perspective" | "none" => Model::default(),
        "brown3" | "brown4" | "brown3t2" | "brown4t2" => Model::Polynomial(Polynomial {
            numerator: [k[0], k[1], k[2], k[3], 0.0, 0.0],
            tangential: [k[4], k[5]],
            ..Default::default()
        }),
        "division" => Model::Division { k: k[0] },
        other => {
            return Err(Error::new(ErrorKind::Unsupported, format!("the distortion model {other} is not read"))
                .at(place.clone())
                .remedy("export undistorted photos, or align with a Brown or division model"));
        }
    };
    Ok(Lens::new(model))
}

/// Lists a scene of side files and reads its cameras.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let (inner, files) = side_files(folder).unwrap_or_else(|| (folder.into(), Vec::new()));
    let photos = PhotoIndex::of_folders(&[inner.clone(), folder.into()])?;
    let mut findings = Vec::new();
    let (mut posed, mut rejected, mut elsewhere) = (Vec::new(), Vec::new(), Vec::new());
    let (mut sides, mut unaligned, mut tangential) = (Vec::new(), Vec::new(), false);
    for path in files {
        // Photos of one name in several folders are told apart by these.
        let stem = path.strip_prefix(&inner).unwrap_or(&path).with_extension("").to_string_lossy().into_owned();
        match side_of(&path)? {
            Some(side) => sides.push((path, stem, side)),
            None => unaligned.push(stem),
        }
    }
    // Where none is to be textured, nothing was textured yet.
    let is_any_textured = sides.iter().any(|(_, _, side)| side.in_texturing);
    let largest = largest_component(&sides);
    for (path, stem, side) in sides {
        if is_any_textured && !side.in_texturing {
            rejected.push(stem);
            continue;
        }
        if side.component != largest {
            elsewhere.push(stem);
            continue;
        }
        let place = Place::File(path.clone());
        let size = photos.find(&stem).map(|path| file::read_size(&path)).transpose()?;
        let (width, height) = size.map_or((1.0, 1.0), |(width, height)| (width as f64, height as f64));
        let side_pixels = width.max(height);
        let focal = side.focal_film * side_pixels / FILM_MILLIMETRES;
        let centre = [0.5 * width + side.centre[0] * side_pixels, 0.5 * height + side.centre[1] * side_pixels];
        let rotation = DMat3::from_cols_array(&side.rotation).transpose();
        let translation = -(rotation * DVec3::from_array(side.position));
        let (camera, mut noticed) = SourceCamera::new(matrix([focal; 2], centre), rotation, translation, &place)?;
        findings.append(&mut noticed);
        tangential |= side.distortion.iter().skip(4).any(|value| value.abs() > 1e-9);
        posed.push(Posed { listed: stem, camera, lens: lens_of(&side, &place)?, size, mask: None, place });
    }
    if tangential {
        findings.push(Finding::new(
            Severity::Note,
            "tangential-order-assumed",
            "the lens has tangential coefficients: t1 and t2 are taken for OpenCV's p1 and p2",
        ));
    }
    for (names, code, what) in [
        (unaligned, "camera-not-aligned", "are not aligned and take no part"),
        (rejected, "photo-rejected", "were excluded from texturing in the project and take no part"),
        (elsewhere, "component-chosen", "are of a smaller component with a frame of its own and take no part"),
    ] {
        if !names.is_empty() {
            findings.push(Finding::new(
                Severity::Note,
                code,
                format!("{} photos {what}: {}", names.len(), some_of(&names)),
            ));
        }
    }
    let views = views_of(posed, &photos, &[folder.into()], &mut findings)?;
    let mesh = mesh_choice::find(&[folder.into(), inner], &mut findings);
    Ok(SourceScene { findings, sizes_are_of_files: true, ..SourceScene::of_photographs(folder, mesh, views) })
}

/// The component with the most cameras; the first of equals.
fn largest_component(sides: &[(PathBuf, String, Side)]) -> Option<String> {
    let count = |own: &Option<String>| sides.iter().filter(|(_, _, side)| side.component == *own).count();
    // The last of equals is taken.
    sides.iter().rev().map(|(_, _, side)| &side.component).max_by_key(|own| count(own)).cloned().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    fn side(in_texturing: u8) -> String {
        format!(
            r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
            <rdf:Description xcr:Version="3" xcr:DistortionModel="brown4t2" xcr:FocalLength35mm="45" xcr:PrincipalPointU="0.01"
            xcr:PrincipalPointV="-0.02" xcr:InTexturing="{in_texturing}" xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#">
            <xcr:Rotation>0 1 0 -1 0 0 0 0 1</xcr:Rotation><xcr:Position>1 2 3</xcr:Position>
            <xcr:DistortionCoeficients>0.1 0.02 0 0.001 0 0</xcr:DistortionCoeficients></rdf:Description></rdf:RDF></x:xmpmeta>"#
        )
    }

    #[test]
    fn photos_in_several_folders_are_told_apart_and_files_of_lightroom_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join("images");
        for (name, position) in [("a", "1 2 3"), ("b", "4 5 6")] {
            std::fs::create_dir_all(images.join(name)).unwrap();
            file::write_png_srgb8(&images.join(name).join("0.png"), &Image::filled(40, 30, [9; 3])).unwrap();
            std::fs::write(images.join(name).join("0.xmp"), side(1).replace("1 2 3", position)).unwrap();
        }
        std::fs::write(images.join("0.xmp"), "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"/>").unwrap();
        assert_eq!(folder_of(folder.path()), Some(images.clone()));
        let scene = read(folder.path()).unwrap();
        let centres = scene.views.iter().map(|view| {
            let centre = view.camera.rotation.transpose() * -view.camera.translation;
            (view.photo.clone(), centre.x.round())
        });
        let expected = [(images.join("a/0.png"), 1.0), (images.join("b/0.png"), 4.0)];
        assert_eq!(centres.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn side_files_are_read_and_rejected_photos_left_out() {
        let folder = tempfile::tempdir().unwrap();
        for (name, in_texturing) in [("a", 1), ("b", 0)] {
            file::write_png_srgb8(&folder.path().join(format!("{name}.png")), &Image::filled(40, 30, [9; 3])).unwrap();
            std::fs::write(folder.path().join(format!("{name}.xmp")), side(in_texturing)).unwrap();
        }
        assert_eq!(folder_of(folder.path()).unwrap(), folder.path().join(""));
        let scene = read(folder.path()).unwrap();
        assert_eq!(scene.views.len(), 1);
        let camera = &scene.views[0].camera;
        assert_eq!(camera.pinhole().focal_pixels.to_array(), [50.0, 50.0]);
        assert!((camera.pinhole().centre_pixels - glam::DVec2::new(20.4, 14.2)).length() < 1e-9);
        assert!((camera.rotation * DVec3::Y - DVec3::X).length() < 1e-12, "row by row, world to camera");
        assert!((camera.rotation.transpose() * -camera.translation - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        assert!(scene.findings.iter().any(|finding| finding.code == "photo-rejected"));
        // Where none is to be textured, all take part; of two components the larger does.
        std::fs::write(folder.path().join("a.xmp"), side(0)).unwrap();
        assert_eq!(read(folder.path()).unwrap().views.len(), 2);
        let of_component =
            |name: &str| side(1).replace("xcr:Version", &format!("xcr:ComponentId=\"{name}\" xcr:Version"));
        for (name, component) in [("a", "{1}"), ("b", "{2}"), ("c", "{2}")] {
            file::write_png_srgb8(&folder.path().join(format!("{name}.png")), &Image::filled(40, 30, [9; 3])).unwrap();
            std::fs::write(folder.path().join(format!("{name}.xmp")), of_component(component)).unwrap();
        }
        let scene = read(folder.path()).unwrap();
        assert_eq!(scene.views.iter().map(|view| view.name.as_str()).collect::<Vec<_>>(), ["b", "c"]);
        assert!(scene.findings.iter().any(|own| own.code == "component-chosen" && own.message.ends_with(": a")));
        std::fs::remove_file(folder.path().join("c.xmp")).unwrap();
        std::fs::write(folder.path().join("b.xmp"), side(0)).unwrap();
        for (from, to, kind) in [
            ("brown4t2", "spiral", ErrorKind::Unsupported),
            ("xcr:Version", "xcr:AspectRatio=\"1.1\" xcr:Version", ErrorKind::Unsupported),
            ("xcr:Version", "xcr:Skew=\"0.01\" xcr:Version", ErrorKind::Unsupported),
            (">0.1 0.02", ">nan 0.02", ErrorKind::NonFinite),
        ] {
            std::fs::write(folder.path().join("a.xmp"), side(1).replace(from, to)).unwrap();
            assert_eq!(read(folder.path()).unwrap_err().kind(), kind, "{to}");
        }
        let square = side(1).replace("xcr:Version", "xcr:AspectRatio=\"1\" xcr:Skew=\"0\" xcr:Version");
        std::fs::write(folder.path().join("a.xmp"), square).unwrap();
        assert_eq!(read(folder.path()).unwrap().views.len(), 1);
    }
}
