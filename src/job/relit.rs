//! Views relit from cached transport on a thread of its own, for a window: the newest request wins.
//!
//! [`transport_of`] traces the cache of a surface once. [`Relighter`] then keeps what the eye sees: a request that differs
//! from the last only in its light costs no ray. A view is traced with one ray a pixel first and shown, and once nothing
//! else is asked for with as many as the fit takes. Work is done on a pool of its own, which gives way.

use super::kept::{self, Kept};
use super::newest::Newest;
use super::{Slot, Wake, background};
use crate::error::{Error, ErrorKind, Result, text_of_panic};
use crate::fit::solver::SolverSettings;
use crate::fit::{FitSettings, Method};
use crate::image::RgbImage;
use crate::light::Environment;
use crate::material::texels::texels_from_maps;
use crate::material::{LobeModel, Material, MaterialMaps};
use crate::render::Surface;
use crate::render::cached::{CachedSettings, CachedTransport, FootprintSettings};
use crate::render::relight::RelitView;
use crate::scene::Camera;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::JoinHandle;
use std::time::Instant;

/// Width and height of the lights that the cache of a window is made for.
const LIGHT_SIZE: (usize, usize) = (64, 32);
/// Texels a side of its grid.
const GRID: usize = 192;
/// The same of a fit's own cache that is taken for it, at most: each texel more is lit anew with every light.
const LARGEST_GRID: usize = 256;

/// The cache by which a window relights a surface, from disk where it was traced before; `None` when `stop` was raised.
pub fn transport_of(
    surface: &Surface,
    settings: CachedSettings,
    kept: &Kept,
    stop: &AtomicBool,
) -> Option<CachedTransport> {
    kept::transport(surface, settings, LIGHT_SIZE, kept, stop)
}

/// How fine that cache is where fits with these settings are begun and looked at: the one that a fit by the solver begins
/// with, where it is about as fine, so that it is traced once.
pub fn settings_beside(fit: &FitSettings, max_bounces: usize) -> CachedSettings {
    let (first, _) = SolverSettings::first_cache(fit);
    let is_about_as_fine = (GRID..=LARGEST_GRID).contains(&first.grid) && first.max_bounces == max_bounces;
    let serves = fit.has_lobe() && is_about_as_fine && is_first_cache(&first, fit);
    if serves { first } else { settings_of(max_bounces, fit.has_lobe().then_some(fit.lobe)) }
}

/// Whether a fit with these settings begins with such a cache of a window.
pub fn is_first_cache(settings: &CachedSettings, fit: &FitSettings) -> bool {
    fit.method == Method::Solver && SolverSettings::first_cache(fit) == (*settings, LIGHT_SIZE)
}

/// How fine that cache is, for surface with a lobe of these microfacets or without one.
pub fn settings_of(max_bounces: usize, lobe: Option<LobeModel>) -> CachedSettings {
    let lobe_strength = if lobe.is_some() { 1.0 } else { 0.0 };
    let lobe = lobe.unwrap_or_default();
    CachedSettings { grid: GRID, max_bounces, lobe_strength, lobe, ..CachedSettings::default() }
}

/// A light of a request.
#[derive(Clone)]
pub struct RelitLight {
    /// Radiance from every direction.
    pub environment: Arc<Environment>,
    /// Turned about +y by this angle in radians.
    pub turn_radians: f32,
    /// Times this factor.
    pub strength: f32,
}

impl RelitLight {
    fn environment(&self) -> Environment {
        let turned = match self.turn_radians {
            0.0 => (*self.environment).clone(),
            turn => self.environment.rotated_about_up(turn),
        };
        match self.strength {
            1.0 => turned,
            factor => Environment { radiance: turned.radiance.map(|radiance| *radiance * factor) },
        }
    }
}

/// What is to be drawn.
#[derive(Clone)]
pub struct RelitRequest {
    /// The surface.
    pub surface: Arc<Surface>,
    /// Its cache.
    pub transport: Arc<CachedTransport>,
    /// The maps.
    pub maps: Arc<MaterialMaps>,
    /// The camera, of the size of the picture.
    pub camera: Camera,
    /// One or more lights: each gives a picture.
    pub lights: Vec<RelitLight>,
    /// Whether the lights show behind the surface; it is black otherwise.
    pub background_visible: bool,
    /// By how many degrees they are blurred there.
    pub background_blur_degrees: f32,
    /// Whether the maps stay for a while, so that it is worth while to make further lights cheap.
    pub is_settled: bool,
    /// Chosen by who asks; comes back with the pictures.
    pub key: u64,
    /// The same, equal for requests that differ in their lights alone.
    pub view: u64,
}

/// Pictures that were asked for.
#[derive(Clone, Debug)]
pub struct RelitPictures {
    /// That of the request.
    pub key: u64,
    /// That of the request.
    pub view: u64,
    /// Linear radiance, one picture a light.
    pub pictures: Vec<Arc<RgbImage>>,
    /// Whether edges are smooth: a picture of one ray a pixel comes before.
    pub is_fine: bool,
    /// Whether rays were traced for it.
    pub is_of_new_view: bool,
    /// Seconds that the lights took.
    pub light_seconds: f64,
}

/// The thread that draws.
pub struct Relighter {
    /// The newest pictures.
    pub pictures: Arc<Slot<RelitPictures>>,
    /// The newest failure, with the key of its request.
    pub failures: Arc<Slot<(u64, Error)>>,
    requests: Arc<Newest<RelitRequest>>,
    thread: Option<JoinHandle<()>>,
}

impl Relighter {
    /// Starts the thread. `wake` is called after each picture and failure.
    ///
    /// # Errors
    /// `Internal` when the system gives no thread.
    pub fn start(wake: Option<Wake>) -> Result<Self> {
        let requests = Arc::new(Newest::default());
        let (pictures, failures) = (Arc::new(Slot::default()), Arc::new(Slot::default()));
        let worker = Worker {
            requests: Arc::clone(&requests),
            pool: background::pool("patina-relit"),
            pictures: Arc::clone(&pictures),
            failures: Arc::clone(&failures),
            wake,
            seen: None,
        };
        let thread = std::thread::Builder::new().name("patina-relit".into()).spawn(move || worker.run());
        let thread =
            thread.map_err(|source| Error::new(ErrorKind::Internal, format!("cannot start a thread: {source}")))?;
        Ok(Relighter { pictures, failures, requests, thread: Some(thread) })
    }

    /// Draws this next. A request for the same view waits for the one in progress, so that a light that turns is seen to
    /// turn; another view ends it.
    pub fn request(&self, request: RelitRequest, is_other_view: bool) {
        self.requests.put(request, is_other_view);
    }

    /// Drops what is waiting or in progress.
    pub fn cancel(&self) {
        self.requests.cancel();
    }
}

impl Drop for Relighter {
    fn drop(&mut self) {
        self.requests.close();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A view that is kept, and what it is of.
struct Seen {
    request: RelitRequest,
    view: RelitView,
    reflectance: Vec<[f32; 3]>,
    is_fine: bool,
}

impl Seen {
    fn is_same_place(&self, request: &RelitRequest) -> bool {
        Arc::ptr_eq(&self.request.surface, &request.surface)
            && Arc::ptr_eq(&self.request.transport, &request.transport)
            && self.request.camera == request.camera
            && self.request.maps.diffuse.width() == request.maps.diffuse.width()
    }
}

struct Worker {
    requests: Arc<Newest<RelitRequest>>,
    pool: Option<rayon::ThreadPool>,
    pictures: Arc<Slot<RelitPictures>>,
    failures: Arc<Slot<(u64, Error)>>,
    wake: Option<Wake>,
    seen: Option<Seen>,
}

impl Worker {
    fn run(mut self) {
        // What could be drawn finer once nothing else is asked for.
        let mut to_refine: Option<RelitRequest> = None;
        while let Some((request, is_fine)) = self.requests.next(&mut to_refine) {
            let key = request.key;
            let pool = self.pool.take();
            let drawn = catch_unwind(AssertUnwindSafe(|| match &pool {
                Some(pool) => pool.install(|| self.draw(request.clone(), is_fine)),
                None => self.draw(request.clone(), is_fine),
            }));
            self.pool = pool;
            match drawn {
                Ok(Some(pictures)) => {
                    let is_fine = pictures.is_fine;
                    self.pictures.put(pictures);
                    if is_fine && request.is_settled {
                        self.freeze(&request.transport);
                    }
                    to_refine = (!is_fine).then_some(request);
                }
                // Something else is wanted.
                Ok(None) => to_refine = None,
                Err(panic) => {
                    self.seen = None;
                    let message = format!("the view could not be relit: {}", text_of_panic(&*panic));
                    let error = Error::new(ErrorKind::Internal, message);
                    self.failures.put((key, error.remedy("internal error (please report); path tracing still works")));
                }
            }
            if let Some(wake) = &self.wake {
                wake();
            }
        }
    }

    /// Makes further lights on the view that was drawn cheap, unless another view is asked for meanwhile.
    fn freeze(&mut self, transport: &CachedTransport) {
        let Some(seen) = self.seen.as_mut().filter(|seen| !seen.view.is_frozen()) else { return };
        let mut freeze = || seen.view.freeze(transport, &self.requests.stop);
        match &self.pool {
            Some(pool) => pool.install(freeze),
            None => freeze(),
        }
    }

    /// Draws a request; `None` when it was stopped.
    fn draw(&mut self, request: RelitRequest, wants_fine: bool) -> Option<RelitPictures> {
        let requests = Arc::clone(&self.requests);
        let stop = &requests.stop;
        let map_size = request.maps.diffuse.width();
        let texels = || -> Vec<Material<f32>> { texels_from_maps(&request.maps) };
        let is_kept =
            self.seen.as_ref().is_some_and(|seen| seen.is_same_place(&request) && (seen.is_fine || !wants_fine));
        let kept = if is_kept { self.seen.take() } else { None };
        let seen = match kept {
            Some(seen) if Arc::ptr_eq(&seen.request.maps, &request.maps) => Seen { request: request.clone(), ..seen },
            Some(seen) => {
                let texels = texels();
                let reflectance = request.transport.reflectance_of_points(&texels, map_size);
                let view = seen.view.with_texels(&request.transport, &texels);
                Seen { request: request.clone(), view, reflectance, is_fine: seen.is_fine }
            }
            None => {
                let texels = texels();
                let settings = match wants_fine {
                    true => FootprintSettings { map_size, ..FootprintSettings::default() },
                    false => FootprintSettings { map_size, ..FootprintSettings::COARSE },
                };
                let (surface, transport) = (&request.surface, &request.transport);
                let view = RelitView::new(surface, transport, &request.camera, &texels, &settings, stop)?;
                let reflectance = transport.reflectance_of_points(&texels, map_size);
                Seen { request: request.clone(), view, reflectance, is_fine: wants_fine }
            }
        };
        let began = Instant::now();
        let mut pictures = Vec::with_capacity(request.lights.len());
        for light in &request.lights {
            let environment = light.environment();
            let behind = request.background_visible.then(|| environment.out_of_focus(request.background_blur_degrees));
            let lit = seen.view.lit(&request.transport, &environment, &seen.reflectance, behind.as_ref(), stop);
            let Some(lit) = lit else { break };
            pictures.push(Arc::new(lit.radiance));
        }
        let is_fine = seen.is_fine;
        self.seen = Some(seen);
        let light_seconds = began.elapsed().as_secs_f64();
        let (key, view) = (request.key, request.view);
        let is_whole = pictures.len() == request.lights.len();
        is_whole.then_some(RelitPictures { key, view, pictures, is_fine, is_of_new_view: !is_kept, light_seconds })
    }
}

#[cfg(test)]
mod tests;
