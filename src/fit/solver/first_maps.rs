//! Maps of all texels while the light is still looked for: what light between surfaces is reckoned by, and what there is to
//! see before maps are made.
//!
//! A round on the light solves some blocks. All other texels take the mean lobe of those, and a diffuse reflectance by
//! division: radiance of their pixels over the light that arrives there, by least squares, times the factor by which blocks
//! that were solved differ from that, since a lobe sends a part of what photos show.

use super::estimate::{Estimate, fill_from_known};
use super::scene::SolverScene;
use crate::material::Material;
use crate::math::parallel;
use crate::render::cached::{CachedTransport, PointLight};

/// A texel's pixels: sums of radiance times arriving light, and of the latter's squares.
#[derive(Clone, Copy, Default)]
struct Division {
    product: [f32; 3],
    power: [f32; 3],
}

impl Division {
    fn is_known(&self) -> bool {
        self.power.iter().all(|&power| power > 0.0)
    }

    fn reflectance(&self, c: usize) -> f32 {
        self.product[c] / self.power[c]
    }
}

impl SolverScene {
    /// Gives all texels that were not solved for what is written above, under the estimate's own light; texels that no photo
    /// shows what the nearest has.
    pub(super) fn fill_by_division(&self, estimate: &mut Estimate) {
        let Some(mean) = estimate.mean_of_solved() else { return };
        let planes = self.transport.basis.planes(&estimate.light);
        let at_points = self.point_light(&estimate.texels, &planes);
        let division = |texel: usize| self.division(texel, &at_points, &estimate.log_gains);
        let divisions = parallel::map_small(estimate.texels.len(), division);
        // The factor by least squares over solved texels as well, so that what is hardly lit counts little.
        let (mut product, mut power) = ([0.0f64; 3], [0.0f64; 3]);
        for ((texel, known), division) in estimate.texels.iter().zip(&estimate.variances).zip(&divisions) {
            if known.is_solved() && division.is_known() {
                for c in 0..3 {
                    product[c] += f64::from(texel.diffuse[c] * division.product[c]);
                    power[c] += f64::from(division.product[c] * division.reflectance(c));
                }
            }
        }
        let factor = [0, 1, 2].map(|c| if power[c] > 0.0 { (product[c] / power[c]) as f32 } else { 1.0 });
        let is_solved = estimate.variances.iter().map(|known| known.is_solved());
        let is_known: Vec<bool> = is_solved.zip(&divisions).map(|(solved, own)| solved || own.is_known()).collect();
        let of_texels = estimate.texels.iter_mut().zip(&estimate.variances).zip(&divisions);
        for ((texel, _), division) in of_texels.filter(|((_, known), own)| !known.is_solved() && own.is_known()) {
            let diffuse = [0, 1, 2].map(|c| (factor[c] * division.reflectance(c)).clamp(0.0, 1.0));
            *texel = Material { diffuse, ..mean };
        }
        fill_from_known(&mut estimate.texels, is_known, self.settings.map_size);
    }

    /// What a texel's pixels say; clipped ones only where there are no others.
    fn division(&self, texel: usize, at_points: &PointLight, log_gains: &[f32]) -> Division {
        let observations = &self.observations.list[self.observations.range(texel)];
        let counts_clipped = observations.iter().all(|observation| observation.clipped);
        let mut sums = Division::default();
        for observation in observations.iter().filter(|own| counts_clipped || !own.clipped) {
            let view = observation.view as usize;
            let (footprints, gain) = (&self.footprints[view], (-log_gains[view]).exp());
            let point = &footprints.points[observation.point as usize];
            let arriving = CachedTransport::interpolate(&at_points.arriving, footprints, point);
            for c in 0..3 {
                sums.product[c] += gain * observation.radiance[c] * arriving[c];
                sums.power[c] += arriving[c] * arriving[c];
            }
        }
        sums
    }
}

#[cfg(all(test, feature = "cli"))]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::estimate::{START_TEXEL, TexelVariance};
    use super::super::refine::tests::photographed;
    use super::super::solver::Solver;

    #[test]
    fn texels_between_blocks_have_nearly_the_colours_that_photos_show() {
        let gain = |view: usize| 1.0 + 0.5 * (view % 2) as f32;
        let (mut solver, truth) = photographed(|view| [gain(view); 3]);
        let Solver { scene, estimate } = &mut solver;
        estimate.log_gains = (0..scene.views.len()).map(|view| gain(view).ln()).collect();
        // Every seventh row was solved for.
        for texel in 0..truth.len() {
            if texel / scene.settings.map_size % 7 == 3 && !scene.observations.range(texel).is_empty() {
                estimate.set(texel, truth[texel], TexelVariance::default());
            } else {
                (estimate.texels[texel], estimate.variances[texel]) = (START_TEXEL, TexelVariance::default());
            }
        }
        let mean = estimate.mean_of_solved().unwrap();
        scene.fill_by_division(estimate);
        let is_between =
            |texel: &usize| !estimate.variances[*texel].is_solved() && scene.observations.range(*texel).len() > 2;
        let (mut own, mut of_mean, mut count) = (0.0f32, 0.0f32, 0);
        for texel in (0..truth.len()).filter(is_between) {
            assert_eq!(
                (estimate.texels[texel].specular, estimate.texels[texel].log_width),
                (mean.specular, mean.log_width)
            );
            for c in 0..3 {
                own += (estimate.texels[texel].diffuse[c] - truth[texel].diffuse[c]).abs();
                of_mean += (mean.diffuse[c] - truth[texel].diffuse[c]).abs();
            }
            count += 1;
        }
        assert!(count > 200 && own < 0.5 * of_mean, "{count}: {own} beside {of_mean} of the mean");
    }
}
