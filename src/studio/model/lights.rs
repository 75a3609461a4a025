//! The shelf of lights, and which of them lights the stage.

use crate::error::{Error, ErrorKind, Finding, Place, Result};
use crate::image::{RgbImage, resize};
use crate::job::pictures::{light_of, matched};
use crate::light::Environment;
use crate::light::day::Day;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Height of a light of the shelf in texels.
pub const SHELF_HEIGHT: usize = 128;
/// Width of a small picture of a light in texels.
const SMALL_WIDTH: usize = 96;

/// Which light, by what it is rather than by its place.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum LightName {
    /// The light of the run.
    #[default]
    Fitted,
    /// The light of a scene whose truth is known.
    Truth,
    /// A light of the truth that no photo shows.
    Unseen,
    /// A built-in sky: `noon`, `evening`, `overcast`.
    Sky(String),
    /// The sky of an hour and a latitude, as they are set.
    Day,
    /// An HDR map.
    File(PathBuf),
}

impl LightName {
    /// The name on screen.
    pub fn label(&self) -> String {
        match self {
            LightName::Fitted => "Estimated environment".into(),
            LightName::Truth => "Ground-truth environment".into(),
            LightName::Unseen => "Novel environment (ground truth)".into(),
            LightName::Sky(name) => match name.as_str() {
                "noon" => "Noon sky".into(),
                "evening" => "Evening sky".into(),
                "overcast" => "Overcast sky".into(),
                other => other.into(),
            },
            LightName::Day => "Sky by the hour".into(),
            LightName::File(path) => path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into()),
        }
    }
}

/// A light on the shelf.
#[derive(Clone, Debug)]
pub struct ShelfLight {
    /// Which it is.
    pub name: LightName,
    /// Its radiance, in its own units.
    pub environment: Arc<Environment>,
    /// A small picture of it.
    pub small: Arc<RgbImage>,
    /// Mean radiance over the sphere.
    pub mean_radiance: Vec3,
    /// Largest number of any texel.
    pub brightest: f32,
}

impl ShelfLight {
    /// A light with its small picture and what is said of it: a window asks for them in every frame.
    pub fn new(name: LightName, environment: Arc<Environment>) -> Self {
        let factor = (environment.width() / SMALL_WIDTH).max(1);
        let small = resize::shrink(&environment.radiance, factor);
        let brightest = environment.radiance.pixels().iter().map(|texel| texel.max_element()).fold(0.0, f32::max);
        let mean_radiance = environment.mean_radiance();
        ShelfLight { name, environment, small: Arc::new(small), mean_radiance, brightest }
    }
}

/// Reads a light from its file, at the size the shelf keeps, with what was noticed.
///
/// # Errors
/// Those of [`Environment::read`].
pub fn read(path: &Path) -> Result<(ShelfLight, Vec<Finding>)> {
    let read = light_of(&path.to_string_lossy(), 2 * SHELF_HEIGHT)?;
    Ok((ShelfLight::new(LightName::File(path.into()), Arc::new(read.environment)), read.findings))
}

/// The sky of an hour; `None` where the sun has not risen.
pub fn of_day(day: &Day) -> Option<ShelfLight> {
    let environment = day.environment(SHELF_HEIGHT).ok()?;
    Some(ShelfLight::new(LightName::Day, Arc::new(environment)))
}

/// Files of a folder that may be environments, by their names, at most so many.
///
/// # Errors
/// A folder that cannot be read, or holds none.
pub fn of_folder(folder: &Path) -> Result<Vec<PathBuf>> {
    const MOST: usize = 200;
    let entries = std::fs::read_dir(folder).map_err(|source| Error::reading(folder, source))?;
    let is_light = |path: &PathBuf| {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        ["hdr", "exr", "pfm"].contains(&ending.as_str()) && path.is_file()
    };
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(is_light).collect();
    files.sort();
    files.truncate(MOST);
    if files.is_empty() {
        return Err(Error::new(ErrorKind::Missing, "no environment lies in this folder")
            .at(Place::File(folder.into()))
            .remedy("choose a folder with HDR, EXR or PFM files"));
    }
    Ok(files)
}

/// All lights that can light the stage.
#[derive(Clone, Debug, Default)]
pub struct Shelf {
    lights: Vec<ShelfLight>,
}

impl Shelf {
    /// The built-in skies.
    pub fn built_in() -> Self {
        let sky = |name: &str| {
            let environment = light_of(name, SHELF_HEIGHT).ok()?.environment;
            Some(ShelfLight::new(LightName::Sky(name.into()), Arc::new(environment)))
        };
        let skies = ["noon", "evening", "overcast"].into_iter().filter_map(sky);
        Shelf { lights: skies.chain(of_day(&Day::default())).collect() }
    }

    /// All lights, in the order of the shelf: of the scene, built-in, files.
    pub fn lights(&self) -> &[ShelfLight] {
        &self.lights
    }

    /// Puts a light on the shelf, in the place of the one of the same name.
    pub fn put(&mut self, light: ShelfLight) {
        match self.lights.iter_mut().find(|other| other.name == light.name) {
            Some(other) => *other = light,
            None => {
                self.lights.push(light);
                self.lights.sort_by_key(|light| match &light.name {
                    LightName::Fitted => 0,
                    LightName::Truth => 1,
                    LightName::Unseen => 2,
                    LightName::Sky(_) => 3,
                    LightName::Day => 4,
                    LightName::File(_) => 5,
                });
            }
        }
    }

    /// Takes a light off the shelf.
    pub fn remove(&mut self, name: &LightName) {
        self.lights.retain(|light| light.name != *name);
    }

    /// Takes the lights of a scene off the shelf.
    pub fn forget_scene(&mut self) {
        self.lights.retain(|light| matches!(light.name, LightName::Sky(_) | LightName::Day | LightName::File(_)));
    }

    /// A light by its name.
    pub fn find(&self, name: &LightName) -> Option<&ShelfLight> {
        self.lights.iter().find(|light| light.name == *name)
    }

    /// The name so many places after another one, around the end; the first light when that one is not there.
    pub fn step(&self, name: &LightName, places: isize) -> Option<LightName> {
        let count = self.lights.len() as isize;
        if count == 0 {
            return None;
        }
        let place = self.lights.iter().position(|light| light.name == *name).map_or(0, |place| place as isize + places);
        Some(self.lights[place.rem_euclid(count) as usize].name.clone())
    }

    /// A light with the mean luminance of the fitted one, so that the stage keeps its brightness; as it is when there is
    /// no fitted light. The second value is the factor.
    pub fn matched(&self, name: &LightName) -> Option<(Arc<Environment>, f32)> {
        let light = self.find(name)?;
        let reference = self.find(&LightName::Fitted).filter(|fitted| fitted.name != *name);
        match reference {
            Some(fitted) => {
                let (environment, factor) = matched(&light.environment, &fitted.environment);
                Some((Arc::new(environment), factor))
            }
            None => Some((Arc::clone(&light.environment), 1.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shelf_steps_around_and_matches_brightness() {
        let mut shelf = Shelf::built_in();
        assert_eq!(shelf.lights().len(), 4);
        let fitted = Environment::constant(8, 4, glam::Vec3::splat(2.0));
        shelf.put(ShelfLight::new(LightName::Fitted, Arc::new(fitted)));
        assert_eq!(shelf.lights()[0].name, LightName::Fitted);
        assert_eq!(shelf.step(&LightName::Fitted, -1), Some(LightName::Day));
        let (noon, factor) = shelf.matched(&LightName::Sky("noon".into())).unwrap();
        assert!((crate::math::luminance(noon.mean_radiance()) - 2.0).abs() < 1e-3 && factor > 0.0);
        shelf.forget_scene();
        assert_eq!(shelf.lights().len(), 4);
        assert_eq!(Shelf::default().step(&LightName::Fitted, 1), None);
    }

    #[test]
    fn a_folder_of_environments_is_listed_and_one_without_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(of_folder(folder.path()).unwrap_err().remedy_text().contains("HDR"));
        for name in ["b.hdr", "a.EXR", "letter.txt", "photo.jpg"] {
            std::fs::write(folder.path().join(name), b"").unwrap();
        }
        let names: Vec<_> =
            of_folder(folder.path()).unwrap().into_iter().map(|path| path.file_name().unwrap().to_owned()).collect();
        assert_eq!(names, ["a.EXR", "b.hdr"]);
    }
}
