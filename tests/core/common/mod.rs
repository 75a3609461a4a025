//! A scene small enough to be fitted in a fraction of a second, made in code, with photographs rendered from its truth.

// Each test file uses its own part of this.
#![allow(dead_code)]
#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::Result;
use patina::export::RunFolder;
use patina::fit::state::FitState;
use patina::fit::{FitSettings, Fitter, Method, StepOutcome};
use patina::image::Image;
use patina::job::prepare::Prepared;
use patina::job::{JobHandle, JobOptions, RunSettings, start_with};
use patina::light::Environment;
use patina::material::Material;
use patina::material::texels::{PyramidWeights, TexelPyramid};
use patina::render::picture::{PictureSettings, render};
use patina::render::{Parameters, Surface};
use patina::scene::synthetic::layout::{PartChart, lay_out};
use patina::scene::synthetic::shapes;
use patina::scene::{Background, Camera, Mesh, Photo, PixelState, Scene, View};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Width and height of the photos in pixels.
pub const PHOTO: usize = 24;

/// A scene with a truth; every field may be changed before [`Trial::photographed`].
#[derive(Clone)]
pub struct Trial {
    /// The surface, with normals and texture coordinates.
    pub mesh: Mesh,
    /// The cameras.
    pub cameras: Vec<Camera>,
    /// The one material of the truth.
    pub material: Material<f32>,
    /// The light of the truth.
    pub light: Environment,
    /// What is behind the surface.
    pub background: Background,
    /// Surface hits on the longest path of the photos.
    pub bounces: usize,
}

impl Default for Trial {
    fn default() -> Self {
        Trial {
            mesh: ball_on_a_floor(),
            cameras: around(3, 35.0),
            material: Material::from_maps(Vec3::new(0.7, 0.5, 0.3), Vec3::splat(0.1), 0.3),
            light: sky(),
            background: Background::Environment,
            bounces: 2,
        }
    }
}

/// Charts side by side in one texture.
pub fn laid_out(charts: Vec<shapes::Chart>) -> Mesh {
    let charts = charts.into_iter().map(|chart| PartChart { chart, part: 0, density: 1.0 }).collect();
    lay_out(charts, 64, 64).unwrap().mesh
}

/// A ball over a round floor.
pub fn ball_on_a_floor() -> Mesh {
    let lift = |chart: shapes::Chart| chart.placed(glam::Quat::IDENTITY, 1.0, Vec3::new(0.0, 0.75, 0.0));
    let mut charts = shapes::disk(2.0, 2, 16);
    charts.extend(shapes::sphere(0.7, 3).into_iter().map(lift));
    laid_out(charts)
}

/// A camera at an azimuth and an elevation in degrees that looks at the middle of the scene.
pub fn camera_at(azimuth: f32, elevation: f32, width: usize, height: usize) -> Camera {
    let (sin, cos) = azimuth.to_radians().sin_cos();
    let (rise, run) = elevation.to_radians().sin_cos();
    let target = Vec3::new(0.0, 0.4, 0.0);
    Camera::looking_at(target + 5.0 * Vec3::new(run * cos, rise, run * sin), target, width, height, 0.8)
}

/// Cameras evenly around the scene.
pub fn around(count: usize, elevation: f32) -> Vec<Camera> {
    (0..count).map(|index| camera_at(360.0 * index as f32 / count as f32, elevation, PHOTO, PHOTO)).collect()
}

/// A light with a bright side and a dark ground, 8 x 4 texels.
pub fn sky() -> Environment {
    let radiance = Image::from_fn(8, 4, |row, column| {
        let up = [1.0, 0.8, 0.3, 0.2][row];
        up * Vec3::new(0.6, 0.7, 0.9) * if column == 2 && row < 2 { 4.0 } else { 1.0 }
    });
    Environment { radiance }
}

impl Trial {
    /// The truth, as one texel in all places and the light.
    pub fn truth(&self) -> Parameters<f32> {
        let weights = PyramidWeights::flat(1, 1);
        let texels = TexelPyramid::from_base(vec![self.material], &weights);
        Parameters::new(texels, &self.light)
    }

    /// The surface.
    pub fn surface(&self) -> Arc<Surface> {
        Arc::new(Surface::new(self.mesh.clone()).unwrap())
    }

    /// The scene with rendered photos.
    pub fn photographed(&self) -> Scene {
        let surface = self.surface();
        let truth = self.truth();
        let settings = PictureSettings {
            samples: 32,
            max_bounces: self.bounces,
            background_visible: self.background == Background::Environment,
            ..Default::default()
        };
        let mut scene = self.black();
        for view in 0..scene.views.len() {
            let camera = scene.views[view].camera;
            let picture = render(&surface, &camera, &truth, view as u32, &settings, &AtomicBool::new(false));
            assert_eq!(picture.non_finite_pixels, 0, "the photo itself");
            scene.set_photo(view, picture.radiance).unwrap();
        }
        scene
    }

    /// The scene with black photos.
    pub fn black(&self) -> Scene {
        let views = self.cameras.iter().enumerate().map(|(index, &camera)| View {
            name: format!("view{index}"),
            camera,
            photo: Photo::Linear32(Image::filled(camera.width, camera.height, Vec3::ZERO)),
            states: Image::filled(camera.width, camera.height, PixelState::Surface),
            held_out: false,
            exposure_prior_stops: None,
        });
        Scene {
            name: "trial".into(),
            folder: None,
            mesh: self.mesh.clone(),
            views: views.collect(),
            world_from_source: Default::default(),
            background: self.background,
            truth: None,
            findings: Vec::new(),
        }
    }

    /// Fits the rendered photos to the end and checks what no fit may break.
    pub fn fitted(&self, settings: FitSettings) -> Fitter {
        fit(self.photographed(), self.surface(), settings).unwrap()
    }
}

/// Settings of a fit of twelve steps: four stages, maps of 8 and 16 texels, every pixel in every step.
pub fn quick() -> FitSettings {
    FitSettings {
        method: Method::Adam,
        map_size: 16,
        environment_height: 4,
        steps_diffuse: 6,
        steps_all: 6,
        views_per_step: 3,
        pixels_per_step: 0,
        samples: 2,
        bounces: 2,
        levels: 2,
        lobe_ramp: 2,
        held_out_interval: 4,
        ..Default::default()
    }
}

/// Fits a scene to the end; after each step everything must be finite and in its range.
pub fn fit(scene: Scene, surface: Arc<Surface>, settings: FitSettings) -> Result<Fitter> {
    let mut fitter = Fitter::new(Arc::new(scene), surface, settings, None)?;
    run(&mut fitter)?;
    Ok(fitter)
}

/// Runs a fit to its end, with the checks of [`fit`].
pub fn run(fitter: &mut Fitter) -> Result<()> {
    let stop = AtomicBool::new(false);
    assert_sound(fitter.state());
    while let StepOutcome::Stepped(_) = fitter.step(&stop)? {
        assert_sound(fitter.state());
    }
    assert_eq!(fitter.state().step, fitter.steps_total());
    Ok(())
}

/// Asserts that every number of a state is finite and in its range.
pub fn assert_sound(state: &FitState) {
    let step = state.step;
    for (index, texel) in state.texels.iter().enumerate() {
        let colours = [texel.diffuse, texel.specular].concat();
        assert!(colours.iter().all(|value| (0.0..=1.0).contains(value)), "step {step}, texel {index}: {texel:?}");
        assert!((-6.0..=0.0).contains(&texel.log_width), "step {step}, texel {index}: {texel:?}");
    }
    for (index, light) in state.light.iter().enumerate() {
        assert!(light.iter().all(|value| value.is_finite() && *value >= 0.0), "step {step}, light {index}: {light:?}");
    }
    for moments in [&state.moments, &state.light_moments, &state.gain_moments] {
        let mut numbers = moments.first.iter().chain(&moments.second).flatten().chain(&moments.updates);
        assert!(numbers.all(|value| value.is_finite()), "step {step}: a moment is not finite");
    }
    assert!(state.log_gains.iter().all(|gain| gain.is_finite()), "step {step}: {:?}", state.log_gains);
    for row in &state.losses {
        let finite = row.loss.is_finite() && row.image_loss.is_finite() && row.consistency.is_finite();
        assert!(finite && row.held_out_rmse.is_none_or(f64::is_finite), "step {step}: {row:?}");
    }
}

/// Loss from the pictures over the first and over the last `count` steps of the history.
pub fn first_and_last_loss(fitter: &Fitter, count: usize) -> (f64, f64) {
    let losses: Vec<f64> = fitter.state().losses.iter().map(|row| row.image_loss).collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    (mean(&losses[..count]), mean(&losses[losses.len() - count..]))
}

/// The state without what depends on the clock.
pub fn without_seconds(state: &FitState) -> FitState {
    let mut state = state.clone();
    state.seconds = 0.0;
    for row in &mut state.losses {
        row.seconds = 0.0;
    }
    state
}

/// Mean of a number over all texels.
pub fn mean_of(state: &FitState, number: usize) -> f32 {
    state.texels.iter().map(|texel| texel.to_array()[number]).sum::<f32>() / state.texels.len() as f32
}

/// Mean over all texels and channels of the light, not weighed by solid angle.
pub fn mean_light(state: &FitState) -> f32 {
    state.light.iter().flatten().sum::<f32>() / (3 * state.light.len()) as f32
}

/// Asserts that a fit explains its photos better at the end than at the start, or as well as can be, and that every
/// number was finite.
pub fn assert_learned(fitter: &Fitter) {
    let (first, last) = first_and_last_loss(fitter, 3);
    // Below the second number photos are explained to a few percent, and the loss of two samples a pixel is noise.
    assert!(last < 0.9 * first || last.abs() < 2e-3, "the loss went from {first} to {last}");
    assert!(fitter.state().non_finite.is_empty(), "{:?}", fitter.state().non_finite);
}

/// A scene with so many views around it, the last held out, and its surface.
pub fn last_held_out(views: usize) -> (Arc<Scene>, Arc<Surface>) {
    let trial = Trial { cameras: around(views, 35.0), ..Default::default() };
    let mut scene = trial.photographed();
    scene.views[views - 1].held_out = true;
    (Arc::new(scene), trial.surface())
}

/// Starts a job that goes on with a fit.
pub fn job(fitter: Fitter, folder: &Path, options: JobOptions) -> JobHandle {
    let prepared = Prepared {
        scene: Arc::clone(fitter.scene()),
        surface: Arc::clone(fitter.surface()),
        quality: None,
        findings: Vec::new(),
        timings: Vec::new(),
    };
    let settings = RunSettings { fit: fitter.settings().clone(), ..Default::default() };
    start_with(prepared, fitter, settings, RunFolder::create(folder).unwrap(), options).unwrap()
}
