//! Photos of a patterned plane, made larger or laid on their side.

use super::*;
use crate::error::Place;
use crate::image::Image;
use crate::scene::read::colmap_lens::matrix;
use glam::{DMat3, DVec3};
use std::path::Path;

const SIZE: (usize, usize) = (96, 64);
const FOCAL: f64 = 80.0;

/// A plane at z = 0 in two triangles.
fn plane() -> SourceMesh {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    SourceMesh {
        positions: vec![corner(-9.0, -9.0), corner(9.0, -9.0), corner(9.0, 9.0), corner(-9.0, 9.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    }
}

/// Cameras that look down on it from a ring.
fn ring() -> Vec<SourceCamera> {
    let camera = |index: u32| {
        let azimuth = 0.9 * f64::from(index);
        let eye = DVec3::new(1.5 * azimuth.cos(), 1.5 * azimuth.sin(), 4.0);
        // They do not all look at one place: about that, a larger picture would be that of a larger pattern.
        let target = DVec3::new((2.1 * azimuth).cos(), (2.1 * azimuth).sin(), 0.0);
        let forward = (target - eye).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
        let intrinsics = matrix([FOCAL; 2], [0.5 * SIZE.0 as f64, 0.5 * SIZE.1 as f64]);
        SourceCamera { intrinsics, rotation, translation: -(rotation * eye) }
    };
    (0..7).map(camera).collect()
}

/// What a camera sees of the pattern in a picture of `factor` times the size.
fn seen(camera: &SourceCamera, factor: f64) -> Image<[u8; 3]> {
    let size = [SIZE.0, SIZE.1].map(|side| (side as f64 * factor) as usize);
    let eye = camera.rotation.transpose() * -camera.translation;
    Image::from_fn(size[0], size[1], |row, column| {
        let place = DVec3::new(column as f64 + 0.5, row as f64 + 0.5, factor) / factor;
        let ray = camera.rotation.transpose() * (camera.intrinsics.inverse() * place);
        let hit = eye - ray * (eye.z / ray.z);
        let pattern =
            (3.1 * hit.x + 0.7 * hit.y).sin() + (2.3 * hit.y - 1.1 * hit.x).sin() + (1.3 * hit.x * hit.y).sin();
        [(128.0 + 40.0 * pattern) as u8; 3]
    })
}

fn png_with_orientation(image: &Image<[u8; 3]>, orientation: u8) -> Vec<u8> {
    let plain = file::encode_png_srgb8(image).unwrap();
    let block = [&b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"[..], &[orientation, 0, 0, 0, 0, 0, 0, 0]].concat();
    let mut chunk = [&(block.len() as u32).to_be_bytes()[..], b"eXIf", &block].concat();
    let mut sum = flate2::Crc::new();
    sum.update(&chunk[4..]);
    chunk.extend(sum.sum().to_be_bytes());
    let end = plain.len() - 12;
    [&plain[..end], &chunk, &plain[end..]].concat()
}

/// Views of the files in a folder, as a source lists them that counts from the middle of the file.
fn views(folder: &Path, write: impl Fn(&SourceCamera, &Path)) -> Vec<SourceView> {
    let view = |(index, mut camera): (usize, SourceCamera)| {
        let photo = folder.join(format!("{index}.png"));
        write(&camera, &photo);
        let (width, height) = file::read_size(&photo).unwrap();
        camera.intrinsics = matrix([FOCAL; 2], [0.5 * width as f64, 0.5 * height as f64]);
        let size = Some((width, height));
        SourceView { name: index.to_string(), photo, mask: None, camera, lens: None, size, place: Place::Nowhere }
    };
    ring().into_iter().enumerate().map(view).collect()
}

fn settled(views: &mut [SourceView]) -> Vec<Finding> {
    let mut findings = Vec::new();
    settle(views, &plane(), ColourEncoding::Auto, &ReadSettings::default(), &mut findings).unwrap();
    findings
}

#[test]
fn focal_lengths_follow_photos_that_were_made_larger_and_others_stay() {
    for (factor, told) in [(1.0, false), (2.0, true), (0.75, true)] {
        let folder = tempfile::tempdir().unwrap();
        let mut views =
            views(folder.path(), |camera, path| file::write_png_srgb8(path, &seen(camera, factor)).unwrap());
        let findings = settled(&mut views);
        assert_eq!(findings.iter().any(|finding| finding.code == "intrinsics-scaled"), told, "{factor}: {findings:?}");
        assert!(views.iter().all(|view| (view.camera.intrinsics.x_axis.x - factor * FOCAL).abs() < 1e-9), "{factor}");
    }
}

#[test]
fn a_photo_on_its_side_is_turned_only_where_photos_agree_so() {
    let folder = tempfile::tempdir().unwrap();
    // Stored turned: the upright picture has its first row on the right.
    let on_side = |camera: &SourceCamera, path: &Path| {
        let upright = seen(camera, 1.0);
        let stored = Image::from_fn(SIZE.1, SIZE.0, |row, column| upright[(column, SIZE.0 - 1 - row)]);
        std::fs::write(path, png_with_orientation(&stored, 6)).unwrap();
    };
    let mut turned = views(folder.path(), on_side);
    assert!(settled(&mut turned).is_empty());
    for view in &turned {
        assert_eq!(view.size, Some(SIZE));
        assert_eq!(view.camera.pinhole().centre_pixels.to_array(), [0.5 * SIZE.0 as f64, 0.5 * SIZE.1 as f64]);
    }
    // The same tag on pictures that lie as their cameras see them.
    let as_stored = |camera: &SourceCamera, path: &Path| {
        std::fs::write(path, png_with_orientation(&seen(camera, 1.0), 6)).unwrap();
    };
    let mut kept = views(folder.path(), as_stored);
    assert!(settled(&mut kept).is_empty() && kept.iter().all(|view| view.size == Some(SIZE)));
    assert!(kept.iter().all(|view| view.camera.intrinsics.z_axis.x == 0.5 * SIZE.0 as f64));
}
