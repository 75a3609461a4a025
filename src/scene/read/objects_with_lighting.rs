//! An object of the data set Objects with Lighting (Ummenhofer et al. 2024).
//!
//! ```text
//! test/inputs/image_0000.png   8 bits, y = 255 (x 2^exposure)^(1/2.2)     test/inputs/mask_0000.png   an approximate mask
//! test/inputs/camera_0000.txt  K, R, t row by row, then width height channels: x = K (R X + t)
//! ```
//! The first pixel's centre is at (0.5, 0.5), +z is up. The data set has no mesh: one of another program must lie in the
//! folder, or be named. What is scored, `gt_*` beside `inputs`, is no part of the scene.

use super::blended_mvs::files_of;
use super::mesh_choice;
use super::source::{SourceCamera, SourceScene, SourceView};
use super::text::{self, Words};
use crate::error::{Finding, Place, Result, Severity};
use crate::scene::settings::{ColourEncoding, Up};
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

/// The folder of photos and cameras under a folder of an object, of its test, or of the inputs themselves.
pub fn inputs_of(folder: &Path) -> Option<PathBuf> {
    ["test/inputs", "inputs", ""].map(|inner| folder.join(inner)).into_iter().find(|inner| {
        let numbers = camera_files(inner, "");
        numbers.iter().any(|(number, _)| inner.join(format!("image_{number}.png")).is_file())
    })
}

/// Camera files of a folder whose names begin with a prefix and `camera_`, with the number that follows.
pub fn camera_files(folder: &Path, prefix: &str) -> Vec<(String, PathBuf)> {
    let start = format!("{prefix}camera_");
    let files = files_of(folder, &["txt"]).unwrap_or_default();
    let numbered = files.into_iter().filter_map(|path| {
        let stem = path.file_stem()?.to_string_lossy().into_owned();
        Some((stem.strip_prefix(&start)?.to_owned(), path))
    });
    numbered.collect()
}

/// Reads a camera: the camera, and width and height of its photo.
pub fn read_camera(path: &Path) -> Result<(SourceCamera, (usize, usize), Vec<Finding>)> {
    let text = text::read(path)?;
    let mut words = Words::new(path, &text);
    // Sizes may be written as other numbers are, with a point and an exponent.
    let mut values = [0.0; 23];
    for (index, value) in values.iter_mut().enumerate() {
        *value = words.number(match index {
            0..9 => "the intrinsics",
            9..18 => "the rotation",
            18..21 => "the translation",
            _ => "the size",
        })?;
    }
    let size = (values[21].max(0.0) as usize, values[22].max(0.0) as usize);
    let matrix = |start: usize| {
        let mut nine = [0.0; 9];
        nine.copy_from_slice(&values[start..start + 9]);
        DMat3::from_cols_array(&nine).transpose()
    };
    let translation = DVec3::new(values[18], values[19], values[20]);
    let (camera, findings) = SourceCamera::new(matrix(0), matrix(9), translation, &Place::File(path.into()))?;
    Ok((camera, size, findings))
}

/// Lists an object and reads its cameras.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let inputs = inputs_of(folder).unwrap_or_else(|| folder.into());
    let (mut views, mut findings, mut alone) = (Vec::new(), Vec::new(), 0usize);
    for (number, path) in camera_files(&inputs, "") {
        let photo = inputs.join(format!("image_{number}.png"));
        if !photo.is_file() {
            alone += 1;
            continue;
        }
        let (camera, size, mut noticed) = read_camera(&path)?;
        findings.append(&mut noticed);
        let mask = Some(inputs.join(format!("mask_{number}.png"))).filter(|mask| mask.is_file());
        let name = format!("image_{number}");
        views.push(SourceView { name, photo, mask, camera, lens: None, size: Some(size), place: Place::File(path) });
    }
    if alone > 0 {
        findings.push(
            Finding::new(Severity::Warning, "camera-without-photo", format!("{alone} cameras have no photo here"))
                .at(Place::File(inputs.clone()))
                .remedy("copy their photos as well if they should take part"),
        );
    }
    let beside = inputs.ancestors().take(3).filter(|parent| parent.starts_with(folder)).map(Path::to_path_buf);
    let mesh = mesh_choice::find(&beside.collect::<Vec<_>>(), &mut findings);
    Ok(SourceScene {
        findings,
        up: Up::Z,
        encoding: ColourEncoding::Gamma22,
        ..SourceScene::of_photographs(folder, mesh, views)
    })
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::image::{Image, file};
    use crate::scene::ReadSettings;
    use crate::scene::read::{Format, locate, photos};

    #[test]
    fn cameras_masks_and_the_curve_are_those_of_the_data_set() {
        let folder = tempfile::tempdir().unwrap();
        let inputs = folder.path().join("test/inputs");
        std::fs::create_dir_all(&inputs).unwrap();
        file::write_png_srgb8(&inputs.join("image_0003.png"), &Image::filled(40, 30, [128, 255, 0])).unwrap();
        file::write_png_srgb8(&inputs.join("mask_0003.png"), &Image::filled(40, 30, [255; 3])).unwrap();
        let camera = "50 0 20.5\n0 51 14.5\n0 0 1\n0 1 0\n-1 0 0\n0 0 1\n1 2 3\n4.0e+01 30 3\n";
        std::fs::write(inputs.join("camera_0003.txt"), camera).unwrap();
        std::fs::write(inputs.join("camera_0004.txt"), camera).unwrap();
        let located = locate(folder.path()).unwrap();
        assert_eq!(located.format, Format::ObjectsWithLighting);
        let scene = located.list(&ReadSettings::default()).unwrap();
        assert_eq!((scene.views.len(), scene.up), (1, Up::Z));
        let view = &scene.views[0];
        assert!((view.camera.rotation * DVec3::Y - DVec3::X).length() < 1e-12, "row by row");
        assert_eq!(view.camera.translation, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(view.size, Some((40, 30)));
        let loaded = photos::load_all(
            &scene.views,
            &[(40, 30)],
            scene.encoding,
            (None, &Default::default()),
            &ReadSettings::default(),
        )
        .unwrap();
        let radiance = loaded[0].photo.radiance(3, 3);
        assert!((f64::from(radiance.x) - (128.0f64 / 255.0).powf(2.2)).abs() < 2e-4, "{radiance}");
        assert!(loaded[0].states[(3, 3)].is_clipped());
        std::fs::write(inputs.join("camera_0003.txt"), &camera[..40]).unwrap();
        assert!(matches!(read(folder.path()).unwrap_err().place(), Place::Line(..)));
    }
}
