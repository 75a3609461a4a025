//! The views of an audit, their paths, and the loss over them.

use super::AuditSettings;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::loss::ViewLoss;
use crate::fit::targets::Target;
use crate::light::EnvironmentSampler;
use crate::material::texels::PyramidWeights;
use crate::math::real::Real;
use crate::math::{evenly_spread, parallel};
use crate::render::accumulate::{PassKey, PixelLoss, accumulate, sum_pixel, trace_pixel};
use crate::render::first_hits::{CameraRays, PixelFilter};
use crate::render::{ParameterGradient, Parameters, PathArena, PathSettings, PathTracer, Surface};
use crate::scene::{Background, Mesh, Scene};
use std::sync::atomic::AtomicBool;

/// Angle a bounced ray stands for, in radians: as in a fit.
const BOUNCE_CONE_RADIANS: f32 = 0.1;

/// What an audit works on: a few views, the parameters, and the proposal, which stays as it is.
pub struct Bench<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// The parameters around which differences are taken.
    pub parameters: &'a Parameters<f32>,
    /// Weights of the mip chain.
    pub weights: &'a PyramidWeights,
    settings: &'a AuditSettings,
    sampler: EnvironmentSampler,
    /// The audited views twice: with the background as evidence, and with a black one, where pixels that are part
    /// surface and part background count too.
    scenes: [Scene; 2],
    views: Vec<BenchView>,
}

struct BenchView {
    scene: usize,
    target: Target,
    pixels: Vec<u32>,
}

/// The paths of a pixel that is evidence.
pub struct PixelRecord {
    /// Index of the view within the audit.
    pub view: usize,
    /// Index of the pixel, row-major.
    pub pixel: usize,
    /// Its paths.
    pub arena: PathArena,
    /// Share of its camera rays that met nothing, in [0, 1].
    pub escaped: f32,
}

impl<'a> Bench<'a> {
    /// Chooses views and pixels. Views alternate between the scene's background and a black one.
    ///
    /// # Errors
    /// `InvalidScene` when the scene has no view for a fit.
    pub fn new(
        scene: &Scene,
        surface: &'a Surface,
        parameters: &'a Parameters<f32>,
        weights: &'a PyramidWeights,
        settings: &'a AuditSettings,
    ) -> Result<Self> {
        let training: Vec<usize> = (0..scene.views.len()).filter(|&view| !scene.views[view].held_out).collect();
        if training.is_empty() {
            return Err(Error::new(ErrorKind::InvalidScene, "there is no view to audit")
                .remedy("hold out fewer views: --hold-out-every 0 keeps them all"));
        }
        let chosen = evenly_spread(&training, settings.views.max(1));
        let with_background = |background| Scene {
            name: scene.name.clone(),
            folder: None,
            mesh: Mesh::default(),
            views: chosen.iter().map(|&view| scene.views[view].clone()).collect(),
            world_from_source: scene.world_from_source,
            background,
            truth: None,
            findings: Vec::new(),
        };
        let scenes = [with_background(scene.background), with_background(Background::Black)];
        let views = (0..chosen.len())
            .map(|view| {
                let target = Target::new(&scenes[0], view, 0);
                // An odd stride does not keep to the same columns of every row.
                let stride = target.pixel_count().div_ceil(settings.pixels_per_view.max(1)) | 1;
                let stride = if target.pixel_count() <= settings.pixels_per_view { 1 } else { stride };
                let pixels = (0..target.pixel_count() as u32).step_by(stride).collect();
                BenchView { scene: view % 2, target, pixels }
            })
            .collect();
        let sampler = EnvironmentSampler::new(&parameters.environment());
        Ok(Bench { surface, parameters, weights, settings, sampler, scenes, views })
    }

    /// Number of views.
    pub fn view_count(&self) -> usize {
        self.views.len()
    }

    /// The mean squared error of a view, divided by the number of views.
    pub fn loss(&self, view: usize) -> ViewLoss<'_> {
        let BenchView { scene, target, pixels } = &self.views[view];
        let weight = 1.0 / (3.0 * pixels.len() as f32 * self.views.len() as f32);
        ViewLoss::new(&self.scenes[*scene], target, weight, 1.0, true)
    }

    /// The losses of all views.
    pub fn losses(&self) -> Vec<ViewLoss<'_>> {
        (0..self.views.len()).map(|view| self.loss(view)).collect()
    }

    fn tracer(&self, view: usize) -> PathTracer<'_> {
        let BenchView { scene, target, .. } = &self.views[view];
        PathTracer {
            surface: self.surface,
            proposal: &self.parameters.texels,
            light: &self.sampler,
            environment_size: self.parameters.environment_size,
            settings: PathSettings {
                max_bounces: self.settings.bounces,
                lobe_strength: self.settings.lobe_strength,
                background_visible: self.scenes[*scene].background == Background::Environment,
                two_sided: false,
                camera_cone_radians: target.camera.pixel_angle_radians() / (self.settings.samples as f32).sqrt(),
                bounce_cone_radians: BOUNCE_CONE_RADIANS,
            },
        }
    }

    fn rays(&self, view: usize) -> CameraRays<'_> {
        CameraRays::fresh(self.surface, &self.views[view].target.camera, PixelFilter::Box, self.settings.samples)
    }

    fn key(&self, view: usize) -> PassKey {
        PassKey::halves(self.settings.seed, 0, view as u32)
    }

    /// Traces and keeps the paths of all pixels that are evidence.
    pub fn records(&self, parameters: &Parameters<f64>) -> Vec<PixelRecord> {
        (0..self.views.len())
            .flat_map(|view| {
                let (tracer, rays, loss, key) = (self.tracer(view), self.rays(view), self.loss(view), self.key(view));
                let trace = |&pixel: &u32| {
                    let pixel = pixel as usize;
                    let mut arena = PathArena::default();
                    trace_pixel(&tracer, &rays, pixel, key, &mut arena);
                    let estimate = sum_pixel(parameters, &arena, self.settings.lobe_strength);
                    loss.at(pixel, &estimate)?;
                    Some(PixelRecord { view, pixel, arena, escaped: estimate.escaped })
                };
                parallel::map_items(&self.views[view].pixels, trace).into_iter().flatten()
            })
            .collect()
    }

    /// The loss of a kept pixel under other parameters.
    pub fn pixel_loss(&self, losses: &[ViewLoss<'_>], record: &PixelRecord, parameters: &Parameters<f64>) -> f64 {
        let estimate = sum_pixel(parameters, &record.arena, self.settings.lobe_strength);
        losses[record.view].at(record.pixel, &estimate).map_or(0.0, |derivative| derivative.loss)
    }

    /// Parameters that are moved for the gradient of the disagreement.
    pub fn consistency_parameters(&self) -> usize {
        self.settings.consistency_parameters
    }

    /// Strength of the specular lobe.
    pub fn lobe_strength(&self) -> f32 {
        self.settings.lobe_strength
    }

    /// The gradient of a view's loss by reverse mode, as a fit computes it, added to a gradient on all levels.
    pub fn reverse<R: Real>(
        &self,
        view: usize,
        parameters: &Parameters<R>,
        gradient: &mut ParameterGradient<R>,
        stop: &AtomicBool,
    ) {
        let (tracer, rays, loss) = (self.tracer(view), self.rays(view), self.loss(view));
        accumulate(&tracer, &rays, &self.views[view].pixels, self.key(view), parameters, &loss, gradient, stop);
    }

    /// A gradient of zeros on all levels.
    pub fn zeros<R: Real>(&self) -> ParameterGradient<R> {
        ParameterGradient::zeros(self.weights, self.parameters.light.len())
    }
}
