//! What was read beside the window, with what is drawn of it at once: small photos, shares of clipped pixels.

use super::project::Atlas;
use crate::error::Finding;
use crate::export::RunFolder;
use crate::fit::Suited;
use crate::image::RgbImage;
use crate::insight::report::data::StageTime;
use crate::job::open::{OpenedRun, OpenedScene};
use crate::job::prepare::{Prepared, RunSettings};
use crate::math::parallel;
use crate::render::Surface;
use crate::scene::{Mesh, Scene};
use std::path::PathBuf;
use std::sync::Arc;

/// Longest side of the small picture of a photo, in pixels.
const THUMBNAIL_SIDE: usize = 128;
/// Pixels along the shorter side of a photo whose rays are asked whether they meet the surface.
const LOOKED_AT_A_SIDE: usize = 64;

/// A scene that was read; it is shown before it is checked.
pub struct SceneRead {
    pub(super) path: Option<PathBuf>,
    pub(super) settings: RunSettings,
    /// What suits the scene as far as its photos alone say; the check says the rest.
    pub(super) suited: Option<Suited>,
    pub(super) scene: Arc<Scene>,
    pub(super) mesh: Arc<Mesh>,
    pub(super) timings: Vec<StageTime>,
    pub(super) thumbnails: Vec<Arc<RgbImage>>,
}

/// What the check of a scene says.
pub struct SceneChecked {
    pub(super) suited: Suited,
    pub(super) findings: Vec<Finding>,
    pub(super) timings: Vec<StageTime>,
}

/// A scene with its atlas.
pub struct PreparedScene {
    pub(super) prepared: Prepared,
    pub(super) atlas: Atlas,
    pub(super) clipped_shares: Vec<f32>,
}

/// A run that was read.
pub struct RunRead {
    pub(super) folder: RunFolder,
    pub(super) run: OpenedRun,
    pub(super) atlas: Atlas,
    pub(super) thumbnails: Vec<Arc<RgbImage>>,
    pub(super) clipped_shares: Vec<f32>,
}

impl SceneRead {
    pub(super) fn new(path: Option<PathBuf>, settings: RunSettings, opened: OpenedScene) -> Self {
        let OpenedScene { scene, timings, .. } = opened;
        let mut mesh = scene.mesh.clone();
        if mesh.normals.len() != mesh.positions.len() {
            mesh.compute_normals();
        }
        let thumbnails = small_pictures(&scene);
        SceneRead { path, suited: None, settings, scene: Arc::new(scene), mesh: Arc::new(mesh), timings, thumbnails }
    }
}

impl RunRead {
    pub(super) fn new(folder: RunFolder, run: OpenedRun) -> Self {
        let atlas = Atlas::of(Arc::clone(&run.surface));
        let thumbnails = run.scene.as_deref().map(small_pictures).unwrap_or_default();
        let of_rays = |scene: &Scene| clipped_shares(scene, &run.surface);
        let clipped_shares = run.scene.as_deref().map(of_rays).unwrap_or_default();
        RunRead { folder, run, atlas, thumbnails, clipped_shares }
    }
}

/// A small picture of each photo.
fn small_pictures(scene: &Scene) -> Vec<Arc<RgbImage>> {
    let small = |view: &crate::scene::View| {
        let (photo, size) = (&view.photo, (view.photo.width(), view.photo.height()));
        Arc::new(crate::image::area::thumbnail_of(size, |row, column| photo.radiance(row, column), THUMBNAIL_SIDE))
    };
    parallel::map_items(&scene.views, small)
}

/// The share of clipped pixels among those whose rays meet the surface, of each photo: without a mask only rays tell the
/// object from a bright sky. Looks at a grid of pixels.
pub(super) fn clipped_shares(scene: &Scene, surface: &Surface) -> Vec<f32> {
    let of_view = |view: &crate::scene::View| {
        let states = &view.states;
        let every = (states.width().min(states.height()) / LOOKED_AT_A_SIDE).max(1);
        let (mut met, mut clipped) = (0usize, 0usize);
        for row in (every / 2..states.height()).step_by(every) {
            for column in (every / 2..states.width()).step_by(every) {
                let state = states[(row, column)];
                let place = glam::Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                if state.is_surface() && surface.closest(&view.camera.ray_through(place)).is_some() {
                    met += 1;
                    clipped += usize::from(state.is_clipped());
                }
            }
        }
        clipped as f32 / met.max(1) as f32
    };
    parallel::map_items(&scene.views, of_view)
}
