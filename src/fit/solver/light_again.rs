//! The light once more, from maps of all texels.
//!
//! [Rounds on the light](super::light_round) know a block of surface by one lobe and a few colours, and what these leave
//! unexplained goes to the light. Once the [descent](super::descent) has maps, a pixel's row is that of the very texel it
//! shows. Maps were made to suit the light that is, so held fast they would hold it: reflectances of a block move along and
//! are taken out of its rows, as in the rounds, and steps of the descent make them good under the new light.

use super::estimate::Estimate;
use super::light_evidence::EvidenceShares;
use super::light_round::LEAST_OBSERVATIONS;
use super::light_shape::{LightShape, bright_texels};
use super::normal_equations::NormalEquations;
use super::round::open_prior;
use super::scene::SolverScene;
use std::sync::atomic::AtomicBool;

/// Rounds: under a light that has moved the same maps say a little else.
const ROUNDS: usize = 2;
/// How far lobes are let go from those of the maps, between what is believed of one of which nothing was found and of one that
/// is free.
const OPENNESS: f64 = 0.5;

impl SolverScene {
    /// The light by the estimate's maps, which stay, holes filled, and what its texels are known by; the estimate's own where no
    /// block has maps. `seen` hears of the light after each round, with the share of the rounds that are done. `None` when `stop` was
    /// raised.
    pub(super) fn light_again(
        &self,
        mut estimate: Estimate,
        stop: &AtomicBool,
        seen: &mut dyn FnMut(f64, &[[f32; 3]]),
    ) -> Option<(Vec<[f32; 3]>, Vec<EvidenceShares>)> {
        let prior = open_prior(self.observations.mean, OPENNESS);
        let size = self.settings.light_size;
        let rounds = self.settings.coarse_rounds + self.settings.fine_rounds;
        for number in rounds..rounds + ROUNDS {
            let shape = LightShape::new(size, bright_texels(&estimate.light, size, self.settings.narrow_hats));
            let planes = self.transport.basis.planes(&estimate.light);
            let at_points = self.point_light(&estimate.texels, &planes);
            let round = self.round(&estimate, &planes, &at_points);
            let (mut equations, done, kept) = self.sums_of_blocks(
                &round,
                (&shape, number, LEAST_OBSERVATIONS),
                &|block, work, rows| {
                    let is_given = round.take_given(&estimate, &prior, work);
                    if is_given {
                        round.given_rows(&estimate, Some(block), work, &shape, rows);
                    }
                    is_given
                },
                stop,
            )?;
            if done.is_empty() && number == rounds {
                return Some((estimate.light, estimate.light_known.shares));
            }
            if done.is_empty() {
                break;
            }
            self.add_coupled(&mut equations, &done, &kept);
            let surface = equations.each_ref().map(NormalEquations::diagonal);
            self.add_background(&mut equations, &shape, &estimate.log_gains);
            // How much light there is in all is not asked again.
            let held = self.mean_light(&estimate.light);
            let (light, known) = self.solve_light(&equations, &surface, &shape, held, &estimate, stop)?;
            estimate.light = light;
            estimate.light_known.shares = known.shares;
            let mut light = estimate.light.clone();
            self.fill_holes(&mut light);
            seen((number + 1 - rounds) as f64 / ROUNDS as f64, &light);
        }
        self.fill_holes(&mut estimate.light);
        Some((estimate.light, estimate.light_known.shares))
    }
}

#[cfg(all(test, feature = "cli"))]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::refine::tests::photographed_under;
    use super::super::solver::Solver;
    use super::*;
    use crate::light::Environment;
    use crate::math::sphere::solid_angle_of_texel;
    use glam::Vec3;

    #[test]
    fn the_light_of_the_photos_is_found_from_maps() {
        let mut lamp = Environment::constant(32, 16, Vec3::splat(0.5));
        lamp.radiance[(4, 10)] = Vec3::splat(60.0);
        let (Solver { scene, mut estimate }, _) = photographed_under(&lamp, -2.0, |_| [1.0; 3]);
        estimate.variances.iter_mut().for_each(|known| known.lobe_cluster_size = 1.0);
        let truth = estimate.light.clone();
        // From an even light that is as bright in all.
        let even = scene.mean_light(&vec![[1.0; 3]; truth.len()]);
        let mean = scene.mean_light(&truth);
        let begun = vec![[0, 1, 2].map(|c| (mean[c] / even[c]) as f32); truth.len()];
        estimate.light.clone_from(&begun);
        let (found, shares) = scene.light_again(estimate.clone(), &AtomicBool::new(false), &mut |_, _| {}).unwrap();
        assert!(shares.len() == found.len() && shares.iter().flatten().any(|&share| share > 0.1));
        let error = |light: &[[f32; 3]]| -> f64 {
            let of_texel = |texel: usize| {
                let square: f32 = (0..3).map(|c| (light[texel][c] - truth[texel][c]).powi(2)).sum();
                solid_angle_of_texel(texel / 32, 32, 16) * f64::from(square)
            };
            (0..truth.len()).map(of_texel).sum::<f64>().sqrt()
        };
        assert!(error(&found) < 0.5 * error(&begun), "{} of {}", error(&found), error(&begun));
        assert!(scene.light_again(estimate, &AtomicBool::new(true), &mut |_, _| {}).is_none());
    }
}
