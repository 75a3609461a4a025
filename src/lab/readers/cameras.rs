//! Lens models as pycolmap projects them, before and after undistortion.

use super::ReaderOptions;
use crate::error::{Error, ErrorKind, Result};
use crate::lab::bar_table::{BarRow, BarTable};
use crate::scene::read::locate;
use crate::scene::{PixelState, ReadSettings, read};
use glam::{DVec2, DVec3};
use serde::Deserialize;
use std::path::Path;

/// Farthest that a point may fall from where pycolmap puts it, in pixels.
pub const LARGEST_PIXELS: f64 = 1e-3;
/// Kinds of files each model is written as.
const KINDS: [&str; 2] = ["text", "binary"];

/// What the script wrote down.
#[derive(Debug, Deserialize)]
pub struct Answers {
    /// Version of pycolmap.
    pub version: String,
    /// What a photo's red and green are times this are x and y of the place where they were taken, in pixels.
    pub scale: f64,
    /// Models that this version of pycolmap does not have, though they are read here.
    pub missing: Vec<String>,
    /// What it has.
    pub models: Vec<Model>,
}

/// A lens model.
#[derive(Debug, Deserialize)]
pub struct Model {
    /// Name in COLMAP.
    pub model: String,
    /// The script has no parameters for it: COLMAP has something new.
    #[serde(default)]
    pub untried: bool,
    /// It must be refused.
    #[serde(default)]
    pub refused: bool,
    /// A point of the world, its place on the photo, its place on an ideal pinhole's picture.
    #[serde(default)]
    pub points: Vec<[f64; 7]>,
    /// Column and row of a pixel of the pinhole's picture, and where on the photo it is seen.
    #[serde(default)]
    pub pixels: Vec<[f64; 4]>,
}

/// Largest distances in pixels over all points of a model.
#[derive(Clone, Copy, Debug, Default)]
struct Distances {
    /// On the photo, through the lens.
    photo: f64,
    /// On the pinhole's picture.
    pinhole: f64,
    /// Between where a pixel of the undistorted photo was taken from and where it should be.
    resampled: f64,
    /// Pixels that the photo holds and the undistorted one does not.
    unseen: usize,
}

/// Reads each model and compares.
pub fn compare(answers: &Answers, options: &ReaderOptions) -> BarTable {
    let mut table =
        BarTable::new(&["lens model", "files", "points", "on the photo, pixels", "undistorted", "resampled"]);
    let bare = |name: &str, shortfall: &str| BarRow {
        name: name.into(),
        figures: vec![String::new(); 5],
        shortfall: Some(shortfall.into()),
    };
    table.rows.extend(answers.missing.iter().map(|name| bare(name, "this pycolmap does not write it")));
    for model in &answers.models {
        if model.untried {
            table.rows.push(bare(&model.model, "pycolmap writes it, and tests/readers has no parameters for it"));
            continue;
        }
        for kind in KINDS {
            let folder = options.output.join("cameras").join(format!("{}_{kind}", model.model));
            table.rows.push(match model.refused {
                true => refused(model, kind, &folder),
                false => row(model, kind, distances(model, answers.scale, &folder), options.points),
            });
        }
    }
    table
}

/// A model that no pinhole can be made of is refused as one that is not supported.
fn refused(model: &Model, kind: &str, folder: &Path) -> BarRow {
    let shortfall = match read(folder, &ReadSettings::default()) {
        Err(error) if error.kind() == ErrorKind::Unsupported => None,
        Err(error) => Some(format!("refused for another reason: {error}")),
        Ok(_) => Some("it is read, and should be refused".into()),
    };
    let figures = [kind, "", "refused", "", ""].map(String::from).to_vec();
    BarRow { name: model.model.clone(), figures, shortfall }
}

fn row(model: &Model, kind: &str, found: Result<Distances>, points: usize) -> BarRow {
    let count = model.points.len().min(model.pixels.len());
    let mut figures = vec![kind.to_string(), count.to_string()];
    let shortfall = match found {
        Err(error) => {
            figures.resize(5, String::new());
            Some(error.to_string())
        }
        Ok(Distances { photo, pinhole, resampled, unseen }) => {
            figures.extend([photo, pinhole, resampled].map(|distance| format!("{distance:.1e}")));
            let largest = photo.max(pinhole).max(resampled);
            match (unseen, largest) {
                _ if count < points => Some(format!("only {count} of {points} points")),
                (0, largest) if largest <= LARGEST_PIXELS => None,
                (0, largest) => Some(format!("off by {largest:.1e} pixels")),
                (unseen, _) => Some(format!("{unseen} pixels that the photo holds are not seen")),
            }
        }
    };
    BarRow { name: model.model.clone(), figures, shortfall }
}

/// NaN counts as farthest.
fn farther(largest: f64, distance: f64) -> f64 {
    if distance.is_nan() { f64::INFINITY } else { largest.max(distance) }
}

fn distances(model: &Model, scale: f64, folder: &Path) -> Result<Distances> {
    let settings = ReadSettings::default();
    let none = || Error::new(ErrorKind::InvalidScene, "no view was read");
    let mut found = Distances::default();

    // The camera as the reader found it, with its lens.
    let listed = locate(folder)?.list(&settings)?;
    let view = listed.views.first().ok_or_else(none)?;
    let pinhole = view.camera.pinhole();
    let lens = view.lens.clone().unwrap_or_default();
    for &[x, y, z, across, down, ..] in &model.points {
        let direction = view.camera.rotation * DVec3::new(x, y, z) + view.camera.translation;
        let place = lens.project(direction) * pinhole.focal_pixels + pinhole.centre_pixels;
        found.photo = farther(found.photo, (place - DVec2::new(across, down)).length());
    }

    // The scene as a fit sees it: a pinhole in the program's world, and the photo resampled to it.
    let scene = read(folder, &settings)?;
    let view = scene.views.first().ok_or_else(none)?;
    let world = scene.world_from_source;
    for &[x, y, z, .., across, down] in &model.points {
        let point = world.rotation * (DVec3::new(x, y, z) - world.origin_in_source);
        let place = view.camera.project(point.as_vec3()).map_or(DVec2::NAN, |(place, _)| place.as_dvec2());
        found.pinhole = farther(found.pinhole, (place - DVec2::new(across, down)).length());
    }
    for &[column, row, across, down] in &model.pixels {
        let (row, column) = (row as usize, column as usize);
        if view.states[(row, column)] == PixelState::Ignored {
            found.unseen += 1;
            continue;
        }
        let place = view.photo.radiance(row, column).truncate().as_dvec2() * scale;
        found.resampled = farther(found.resampled, (place - DVec2::new(across, down)).length());
    }
    Ok(found)
}
