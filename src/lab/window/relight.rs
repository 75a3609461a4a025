//! A view relit from cached transport: how long a new environment takes, how often a second one turns, and how far the
//! picture is from the path tracer's.
//!
//! It needs no window: what the stage does is done here on its own, with the maps of a truth or of a run. The squared error
//! is the product of the differences to two independent pictures of the path tracer, so that their noise does not count.

use crate::error::{Error, ErrorKind, Result};
use crate::export::RunFolder;
use crate::fit::{FitSettings, Method};
use crate::image::RgbImage;
use crate::job::kept::Kept;
use crate::job::pictures::{light_of, matched, parameters_with};
use crate::job::prepare::RunSettings;
use crate::job::relit;
use crate::light::Environment;
use crate::material::texels::texels_from_maps;
use crate::material::{LobeModel, MaterialMaps};
use crate::render::Surface;
use crate::render::cached::{CachedSettings, CachedTransport, FootprintSettings};
use crate::render::picture::{PictureSettings, render};
use crate::render::relight::RelitView;
use crate::scene::{ReadSettings, demo};
use crate::studio::model::framing::subject;
use crate::studio::stage::eye::{Eye, OrbitEye};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Width and height of the viewport in pixels: about what a window of 1440 x 900 leaves to it.
pub const VIEW: [usize; 2] = [900, 560];
/// Seconds that a new environment may take.
pub const MOST_SECONDS: f64 = 0.25;
/// Largest relative error.
pub const LARGEST_ERROR: f64 = 0.03;
/// Height in texels of the environments, as the window keeps them.
const LIGHT_HEIGHT: usize = 128;
/// Surface hits of the longest path.
const BOUNCES: usize = 2;
/// Times that an environment is timed.
const TIMES: usize = 7;

/// What one environment gave.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct RelightRow {
    /// The scene.
    pub scene: String,
    /// The environment.
    pub light: String,
    /// Seconds from an environment to the whole picture where the view just came, median.
    pub first_light_seconds: f64,
    /// The same once the view has rested: its lobes are kept as rows.
    pub light_seconds: f64,
    /// Seconds of rest that this takes, once an eye.
    pub rest_seconds: f64,
    /// Pictures a second of an environment that turns, its rotation included.
    pub turns_per_second: f64,
    /// Error relative to the root mean square of the path tracer's picture.
    pub relative_error: f64,
    /// Mean difference relative to the mean of that picture.
    pub bias: f64,
    /// Shading points at which lobes were integrated.
    pub lobe_points: usize,
    /// Seconds that tracing the cache took, once a scene.
    pub cache_seconds: f64,
    /// Seconds of a new view of one ray a pixel, once an eye.
    pub view_seconds: f64,
    /// Seconds of a view with smooth edges.
    pub fine_view_seconds: f64,
}

impl RelightRow {
    /// Whether both figures are within their limits.
    pub fn passes(&self) -> bool {
        self.light_seconds <= MOST_SECONDS && self.relative_error <= LARGEST_ERROR
    }
}

/// The cache of a window beside a fit by the solver.
fn beside_a_fit(fit: FitSettings) -> CachedSettings {
    relit::settings_beside(&FitSettings { method: Method::Solver, ..fit }, BOUNCES)
}

/// What is relit.
struct Subject {
    name: String,
    surface: Surface,
    maps: MaterialMaps,
    environment: Environment,
    lobe: LobeModel,
    eye: OrbitEye,
    /// As the window has them beside it.
    cached: CachedSettings,
}

impl Subject {
    fn demo() -> Result<Self> {
        let scene = demo::build(&demo::DemoSettings::default())?.scene;
        let truth = scene.truth.clone();
        let truth = truth.ok_or_else(|| Error::new(ErrorKind::Internal, "the demo has no truth"))?;
        let surface = Surface::new(scene.mesh.clone())?;
        let eye = OrbitEye::around(subject(surface.mesh(), Some(&scene)));
        let (maps, environment, lobe) = (truth.maps, truth.environment, LobeModel::BlinnPhong);
        let cached = beside_a_fit(FitSettings { lobe, ..FitSettings::default() });
        Ok(Subject { name: "demo".into(), surface, maps, environment, lobe, eye, cached })
    }

    /// A run folder, or an exchange folder with its truth.
    fn at(path: &Path) -> Result<Self> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let folder = RunFolder::open(path)?;
        if folder.is_run() {
            let result = folder.read_result()?;
            let surface = Surface::new(result.mesh)?;
            let eye = OrbitEye::around(subject(surface.mesh(), None));
            let (maps, environment, lobe) = (result.maps, result.environment, result.lobe);
            let cached = beside_a_fit(FitSettings { lobe, ..folder.read_settings::<RunSettings>()?.fit });
            return Ok(Subject { name, surface, maps, environment, lobe, eye, cached });
        }
        let scene = crate::scene::read(path, &ReadSettings { hold_out_every: 0, ..ReadSettings::default() })?;
        let Some(truth) = scene.truth.clone() else {
            return Err(Error::new(ErrorKind::Unsupported, "there are no maps to relight")
                .remedy("name a run folder, or an exchange folder with its truth"));
        };
        let surface = Surface::new(scene.mesh.clone())?;
        let eye = OrbitEye::around(subject(surface.mesh(), Some(&scene)));
        let (maps, environment, lobe) = (truth.maps, truth.environment, LobeModel::BlinnPhong);
        let cached = beside_a_fit(FitSettings { lobe, ..FitSettings::default() });
        Ok(Subject { name, surface, maps, environment, lobe, eye, cached })
    }
}

/// Relights the demo, or what lies at a path, under several environments. `is_quick`: fewer paths in the references.
///
/// # Errors
/// What cannot be read.
pub fn measure(path: Option<&Path>, is_quick: bool, tell: &dyn Fn(&str)) -> Result<Vec<RelightRow>> {
    let own = path.map_or_else(Subject::demo, Subject::at)?;
    let stop = AtomicBool::new(false);
    let stopped = || Error::new(ErrorKind::Stopped, "the bench was stopped");
    tell(&format!("caching light transport: {}", own.name));
    let began = Instant::now();
    let transport = relit::transport_of(&own.surface, own.cached, &Kept::nowhere(), &stop).ok_or_else(stopped)?;
    let cache_seconds = began.elapsed().as_secs_f64();
    let map_size = own.maps.diffuse.width();
    let texels = texels_from_maps(&own.maps);
    let camera = Eye::Orbit(own.eye).as_camera(VIEW[0], VIEW[1]);
    let trace = |settings: FootprintSettings| {
        let began = Instant::now();
        let settings = FootprintSettings { map_size, ..settings };
        let view = RelitView::new(&own.surface, &transport, &camera, &texels, &settings, &stop);
        view.map(|view| (view, began.elapsed().as_secs_f64())).ok_or_else(stopped)
    };
    let (_, view_seconds) = trace(FootprintSettings::COARSE)?;
    let (mut view, fine_view_seconds) = trace(FootprintSettings::default())?;
    let reflectance = transport.reflectance_of_points(&texels, map_size);
    let mut lights = vec![("its own environment".to_owned(), own.environment.clone())];
    for sky in ["noon", "evening", "overcast"] {
        let environment = light_of(sky, LIGHT_HEIGHT)?.environment;
        lights.push((format!("{sky} sky"), matched(&environment, &own.environment).0));
    }
    let seconds_of = |view: &RelitView, environment: &Environment| {
        let began = Instant::now();
        let picture = view.lit(&transport, environment, &reflectance, Some(environment), &stop);
        picture.map(|_| began.elapsed().as_secs_f64()).ok_or_else(stopped)
    };
    let median_of = |view: &RelitView, environment: &Environment| -> Result<f64> {
        let seconds = (0..TIMES).map(|_| seconds_of(view, environment)).collect::<Result<Vec<f64>>>()?;
        Ok(crate::math::statistics::quantile(&seconds, 0.5))
    };
    let at_first = lights.iter().map(|(_, environment)| median_of(&view, environment)).collect::<Result<Vec<f64>>>()?;
    let began = Instant::now();
    view.freeze(&transport, &stop);
    let rest_seconds = began.elapsed().as_secs_f64();
    let mut rows = Vec::new();
    for ((light, environment), first_light_seconds) in lights.into_iter().zip(at_first) {
        tell(&format!("{}: {light}", own.name));
        let light_seconds = median_of(&view, &environment)?;
        let began = Instant::now();
        for step in 0..TIMES {
            seconds_of(&view, &environment.rotated_about_up((5.0 * step as f32).to_radians()))?;
        }
        let turns_per_second = TIMES as f64 / began.elapsed().as_secs_f64();
        let of_surface = view.lit(&transport, &environment, &reflectance, None, &stop).ok_or_else(stopped)?;
        let (relative_error, bias) = errors(&own, &transport, &of_surface.radiance, &environment, is_quick, &view);
        rows.push(RelightRow {
            scene: own.name.clone(),
            light,
            first_light_seconds,
            light_seconds,
            rest_seconds,
            turns_per_second,
            relative_error,
            bias,
            lobe_points: of_surface.lobe_points,
            cache_seconds,
            view_seconds,
            fine_view_seconds,
        });
    }
    Ok(rows)
}

/// Error and bias of a picture of the surface against two independent ones of the path tracer.
fn errors(
    own: &Subject,
    transport: &CachedTransport,
    picture: &RgbImage,
    environment: &Environment,
    is_quick: bool,
    view: &RelitView,
) -> (f64, f64) {
    let lit = parameters_with(&own.maps, environment, own.lobe);
    let references = [7, 8].map(|seed| {
        let settings = PictureSettings {
            samples: if is_quick { 8 } else { 32 },
            max_bounces: transport.settings.max_bounces,
            background_visible: false,
            seed,
            ..PictureSettings::default()
        };
        render(&own.surface, view.camera(), &lit, 0, &settings, &AtomicBool::new(false)).radiance
    });
    let (mut squared, mut power, mut difference, mut mean) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for ((own, first), second) in picture.pixels().iter().zip(references[0].pixels()).zip(references[1].pixels()) {
        for channel in 0..3 {
            let (own, a, b) = (f64::from(own[channel]), f64::from(first[channel]), f64::from(second[channel]));
            squared += (own - a) * (own - b);
            power += a * b;
            difference += own - 0.5 * (a + b);
            mean += 0.5 * (a + b);
        }
    }
    ((squared / power).max(0.0).sqrt(), difference / mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "slow: references of the path tracer at the size of a window"]
    fn the_demo_relit_is_what_the_path_tracer_makes_of_it() {
        let rows = measure(None, true, &|_| {}).unwrap();
        assert_eq!(rows.len(), 4);
        for row in &rows {
            println!("{row:?}");
            assert!(row.relative_error <= LARGEST_ERROR, "{row:?}");
        }
    }
}
