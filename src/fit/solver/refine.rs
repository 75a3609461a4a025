//! The last step of the solver, and the bake without a light: the [descent](super::descent) from whole pixels.
//!
//! With a light and without one the same objective is made less from the same pixels with the same texels. So what the light
//! bought can be read from the two.

use super::descent::Descended;
use super::estimate::{Estimate, START_TEXEL, TexelVariance};
use super::photo_gains::log_gains;
use super::report::StepReport;
use super::scene::SolverScene;
use super::sight::Lit;
use super::way::Watch;
use crate::material::Material;
use crate::math::statistics::median;
use std::sync::atomic::AtomicBool;

/// Standard deviations of a lobe that was taken over from its neighbourhood: of F0, and of the logarithm of the width.
const LOBE_TAKEN_OVER: [f32; 2] = [0.1, 0.5];
/// Largest standard deviation of a reflectance in [0, 1] of which nothing is known.
const MOST_DEVIATION: f32 = 0.3;

impl SolverScene {
    /// The bake: one colour a texel, no light. `None` when `stop` was raised.
    pub fn bake(&self, stop: &AtomicBool) -> Option<Descended> {
        let grey = Material { diffuse: [self.observations.mean; 3], ..START_TEXEL };
        let start = vec![grey; self.settings.map_size * self.settings.map_size];
        self.descend(&Estimate::default(), start, Lit::No, stop)
    }

    /// Goes down the objective over all texels, under the light that was found; `watch` hears of the way. `None` when
    /// `stop` was raised: nothing was changed then.
    pub fn refine<'a>(
        &self,
        estimate: &mut Estimate,
        stop: &AtomicBool,
        watch: &'a mut Watch<'a>,
    ) -> Option<StepReport> {
        let found = self.descend_watched(estimate, estimate.texels.clone(), Lit::Yes, stop, Some(watch))?;
        if let Some(scale) = found.scale {
            estimate.scale_variances(&scale, &found.scaled_specular);
            estimate.light.clone_from(&found.light);
            if !found.light_shares.is_empty() {
                estimate.light_known.shares.clone_from(&found.light_shares);
            }
        }
        if self.settings.exposure {
            estimate.log_gains = log_gains(&found.learned.gains);
        }
        for (known, precision) in estimate.variances.iter_mut().zip(&found.precision) {
            if precision[0] <= 0.0 {
                // What no pixel shows takes over what its neighbours have.
                *known = TexelVariance::default();
                continue;
            }
            let of_pixels = [0, 1, 2].map(|c| 1.0 / (self.settings.independence as f32 * precision[c]).max(1e-12));
            if known.is_solved() {
                // What errs in common over many pixels, as coarser maps knew it, is not made less by more of them.
                known.variance.diffuse.iter_mut().zip(of_pixels).for_each(|(own, more)| *own += more);
            } else {
                let [specular, log_width] = LOBE_TAKEN_OVER.map(|deviation| deviation * deviation);
                let diffuse = of_pixels.map(|variance| variance.min(MOST_DEVIATION * MOST_DEVIATION));
                let variance = Material { diffuse, specular: [specular; 3], log_width };
                *known = TexelVariance { variance, lobe_cluster_size: 1.0 };
            }
        }
        estimate.texels.clone_from(&found.texels);
        self.fill_from_neighbours(estimate);
        let view_errors = found.errors.of_views(&self.views);
        let mut errors: Vec<f32> = view_errors.iter().map(|(_, rmse)| *rmse).collect();
        Some(StepReport {
            residual: median(&mut errors),
            squared_error: found.errors.mean(),
            blocks: self.observations.list.len(),
            view_errors,
            descent: found.steps,
            ..StepReport::default()
        })
    }
}

#[cfg(all(test, feature = "cli"))]
#[allow(clippy::unwrap_used)]
pub(super) mod tests {
    use super::super::SolverSettings;
    use super::super::pixel_system::PixelSystem;
    use super::super::pixels::Pixels;
    use super::super::sight::Slopes;
    use super::super::solver::Solver;
    use super::*;
    use crate::core_tests::hard_scenes::bowl_of_plaster;
    use crate::light::Environment;
    use crate::math::random::SequentialRandom;
    use crate::render::Surface;
    use glam::Vec3;

    /// Texels along the side of the maps.
    pub const SIZE: usize = 64;

    /// A bowl whose photos are what the cache makes of a surface of patches under gains, and one pixel in fifty is wrong.
    pub fn photographed(gains: impl Fn(usize) -> [f32; 3]) -> (Solver, Vec<Material<f32>>) {
        photographed_under(&Environment::constant(32, 16, Vec3::new(0.8, 1.0, 1.2)), -0.5, gains)
    }

    /// The same with lobes of this width under this light.
    pub fn photographed_under(
        light: &Environment,
        log_width: f32,
        gains: impl Fn(usize) -> [f32; 3],
    ) -> (Solver, Vec<Material<f32>>) {
        let scene = bowl_of_plaster(SIZE);
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let settings = SolverSettings { map_size: SIZE, grid: SIZE, light_size: (32, 16), ..SolverSettings::default() };
        let mut solver = Solver::new(&scene, &surface, settings, Some(light)).unwrap();
        let truth: Vec<Material<f32>> = (0..SIZE * SIZE)
            .map(|texel| {
                let patch = (texel / SIZE / 8 + texel % SIZE / 8) % 2;
                let diffuse = [[0.2, 0.3, 0.1], [0.5, 0.4, 0.6]][patch];
                Material { diffuse, specular: [0.04; 3], log_width }
            })
            .collect();
        solver.estimate.texels.clone_from(&truth);
        let (radiance, whole) = {
            let pixels = Pixels::of(&solver.scene);
            let mut system = PixelSystem::new(&pixels, SIZE);
            let never = AtomicBool::new(false);
            let sight = solver.scene.sight(
                (&pixels, &mut system),
                &solver.estimate.light,
                &truth,
                (Lit::Yes, Slopes::OfReflectances),
                &never,
            );
            (sight.unwrap().radiance, pixels.whole())
        };
        let mut random = SequentialRandom::new(7);
        let mut photo = |index: usize, view: u32| {
            let (gain, noise) = (gains(view as usize), 1.0 + 0.002 * random.next_normal());
            let wrong = if index.is_multiple_of(50) { 2.0 } else { 1.0 };
            [0, 1, 2].map(|c| wrong * noise * gain[c] * radiance[index][c])
        };
        for (index, own) in solver.scene.observations.list.iter_mut().enumerate() {
            own.radiance = photo(index, own.view);
        }
        let mut edges: Vec<_> = solver.scene.edges.iter_mut().flat_map(|view| &mut view.pixels).collect();
        edges.sort_by_key(|own| (own.texel, own.view, own.first));
        assert!(edges.len() > 20, "{}", edges.len());
        for (index, own) in edges.into_iter().enumerate() {
            own.radiance = photo(whole + index, own.view);
        }
        (solver, truth)
    }

    /// Root mean square of the difference of diffuse reflectance, relative to the truth, over texels that pixels show.
    fn error(solver: &Solver, found: &Descended, factor: [f32; 3], truth: &[Material<f32>]) -> f64 {
        let well =
            |texel: &usize| found.precision[*texel][0] > 0.0 && solver.scene.observations.range(*texel).len() > 3;
        let (mut sum, mut count) = (0.0, 0.0);
        for texel in (0..truth.len()).filter(well) {
            for c in 0..3 {
                let own = found.texels[texel].diffuse[c] / factor[c];
                sum += f64::from(own / truth[texel].diffuse[c] - 1.0).powi(2);
                count += 1.0;
            }
        }
        assert!(count > 500.0, "{count}");
        f64::sqrt(sum / count)
    }

    fn grey(solver: &mut Solver) {
        solver.estimate.texels.iter_mut().for_each(|texel| texel.diffuse = [0.4; 3]);
    }

    #[test]
    fn reflectance_and_gains_are_found_beside_pixels_that_are_wrong() {
        // What differs is large beside what the model's errors have in common, so that little of it is shrunk.
        let gains = |view: usize| [1.3f32, 0.8, 1.0].map(|gain| if view < 3 { gain } else { 1.0 });
        let (mut solver, truth) = photographed(gains);
        grey(&mut solver);
        let never = AtomicBool::new(false);
        let Solver { scene, estimate } = &solver;
        let found = scene.descend(estimate, estimate.texels.clone(), Lit::Yes, &never).unwrap();
        // Each step makes the objective less, the first ones by much.
        for [before, after] in &found.steps {
            assert!(after.total() < before.total(), "{before:?} {after:?}");
        }
        let [before, after] = found.steps[0];
        assert!(after.pixels < before.pixels - 100.0, "{before:?} {after:?}");
        // Gains have mean one over the views, and what that leaves is a factor of all reflectances.
        let found_gains = &found.learned.gains;
        for c in 0..2 {
            let share = (found_gains[0][c] / found_gains[7][c]).ln() / gains(0)[c].ln();
            assert!((0.85..1.02).contains(&share), "{share}: {found_gains:?}");
        }
        assert!((found_gains[0][2] / found_gains[7][2] - 1.0).abs() < 0.01, "{found_gains:?}");
        let factor = [0, 1, 2].map(|c| gains(7)[c] / found_gains[7][c]);
        let off = error(&solver, &found, factor, &truth);
        assert!(off < 0.03, "{off}");
        // The same by the step, which begins at what it knows.
        let before = solver.estimate.texels.clone();
        let Solver { scene, estimate } = &mut solver;
        let report = {
            let (mut seen, mut shares) = (Vec::new(), Vec::new());
            let report = scene.refine(estimate, &never, &mut |way| {
                shares.push(way.share);
                if way.is_reached {
                    let look = (way.look)();
                    seen.push((look.texels.to_vec(), look.light.to_vec()));
                }
            });
            assert!(shares.is_sorted() && shares[0] > 0.0 && shares.last() == Some(&1.0), "{shares:?}");
            // Each step was told of, and the last with what stays; texels that no pixel shows are filled after it.
            let (texels, light) = seen.last().unwrap();
            assert_eq!((seen.len(), light), (found.steps.len(), &estimate.light));
            let is_shown = |texel: &usize| estimate.variances[*texel].is_solved();
            assert!((0..texels.len()).filter(is_shown).all(|texel| texels[texel] == estimate.texels[texel]));
            report.unwrap()
        };
        assert!(report.squared_error > 0.0 && estimate.texels != before && report.descent.len() == found.steps.len());
        assert!(scene.refine(&mut estimate.clone(), &AtomicBool::new(true), &mut |_| {}).is_none());
    }

    #[test]
    fn a_light_that_is_too_dark_and_red_becomes_what_gloss_says() {
        let mut light = Environment::constant(32, 16, Vec3::splat(0.3));
        for (texel, radiance) in light.radiance.pixels_mut().iter_mut().enumerate() {
            if texel / 32 < 8 && texel % 7 == 3 {
                *radiance = Vec3::splat(4.0);
            }
        }
        let (mut solver, truth) = photographed_under(&light, -1.5, |_| [1.0; 3]);
        let wrong = [0.8f32, 0.7, 0.6];
        for radiance in &mut solver.estimate.light {
            (0..3).for_each(|c| radiance[c] *= wrong[c]);
        }
        for texel in &mut solver.estimate.texels {
            for c in 0..3 {
                texel.diffuse[c] /= wrong[c];
                texel.specular[c] /= wrong[c];
            }
        }
        let Solver { scene, estimate } = &mut solver;
        scene.refine(estimate, &AtomicBool::new(false), &mut |_| {}).unwrap();
        let stated = estimate.light_known.scale_deviation;
        assert!((0.1..0.3).contains(&stated), "{stated}");
        let (truth_sum, sum) = (light.radiance.pixels().iter().sum::<Vec3>(), |c: usize| -> f32 {
            estimate.light.iter().map(|radiance| radiance[c]).sum()
        });
        for c in 0..3 {
            // Nearer by half at least, and within what is stated.
            let off = (sum(c) / truth_sum[c]).ln().abs();
            assert!(off < 0.5 * wrong[c].ln().abs() && f64::from(off) < stated, "channel {c}: {off}, {}", wrong[c]);
        }
        let seen: Vec<usize> = (0..SIZE * SIZE).filter(|&texel| scene.observations.range(texel).len() > 3).collect();
        let mean = |of: &[Material<f32>]| seen.iter().map(|&texel| of[texel].diffuse[2]).sum::<f32>();
        let off = (mean(&estimate.texels) / mean(&truth)).ln().abs();
        assert!(off < 0.5 * wrong[2].ln().abs() && f64::from(off) < stated, "blue reflectance {off}");
    }

    #[test]
    fn a_light_that_is_held_too_dim_is_raised_until_bright_surface_is_explained() {
        let (mut solver, truth) = photographed(|_| [1.0; 3]);
        solver.scene.background.clear();
        solver.estimate.light.iter_mut().flatten().for_each(|radiance| *radiance *= 0.4);
        let never = AtomicBool::new(false);
        let Solver { scene, estimate } = &solver;
        let found = scene.descend(estimate, estimate.texels.clone(), Lit::Yes, &never).unwrap();
        let factor = found.scale.unwrap().factor;
        // The brightest surface has 0.6, which is 1.5 under this light, and more where a pixel is wrong.
        assert!((1.4..2.0).contains(&factor[0]) && factor == [factor[0]; 3], "{factor:?}");
        assert!(found.texels.iter().flat_map(|own| own.diffuse).all(|value| value <= 1.0));
        let off = error(&solver, &found, factor.map(|factor| 1.0 / (0.4 * factor)), &truth);
        assert!(off < 0.05, "{off}");
    }

    #[test]
    fn with_light_pixels_are_explained_no_worse_than_by_a_texture_alone() {
        let (mut solver, _) = photographed(|_| [1.0; 3]);
        grey(&mut solver);
        let never = AtomicBool::new(false);
        let Solver { scene, estimate } = &solver;
        let texture = scene.bake(&never).unwrap();
        let lit = scene.descend(estimate, estimate.texels.clone(), Lit::Yes, &never).unwrap();
        let of = |found: &Descended| found.errors.mean();
        assert!(of(&lit) < of(&texture), "{} {}", of(&lit), of(&texture));
        let (lit, texture) = (lit.learned.noise.deviation(0.3), texture.learned.noise.deviation(0.3));
        assert!(lit < texture, "{lit} {texture}");
    }
}
