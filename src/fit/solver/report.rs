//! What a step of the solver did, for the curve and for whoever watches.

use super::choice::Choices;
use super::estimate::Estimate;
use super::lobe_tails::LobeTails;
use super::objective::Objective;
use super::pixel_terms::PixelTerms;
use super::round::{BlockWork, Round};
use super::scene::SolverScene;
use crate::material::Material;
use crate::render::cached::{CachedTransport, LightPlanes, PointLight};
use crate::scene::Scene;

/// Figures of one step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Median over blocks of the root mean square residual, in radiance.
    pub residual: f64,
    /// Mean squared error over the observations that were looked at and channels; robust weights left out.
    pub squared_error: f64,
    /// Blocks that took part.
    pub blocks: usize,
    /// Unknowns of the light.
    pub light_unknowns: usize,
    /// Root mean squared error of views, by index in the scene.
    pub view_errors: Vec<(usize, f32)>,
    /// The objective before and after each step of the descent, by what was learned then; only where there was one.
    pub descent: Vec<[Objective; 2]>,
    /// What judging views say of the model's freedoms; only where maps were made and that was asked for.
    pub choices: Option<Choices>,
    /// What pixels say of tails of lobes; only where maps were made and enough views see lobes.
    pub tails: Option<LobeTails>,
}

/// Squared errors, view by view.
#[derive(Clone, Debug)]
pub struct ErrorSums {
    /// Sum and count, in the order of the solver's views.
    sums: Vec<(f64, f64)>,
}

impl ErrorSums {
    /// Nothing yet, of so many views.
    pub fn new(views: usize) -> Self {
        ErrorSums { sums: vec![(0.0, 0.0); views] }
    }

    /// Adds a pixel: its squared error, mean over channels.
    #[inline]
    pub fn add(&mut self, view: usize, squared: f64) {
        self.sums[view].0 += squared;
        self.sums[view].1 += 1.0;
    }

    /// Adds the unclipped pixels of a block, with its model.
    pub fn add_block(&mut self, round: &Round, work: &BlockWork) {
        for (term, &used) in work.terms.iter().zip(&work.used) {
            let observation = &round.observations.list[used as usize];
            if !observation.clipped {
                self.add(observation.view as usize, squared_error(&round.model(work, term), term));
            }
        }
    }

    /// Adds the sums of other pixels.
    pub fn merge(&mut self, other: &ErrorSums) {
        for (own, other) in self.sums.iter_mut().zip(&other.sums) {
            own.0 += other.0;
            own.1 += other.1;
        }
    }

    /// Mean over all pixels.
    pub fn mean(&self) -> f64 {
        let (sum, count) = self.sums.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        sum / f64::max(count, 1.0)
    }

    /// Root mean squared error of each view that was looked at, under its index in the scene.
    pub fn of_views(&self, views: &[usize]) -> Vec<(usize, f32)> {
        let seen = views.iter().zip(&self.sums).filter(|(_, (_, count))| *count > 0.0);
        seen.map(|(&view, (sum, count))| (view, (sum / count).sqrt() as f32)).collect()
    }
}

/// Squared error of a pixel, mean over channels.
#[inline]
pub fn squared_error(model: &[f32; 3], term: &PixelTerms) -> f64 {
    (0..3).map(|c| f64::from(term.radiance[c] - model[c]).powi(2)).sum::<f64>() / 3.0
}

impl SolverScene {
    /// The light at the points of the grid, among surface of these texels.
    pub fn point_light(&self, texels: &[Material<f32>], planes: &LightPlanes) -> PointLight {
        let reflectance = self.transport.reflectance_of_points(texels, self.settings.map_size);
        self.transport.point_light(planes, &reflectance)
    }

    /// Root mean squared error of the cache's pictures over the unclipped surface pixels of the held-out views, and of
    /// each of them. `None` without such views. The curve's figure; what is published is drawn by the path tracer.
    pub fn held_out_rmse(&self, scene: &Scene, estimate: &Estimate) -> (Option<f64>, Vec<(usize, f32)>) {
        if self.held_out.is_empty() {
            return (None, Vec::new());
        }
        let planes = self.transport.basis.planes(&estimate.light);
        let at = self.point_light(&estimate.texels, &planes);
        let mut sums = ErrorSums::new(self.held_out.len());
        for (index, (target, footprints)) in self.held_out.iter().enumerate() {
            let picture = self.transport.picture(footprints, &estimate.texels, &planes, &at);
            for (pixel, model) in picture.iter().enumerate() {
                let (photo, state) = target.at(scene, pixel);
                if state.is_surface() && !state.is_clipped() && footprints.escaped[pixel] == 0.0 {
                    let term = PixelTerms { radiance: photo.to_array(), ..PixelTerms::default() };
                    sums.add(index, squared_error(model, &term));
                }
            }
        }
        let views: Vec<usize> = self.held_out.iter().map(|(target, _)| target.view).collect();
        let of_views = sums.of_views(&views);
        ((!of_views.is_empty()).then(|| sums.mean().sqrt()), of_views)
    }

    /// What all blocks of a step share.
    pub(super) fn round<'a>(
        &'a self,
        estimate: &'a Estimate,
        planes: &'a LightPlanes,
        at_points: &'a PointLight,
    ) -> Round<'a> {
        Round {
            transport: &self.transport,
            footprints: &self.footprints,
            observations: &self.observations,
            log_gains: &estimate.log_gains,
            light: planes,
            at_points,
        }
    }

    /// The mean over a footprint of what the points of the grid hold, for an observation by its index.
    #[inline]
    pub(super) fn interpolate(&self, values: &[[f32; 3]], observation: usize) -> [f32; 3] {
        let observation = &self.observations.list[observation];
        let view = &self.footprints[observation.view as usize];
        CachedTransport::interpolate(values, view, &view.points[observation.point as usize])
    }
}
