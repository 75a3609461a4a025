//! Bundler: `bundle.out`, or `NAME.out` as others export it, with the list of its photos (Snavely 2008, manual of version 0.3).
//!
//! Camera axes x right, y up, looking along -z; the origin of pixels is the middle of the photo, y up; with p = -P / P.z the lens
//! is f (1 + k1 |p|² + k2 |p|⁴) p. Cameras with f = 0 were not registered.

use super::blended_mvs::files_of;
use super::camera_file::read_text;
use super::colmap_lens::matrix;
use super::photo_index::PhotoIndex;
use super::posed::Posed;
use super::source::{SourceCamera, SourceScene};
use super::tool_folder::scene_of;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::folder_of;
use crate::image::file;
use crate::scene::lens::{Lens, Model, Polynomial};
use glam::{DMat3, DVec3};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Files that are taken for cameras by their name alone, the likelier first.
const USUAL: [&str; 3] = ["bundle.out", "bundle/bundle.out", "bundle.rd.out"];
/// Lists of photos of any file of cameras.
const LISTS: [&str; 3] = ["list.txt", "bundle.list.txt", "image_list.txt"];

/// The file of cameras under a folder, where the list of its photos is there too.
pub fn file_of(folder: &Path) -> Option<PathBuf> {
    let usual = USUAL.iter().map(|name| folder.join(name)).filter(|path| path.is_file());
    let others = files_of(folder, &["out"]).unwrap_or_default().into_iter().filter(|path| is_bundle(path));
    usual.chain(others).find(|path| list_of(path).is_some())
}

/// Whether a file begins as one of cameras does.
fn is_bundle(path: &Path) -> bool {
    let mut start = Vec::new();
    let file = std::fs::File::open(path);
    file.and_then(|file| file.take(64).read_to_end(&mut start)).is_ok() && start.starts_with(b"# Bundle file")
}

/// The list of photos of a file of cameras: `NAME.list.txt` of `NAME.out` (Metashape) or `NAME.bundle.out` (COLMAP), or one
/// of the usual names.
fn list_of(bundle: &Path) -> Option<PathBuf> {
    let name = bundle.file_name()?.to_string_lossy();
    let stem = name.strip_suffix(".out").unwrap_or(&name);
    let stems = [stem.strip_suffix(".bundle").unwrap_or(stem), stem, &name];
    let names = stems.map(|stem| format!("{stem}.list.txt")).into_iter().chain(LISTS.map(str::to_owned));
    let own = folder_of(bundle);
    let above = if own.ends_with("bundle") { own.parent().unwrap_or(own) } else { own };
    let folders = [own.to_path_buf(), above.to_path_buf(), own.join("bundle")];
    names.flat_map(|name| folders.clone().map(|folder| folder.join(&name))).find(|path| path.is_file())
}

/// Lists a Bundler scene of a file of cameras in or below `folder` and reads them.
///
/// # Errors
/// `Missing` without the list of its photos, `Malformed` with the line, `InvalidScene` for a list of other photos.
pub fn read(bundle: &Path, folder: &Path) -> Result<SourceScene> {
    let list = list_of(bundle).ok_or_else(|| {
        Error::new(ErrorKind::Missing, "the list of its photos is not there")
            .at(Place::File(bundle.into()))
            .remedy("put list.txt beside bundle.out, or NAME.list.txt beside NAME.out")
    })?;
    let text = read_text(bundle)?;
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
            .at(Place::Line(bundle.into(), if line > 0 { line } else { text.lines().count().max(1) }))
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
        let place = Place::Line(bundle.into(), line);
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
        findings.push(Finding::new(Severity::Note, "camera-not-aligned", message).at(Place::File(bundle.into())));
    }
    let scene = scene_of(folder, posed, &photos, &[folder.into()], findings)?;
    Ok(SourceScene { sizes_are_of_files: true, ..scene })
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
        let scene = read(&file_of(folder.path()).unwrap(), folder.path()).unwrap();
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
        assert!(matches!(read(&folder.path().join("bundle.out"), folder.path()).unwrap_err().place(), Place::Line(..)));
    }

    #[test]
    fn other_programs_name_cameras_and_list_after_the_project() {
        let bundle = "# Bundle file v0.3\n1 0\n50 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 -4\n";
        for (cameras, list) in [
            ("head.out", "head.list.txt"),
            ("head.bundle.out", "head.list.txt"),
            ("bundle.out", "bundle.out.list.txt"),
            ("bundle/bundle.out", "list.txt"),
            ("bundle.out", "bundle/list.txt"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let root = folder.path();
            std::fs::create_dir(root.join("bundle")).unwrap();
            file::write_png_srgb8(&root.join("a.png"), &Image::filled(40, 30, [9; 3])).unwrap();
            std::fs::write(root.join(cameras), bundle).unwrap();
            assert_eq!(file_of(root), None, "{cameras} without a list");
            std::fs::write(root.join(list), "a.png\n").unwrap();
            std::fs::write(root.join("log.out"), "nothing of the kind").unwrap();
            let path = file_of(root).unwrap();
            assert_eq!(path, root.join(cameras));
            let scene = read(&path, root).unwrap();
            assert_eq!((scene.views.len(), scene.folder.as_path()), (1, root), "{cameras}");
        }
    }
}
