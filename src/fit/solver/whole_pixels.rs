//! Diffuse reflectance of all texels from whole pixels: the last step of the solver, and the bake without a light.
//!
//! A photo's pixel is `g (E · mean of rho under its footprint + lobe)`, with the light that arrives, `E`, and what lobes send
//! from the cache, and a gain `g` for each photo and channel. With `E = 1` and no lobe that is a texture without a light: one
//! colour a texel, the best that any picture without light can do. Both are solved alike, so the second is contained in the
//! first, and what the light bought can be read from the two.
//!
//! Noise ([`super::pixel_noise`]) and gains ([`super::photo_gains`]) are learned between solutions, by expectation and
//! maximisation: pixels that no texture explains (somebody who walks by, a wrong mask) lose their weight.

use super::diffuse::{self, Leaning, Neighbours};
use super::diffuse_system::{DiffuseRow, DiffuseSystem};
use super::estimate::{Estimate, TexelVariance};
use super::photo_gains::{GainSums, gains};
use super::pixel_noise::{PixelNoise, Residual};
use super::report::{ErrorSums, StepReport};
use super::scene::SolverScene;
use crate::render::cached::{CachedTransport, LightPlanes, PointLight, SeenLight};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// What reflectances lean on: hardly on where they begin, weakly on each other.
const LEANING: Leaning = Leaning { start: 1e-3, neighbours: Neighbours::Relative(NEIGHBOURS_DIFFER) };
/// Standard deviation of the difference between logarithms of neighbouring reflectances: hardly a wish. Where textures are
/// fine they differ by factors, and smaller ones blurred them (.6 cost half a decibel on both photographed captures).
const NEIGHBOURS_DIFFER: f32 = 4.0;
/// Iterations of conjugate gradients in each solution; noise and gains are learned before all but the first.
const ITERATIONS: [usize; 4] = [8, 8, 8, 20];
/// Reflectances follow gains and gains reflectances, so that each pass leaves a share of what is wrong with the gains: the
/// larger, the fewer photos share a texel. Going further by this factor is successive over-relaxation of their logarithms.
const OVER_RELAXATION: f32 = 1.5;
/// Observations whose lobes are integrated together, sorted by the points of the grid that serve them.
const TOGETHER: usize = 4096;

/// What multiplies reflectance in each pixel, and what is there beside it, in units of the light.
pub struct WholePixels {
    /// Arriving light: irradiance over pi.
    pub arriving: Vec<[f32; 3]>,
    /// What lobes send.
    pub lobe: Vec<[f32; 3]>,
    /// What no reflectance is above: 1, and of a texture without a light any colour.
    most: f32,
}

/// A solution.
pub struct WholeSolution {
    /// Diffuse reflectance of all texels; in the bake radiance at a gain of one.
    pub rho: Vec<[f32; 3]>,
    /// Gain of each view and channel.
    pub gains: Vec<[f32; 3]>,
    /// The noise that was learned.
    pub noise: PixelNoise,
    /// Precision of each texel's reflectance by its own pixels; 0 where none shows it.
    pub precision: Vec<[f32; 3]>,
    /// Mean negative logarithm of the density of a pixel, in nats.
    pub nats: f64,
    /// Squared errors in units of the photos.
    pub errors: ErrorSums,
}

impl SolverScene {
    /// Pixels under no light at all.
    fn unlit_pixels(&self) -> WholePixels {
        let count = self.observations.list.len();
        WholePixels { arriving: vec![[1.0; 3]; count], lobe: vec![[0.0; 3]; count], most: f32::MAX }
    }

    /// Pixels under the light and with the lobes of an estimate. `None` when `stop` was raised.
    fn lit_pixels(
        &self,
        estimate: &Estimate,
        planes: &LightPlanes,
        at_points: &PointLight,
        stop: &AtomicBool,
    ) -> Option<WholePixels> {
        let count = self.observations.list.len();
        let arriving = (0..count).into_par_iter().map(|index| self.interpolate(&at_points.arriving, index)).collect();
        let lobe: Vec<Vec<[f32; 3]>> = (0..count.div_ceil(TOGETHER))
            .into_par_iter()
            .map_init(SeenLight::default, |seen, chunk| {
                let first = chunk * TOGETHER;
                let mut sent = vec![[0.0f32; 3]; (first + TOGETHER).min(count) - first];
                if stop.load(Ordering::Relaxed) {
                    return sent;
                }
                let of = |index: usize| {
                    let observation = &self.observations.list[first + index];
                    let view = &self.footprints[observation.view as usize];
                    (view, &view.points[observation.point as usize])
                };
                let mut order: Vec<usize> = (0..sent.len()).collect();
                order.sort_by_key(|&index| of(index).1.lobe_point);
                for index in order {
                    let (view, point) = of(index);
                    let mut material = CachedTransport::material_of(view, point, &estimate.texels);
                    material[..3].fill(0.0);
                    sent[index] = self.transport.shade(planes, at_points, view, point, &material, seen);
                }
                sent
            })
            .collect();
        (!stop.load(Ordering::Relaxed)).then(|| WholePixels { arriving, lobe: lobe.concat(), most: 1.0 })
    }

    /// Solves for all reflectances together, with noise and gains, from `rho`. `None` when `stop` was raised.
    fn solve_whole(&self, pixels: &WholePixels, mut rho: Vec<[f32; 3]>, stop: &AtomicBool) -> Option<WholeSolution> {
        let count = self.observations.list.len();
        let mut view_gains = vec![[1.0f32; 3]; self.views.len()];
        let mut noise = None;
        let mut rows = vec![DiffuseRow::default(); count];
        for (pass, &iterations) in ITERATIONS.iter().enumerate() {
            self.set_rows(pixels, &view_gains, |_| 1.0, &mut rows);
            if pass > 0 {
                let models = self.system(&rows).models(&rho);
                // A clipped pixel is as bright as it says or brighter.
                let residuals = self.residuals(&rows, &models, pixels, &view_gains);
                let learned = PixelNoise::learn(&residuals);
                rows.iter_mut().zip(&residuals).for_each(|(row, own)| row.weight = learned.weight(*own));
                view_gains = self.gains_beside(&rows, &models, pixels, &view_gains);
                let weights: Vec<f32> = rows.iter().map(|row| row.weight).collect();
                self.set_rows(pixels, &view_gains, |index| weights[index], &mut rows);
                noise = Some(learned);
            }
            self.drop_clipped(&mut rows, &rho);
            let solved = diffuse::solve(&mut self.system(&rows), &mut rho, LEANING, pixels.most, iterations, stop);
            if !solved {
                return None;
            }
        }
        let mut system = self.system(&rows);
        let models = system.models(&rho);
        let precision = system.transposed(|row| row.arriving.map(|arriving| row.weight * arriving * arriving));
        drop(system);
        let residuals = self.residuals(&rows, &models, pixels, &view_gains);
        let noise = noise.unwrap_or_else(|| PixelNoise::learn(&residuals));
        let mut errors = ErrorSums::new(self.views.len());
        let mut nats = 0.0;
        for ((observation, row), own) in self.observations.list.iter().zip(&rows).zip(&residuals) {
            if row.weight > 0.0 && !observation.clipped {
                errors.add(observation.view as usize, f64::from(own.square) / 3.0);
                nats += noise.nats(*own);
            }
        }
        Some(WholeSolution { rho, gains: view_gains, noise, precision, nats: nats / count.max(1) as f64, errors })
    }

    fn system<'a>(&self, rows: &'a [DiffuseRow]) -> DiffuseSystem<'a> {
        DiffuseSystem::new(&self.footprints, &self.observations, rows, self.settings.map_size)
    }

    /// Equations in units of the photos, so that all gains have the same noise.
    fn set_rows(
        &self,
        pixels: &WholePixels,
        gains: &[[f32; 3]],
        weight: impl Fn(usize) -> f32 + Sync,
        rows: &mut [DiffuseRow],
    ) {
        rows.par_iter_mut().enumerate().for_each(|(index, row)| {
            let observation = &self.observations.list[index];
            let gain = gains[observation.view as usize];
            let (arriving, lobe) = (&pixels.arriving[index], &pixels.lobe[index]);
            row.arriving = [0, 1, 2].map(|c| gain[c] * arriving[c]);
            row.radiance = [0, 1, 2].map(|c| observation.radiance[c] - gain[c] * lobe[c]);
            row.weight = weight(index);
        });
    }

    /// A clipped pixel counts only where the model is darker than it.
    fn drop_clipped(&self, rows: &mut [DiffuseRow], rho: &[[f32; 3]]) {
        if !self.observations.list.iter().any(|observation| observation.clipped) {
            return;
        }
        let models = self.system(rows).models(rho);
        for ((row, model), observation) in rows.iter_mut().zip(&models).zip(&self.observations.list) {
            if observation.clipped && !(0..3).all(|c| model[c] < row.radiance[c]) {
                row.weight = 0.0;
            }
        }
    }

    fn residuals(
        &self,
        rows: &[DiffuseRow],
        models: &[[f32; 3]],
        pixels: &WholePixels,
        gains: &[[f32; 3]],
    ) -> Vec<Residual> {
        rows.par_iter()
            .enumerate()
            .map(|(index, row)| {
                let (model, gain) = (&models[index], gains[self.observations.list[index].view as usize]);
                let radiance = (0..3).map(|c| model[c] + gain[c] * pixels.lobe[index][c]).sum::<f32>() / 3.0;
                Residual { radiance, square: (0..3).map(|c| (row.radiance[c] - model[c]).powi(2)).sum() }
            })
            .collect()
    }

    /// The gains that bring the model nearest to each photo.
    fn gains_beside(
        &self,
        rows: &[DiffuseRow],
        models: &[[f32; 3]],
        pixels: &WholePixels,
        before: &[[f32; 3]],
    ) -> Vec<[f32; 3]> {
        // A fixed number of parts, added up in order.
        let part = rows.len().div_ceil(64).max(1);
        let parts: Vec<Vec<GainSums>> = rows
            .par_chunks(part)
            .enumerate()
            .map(|(which, rows)| {
                let mut sums = vec![GainSums::default(); self.views.len()];
                for (offset, row) in rows.iter().enumerate() {
                    let index = which * part + offset;
                    let observation = &self.observations.list[index];
                    if row.weight > 0.0 && !observation.clipped {
                        let gain = before[observation.view as usize];
                        let model = [0, 1, 2].map(|c| models[index][c] / gain[c] + pixels.lobe[index][c]);
                        sums[observation.view as usize].add(row.weight, observation.radiance, model);
                    }
                }
                sums
            })
            .collect();
        let mut total = vec![GainSums::default(); self.views.len()];
        for part in &parts {
            total.iter_mut().zip(part).for_each(|(total, part)| total.merge(part));
        }
        let found = gains(&total);
        let further = |before: f32, found: f32| before * (found / before).powf(OVER_RELAXATION);
        before.iter().zip(&found).map(|(before, found)| [0, 1, 2].map(|c| further(before[c], found[c]))).collect()
    }

    /// The bake: one colour a texel, no light. `None` when `stop` was raised.
    pub fn bake(&self, stop: &AtomicBool) -> Option<WholeSolution> {
        let grey = vec![[self.observations.mean; 3]; self.settings.map_size * self.settings.map_size];
        self.solve_whole(&self.unlit_pixels(), grey, stop)
    }

    /// Solves for all diffuse reflectances with whole pixels, under the light and with the lobes that were found. `None`
    /// when `stop` was raised: nothing was changed then.
    pub fn refine(&self, estimate: &mut Estimate, stop: &AtomicBool) -> Option<StepReport> {
        let planes = self.transport.basis.planes(&estimate.light);
        let at_points = self.point_light(estimate, &planes);
        let pixels = self.lit_pixels(estimate, &planes, &at_points, stop)?;
        let solved = self.solve_whole(&pixels, estimate.diffuse(), stop)?;
        if self.settings.exposure {
            for (log_gain, gain) in estimate.log_gains.iter_mut().zip(&solved.gains) {
                *log_gain = gain.iter().map(|gain| gain.ln()).sum::<f32>() / 3.0;
            }
        }
        for (texel, precision) in solved.precision.iter().enumerate() {
            if precision[0] > 0.0 {
                let own = &mut estimate.variances[texel];
                // What errs in common over many pixels, as the coarser maps knew it, is not made less by more of them.
                for (variance, precision) in own.variance.diffuse.iter_mut().zip(precision) {
                    *variance += 1.0 / (self.settings.independence as f32 * precision).max(1e-12);
                }
                own.lobe_cluster_size = own.lobe_cluster_size.max(1.0);
            } else {
                // What no pixel shows takes over what its neighbours have.
                estimate.variances[texel] = TexelVariance::default();
            }
        }
        estimate.set_diffuse(&solved.rho);
        self.fill_from_neighbours(estimate);
        let mut squares: Vec<f32> = solved.errors.of_views(&self.views).iter().map(|(_, rmse)| *rmse).collect();
        Some(StepReport {
            residual: super::report::median(&mut squares),
            squared_error: solved.errors.mean(),
            blocks: self.observations.list.len(),
            view_errors: solved.errors.of_views(&self.views),
            ..StepReport::default()
        })
    }
}

#[cfg(all(test, feature = "cli"))]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::SolverSettings;
    use super::super::solver::Solver;
    use super::*;
    use crate::core_tests::hard_scenes::bowl_of_plaster;
    use crate::light::Environment;
    use crate::material::Material;
    use crate::math::random::SequentialRandom;
    use crate::render::Surface;
    use glam::Vec3;

    const SIZE: usize = 64;

    /// A bowl whose photos are what the cache makes of a surface of patches under gains, and one pixel in fifty is wrong.
    fn photographed(gains: impl Fn(usize) -> [f32; 3]) -> (Solver, Vec<Material<f32>>) {
        let scene = bowl_of_plaster(SIZE);
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let settings = SolverSettings { map_size: SIZE, grid: SIZE, light_size: (32, 16), ..SolverSettings::default() };
        let light = Environment::constant(32, 16, Vec3::new(0.8, 1.0, 1.2));
        let mut solver = Solver::new(&scene, &surface, settings, Some(&light)).unwrap();
        let truth: Vec<Material<f32>> = (0..SIZE * SIZE)
            .map(|texel| {
                let patch = (texel / SIZE / 8 + texel % SIZE / 8) % 2;
                let diffuse = [[0.2, 0.3, 0.1], [0.5, 0.4, 0.6]][patch];
                Material { diffuse, specular: [0.04; 3], log_width: -0.5 }
            })
            .collect();
        solver.estimate.texels.clone_from(&truth);
        let planes = solver.scene.transport.basis.planes(&solver.estimate.light);
        let at_points = solver.scene.point_light(&solver.estimate, &planes);
        let pixels = solver.scene.lit_pixels(&solver.estimate, &planes, &at_points, &AtomicBool::new(false)).unwrap();
        let rho = solver.estimate.diffuse();
        let mut rows = vec![DiffuseRow::default(); pixels.lobe.len()];
        let one = vec![[1.0; 3]; solver.scene.views.len()];
        solver.scene.set_rows(&pixels, &one, |_| 1.0, &mut rows);
        let models = solver.scene.system(&rows).models(&rho);
        let mut random = SequentialRandom::new(7);
        for (index, observation) in solver.scene.observations.list.iter_mut().enumerate() {
            let gain = gains(observation.view as usize);
            let noise = 1.0 + 0.002 * random.next_normal();
            let wrong = if index % 50 == 0 { 2.0 } else { 1.0 };
            observation.radiance =
                [0, 1, 2].map(|c| wrong * noise * gain[c] * (models[index][c] + pixels.lobe[index][c]));
        }
        (solver, truth)
    }

    /// Root mean square of the difference of diffuse reflectance, relative to the truth, over texels that pixels show.
    fn error(solver: &Solver, shown: &[[f32; 3]], found: &[[f32; 3]], truth: &[Material<f32>]) -> f64 {
        let well = |texel: &usize| shown[*texel][0] > 0.0 && solver.scene.observations.range(*texel).len() > 3;
        let (mut sum, mut count) = (0.0, 0.0);
        for texel in (0..truth.len()).filter(well) {
            for c in 0..3 {
                sum += f64::from(found[texel][c] / truth[texel].diffuse[c] - 1.0).powi(2);
                count += 1.0;
            }
        }
        assert!(count > 500.0, "{count}");
        f64::sqrt(sum / count)
    }

    #[test]
    fn reflectance_and_gains_are_found_beside_pixels_that_are_wrong() {
        // What differs is large beside what the model's errors have in common, so that hardly any of it is shrunk.
        let gains = |view: usize| [1.3f32, 0.8, 1.0].map(|gain| if view < 3 { gain } else { 1.0 });
        let (mut solver, truth) = photographed(gains);
        solver.estimate.texels.iter_mut().for_each(|texel| texel.diffuse = [0.4; 3]);
        let never = AtomicBool::new(false);
        let planes = solver.scene.transport.basis.planes(&solver.estimate.light);
        let mut known = solver.estimate.clone();
        known.texels.clone_from(&truth);
        let at_points = solver.scene.point_light(&known, &planes);
        let pixels = solver.scene.lit_pixels(&solver.estimate, &planes, &at_points, &never).unwrap();
        let found = solver.scene.solve_whole(&pixels, solver.estimate.diffuse(), &never).unwrap();
        // Gains have mean one over the views, and what that leaves is a factor of all reflectances.
        for c in 0..3 {
            let ratio = found.gains[0][c] / found.gains[7][c];
            assert!((ratio / gains(0)[c] - 1.0).abs() < 0.02, "{:?}", found.gains);
        }
        let factor = [0, 1, 2].map(|c| gains(7)[c] / found.gains[7][c]);
        let rho: Vec<[f32; 3]> = found.rho.iter().map(|rho| [0, 1, 2].map(|c| rho[c] / factor[c])).collect();
        let off = error(&solver, &found.precision, &rho, &truth);
        assert!(off < 0.03, "{off}");
        // The same by the step, which begins at what it knows; light between surfaces follows then.
        let before = solver.estimate.diffuse();
        let Solver { scene, estimate } = &mut solver;
        let report = scene.refine(estimate, &never).unwrap();
        assert!(report.squared_error > 0.0 && estimate.diffuse() != before);
        let stopped = scene.refine(&mut estimate.clone(), &AtomicBool::new(true));
        assert!(stopped.is_none());
    }

    #[test]
    fn with_light_pixels_are_explained_no_worse_than_by_a_texture_alone() {
        let (mut solver, _) = photographed(|_| [1.0; 3]);
        solver.estimate.texels.iter_mut().for_each(|texel| texel.diffuse = [0.4; 3]);
        let never = AtomicBool::new(false);
        let texture = solver.scene.bake(&never).unwrap();
        let planes = solver.scene.transport.basis.planes(&solver.estimate.light);
        let at_points = solver.scene.point_light(&solver.estimate, &planes);
        let pixels = solver.scene.lit_pixels(&solver.estimate, &planes, &at_points, &never).unwrap();
        let lit = solver.scene.solve_whole(&pixels, solver.estimate.diffuse(), &never).unwrap();
        let (lit, texture) = (lit.noise.deviation(0.3), texture.noise.deviation(0.3));
        assert!(lit < texture, "{lit} {texture}");
    }
}
