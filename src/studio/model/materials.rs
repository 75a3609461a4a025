//! The library of materials as the window knows it: thumbnails, the map, and what was chosen on it.

use super::lights::LightName;
use super::{Done, Model};
use crate::image::RgbImage;
use crate::job::materials::{MaterialShown, Materials};
use crate::neural::between::Part;
use std::sync::Arc;

/// Title of the task that reads the library and draws its thumbnails.
pub const DRAWING_TITLE: &str = "Drawing the materials";
/// Title of the task that draws the chosen material.
pub const SHOWING_TITLE: &str = "Drawing the material";
/// Side of a thumbnail in pixels.
pub const THUMBNAIL_SIDE: usize = 72;

/// A place on the map of codes.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Along the two main directions.
    pub at: [f64; 2],
    /// Its materials with their shares, the largest first.
    pub parts: Vec<Part>,
}

/// The library.
#[derive(Default)]
pub struct MaterialBrowser {
    /// The library; `None` until a panel asks for it.
    pub library: Option<Arc<Materials>>,
    /// Its thumbnails, in the order of the map; empty until they are drawn.
    pub thumbnails: Vec<Arc<RgbImage>>,
    /// Whether it was asked for.
    pub was_asked: bool,
    /// What was chosen.
    pub choice: Option<Choice>,
    /// What was chosen, drawn; that of the choice before while another is being drawn.
    pub shown: Option<Arc<MaterialShown>>,
    /// The light of its sphere; `None` for three lamps.
    pub light: Option<LightName>,
}

impl Model {
    /// Reads the library and draws its thumbnails, unless that is done or going on.
    pub fn load_materials(&mut self) {
        self.materials.was_asked = true;
        if !self.materials.thumbnails.is_empty() || self.tasks.is_running(DRAWING_TITLE) {
            return;
        }
        let library = self.materials.library.clone();
        self.tasks.spawn(DRAWING_TITLE, move |context| {
            let library = match library {
                Some(library) => library,
                None => Arc::new(Materials::shipped()?),
            };
            let tell = |share: f32| context.tell("spheres", share);
            let pictures = library.thumbnails(THUMBNAIL_SIDE, &context.stop, &tell)?;
            Ok(Done::MaterialsDrawn(library, pictures))
        });
    }

    pub(super) fn materials_were_drawn(&mut self, library: Arc<Materials>, pictures: Vec<RgbImage>) {
        self.materials.thumbnails = pictures.into_iter().map(Arc::new).collect();
        self.materials.library = Some(library);
    }

    /// Chooses a place on the map and draws its material.
    pub fn choose_material(&mut self, at: [f64; 2]) {
        let Some(library) = &self.materials.library else { return };
        self.materials.choice = Some(Choice { at, parts: library.map.parts_at(at) });
        self.show_material();
    }

    /// Chooses the next material of the library, or one before.
    pub fn step_material(&mut self, places: isize) {
        let Some(library) = &self.materials.library else { return };
        let map = &library.map;
        let now = self.materials.choice.as_ref().and_then(|choice| map.nearest(choice.at));
        let count = map.places.len() as isize;
        let next = now.map_or(0, |now| (now as isize + places).rem_euclid(count.max(1)));
        if let Some(place) = map.places.get(next as usize) {
            self.choose_material(place.at);
        }
    }

    /// Draws the chosen material in the chosen light.
    pub fn show_material(&mut self) {
        let (Some(library), Some(choice)) = (self.materials.library.clone(), self.materials.choice.clone()) else {
            return;
        };
        let light = self.materials.light.as_ref().and_then(|name| self.shelf.find(name));
        let light = light.map(|light| Arc::clone(&light.environment));
        self.tasks.stop(SHOWING_TITLE);
        self.tasks.spawn(SHOWING_TITLE, move |_| {
            let shown = library.shown(&choice.parts, light.as_deref())?;
            Ok(Done::MaterialShown(Box::new(shown)))
        });
    }
}

impl MaterialBrowser {
    /// The choice in words: a material, or shares of several.
    pub fn words(parts: &[Part]) -> String {
        match parts {
            [] => String::new(),
            [one] => one.name.clone(),
            many => {
                let words: Vec<String> =
                    many.iter().map(|part| format!("{:.0} % {}", 100.0 * part.share, part.name)).collect();
                format!("Between: {}", words.join(", "))
            }
        }
    }
}
