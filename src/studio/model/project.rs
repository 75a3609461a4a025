//! What is open: a scene, and the maps and light that belong to it.

use super::known::Known;
use super::laid::{CachedOf, LaidPhotos};
use super::lights::LightName;
use crate::atlas::{AtlasQuality, chart_borders};
use crate::error::Finding;
use crate::fit::{FitSettings, Suited};
use crate::image::{GreyImage, RgbImage};
use crate::insight::cursor::UvIndex;
use crate::insight::report::data::StageTime;
use crate::job::entanglement::Entanglement;
use crate::job::prepare::RunSettings;
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::render::Surface;
use crate::scene::{Mesh, Scene};
use std::path::PathBuf;
use std::sync::Arc;

/// A surface with what the panels need of it; made beside the window, since it takes a while for a large mesh.
pub struct Atlas {
    /// The surface.
    pub surface: Arc<Surface>,
    /// Its mesh.
    pub mesh: Arc<Mesh>,
    /// Finds the triangle under a texture coordinate.
    pub uv_index: Arc<UvIndex>,
    /// Chart borders as pairs of texture coordinates.
    pub chart_borders: Arc<Vec<(glam::Vec2, glam::Vec2)>>,
}

impl Atlas {
    /// Makes what follows from a surface.
    pub fn of(surface: Arc<Surface>) -> Self {
        let mesh = Arc::new(surface.mesh().clone());
        let uv_index = Arc::new(UvIndex::new(&mesh));
        let chart_borders = Arc::new(chart_borders(&mesh));
        Atlas { surface, mesh, uv_index, chart_borders }
    }
}

/// A scene that is open.
#[derive(Default)]
pub struct Project {
    /// What the window's title says.
    pub title: String,
    /// The folder that was opened; `None` for the built-in demo.
    pub path: Option<PathBuf>,
    /// Whether a run folder was opened rather than a scene.
    pub is_run: bool,
    /// Cameras and photos; `None` for a run whose scene is gone.
    pub scene: Option<Arc<Scene>>,
    /// The mesh the stage shows: with the atlas once there is one.
    pub mesh: Arc<Mesh>,
    /// The surface with the atlas; `None` until it is made.
    pub surface: Option<Arc<Surface>>,
    /// What suits the scene where nobody chose; `None` for runs and for scenes made in code.
    pub suited: Option<Suited>,
    /// Settings a scene made in code came with; `None` for others.
    pub default_fit: Option<FitSettings>,
    /// Settings beyond those of the fit: how it was read, how the atlas is made.
    pub settings: RunSettings,
    /// How good the atlas is, where it was made here.
    pub quality: Option<AtlasQuality>,
    /// What the check and the atlas found.
    pub findings: Vec<Finding>,
    /// Time of each stage so far.
    pub timings: Vec<StageTime>,
    /// The photos on the surface, once they are laid.
    pub laid: Option<LaidPhotos>,
    /// The cache that relights the surface, once it is traced.
    pub transport: Option<Arc<CachedOf>>,
    /// The newest maps.
    pub maps: Option<Arc<MaterialMaps>>,
    /// The newest light of the run.
    pub environment: Option<Arc<Environment>>,
    /// How many photos see each texel.
    pub times_seen: Option<Arc<GreyImage>>,
    /// Root mean square error over the photos that see each texel.
    pub photo_error: Option<Arc<GreyImage>>,
    /// Share of the photos that see each texel.
    pub coverage: Option<Arc<GreyImage>>,
    /// Disagreement of the photos in [0, 1].
    pub disagreement: Option<Arc<GreyImage>>,
    /// What the solver tells of its maps and light; empty under Adam.
    pub known: Known,
    /// Errors at the two ends of the colour scale.
    pub photo_error_range: [f32; 2],
    /// Disagreements at the two ends of the colour scale.
    pub disagreement_range: [f32; 2],
    /// The stage's view under every light of the shelf, as last drawn.
    pub strip: Vec<(LightName, Arc<RgbImage>)>,
    /// Errors under lights the fit never saw, once they are measured.
    pub entanglement: Option<Arc<Entanglement>>,
    /// Root mean square error of each view, where it is known.
    pub view_errors: Vec<Option<f32>>,
    /// Share of each view's surface pixels that are clipped; empty until rays tell the surface from the sky.
    pub clipped_shares: Vec<f32>,
    /// A small picture of each photo.
    pub thumbnails: Vec<Arc<RgbImage>>,
    /// The view that was chosen.
    pub chosen_view: usize,
    /// Finds the triangle under a texture coordinate.
    pub uv_index: Option<Arc<UvIndex>>,
    /// Chart borders as pairs of texture coordinates.
    pub chart_borders: Option<Arc<Vec<(glam::Vec2, glam::Vec2)>>>,
}

impl Project {
    /// Number of photos.
    pub fn view_count(&self) -> usize {
        self.scene.as_ref().map_or(0, |scene| scene.views.len())
    }

    /// Takes over a surface with its atlas, and what follows from it.
    pub fn take_surface(&mut self, surface: Arc<Surface>) {
        self.take_atlas(Atlas::of(surface));
    }

    /// Takes over an atlas whose parts are made already.
    pub fn take_atlas(&mut self, atlas: Atlas) {
        self.mesh = atlas.mesh;
        self.surface = Some(atlas.surface);
        self.uv_index = Some(atlas.uv_index);
        self.chart_borders = Some(atlas.chart_borders);
    }

    /// Name of the chosen photo.
    pub fn chosen_name(&self) -> Option<&str> {
        self.scene.as_ref()?.views.get(self.chosen_view).map(|view| view.name.as_str())
    }

    /// Chooses a photo by its name; false when there is none.
    pub fn choose_by_name(&mut self, name: &str) -> bool {
        let place = self.scene.as_ref().and_then(|scene| scene.views.iter().position(|view| view.name == name));
        self.chosen_view = place.unwrap_or(self.chosen_view);
        place.is_some()
    }

    /// Chooses the photo so many places after the chosen one, around the end.
    pub fn choose_next(&mut self, places: isize) {
        let count = self.view_count() as isize;
        if count > 0 {
            self.chosen_view = (self.chosen_view as isize + places).rem_euclid(count) as usize;
        }
    }
}
