//! A COLMAP model, text or binary, with its photos; also a dense workspace with its mesh.
//!
//! ```text
//! sparse/0/ or sparse/ or the folder itself:   cameras, images (.bin preferred to .txt); rigs and frames are not needed;
//!                                              of sparse/0/, sparse/1/, ... the one with the most images
//! images/                                      photos, in subfolders too; masks/ by the names of photos
//! meshed-poisson.ply, textured/mesh.ply, ...   or any other mesh; dense/0/ is looked into
//! ```
//! World to camera, OpenCV axes, quaternions as w x y z, the first pixel's centre at (0.5, 0.5) (COLMAP, `doc/format.rst` and
//! `sensor/models.h`).

use super::bytes::Bytes;
use super::camera_file::read_text;
use super::colmap_lens::{lens_of, model_of_id, model_of_name};
use super::mesh_choice;
use super::photo_index::PhotoIndex;
use super::posed::{Posed, views_of};
use super::source::{SourceCamera, SourceScene};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use glam::{DMat3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Folders the model may lie in, or models in folders that are numbers.
const MODEL_FOLDERS: [&str; 6] =
    ["sparse", "", "colmap/sparse", "dense/sparse", "dense/0/sparse", "undistorted/sparse"];

/// Words of an image's line: its number, seven of its pose, its camera's number, a name.
const WORDS_OF_IMAGE: usize = 10;

/// A camera of `cameras`.
struct ColmapCamera {
    model: &'static str,
    size: (usize, usize),
    parameters: Vec<f64>,
    place: Place,
}

/// An image of `images`.
struct ColmapImage {
    rotation: [f64; 4],
    translation: DVec3,
    camera: u32,
    name: String,
    place: Place,
}

/// The folder of the model under a scene's folder; of several the one with the most images.
pub fn model_folder(folder: &Path) -> Option<PathBuf> {
    models_of(folder).into_iter().next().map(|(model, _)| model)
}

fn holds_model(folder: &Path) -> bool {
    ["bin", "txt"]
        .iter()
        .any(|extension| ["cameras", "images"].iter().all(|name| folder.join(format!("{name}.{extension}")).is_file()))
}

/// The models that lie side by side under a scene's folder, with how many images each has; the largest first. What cannot
/// be connected becomes a model of its own, `sparse/0`, `sparse/1` and so on.
fn models_of(folder: &Path) -> Vec<(PathBuf, usize)> {
    for base in MODEL_FOLDERS.iter().map(|inner| folder.join(inner)) {
        // In a folder of cameras and images nothing else is looked for.
        if base == folder.join("") && holds_model(&base) {
            return vec![(base, 0)];
        }
        let is_number = |path: &PathBuf| {
            path.file_name().is_some_and(|name| name.to_string_lossy().bytes().all(|byte| byte.is_ascii_digit()))
        };
        let entries = std::fs::read_dir(&base).into_iter().flatten();
        let mut numbered: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        numbered.retain(|path| is_number(path) && holds_model(path));
        numbered.sort();
        if numbered.len() > 1 {
            let mut counted: Vec<(PathBuf, usize)> =
                numbered.into_iter().map(|model| (model.clone(), images_of(&model))).collect();
            counted.sort_by_key(|(_, images)| std::cmp::Reverse(*images));
            return counted;
        }
        if let Some(only) = numbered.pop().or_else(|| holds_model(&base).then_some(base)) {
            return vec![(only, 0)];
        }
    }
    Vec::new()
}

/// How many images a model has; 0 for one that cannot be read.
fn images_of(model: &Path) -> usize {
    let binary = model.join("images.bin");
    if model.join("cameras.bin").is_file() && binary.is_file() {
        let count = Bytes::open(&binary).and_then(|mut bytes| bytes.count("the number of images", 73));
        return count.unwrap_or(0);
    }
    read_images_txt(&model.join("images.txt")).map_or(0, |(images, _)| images.len())
}

/// That one of several models is read.
fn told_of_others(models: &[(PathBuf, usize)], folder: &Path) -> Option<Finding> {
    let ((chosen, count), others) = models.split_first().filter(|(_, others)| !others.is_empty())?;
    let shown = |path: &Path| path.strip_prefix(folder).unwrap_or(path).display().to_string();
    let others: Vec<String> = others.iter().map(|(path, count)| format!("{} has {count}", shown(path))).collect();
    let message = format!(
        "of {} models the largest is read: {} has {count} images, {}",
        others.len() + 1,
        shown(chosen),
        super::photo_index::some_of(&others)
    );
    let remedy = "each model has a frame of its own: to read another, move the larger ones out of the folder";
    Some(Finding::new(Severity::Note, "model-chosen", message).at(Place::File(chosen.clone())).remedy(remedy))
}

/// Lists a COLMAP scene and reads its cameras.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let models = models_of(folder);
    let model = models.first().map_or_else(|| folder.to_path_buf(), |(model, _)| model.clone());
    let is_binary = model.join("cameras.bin").is_file() && model.join("images.bin").is_file();
    let (mut cameras, (images, noticed)) = if is_binary {
        (read_cameras_bin(&model.join("cameras.bin"))?, (read_images_bin(&model.join("images.bin"))?, Vec::new()))
    } else {
        (read_cameras_txt(&model.join("cameras.txt"))?, read_images_txt(&model.join("images.txt"))?)
    };
    let mut findings: Vec<Finding> = told_of_others(&models, folder).into_iter().chain(noticed).collect();
    let mut posed = Vec::new();
    for image in images {
        if cameras.get(&image.camera).is_some_and(Result::is_err) {
            cameras.remove(&image.camera).transpose()?;
        }
        let Some(Ok(camera)) = cameras.get(&image.camera) else {
            return Err(Error::new(
                ErrorKind::Malformed,
                format!("the image {} names camera {}, which is not there", image.name, image.camera),
            )
            .at(image.place)
            .remedy("export the model again: cameras and images do not belong together"));
        };
        let (intrinsics, lens) = lens_of(camera.model, &camera.parameters, &camera.place)?;
        let [w, x, y, z] = image.rotation;
        let rotation = DQuat::from_xyzw(x, y, z, w);
        if !(rotation.length() > 1e-6) {
            return Err(Error::new(ErrorKind::Malformed, format!("the rotation of {} is not one", image.name))
                .at(image.place)
                .remedy("export the model again"));
        }
        let rotation = DMat3::from_quat(rotation.normalize());
        let (camera_in_source, mut noticed) = SourceCamera::new(intrinsics, rotation, image.translation, &image.place)?;
        findings.append(&mut noticed);
        posed.push(Posed {
            listed: image.name,
            camera: camera_in_source,
            lens,
            size: Some(camera.size),
            mask: None,
            place: image.place,
        });
    }
    // The photos of an undistorted workspace lie beside its model, not in the original folder.
    let beside = model.ancestors().skip(1).take(2).filter(|parent| parent.starts_with(folder)).map(Path::to_path_buf);
    let bases: Vec<PathBuf> = beside.chain([folder.to_path_buf()]).collect();
    let named = |names: &[&str]| -> Vec<PathBuf> {
        bases.iter().flat_map(|base| names.iter().map(move |name| base.join(name))).collect()
    };
    let mut roots = named(&["images", "image", "photos", "input"]);
    roots.retain(|root| root.is_dir());
    roots.push(folder.into());
    roots.dedup();
    let views = views_of(posed, &PhotoIndex::of_folders(&roots)?, &bases, &mut findings)?;
    let mesh = mesh_choice::find(&[bases, vec![model.clone()]].concat(), &mut findings);
    Ok(SourceScene { findings, ..SourceScene::of_photographs(folder, mesh, views) })
}

/// Cameras by their number. One that cannot be read is an error only for the images that name it.
type ColmapCameras = BTreeMap<u32, Result<ColmapCamera>>;

fn read_cameras_bin(path: &Path) -> Result<ColmapCameras> {
    let mut bytes = Bytes::open(path)?;
    let count = bytes.count("the number of cameras", 24)?;
    let mut cameras = BTreeMap::new();
    for _ in 0..count {
        let place = bytes.place();
        let id = bytes.u32("the number of a camera")?;
        let (model, parameter_count) = model_of_id(bytes.u32("the model of a camera")? as i32, &place)?;
        let size = (bytes.u64("the width")? as usize, bytes.u64("the height")? as usize);
        let parameters = (0..parameter_count).map(|_| bytes.f64("a parameter")).collect::<Result<_>>()?;
        cameras.insert(id, Ok(ColmapCamera { model, size, parameters, place }));
    }
    Ok(cameras)
}

fn read_images_bin(path: &Path) -> Result<Vec<ColmapImage>> {
    let mut bytes = Bytes::open(path)?;
    let count = bytes.count("the number of images", 73)?;
    let mut images = Vec::new();
    for _ in 0..count {
        let place = bytes.place();
        bytes.u32("the number of an image")?;
        let mut pose = [0.0; 7];
        for value in &mut pose {
            *value = bytes.f64("a pose")?;
        }
        let camera = bytes.u32("the camera of an image")?;
        let name = bytes.text_to_zero("the name of an image")?;
        let points = bytes.count("the number of points", 24)?;
        bytes.skip(points * 24, "the points of an image")?;
        let rotation = [pose[0], pose[1], pose[2], pose[3]];
        images.push(ColmapImage { rotation, translation: DVec3::new(pose[4], pose[5], pose[6]), camera, name, place });
    }
    Ok(images)
}

/// A word as a number, with its line where it is none.
fn parsed<T: std::str::FromStr>(word: Option<&str>, what: &str, path: &Path, line: usize) -> Result<T> {
    word.and_then(|word| word.parse().ok()).ok_or_else(|| {
        Error::new(ErrorKind::Malformed, format!("'{}' is not {what}", word.unwrap_or_default()))
            .at(Place::Line(path.into(), line))
            .remedy("the file is cut short or damaged: export it again")
    })
}

fn read_cameras_txt(path: &Path) -> Result<ColmapCameras> {
    let text = read_text(path)?;
    let mut cameras = BTreeMap::new();
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let (id, rest) = line.trim_start().split_once(char::is_whitespace).unwrap_or((line, ""));
        let id = parsed(Some(id), "the number of a camera", path, index + 1)?;
        cameras.insert(id, camera_of_line(rest, path, index + 1));
    }
    Ok(cameras)
}

/// A camera of what stands behind its number.
fn camera_of_line(text: &str, path: &Path, line: usize) -> Result<ColmapCamera> {
    let place = Place::Line(path.into(), line);
    let mut words = text.split_whitespace();
    let (model, count) = model_of_name(words.next().unwrap_or_default(), &place)?;
    let width = parsed(words.next(), "a width", path, line)?;
    let height = parsed(words.next(), "a height", path, line)?;
    let parameters: Vec<f64> =
        words.map(|word| parsed(Some(word), "a parameter", path, line)).collect::<Result<_>>()?;
    if parameters.len() != count {
        return Err(Error::new(
            ErrorKind::Malformed,
            format!("the model {model} has {count} parameters, not {}", parameters.len()),
        )
        .at(place)
        .remedy("export the model again"));
    }
    Ok(ColmapCamera { model, size: (width, height), parameters, place })
}

/// What a line of `images.txt` looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ImagesLine {
    Blank,
    Points,
    Image,
    Neither,
}

/// The images of a text, and what of it was passed over: damage where the points of an image stand, which nobody needs.
fn read_images_txt(path: &Path) -> Result<(Vec<ColmapImage>, Vec<Finding>)> {
    use ImagesLine::{Blank, Image, Neither, Points};
    let text = read_text(path)?;
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with('#'));
    let lines: Vec<(usize, &str, ImagesLine)> =
        lines.map(|(index, line)| (index + 1, line, kind_of(line, path, index + 1))).collect();
    // The points of an image stand on a line of their own, which may be empty. Some programs leave it out: then a line that
    // is no image is a damaged one.
    let points = lines.iter().filter(|(_, _, kind)| *kind == Points).count();
    let left_out = lines.windows(2).filter(|pair| (pair[0].2, pair[1].2) == (Image, Image)).count() > points;
    let (mut images, mut findings) = (Vec::new(), Vec::new());
    let mut lines = lines.into_iter().peekable();
    while let Some((number, line, kind)) = lines.next() {
        if kind == Blank {
            continue;
        }
        images.push(image_of_line(line, path, number)?);
        let is_of_image = |line: &str, kind| match kind {
            Blank => true,
            Image => false,
            Points => !left_out || line.split_whitespace().count() >= WORDS_OF_IMAGE,
            Neither => !left_out && points > 0,
        };
        if let Some((number, _, Neither)) = lines.next_if(|(_, line, kind)| is_of_image(line, *kind)) {
            let message = "the points of an image are damaged: they are passed over";
            let remedy = "nothing depends on them here; if the line was meant for an image, export the model again";
            findings.push(
                Finding::new(Severity::Warning, "image-points-damaged", message)
                    .at(Place::Line(path.into(), number))
                    .remedy(remedy),
            );
        }
    }
    Ok((images, findings))
}

fn kind_of(line: &str, path: &Path, number: usize) -> ImagesLine {
    match () {
        () if line.trim().is_empty() => ImagesLine::Blank,
        () if is_of_points(line) => ImagesLine::Points,
        () if image_of_line(line, path, number).is_ok() => ImagesLine::Image,
        () => ImagesLine::Neither,
    }
}

/// Whether a line has nothing but points: x, y and the number of a point in space, as often as there are points.
fn is_of_points(line: &str) -> bool {
    let mut count = 0;
    line.split_whitespace().all(|word| {
        count += 1;
        word.parse::<f64>().is_ok()
    }) && count % 3 == 0
}

fn image_of_line(line: &str, path: &Path, number: usize) -> Result<ColmapImage> {
    let mut pose = [0.0; 7];
    let mut rest = line.trim_start();
    let mut next = || {
        let (word, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        rest = after.trim_start();
        word
    };
    parsed::<u32>(Some(next()), "the number of an image", path, number)?;
    for value in &mut pose {
        *value = parsed(Some(next()), "a number of a pose", path, number)?;
    }
    let camera = parsed(Some(next()), "the number of a camera", path, number)?;
    let place = Place::Line(path.into(), number);
    let rotation = [pose[0], pose[1], pose[2], pose[3]];
    let translation = DVec3::new(pose[4], pose[5], pose[6]);
    // What is left is the name, spaces and all.
    if rest.trim_end().is_empty() {
        return Err(Error::new(ErrorKind::Malformed, "the image has no name")
            .at(place)
            .remedy("the file is cut short or damaged: export it again"));
    }
    Ok(ColmapImage { rotation, translation, camera, name: rest.trim_end().to_owned(), place })
}

#[cfg(test)]
#[path = "colmap_tests.rs"]
mod tests;
