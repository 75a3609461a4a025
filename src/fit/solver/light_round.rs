//! A round on the light: some blocks are solved under the light as it is, and their rows move it. Where maps are given there is
//! nothing to solve in a block, and its rows are all that it has to say.

use super::coupling;
use super::eliminate::{BlockRows, KeptUnknown};
use super::estimate::{Estimate, TexelVariance};
use super::gains::gains_after;
use super::light_colour::change_by_highlights;
use super::light_evidence::{LightKnown, Precisions, evidence_shares};
use super::light_shape::{LightShape, bright_texels};
use super::light_step::{ChannelKnown, Gauge, LightPrior, solve_channel};
use super::light_suns::{GROWTHS, narrow_scales};
use super::normal_equations::NormalEquations;
use super::pixel_terms::BlockPrior;
use super::plan::{self, Block};
use super::report::{ErrorSums, StepReport};
use super::round::{BlockWork, Round, open_prior};
use super::scene::{BackgroundPixel, SolverScene};
use crate::material::Material;
use crate::math::parallel;
use crate::math::statistics::median;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Noise of a background pixel, relative to its radiance and to the mean of the surface's.
const BACKGROUND_NOISE: f64 = 0.03;
/// By how much the mean light on the surface may differ from the gauge's where background shows, relative. Errors of
/// transport make blocks take their light for less than it is, so a sun that no photo shows grows where it is free to;
/// but photographs want it loose.
const BACKGROUND_GAUGE_SLACK: f64 = 0.022;
/// Which share of the rows counts beside what is believed of the light, where maps are sought. Blocks are wrong together, by
/// lobes and cells that are coarser than the surface's; a twentieth, as of what lobes are told by, leaves lights as smooth as
/// they are believed.
const INDEPENDENCE_OF_ROWS: f64 = 0.25;
/// A block with fewer observations says nothing of the light.
pub(super) const LEAST_OBSERVATIONS: usize = 16;
/// The same where its reflectances are given: it has nothing to find out of them first.
const LEAST_WITH_GIVEN_MAPS: usize = 4;
/// Parts in which normal matrices are added up; fixed, so that results do not depend on the number of threads.
const PARTS: usize = 4;

/// Places of blocks, and what was found of each.
pub(super) type Solved = Vec<(usize, BlockWork)>;

impl SolverScene {
    /// One round; `number` counts them from 0 and sets which blocks take part and how far lobes are let go. `None` when
    /// `stop` was raised: nothing was changed then.
    pub fn light_round(&self, estimate: &mut Estimate, number: usize, stop: &AtomicBool) -> Option<StepReport> {
        let shape = self.shape_of_round(estimate, number);
        let planes = self.transport.basis.planes(&estimate.light);
        let at_points = self.point_light(&estimate.texels, &planes);
        let round = self.round(estimate, &planes, &at_points);
        let openness = if self.settings.fixed_light { 1.0 } else { self.openness(number) };
        let prior = open_prior(self.observations.mean, openness);
        let (mut equations, done) = self.equations(&round, estimate, &shape, &prior, number, stop)?;

        let light = if self.settings.fixed_light {
            None
        } else {
            let surface = equations.each_ref().map(NormalEquations::diagonal);
            self.add_background(&mut equations, &shape, &estimate.log_gains);
            let held = self.held_light(estimate, &done, number);
            Some(self.solve_light(&equations, &surface, &shape, held, estimate, stop)?)
        };
        let gains = self
            .settings
            .exposure
            .then(|| gains_after(&round, &done, &self.foretold_gains, self.settings.independence));
        let mut errors = ErrorSums::new(self.views.len());
        for (_, work) in &done {
            errors.add_block(&round, work);
        }
        let mut residuals: Vec<f32> = done.iter().map(|(_, work)| work.solution.residual).collect();

        // Nothing is dropped from here on.
        if let Some((light, known)) = light {
            estimate.light = light;
            estimate.light_known = known;
        }
        if let Some(gains) = gains {
            estimate.log_gains = gains;
        }
        if !self.settings.fixed_maps {
            self.take_blocks(estimate, &done);
            self.fill_by_division(estimate);
        }
        Some(StepReport {
            residual: median(&mut residuals),
            squared_error: errors.mean(),
            blocks: done.len(),
            light_unknowns: if self.settings.fixed_light { 0 } else { shape.count() },
            view_errors: errors.of_views(&self.views),
            ..StepReport::default()
        })
    }

    /// Texels of solved blocks that no maps were made for take what was found for the block.
    fn take_blocks(&self, estimate: &mut Estimate, done: &Solved) {
        for (index, work) in done {
            let solution = &work.solution;
            for &(texel, cell) in &self.round_blocks[*index].texels {
                if estimate.is_mapped(texel as usize) {
                    continue;
                }
                let diffuse = solution.cells[usize::from(cell)];
                let own = Material { diffuse, specular: solution.specular, log_width: solution.log_width };
                estimate.set(texel as usize, own, TexelVariance::default());
            }
        }
    }

    /// How far lobes are let go in a round: 0 in the first, 1 in the last, more in rounds on finer photos, which count
    /// as 1.
    fn openness(&self, number: usize) -> f64 {
        let last = (self.settings.coarse_rounds + self.settings.fine_rounds).max(2) - 1;
        number as f64 / last as f64
    }

    fn shape_of_round(&self, estimate: &Estimate, number: usize) -> LightShape {
        let size = self.settings.light_size;
        if number < self.settings.coarse_rounds {
            return LightShape::new(size, Vec::new());
        }
        LightShape::new(size, bright_texels(&estimate.light, size, self.settings.narrow_hats))
    }

    /// Solves the blocks of a round and adds up their rows over the light.
    fn equations(
        &self,
        round: &Round,
        estimate: &Estimate,
        shape: &LightShape,
        prior: &BlockPrior,
        number: usize,
        stop: &AtomicBool,
    ) -> Option<([NormalEquations; 3], Solved)> {
        let settings = &self.settings;
        let of_block = |block: &Block, work: &mut BlockWork, rows: &mut [BlockRows; 3]| {
            let is_solved = match settings.fixed_maps {
                true => round.take_given(estimate, prior, work),
                false => round.solve(block, prior, work),
            };
            match is_solved {
                true if settings.fixed_maps => round.given_rows(estimate, None, work, shape, rows),
                true if !settings.fixed_light => round.rows(block, work, shape, rows),
                _ => {}
            }
            is_solved
        };
        let least = if settings.fixed_maps { LEAST_WITH_GIVEN_MAPS } else { LEAST_OBSERVATIONS };
        let (mut total, done, kept) = self.sums_of_blocks(round, (shape, number, least), &of_block, stop)?;
        if !settings.fixed_light && !settings.fixed_maps {
            self.add_coupled(&mut total, &done, &kept);
        }
        Some((total, done))
    }

    /// Adds up what blocks that take part say of the light: `of_block` fills the rows of one, and says whether it was solved.
    /// The last of their unknowns is kept apart. `None` when `stop` was raised.
    pub(super) fn sums_of_blocks(
        &self,
        round: &Round,
        (shape, number, least): (&LightShape, usize, usize),
        of_block: &(dyn Fn(&Block, &mut BlockWork, &mut [BlockRows; 3]) -> bool + Sync),
        stop: &AtomicBool,
    ) -> Option<([NormalEquations; 3], Solved, [Vec<KeptUnknown>; 3])> {
        let chosen = plan::choose(&self.round_blocks, self.settings.blocks, least, self.settings.seed, number);
        let part = chosen.len().div_ceil(PARTS).max(1);
        let parts = parallel::map_chunks(&chosen, part, |_, chosen| {
            let mut equations = [(); 3].map(|()| NormalEquations::new(shape.count()));
            let mut done = Vec::with_capacity(chosen.len());
            let mut rows = [(); 3].map(|()| BlockRows::default());
            let mut kept: [Vec<KeptUnknown>; 3] = Default::default();
            for &index in chosen {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                let mut work = BlockWork::default();
                round.gather(&self.round_blocks[index], self.settings.observations, &mut work);
                if !of_block(&self.round_blocks[index], &mut work, &mut rows) {
                    continue;
                }
                if !self.settings.fixed_light {
                    equations.iter_mut().zip(&rows).for_each(|(equations, rows)| equations.add(rows));
                    kept.iter_mut().zip(&mut rows).for_each(|(kept, rows)| kept.push(std::mem::take(&mut rows.kept)));
                }
                done.push((index, work));
            }
            equations.iter_mut().for_each(NormalEquations::flush);
            (equations, done, kept)
        });
        let mut total = [(); 3].map(|()| NormalEquations::new(shape.count()));
        let mut done = Vec::new();
        let mut kept: [Vec<KeptUnknown>; 3] = Default::default();
        for (equations, part, own) in parts {
            for (total, equations) in total.iter_mut().zip(&equations) {
                total.merge(equations);
            }
            done.extend(part);
            kept.iter_mut().zip(own).for_each(|(kept, own)| kept.extend(own));
        }
        (!stop.load(Ordering::Relaxed)).then_some((total, done, kept))
    }

    /// Adds what blocks say together, by what is believed of neighbours.
    pub(super) fn add_coupled(&self, total: &mut [NormalEquations; 3], done: &Solved, kept: &[Vec<KeptUnknown>; 3]) {
        let own: Vec<&Block> = done.iter().map(|(index, _)| &self.round_blocks[*index]).collect();
        let pairs = coupling::neighbours(&own);
        total.par_iter_mut().zip(kept).for_each(|(total, kept)| {
            coupling::add_coupled(total, kept, &pairs, INDEPENDENCE_OF_ROWS);
        });
    }

    /// Background pixels as rows of few entries.
    pub(super) fn add_background(&self, total: &mut [NormalEquations; 3], shape: &LightShape, log_gains: &[f32]) {
        let noise = BACKGROUND_NOISE * f64::from(self.observations.mean);
        for BackgroundPixel { view, tap, radiance, scatter } in &self.background {
            let entries: Vec<(u32, f32)> = tap.index.into_iter().zip(tap.weight).collect();
            let row = shape.reduce_sparse(&entries);
            let gain = f64::from((-log_gains[*view]).exp());
            // Bright places are known to a share of their radiance, places that views see differently to that difference.
            for (c, total) in total.iter_mut().enumerate() {
                let scale = 1.0 / (noise + BACKGROUND_NOISE * f64::from(radiance[c].max(0.0)) + f64::from(*scatter));
                let scaled: Vec<(u32, f64)> = row.iter().map(|&(index, value)| (index, value * scale)).collect();
                total.add_sparse(&scaled, f64::from(radiance[c]) * gain * scale);
            }
        }
    }

    /// What the mean light on the surface is held to, per channel: grey surface at first, then as much light in all, of
    /// the colour that highlights ask for.
    fn held_light(&self, estimate: &Estimate, done: &Solved, number: usize) -> [f64; 3] {
        let grey = &self.gauge.1;
        if number < self.settings.coarse_rounds || self.settings.fixed_maps {
            return *grey;
        }
        let now = self.mean_light(&estimate.light);
        let beside_grey = [0, 1, 2].map(|c| (now[c] / grey[c]).max(1e-3).ln());
        let change = change_by_highlights(done.iter().map(|(_, work)| work), beside_grey, self.settings.independence);
        let asked = [0, 1, 2].map(|c| (now[c] * change[c]).max(1e-9));
        let factor = grey.iter().sum::<f64>() / asked.iter().sum::<f64>();
        asked.map(|asked| asked * factor)
    }

    /// The mean light on the surface, per channel.
    pub(super) fn mean_light(&self, light: &[[f32; 3]]) -> [f64; 3] {
        let row = &self.gauge.0;
        [0, 1, 2].map(|c| row.iter().zip(light).map(|(&weight, light)| f64::from(weight) * f64::from(light[c])).sum())
    }

    /// The light, and what each of its texels is known by. `surface` are the diagonals before background was added.
    pub(super) fn solve_light(
        &self,
        equations: &[NormalEquations; 3],
        surface: &[Vec<f64>; 3],
        shape: &LightShape,
        held: [f64; 3],
        estimate: &Estimate,
        stop: &AtomicBool,
    ) -> Option<(Vec<[f32; 3]>, LightKnown)> {
        let prior = LightPrior {
            variation: self.settings.light_variation,
            independence: if self.settings.fixed_maps { 1.0 } else { INDEPENDENCE_OF_ROWS },
            // Where the background shows, it fixes the scale; but not alone: what photos show behind a thing is seldom as
            // far away as a sky, and the light would grow from round to round.
            gauge_slack: match self.background.is_empty() {
                // Maps that are given fix it, and nothing else should.
                _ if self.settings.fixed_maps => f64::INFINITY,
                true => self.settings.gauge_slack,
                false => BACKGROUND_GAUGE_SLACK,
            },
        };
        let mut light = estimate.light.clone();
        let mut known: Vec<ChannelKnown> = Vec::new();
        for growth in GROWTHS {
            let before = shape.coefficients_of_channels(&light);
            let narrow = narrow_scales(shape, &light, &before, growth);
            let channels: Vec<(Vec<f32>, ChannelKnown)> = parallel::map(3, |c| {
                let mut x = before[c].clone();
                let gauge = Gauge { row: &self.gauge.0, mean: held[c] };
                let known = solve_channel(&equations[c], shape, &prior, &gauge, &narrow, &mut x);
                (shape.expand(&x), known)
            });
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            light = (0..light.len()).map(|texel| [0, 1, 2].map(|c| channels[c].0[texel])).collect();
            known = channels.into_iter().map(|(_, known)| known).collect();
        }
        let scale_deviation = known.iter().map(|channel| channel.scale_deviation / 3.0).sum();
        let precisions: Vec<Precisions> = known
            .into_iter()
            .zip(surface.iter().zip(equations))
            .map(|(channel, (own, all))| Precisions::new(own, all, channel.belief, prior.independence))
            .collect();
        let known = LightKnown { shares: evidence_shares(&precisions, shape), scale_deviation };
        Some((light, known))
    }
}
