//! The files of a COLMAP model: `cameras` and `images`, text and binary (COLMAP, `doc/format.rst`).

use super::bytes::Bytes;
use super::camera_file::read_text;
use super::colmap_lens::{model_of_id, model_of_name};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::Path;

/// Words of an image's line: its number, seven of its pose, its camera's number, a name.
const WORDS_OF_IMAGE: usize = 10;

/// A camera of `cameras`.
pub struct ColmapCamera {
    /// Name of its model.
    pub model: &'static str,
    /// Width and height of its photos.
    pub size: (usize, usize),
    /// Parameters of the model, in its order.
    pub parameters: Vec<f64>,
    /// Where it is written.
    pub place: Place,
}

/// An image of `images`.
pub struct ColmapImage {
    /// World to camera as a quaternion, w x y z.
    pub rotation: [f64; 4],
    /// World to camera.
    pub translation: DVec3,
    /// Number of its camera.
    pub camera: u32,
    /// Path of its photo below the folder of photos.
    pub name: String,
    /// Where it is written.
    pub place: Place,
}

/// Cameras by their number. One that cannot be read is an error only for the images that name it.
pub type ColmapCameras = BTreeMap<u32, Result<ColmapCamera>>;

/// Reads `cameras.bin`; errors have the byte.
pub fn read_cameras_bin(path: &Path) -> Result<ColmapCameras> {
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

/// Reads `images.bin`; errors have the byte.
pub fn read_images_bin(path: &Path) -> Result<Vec<ColmapImage>> {
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

/// Reads `cameras.txt`; errors have the line.
pub fn read_cameras_txt(path: &Path) -> Result<ColmapCameras> {
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
pub fn read_images_txt(path: &Path) -> Result<(Vec<ColmapImage>, Vec<Finding>)> {
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
