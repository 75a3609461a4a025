//! Maps under the light that was found: blocks, then tiles of blocks with their lobes, then all reflectances together.

use super::choice::alternatives::TileAlternatives;
use super::choice::apply::Undecided;
use super::choice::check::Check;
use super::diffuse::{self, Leaning, Neighbours};
use super::diffuse_system::{DiffuseRow, DiffuseSystem};
use super::estimate::{Estimate, TexelVariance};
use super::lobe_families;
use super::lobe_prior::LobePrior;
use super::lobe_tails::TailSums;
use super::plan::Block;
use super::report::{ErrorSums, StepReport, median};
use super::round::{BlockWork, Round, open_prior};
use super::scene::SolverScene;
use super::tile::{TILE, Tile};
use crate::atlas::{dilate, nearest_covered};
use crate::image::Image;
use crate::material::Material;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Most observations of a block.
const MOST_OBSERVATIONS: usize = 256;
/// What reflectances lean on where all are solved together.
const LEANING: Leaning = Leaning { start: 0.01, neighbours: Neighbours::Alike(0.02) };
/// Iterations of conjugate gradients.
const ITERATIONS: usize = 20;

/// Tiles that are solved before what they leave is put together, so that few of their pixels' rows wait.
const TILES_AT_ONCE: usize = 128;

/// What a tile leaves.
struct TileResult {
    /// Without its pixels.
    tile: Tile,
    residuals: Vec<f32>,
    /// What its pixels say of diffuse reflectance, by observation.
    rows: Vec<(u32, DiffuseRow)>,
    tails: TailSums,
    /// With less, where that is judged.
    alternatives: Option<TileAlternatives>,
    /// Seconds of one processor until blocks were solved.
    block_seconds: f64,
}

impl SolverScene {
    /// Makes all maps. `None` when `stop` was raised: the estimate is of no use then.
    pub fn make_maps(&self, estimate: &mut Estimate, stop: &AtomicBool) -> Option<StepReport> {
        let planes = self.transport.basis.planes(&estimate.light);
        let at_points = self.point_light(estimate, &planes);
        let round = self.round(estimate, &planes, &at_points);
        let prior = lobe_families::with_families_of(estimate, self.settings.surface_kinds);
        let mut check = Check::begin(self, &at_points, &prior);
        let mut rows = vec![DiffuseRow::default(); self.observations.list.len()];
        let mut residuals = Vec::new();
        let mut made: Vec<Tile> = Vec::new();
        let mut undecided: Vec<Undecided> = Vec::new();
        let mut tails = TailSums::new(self.views.len());
        let tiles = self.tiles();
        for group in tiles.chunks(TILES_AT_ONCE) {
            let results: Vec<TileResult> = group
                .par_iter()
                .map(|(first, blocks)| self.solve_tile(&round, *first, blocks, &prior, check.as_ref(), stop))
                .collect();
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            for result in results {
                residuals.extend(result.residuals);
                for (index, row) in result.rows {
                    rows[index as usize] = row;
                }
                tails.add(&result.tails);
                if let (Some(check), Some(mut alternatives)) = (&mut check, result.alternatives) {
                    check.add(&alternatives, result.block_seconds, result.tile.seconds);
                    if self.settings.apply_choices {
                        undecided.push(Undecided::of(&mut alternatives));
                    }
                }
                made.push(result.tile);
            }
        }
        let mut choices = match check {
            Some(check) => Some(check.end(self, estimate, (&planes, &at_points), stop)?),
            None => None,
        };
        if let Some(choices) = choices.as_mut().filter(|_| self.settings.apply_choices) {
            choices.are_applied = true;
            for (tile, undecided) in made.iter_mut().zip(&undecided) {
                undecided.decide(choices, tile, &mut rows);
            }
        }
        let mut rho = estimate.diffuse();
        for tile in &made {
            for (&texel, own) in tile.texels.iter().zip(&tile.rho) {
                rho[texel as usize] = *own;
            }
        }
        let mut errors = self.solve_diffuse(&rows, &mut rho, stop)?;

        estimate.variances.fill(TexelVariance::default());
        for tile in &made {
            for (index, &texel) in tile.texels.iter().enumerate() {
                let (lobe, texel) = (&tile.lobes[index], texel as usize);
                let [r, g, b, log_width] = lobe.square.map(|value| value as f32);
                let variance = Material { diffuse: tile.variance[index], specular: [r, g, b], log_width };
                let own = Material {
                    diffuse: rho[texel],
                    specular: [0, 1, 2].map(|c| (lobe.mean[c] as f32).clamp(0.0, 1.0)),
                    log_width: lobe.mean[3].min(0.0) as f32,
                };
                estimate.set(texel, own, TexelVariance { variance, lobe_cluster_size: lobe.shared as f32 });
            }
        }
        self.fill_from_neighbours(estimate);
        if let Some(settled) = self.settle(estimate, at_points, &mut rows, stop)? {
            errors = settled;
        }
        Some(StepReport {
            residual: median(&mut residuals),
            squared_error: errors.mean(),
            blocks: residuals.len(),
            light_unknowns: 0,
            view_errors: errors.of_views(&self.views),
            choices,
            tails: tails.tails(self.settings.independence),
        })
    }

    /// Solves for all diffuse reflectances together, from those it is given. `None` when `stop` was raised.
    pub(super) fn solve_diffuse(
        &self,
        rows: &[DiffuseRow],
        rho: &mut [[f32; 3]],
        stop: &AtomicBool,
    ) -> Option<ErrorSums> {
        let mut system = DiffuseSystem::new(&self.footprints, &self.observations, rows, self.settings.map_size);
        diffuse::solve(&mut system, rho, LEANING, 1.0, ITERATIONS, stop)
            .then(|| self.errors_of(rows, &system.models(rho)))
    }

    /// Blocks by the tile they begin in, with the tile's corner.
    fn tiles(&self) -> Vec<((usize, usize), Vec<&Block>)> {
        let size = self.settings.map_size;
        let mut tiles: std::collections::BTreeMap<(usize, usize), Vec<&Block>> = Default::default();
        for block in &self.map_blocks {
            let Some(&(texel, _)) = block.texels.first() else { continue };
            let corner = (texel as usize / size / TILE * TILE, texel as usize % size / TILE * TILE);
            tiles.entry(corner).or_default().push(block);
        }
        tiles.into_iter().collect()
    }

    fn solve_tile(
        &self,
        round: &Round,
        first: (usize, usize),
        blocks: &[&Block],
        lobes: &LobePrior,
        check: Option<&Check>,
        stop: &AtomicBool,
    ) -> TileResult {
        let began = Instant::now();
        let prior = open_prior(self.observations.mean, 1.0);
        let mut solved = Vec::with_capacity(blocks.len());
        for &block in blocks {
            let mut work = BlockWork::default();
            if stop.load(Ordering::Relaxed) {
                break;
            }
            round.gather(block, MOST_OBSERVATIONS, &mut work);
            if round.solve(block, &prior, &mut work) {
                solved.push((block, work));
            }
        }
        let block_seconds = began.elapsed().as_secs_f64();
        let residuals = solved.iter().map(|(_, work)| work.solution.residual).collect();
        let mut tile = Tile::new(round, first, self.settings.map_size, solved);
        let beliefs = (lobes, self.settings.lobe_sharing);
        tile.solve(self.settings.map_size, self.observations.mean, self.settings.independence, beliefs);
        let alternatives = check.map(|check| check.of_tile(self, &mut tile));
        let rows = tile.pixels().map(|(index, lobe, weight)| (index, self.row(round, index, lobe, weight))).collect();
        let tails = tile.tail_sums(self.views.len());
        // They are large.
        tile.drop_pixels();
        TileResult { tile, residuals, rows, tails, alternatives, block_seconds }
    }

    /// What an observation says of diffuse reflectance, where its lobes send this.
    fn row(&self, round: &Round, index: u32, lobe: [f32; 3], weight: f32) -> DiffuseRow {
        let observation = &self.observations.list[index as usize];
        let gain = (-round.log_gains[observation.view as usize]).exp();
        DiffuseRow {
            arriving: self.interpolate(&round.at_points.arriving, index as usize),
            radiance: [0, 1, 2].map(|c| observation.radiance[c] * gain - lobe[c]),
            weight,
        }
    }

    /// Squared errors of the pixels that tiles used.
    fn errors_of(&self, rows: &[DiffuseRow], models: &[[f32; 3]]) -> ErrorSums {
        let mut errors = ErrorSums::new(self.views.len());
        for ((observation, row), model) in self.observations.list.iter().zip(rows).zip(models) {
            if row.weight > 0.0 && !observation.clipped {
                let squared = (0..3).map(|c| f64::from(row.radiance[c] - model[c]).powi(2)).sum::<f64>() / 3.0;
                errors.add(observation.view as usize, squared);
            }
        }
        errors
    }

    /// Texels without observations take the values of the nearest that has some.
    pub(super) fn fill_from_neighbours(&self, estimate: &mut Estimate) {
        let size = self.settings.map_size;
        let solved: Vec<bool> = estimate.variances.iter().map(TexelVariance::is_solved).collect();
        if !solved.contains(&true) {
            return;
        }
        let nearest = nearest_covered(&Image::from_pixels(size, size, solved));
        let texels = Image::from_pixels(size, size, std::mem::take(&mut estimate.texels));
        estimate.texels = dilate(&texels, &nearest).into_pixels();
    }
}
