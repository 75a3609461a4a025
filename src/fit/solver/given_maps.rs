//! A block whose reflectances are given: what it says of the light, with nothing of its own to find.
//!
//! The mirror of [`super::block`]. A pixel's model is that of the texel it shows, at that texel's own lobe; its row over the
//! light needs no elimination, since there is nothing to eliminate, and blocks have nothing to say to each other. What is
//! wrong with the maps counts as noise, block by block. Maps that were found under a light may move along with it instead
//! ([`super::light_again`]).

use super::block::BlockSolution;
use super::eliminate::BlockRows;
use super::estimate::Estimate;
use super::light_reach::LightReach;
use super::light_shape::LightShape;
use super::lobe_widths::{WidthStencil, log_widths};
use super::pixel_terms::BlockPrior;
use super::plan::Block;
use super::round::{BlockWork, LEAST_WEIGHT, Round};
use crate::material::Material;
use crate::render::cached::SeenLight;
use crate::render::cached::lobe_sum::lobe_with_derivative;

/// Least noise of a block, relative to what is believed before looking.
const LEAST_NOISE: f64 = 0.25;
/// Mean diffuse reflectance below which a block counts as that dark.
const DARK: f32 = 1e-3;

impl Round<'_> {
    /// Takes the maps of the estimate for a block's solution, as far as they were seen by photos of their own
    /// ([`is_solved`](super::TexelVariance::is_solved)); weights and noise follow from how well they explain the pixels.
    /// `false` when no pixel shows such a texel.
    pub fn take_given(&self, estimate: &Estimate, prior: &BlockPrior, work: &mut BlockWork) -> bool {
        let texel_of = |used: u32| self.observations.list[used as usize].texel as usize;
        let is_known: Vec<bool> =
            work.used.iter().map(|&used| estimate.variances[texel_of(used)].is_solved()).collect();
        let mut known = is_known.iter();
        work.used.retain(|_| known.next() == Some(&true));
        let mut known = is_known.iter();
        work.terms.retain(|_| known.next() == Some(&true));
        if work.used.is_empty() {
            return false;
        }
        let mut texels: Vec<usize> = work.used.iter().map(|&used| texel_of(used)).collect();
        texels.sort_unstable();
        texels.dedup();
        let mut seen = SeenLight::default();
        for index in self.by_lobe_point(work, (0..work.used.len()).collect()) {
            let observation = &self.observations.list[work.used[index] as usize];
            let texel = observation.texel as usize;
            let Material { specular, log_width, .. } = estimate.texels[texel];
            let place = self.transport.lobe_place(self.point(observation), self.light, self.at_points, &mut seen);
            let sums = lobe_with_derivative(&self.transport.basis, &place, log_width.exp());
            let term = &mut work.terms[index];
            // With F0 taken in, all texels have a lobe of one F0 at one width, as the terms of a block have.
            term.base[0] = [0, 1, 2].map(|c| specular[c] * sums.base[c]);
            term.grazing[0] = sums.grazing;
            term.cell = texels.partition_point(|&other| other < texel) as u16;
        }
        let nodes = log_widths();
        work.solution = BlockSolution {
            specular: [1.0; 3],
            log_width: nodes[0] as f32,
            stencil: WidthStencil::new(&nodes, nodes[0], 0..1),
            cells: texels.iter().map(|&texel| estimate.texels[texel].diffuse).collect(),
            ..BlockSolution::default()
        };
        self.reweigh(work);
        let (mut squared, mut weight) = (0.0f64, 0.0f64);
        for term in &work.terms {
            let model = self.model(work, term);
            weight += f64::from(term.weight);
            squared += (0..3).map(|c| f64::from(term.weight * (term.radiance[c] - model[c]).powi(2))).sum::<f64>();
        }
        if weight <= 0.0 {
            return false;
        }
        work.solution.residual = (squared / (3.0 * weight)).sqrt() as f32;
        let noise = f64::from(work.solution.residual).max(LEAST_NOISE * prior.noise);
        work.prior = Some(BlockPrior { noise, ..*prior });
        true
    }

    /// The rows over the light of a block whose reflectances are given, for each channel, in units of its noise. With `moving`,
    /// the block, its reflectances may move along and are taken out of the rows: those of its cells and of all of it by one
    /// factor each, F0 and width by what is added to those of its texels.
    pub fn given_rows(
        &self,
        estimate: &Estimate,
        moving: Option<&Block>,
        work: &BlockWork,
        shape: &LightShape,
        made: &mut [BlockRows; 3],
    ) {
        let Some(prior) = work.prior else { return };
        let used: Vec<usize> = (0..work.used.len()).filter(|&index| work.terms[index].weight > LEAST_WEIGHT).collect();
        let cells = moving.map_or(0, |block| block.cell_count);
        for rows in made.iter_mut() {
            rows.reset(shape.count(), used.len(), if moving.is_some() { cells + 3 } else { 0 });
        }
        let count = work.solution.cells.len().max(1) as f32;
        let mean = [0, 1, 2].map(|c| (work.solution.cells.iter().map(|cell| cell[c]).sum::<f32>() / count).max(DARK));
        let mut reach = LightReach::new(self, shape);
        let row_of = |index: usize| used.partition_point(|&other| other < index);
        for index in self.by_lobe_point(work, used.clone()) {
            let (row, term) = (row_of(index), &work.terms[index]);
            let observation = &self.observations.list[work.used[index] as usize];
            let Material { diffuse, specular, log_width } = estimate.texels[observation.texel as usize];
            reach.look(self, observation, log_width.exp(), shape);
            let LightReach { rows: [of_diffuse, of_base, of_grazing], of_surface, direct, sums, .. } = &reach;
            let scale = term.weight.sqrt() / prior.noise as f32;
            let cell = moving.map(|block| block.cell_of(observation.texel));
            for (c, rows) in made.iter_mut().enumerate() {
                let known =
                    diffuse[c] * (term.arriving[c] - direct[c]) + specular[c] * of_surface[0][c] + of_surface[1][c];
                rows.right[row] = f64::from(scale * (term.radiance[c] - known));
                let lobe = of_base.iter().zip(of_grazing).map(|(&b, &g)| scale * (specular[c] * b + g));
                rows.set_row(row, lobe, of_diffuse.iter().map(|&d| scale * diffuse[c] * d));
                let Some(cell) = cell else { continue };
                let by_factor = f64::from(scale * term.arriving[c] * diffuse[c] / mean[c]);
                rows.set_unknown(row, 2 + cells, by_factor);
                rows.set_unknown(row, usize::from(cell), by_factor);
                rows.set_unknown(row, cells, f64::from(scale * sums.base[c]));
                rows.set_unknown(row, 1 + cells, f64::from(scale * (specular[c] * sums.d_base[c] + sums.d_grazing[c])));
            }
        }
        if moving.is_none() {
            return;
        }
        for (c, rows) in made.iter_mut().enumerate() {
            for cell in 0..cells {
                rows.set_prior(cell, 1.0 / prior.spread, 0.0);
            }
            rows.set_prior(cells, 1.0 / prior.specular.1, 0.0);
            rows.set_prior(1 + cells, 1.0 / prior.log_width.1, 0.0);
            rows.eliminate();
            rows.kept.value = f64::from(mean[c]);
        }
    }
}
