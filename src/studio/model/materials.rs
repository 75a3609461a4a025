//! The library of materials as the window knows it: thumbnails, the map, and what was chosen on it.

use super::lights::LightName;
use super::tasks::TaskKind;
use super::{Done, Model};
use crate::image::RgbImage;
use crate::job::materials::{MaterialShown, Materials, OpenedMaterial};
use crate::neural::between::Part;
use crate::studio::workspace::Panel;
use std::path::PathBuf;
use std::sync::Arc;

/// Side of a thumbnail in pixels.
pub const THUMBNAIL_SIDE: usize = 72;

/// What was chosen to look at.
#[derive(Clone)]
pub enum Choice {
    /// A place on the map of codes.
    Place {
        /// The library that the map is of.
        library: Arc<Materials>,
        /// Along the two main directions.
        at: [f64; 2],
        /// Its materials with their shares, the largest first.
        parts: Vec<Part>,
    },
    /// A measured table that was opened.
    Opened(Arc<OpenedMaterial>),
}

/// A measured table that was opened, with its sphere.
#[derive(Clone, Debug)]
pub struct OpenedTile {
    /// The table.
    pub material: Arc<OpenedMaterial>,
    /// A sphere of it.
    pub thumbnail: Arc<RgbImage>,
}

/// The library.
#[derive(Default)]
pub struct MaterialBrowser {
    /// The library; `None` until a panel asks for it.
    pub library: Option<Arc<Materials>>,
    /// Its thumbnails, in the order of the map; empty until they are drawn.
    pub thumbnails: Vec<Arc<RgbImage>>,
    /// Measured tables that were opened, the last one first.
    pub opened: Vec<OpenedTile>,
    /// Whether the library was asked for.
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
        if !self.materials.thumbnails.is_empty() || self.tasks.is_running(&TaskKind::DrawingMaterials) {
            return;
        }
        let library = self.materials.library.clone();
        self.tasks.spawn(TaskKind::DrawingMaterials, move |context| {
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
        let parts = library.map.parts_at(at);
        self.materials.choice = Some(Choice::Place { library: Arc::clone(library), at, parts });
        self.show_material();
    }

    /// Reads a measured table, a `.binary` file or a result of object mode, puts it before the library and chooses it.
    pub fn open_material(&mut self, path: PathBuf) {
        self.tasks.spawn(TaskKind::ReadingMaterial(path.clone()), move |_| {
            let material = Arc::new(OpenedMaterial::read(&path)?);
            let thumbnail = Arc::new(material.thumbnail(THUMBNAIL_SIDE));
            Ok(Done::MaterialOpened(OpenedTile { material, thumbnail }))
        });
    }

    pub(super) fn material_was_opened(&mut self, tile: OpenedTile) {
        self.log.note(format!("Opened the material {}", tile.material.path.display()));
        let material = Arc::clone(&tile.material);
        self.materials.opened.retain(|other| other.material.path != material.path);
        self.materials.opened.insert(0, tile);
        self.choose_opened(material);
    }

    /// Chooses a measured table that was opened.
    pub fn choose_opened(&mut self, material: Arc<OpenedMaterial>) {
        self.materials.choice = Some(Choice::Opened(material));
        self.activate = Some(Panel::Material);
        self.show_material();
    }

    /// Chooses the next material of the library, or one before.
    pub fn step_material(&mut self, places: isize) {
        let Some(library) = &self.materials.library else { return };
        let map = &library.map;
        let now = self.materials.choice.as_ref().and_then(Choice::at).and_then(|at| map.nearest(at));
        let count = map.places.len() as isize;
        let next = now.map_or(0, |now| (now as isize + places).rem_euclid(count.max(1)));
        if let Some(place) = map.places.get(next as usize) {
            self.choose_material(place.at);
        }
    }

    /// Draws the chosen material in the chosen light.
    pub fn show_material(&mut self) {
        let Some(choice) = self.materials.choice.clone() else { return };
        let light = self.materials.light.as_ref().and_then(|name| self.shelf.find(name));
        let light = light.map(|light| Arc::clone(&light.environment));
        self.tasks.stop(&TaskKind::DrawingMaterial);
        self.tasks.spawn(TaskKind::DrawingMaterial, move |_| {
            let shown = match &choice {
                Choice::Opened(material) => material.shown(light.as_deref()),
                Choice::Place { library, parts, .. } => library.shown(parts, light.as_deref())?,
            };
            Ok(Done::MaterialShown(Box::new(shown)))
        });
    }
}

impl Choice {
    /// The place on the map of codes; a table has none.
    pub fn at(&self) -> Option<[f64; 2]> {
        match self {
            Choice::Place { at, .. } => Some(*at),
            Choice::Opened(_) => None,
        }
    }

    /// The one material of the library that it is, if it is one.
    pub fn material_of_library(&self) -> Option<&str> {
        match self {
            Choice::Place { parts, .. } if parts.len() == 1 => Some(&parts[0].name),
            _ => None,
        }
    }

    /// In words: a material, or shares of several.
    pub fn words(&self) -> String {
        let parts = match self {
            Choice::Place { parts, .. } => parts,
            Choice::Opened(material) => return format!("{} (measured)", material.name()),
        };
        match parts.as_slice() {
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
