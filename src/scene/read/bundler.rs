//! Bundler: `bundle.out` with the list of its photos (Snavely 2008, manual of version 0.3).
//!
//! Camera axes x right, y up, looking along -z; the origin of pixels is the middle of the photo, y up; with p = -P / P.z the lens
//! is f (1 + k1 |p|² + k2 |p|⁴) p. Cameras with f = 0 were not registered.

use super::camera_file::read_text;
use super::colmap_lens::matrix;
use super::photo_index::{PhotoIndex, Posed};
use super::source::{SourceCamera, SourceScene};
use super::tool_folder::scene_of;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file;
use crate::scene::lens::{Lens, Model, Polynomial};
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

/// The file of cameras and the list of photos under a folder.
pub fn files_of(folder: &Path) -> Option<(PathBuf, PathBuf)> {
    let bundle = ["bundle.out", "bundle/bundle.out", "bundle.rd.out"].map(|name| folder.join(name));
    let bundle = bundle.into_iter().find(|path| path.is_file())?;
    let lists = ["list.txt", "bundle.list.txt", "bundle/list.txt", "bundle.out.list.txt", "image_list.txt"];
    let list = lists.map(|name| folder.join(name)).into_iter().find(|path| path.is_file())?;
    Some((bundle, list))
}

/// Lists a Bundler scene and reads its cameras.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let (bundle, list) = files_of(folder).ok_or_else(|| {
        Error::new(ErrorKind::Missing, "bundle.out or the list of its photos is not there")
            .at(Place::File(folder.into()))
            .remedy("put bundle.out and list.txt side by side")
    })?;
    let text = read_text(&bundle)?;
    let lines: Vec<(usize, Vec<f64>)> = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim_start().starts_with('#') && !line.trim().is_empty())
        .map(|(index, line)| {
            (index + 1, line.split_whitespace().map(|word| word.parse().unwrap_or(f64::NAN)).collect())
        })
        .collect();
    let row = |index: usize, length: usize| -> Result<(usize, &[f64])> {
        let (line, values) = lines.get(index).map(|(line, values)| (*line, values.as_slice())).unwrap_or((0, &[]));
        if values.len() == length && values.iter().all(|value| value.is_finite()) {
            return Ok((line, values));
        }
        Err(Error::new(ErrorKind::Malformed, format!("a line of {length} numbers is missing"))
            .at(Place::Line(bundle.clone(), if line > 0 { line } else { text.lines().count().max(1) }))
            .remedy("the file is cut short or damaged: export it again"))
    };
    let count = row(0, 2)?.1[0] as usize;
    let text = read_text(&list)?;
    let names: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    if names.len() < count || count > lines.len() {
        return Err(Error::new(
            ErrorKind::InvalidScene,
            format!("{count} cameras but {} photos in the list", names.len()),
        )
        .at(Place::File(list))
        .remedy("give the list the cameras were made with, one photo a line"));
    }
    let photos = PhotoIndex::of_folders(&[folder.join("images"), folder.into()].map(|path: PathBuf| path))?;
    let mut findings = Vec::new();
    let (mut posed, mut unregistered) = (Vec::new(), 0usize);
    for (camera, name) in names.iter().take(count).enumerate() {
        // After the name some lists hold a flag and a focal length.
        let name = match name.find(|c: char| c.is_whitespace()) {
            Some(end) if photos.find(name).is_none() => &name[..end],
            _ => name,
        };
        let first = 1 + 5 * camera;
        let (line, lens) = row(first, 3)?;
        let (focal, k1, k2) = (lens[0], lens[1], lens[2]);
        let mut rows = [DVec3::ZERO; 4];
        for (index, own) in rows.iter_mut().enumerate() {
            *own = DVec3::from_slice(row(first + 1 + index, 3)?.1);
        }
        if focal <= 0.0 {
            unregistered += 1;
            continue;
        }
        let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let rotation = turn * DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
        let place = Place::Line(bundle.clone(), line);
        let size = photos.find(name).map(|path| file::read_size(&path)).transpose()?;
        let centre = size.map_or([0.0; 2], |(width, height)| [0.5 * width as f64, 0.5 * height as f64]);
        let (camera, mut noticed) = SourceCamera::new(matrix([focal; 2], centre), rotation, turn * rows[3], &place)?;
        findings.append(&mut noticed);
        let polynomial = Polynomial { numerator: [k1, k2, 0.0, 0.0, 0.0, 0.0], ..Default::default() };
        let lens = Lens::new(Model::Polynomial(polynomial));
        posed.push(Posed { listed: name.to_owned(), camera, lens, size, mask: None, place });
    }
    if unregistered > 0 {
        let message = format!("{unregistered} of {count} cameras were not registered and are skipped");
        findings.push(Finding::new(Severity::Note, "camera-not-aligned", message).at(Place::File(bundle)));
    }
    scene_of(folder, posed, &photos, &[folder.into()], findings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    #[test]
    fn axes_turn_and_the_lens_keeps_its_meaning() {
        let folder = tempfile::tempdir().unwrap();
        file::write_png_srgb8(&folder.path().join("a.png"), &Image::filled(40, 30, [9; 3])).unwrap();
        let bundle = "# Bundle file v0.3\n2 0\n50 0.1 -0.02\n1 0 0\n0 1 0\n0 0 1\n0.5 0.25 -4\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n";
        std::fs::write(folder.path().join("bundle.out"), bundle).unwrap();
        std::fs::write(folder.path().join("list.txt"), "dir/a.png 0 50\ndir/b.png\n").unwrap();
        let scene = read(folder.path()).unwrap();
        let (camera, lens) = (&scene.views[0].camera, scene.views[0].lens.as_ref().unwrap());
        // P = X + t; p = -P / P.z; from the middle, y up.
        let point = DVec3::new(0.7, 0.3, 1.0);
        let own = point + DVec3::new(0.5, 0.25, -4.0);
        let p = -own.truncate() / own.z;
        let scaled = 50.0 * (1.0 + 0.1 * p.length_squared() - 0.02 * p.length_squared().powi(2)) * p;
        let expected = glam::DVec2::new(20.0 + scaled.x, 15.0 - scaled.y);
        let pinhole = camera.pinhole();
        let place = lens.project(camera.rotation * point + camera.translation) * pinhole.focal_pixels;
        assert!((place + pinhole.centre_pixels - expected).length() < 1e-9);
        assert!(scene.findings.iter().any(|finding| finding.code == "camera-not-aligned"));
        std::fs::write(folder.path().join("bundle.out"), &bundle[..60]).unwrap();
        assert!(matches!(read(folder.path()).unwrap_err().place(), Place::Line(..)));
    }
}
