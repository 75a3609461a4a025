//! The whole way in one call: for tests, measurements, and whoever needs neither checkpoint nor job.

use super::estimate::Estimate;
use super::report::StepReport;
use super::scene::SolverScene;
use super::settings::SolverSettings;
use super::way::Watch;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::targets::targets;
use crate::image::Image;
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::render::Surface;
use crate::scene::Scene;
use glam::Vec3;
use std::sync::atomic::AtomicBool;

/// A step of the solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolverStep {
    /// A round on the light, counted from 0 over wide and narrow hats.
    Light(usize),
    /// All maps, under the light with its holes filled.
    Maps,
    /// All texels at once, from whole pixels.
    Refine,
}

impl SolverScene {
    /// Does a step. `None` when `stop` was raised: nothing was changed then.
    pub fn step(&self, step: SolverStep, estimate: &mut Estimate, stop: &AtomicBool) -> Option<StepReport> {
        self.step_watched(step, estimate, stop, &mut |_| {})
    }

    /// The same; `watch` hears of texels and light within a step that takes long.
    pub(crate) fn step_watched<'a>(
        &self,
        step: SolverStep,
        estimate: &mut Estimate,
        stop: &AtomicBool,
        watch: &'a mut Watch<'a>,
    ) -> Option<StepReport> {
        match step {
            SolverStep::Light(number) => self.light_round(estimate, number, stop),
            SolverStep::Refine => self.refine(estimate, stop, watch),
            SolverStep::Maps => {
                let mut next = estimate.clone();
                self.fill_holes(&mut next.light);
                let report = self.make_maps(&mut next, stop, watch)?;
                *estimate = next;
                Some(report)
            }
        }
    }

    /// The constant light under which the mean of the photos is explained by the reflectance that is held.
    pub fn constant_light(&self) -> Environment {
        let (width, height) = self.settings.light_size;
        let white: f64 = self.gauge.0.iter().map(|&value| f64::from(value)).sum();
        let radiance = self.gauge.1.map(|mean| (mean / white.max(1e-9)) as f32);
        Environment { radiance: Image::from_pixels(width, height, vec![Vec3::from_array(radiance); width * height]) }
    }
}

/// A fit by the solver.
pub struct Solver {
    /// What never changes.
    pub scene: SolverScene,
    /// What does.
    pub estimate: Estimate,
}

impl Solver {
    /// Makes a scene ready, with all its views that are not held out; starts from a light, or a constant one.
    ///
    /// # Errors
    /// As of [`SolverScene::build`].
    pub fn new(
        scene: &Scene,
        surface: &Surface,
        settings: SolverSettings,
        light: Option<&Environment>,
    ) -> Result<Self> {
        let views: Vec<usize> = (0..scene.views.len()).filter(|&view| !scene.views[view].held_out).collect();
        let judging: Vec<usize> = (0..scene.views.len()).filter(|&view| scene.views[view].held_out).collect();
        let judging = if settings.check_choices { targets(scene, &judging, 0) } else { Vec::new() };
        let made = SolverScene::build(
            scene,
            surface,
            (targets(scene, &views, 0), &judging),
            settings,
            None,
            &AtomicBool::new(false),
            &mut |_| {},
        )?;
        let Some(scene) = made else { return Err(Error::new(ErrorKind::Stopped, "stopped")) };
        let (width, height) = settings.light_size;
        let light = light.map_or_else(|| scene.constant_light(), |light| light.resampled(width, height));
        let mut estimate = Estimate::start(settings.map_size, &light, views.len());
        if scene.settings.exposure {
            estimate.log_gains.clone_from(&scene.foretold_gains);
        }
        Ok(Solver { scene, estimate })
    }

    /// All steps in their order.
    pub fn steps(&self) -> Vec<SolverStep> {
        let rounds = self.scene.settings.coarse_rounds + self.scene.settings.fine_rounds;
        (0..rounds).map(SolverStep::Light).chain([SolverStep::Maps, SolverStep::Refine]).collect()
    }

    /// Does all steps; `tell` hears of each. Stops early when `stop` is raised, with what there is.
    pub fn run(&mut self, stop: &AtomicBool, tell: &mut dyn FnMut(SolverStep, &StepReport, &Estimate)) {
        for step in self.steps() {
            match self.scene.step(step, &mut self.estimate, stop) {
                Some(report) => tell(step, &report, &self.estimate),
                None => return,
            }
        }
    }

    /// The maps.
    pub fn maps(&self) -> MaterialMaps {
        self.estimate.maps(self.scene.settings.map_size)
    }

    /// The light.
    pub fn environment(&self) -> Environment {
        self.estimate.environment(self.scene.settings.light_size)
    }
}
