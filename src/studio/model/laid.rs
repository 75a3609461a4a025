//! What is made of a scene beside the window as soon as it is read: its photos laid on the mesh, so that something true is
//! seen before any fit, and the cached transport by which its maps are relit at once.

use super::tasks::TaskKind;
use super::{Done, Model};
use crate::error::{Error, ErrorKind};
use crate::fit::FitSettings;
use crate::insight::projected_photos::{ProjectedPhotos, WeightedColour};
use crate::job::relit;
use crate::material::MaterialMaps;
use crate::render::Surface;
use crate::render::cached::{CachedSettings, CachedTransport};
use crate::scene::Mesh;
use crate::studio::stage::{CoveredTexels, Layer};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// How often who waits for a cache looks whether to give up.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);

/// The photos on the surface.
#[derive(Clone)]
pub struct LaidPhotos {
    projected: Arc<ProjectedPhotos>,
    /// The mesh that is coloured.
    pub mesh: Arc<Mesh>,
    /// Colours of its vertices; until there are those of texels.
    pub vertices: Option<Arc<Vec<WeightedColour>>>,
    /// Colours of the texels of its atlas as a diffuse map, and which of them some photo sees.
    pub texels: Option<(Arc<MaterialMaps>, Arc<CoveredTexels>)>,
}

/// A cache, and the surface it is of.
pub struct CachedOf {
    /// The surface.
    pub surface: Arc<Surface>,
    transport: Arc<CachedTransport>,
}

impl CachedOf {
    /// The cache.
    pub fn transport(&self) -> Arc<CachedTransport> {
        Arc::clone(&self.transport)
    }
}

/// A cache that is being traced, for a fit that begins meanwhile: it would trace the same.
pub struct BeingCached {
    surface: Arc<Surface>,
    settings: CachedSettings,
    made: Receiver<Arc<CachedTransport>>,
}

impl BeingCached {
    /// Whether a fit of this surface with such settings begins with it.
    pub(super) fn is_first_of(&self, surface: &Arc<Surface>, fit: &FitSettings) -> bool {
        Arc::ptr_eq(&self.surface, surface) && relit::is_first_cache(&self.settings, fit)
    }

    /// Waits for it. `None` when `stop` was raised, or who traces it gave up.
    pub(super) fn wait(self, stop: &AtomicBool) -> Option<Arc<CachedTransport>> {
        while !stop.load(Ordering::Relaxed) {
            match self.made.recv_timeout(BETWEEN_LOOKS) {
                Ok(made) => return Some(made),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        }
        None
    }
}

impl Model {
    /// Lays the photos of what is open on its mesh, beside the window: on vertices until there is an atlas, on texels then.
    pub(super) fn lay_photos(&mut self) {
        let Some(project) = &self.project else { return };
        let Some(scene) = project.scene.clone().filter(|scene| !scene.views.is_empty()) else { return };
        let (mesh, surface) = (Arc::clone(&project.mesh), project.surface.clone());
        let known = project.laid.as_ref().map(|laid| Arc::clone(&laid.projected));
        let known = known.filter(|known| Arc::ptr_eq(known.scene(), &scene));
        let map_size = self.edits.fit.map_size;
        self.tasks.stop(&TaskKind::LayingPhotos);
        self.tasks.spawn(TaskKind::LayingPhotos, move |context| {
            let stopped = || Error::new(ErrorKind::Stopped, "stopped while photos were projected");
            let projected = match known {
                Some(known) => known,
                None => Arc::new(ProjectedPhotos::new(scene, &context.stop).ok_or_else(stopped)?),
            };
            let mut laid = LaidPhotos { projected, mesh, vertices: None, texels: None };
            match surface {
                Some(surface) => {
                    let (maps, seen) = laid.projected.of_texels(&surface, map_size);
                    laid.texels = Some((Arc::new(maps), Arc::new(CoveredTexels::new(Box::new(move || seen)))));
                }
                None => laid.vertices = Some(Arc::new(laid.projected.of_vertices(&laid.mesh))),
            }
            Ok(Done::PhotosLaid(Box::new(laid)))
        });
    }

    /// Takes the photos in, unless they are of a mesh that is no longer shown.
    pub(super) fn photos_were_laid(&mut self, laid: LaidPhotos) {
        let Some(project) = &mut self.project else { return };
        let is_of_scene = project.scene.as_ref().is_some_and(|scene| Arc::ptr_eq(scene, laid.projected.scene()));
        let has_texels = project.laid.as_ref().is_some_and(|own| own.texels.is_some());
        if is_of_scene && (laid.texels.is_some() || !has_texels) {
            project.laid = Some(laid);
        }
    }

    /// Traces the cache that relights what is open, beside the window, unless it is there already.
    pub fn cache_transport(&mut self) {
        let wanted = relit::settings_beside(&self.edits.fit, self.picture_settings(1).max_bounces);
        let Some(project) = &self.project else { return };
        let Some(surface) = project.surface.clone().filter(|_| self.switches.traced) else { return };
        let is_there = project
            .transport
            .as_ref()
            .is_some_and(|own| own.transport.settings == wanted && Arc::ptr_eq(&own.surface, &surface));
        if is_there || self.tasks.is_running(&TaskKind::CachingTransport) {
            return;
        }
        let kept = self.kept.clone();
        let (made, for_a_fit) = channel();
        self.being_cached = Some(BeingCached { surface: Arc::clone(&surface), settings: wanted, made: for_a_fit });
        self.tasks.spawn(TaskKind::CachingTransport, move |context| {
            let transport = relit::transport_of(&surface, wanted, &kept, &context.stop);
            let stopped = || Error::new(ErrorKind::Stopped, "stopped while light transport was cached");
            let transport = Arc::new(transport.ok_or_else(stopped)?);
            // Mostly no fit waits for it.
            let _ = made.send(Arc::clone(&transport));
            Ok(Done::TransportCached(Box::new(CachedOf { surface, transport })))
        });
    }

    pub(super) fn transport_was_cached(&mut self, cached: CachedOf) {
        self.being_cached = None;
        let Some(project) = &mut self.project else { return };
        if project.surface.as_ref().is_some_and(|own| Arc::ptr_eq(own, &cached.surface)) {
            project.transport = Some(Arc::new(cached));
        } else {
            // The atlas was made anew meanwhile.
            self.cache_transport();
        }
    }

    /// The layer that is drawn: before there are maps the photos stand in for shaded materials.
    pub fn shown_layer(&self) -> Layer {
        let is_blank = self.project.as_ref().is_some_and(|own| own.maps.is_none() && own.laid.is_some());
        match self.edits.layer {
            Layer::Lit | Layer::Crossfade if is_blank => Layer::Photos,
            layer => layer,
        }
    }

    /// Shows the surface under the light, unless it is seen already.
    pub fn show_light(&mut self) {
        if !self.shows_light() {
            self.edits.layer = Layer::Lit;
        }
    }

    /// Whether the light is seen on the surface: materials under it, or a crossfade that nears them.
    pub fn shows_light(&self) -> bool {
        match self.shown_layer() {
            Layer::Lit => true,
            Layer::Crossfade => self.edits.crossfade > 1.0,
            _ => false,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::fit::Method;
    use glam::{Vec2, Vec3};

    #[test]
    fn a_wait_for_a_cache_ends_with_who_traces_it_and_with_who_waits() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let (normals, uvs) = (vec![Vec3::Z; 3], vec![Vec2::ZERO, Vec2::X, Vec2::Y]);
        let mesh = Mesh { positions, normals, uvs, triangles: vec![[0, 1, 2]] };
        let of_mesh = |mesh: &Mesh| Arc::new(Surface::new(mesh.clone()).unwrap());
        let surface = of_mesh(&mesh);
        let fit = FitSettings { method: Method::Solver, ..FitSettings::default() };
        let being = |settings: CachedSettings| {
            let (made, for_a_fit) = channel();
            (made, BeingCached { surface: Arc::clone(&surface), settings, made: for_a_fit })
        };
        let first = relit::settings_beside(&fit, fit.bounces);
        let (made, own) = being(first);
        let other = of_mesh(&mesh);
        assert!(own.is_first_of(&surface, &fit) && !own.is_first_of(&other, &fit));
        assert!(!own.is_first_of(&surface, &FitSettings { bounces: fit.bounces + 1, ..fit.clone() }));
        let adam = FitSettings { method: Method::Adam, ..fit.clone() };
        assert!(!own.is_first_of(&surface, &adam), "Adam needs none");
        drop(made);
        assert!(own.wait(&AtomicBool::new(false)).is_none(), "who traces it gave up");
        let (_made, own) = being(first);
        assert!(own.wait(&AtomicBool::new(true)).is_none(), "who waits was stopped");
        let (made, own) = being(first);
        let small = CachedSettings { grid: 8, bounce_rays: 16, ..first };
        let transport = Arc::new(CachedTransport::build(&surface, small, (16, 8), &AtomicBool::new(false)).unwrap());
        made.send(Arc::clone(&transport)).unwrap();
        drop(made);
        assert!(Arc::ptr_eq(&own.wait(&AtomicBool::new(false)).unwrap(), &transport));
    }
}
