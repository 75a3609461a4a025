//! What a round does with a block: light at its pixels, and its unknowns.

use super::block::{BlockSolution, solve_block};
use super::lobe_widths::{MOST_NODES, WIDTHS, log_widths};
use super::observations::{Observation, Observations};
use super::pixel_terms::{BlockPrior, PixelTerms};
use super::plan::Block;
use crate::render::cached::lobe_place::{LobeSums, wide_from};
use crate::render::cached::lobe_sum::lobe_sums;
use crate::render::cached::{CachedTransport, LightPlanes, PointLight, SeenLight, ShadingPoint, ViewFootprints};

/// Weight of a pixel below which it says nothing of the light.
pub(super) const LEAST_WEIGHT: f32 = 0.02;

/// What all blocks of a round share.
pub struct Round<'a> {
    /// The cache.
    pub transport: &'a CachedTransport,
    /// Footprints of the views.
    pub footprints: &'a [ViewFootprints],
    /// The observations.
    pub observations: &'a Observations,
    /// Logarithm of each view's gain.
    pub log_gains: &'a [f32],
    /// The light in planes.
    pub light: &'a LightPlanes,
    /// The light at the points of the grid.
    pub at_points: &'a PointLight,
}

/// A block at work.
#[derive(Clone, Debug, Default)]
pub struct BlockWork {
    /// Indices of the observations that are used.
    pub used: Vec<u32>,
    /// Their terms.
    pub terms: Vec<PixelTerms>,
    /// Nodes of the widths whose terms are set.
    pub nodes: std::ops::Range<usize>,
    /// What was found.
    pub solution: BlockSolution,
    /// What was believed, with the noise and spread that were found.
    pub prior: Option<BlockPrior>,
}

/// What is believed of any block before looking. `openness` in [0, 1] says how far the light can be trusted: under a
/// light that is not known yet, a lobe that is free takes what the light should explain (left free from the start, the
/// light grew tenfold and lobes went wide until they stood in for diffuse reflectance), so it begins near a dielectric's
/// and is let go round by round.
pub fn open_prior(mean_radiance: f32, openness: f64) -> BlockPrior {
    let between = |closed: f64, open: f64| closed * (open / closed).powf(openness.clamp(0.0, 1.0));
    BlockPrior {
        specular: ([0.07; 3], between(0.02, 0.3)),
        log_width: (-0.6, between(0.15, 0.6)),
        // Black photos have no mean to measure noise by.
        noise: 0.05 * f64::from(mean_radiance).max(1e-6),
        spread: 0.1,
    }
}

impl Round<'_> {
    pub(super) fn point(&self, observation: &Observation) -> &ShadingPoint {
        &self.footprints[observation.view as usize].points[observation.point as usize]
    }

    /// Mean over an observation's footprint of what the points of the grid hold.
    pub(super) fn interpolate(&self, values: &[[f32; 3]], observation: &Observation) -> [f32; 3] {
        CachedTransport::interpolate(values, &self.footprints[observation.view as usize], self.point(observation))
    }

    /// Takes up to `most` observations of a block, spread evenly over its texels and views.
    pub fn gather(&self, block: &Block, most: usize, work: &mut BlockWork) {
        work.used.clear();
        work.terms.clear();
        let step = (block.observations as f64 / most as f64).max(1.0);
        let mut next = 0.0;
        let mut seen = 0usize;
        for &(texel, cell) in &block.texels {
            for index in self.observations.range(texel as usize) {
                if seen as f64 >= next {
                    next += step;
                    let observation = &self.observations.list[index];
                    let gain = (-self.log_gains[observation.view as usize]).exp();
                    work.used.push(index as u32);
                    work.terms.push(PixelTerms {
                        radiance: observation.radiance.map(|value| value * gain),
                        cell,
                        // A clipped pixel says nothing until the model is darker than it.
                        weight: if observation.clipped { 0.0 } else { 1.0 },
                        arriving: self.interpolate(&self.at_points.arriving, observation),
                        ..PixelTerms::default()
                    });
                }
                seen += 1;
            }
        }
        work.nodes = 0..0;
    }

    fn point_of(&self, work: &BlockWork, index: usize) -> &ShadingPoint {
        self.point(&self.observations.list[work.used[index] as usize])
    }

    /// Terms of a block in the order of the points of the grid that serve their lobes: what a point sees is put
    /// together once then.
    pub(super) fn by_lobe_point(&self, work: &BlockWork, mut terms: Vec<usize>) -> Vec<usize> {
        terms.sort_by_key(|&index| self.point_of(work, index).lobe_point);
        terms
    }

    /// Fills in the lobe's integrals at these nodes.
    fn fill(&self, work: &mut BlockWork, nodes: std::ops::Range<usize>) {
        let mut sums = [LobeSums::default(); MOST_NODES];
        let mut seen = SeenLight::default();
        for index in self.by_lobe_point(work, (0..work.used.len()).collect()) {
            let (point, term) = (self.point_of(work, index), &mut work.terms[index]);
            let place = self.transport.lobe_place(point, self.light, self.at_points, &mut seen);
            let widths = &WIDTHS[nodes.clone()];
            lobe_sums(&self.transport.basis, &place, widths, &mut sums[..widths.len()]);
            for (node, sums) in nodes.clone().zip(&sums) {
                (term.base[node], term.grazing[node]) = (sums.base, sums.grazing);
            }
        }
        work.nodes = if work.nodes.is_empty() {
            nodes
        } else {
            work.nodes.start.min(nodes.start)..work.nodes.end.max(nodes.end)
        };
    }

    /// Solves a block: all wide lobes, and narrow ones only when the narrowest of those was the best. Weights are set
    /// by how well pixels fit (Cauchy), noise and spread by what is left.
    pub fn solve(&self, block: &Block, prior: &BlockPrior, work: &mut BlockWork) -> bool {
        let log_widths = log_widths();
        let first_wide = WIDTHS.partition_point(|&width| width < wide_from(&self.transport.basis)).min(MOST_NODES - 1);
        let mut prior = *prior;
        self.fill(work, first_wide..MOST_NODES);
        let floor = 0.25 * prior.noise;
        for pass in 0..4 {
            let nodes = work.nodes.clone();
            let Some(solution) = solve_block(&work.terms, block.cell_count, &log_widths, nodes, &prior) else {
                return false;
            };
            work.solution = solution;
            if work.nodes.start > 0 && work.solution.best_node == work.nodes.start {
                let start = work.nodes.start;
                self.fill(work, start.saturating_sub(if start == first_wide { 2 } else { 3 })..start);
                continue;
            }
            if pass == 3 {
                break;
            }
            self.reweigh(work);
            let unknowns = 3.0 + 0.5 * block.cell_count as f64;
            let count: f64 = work.terms.iter().map(|term| f64::from(term.weight)).sum();
            let freedom = (count / (count - unknowns).max(0.25 * count)).sqrt();
            prior.noise = (f64::from(work.solution.residual) * freedom).max(floor);
            let deviations: f64 = work
                .solution
                .cells
                .iter()
                .flat_map(|cell| (0..3).map(|c| f64::from(cell[c] - work.solution.diffuse[c]).powi(2)))
                .sum::<f64>()
                / (3 * block.cell_count) as f64;
            prior.spread = (deviations + 0.01f64.powi(2)).sqrt();
        }
        work.prior = Some(prior);
        true
    }

    /// Model radiance of a term with the block's solution.
    pub fn model(&self, work: &BlockWork, term: &PixelTerms) -> [f32; 3] {
        let solution = &work.solution;
        [0, 1, 2].map(|c| {
            solution.cells[usize::from(term.cell)][c] * term.arriving[c]
                + solution.specular[c] * solution.stencil.of(&term.base, c)
                + solution.stencil.of(&term.grazing, c)
        })
    }

    pub(super) fn reweigh(&self, work: &mut BlockWork) {
        let models: Vec<[f32; 3]> = work.terms.iter().map(|term| self.model(work, term)).collect();
        let squared = |term: &PixelTerms, model: &[f32; 3]| {
            (0..3).map(|c| (term.radiance[c] - model[c]).powi(2)).sum::<f32>() / 3.0
        };
        let mut errors: Vec<f32> = work.terms.iter().zip(&models).map(|(term, model)| squared(term, model)).collect();
        let middle = errors.len() / 2;
        let median = *errors.select_nth_unstable_by(middle, f32::total_cmp).1;
        let scale = 60.0 * median + 1e-12;
        for ((term, model), &used) in work.terms.iter_mut().zip(&models).zip(&work.used) {
            let clipped = self.observations.list[used as usize].clipped;
            let darker = (0..3).all(|c| model[c] < term.radiance[c]);
            term.weight = if clipped && !darker { 0.0 } else { 1.0 / (1.0 + squared(term, model) / scale) };
        }
    }
}
