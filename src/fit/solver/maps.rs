//! Maps under the light that was found: blocks, then tiles of blocks with their lobes.

use super::choice::alternatives::TileAlternatives;
use super::choice::check::Check;
use super::estimate::{Estimate, TexelVariance, fill_from_solved};
use super::lobe_families;
use super::lobe_prior::LobePrior;
use super::lobe_tails::TailSums;
use super::lobe_tree::LobeSharing;
use super::plan::Block;
use super::report::{ErrorSums, StepReport};
use super::round::{BlockWork, Round, open_prior};
use super::scene::SolverScene;
use super::tile::{TILE, Tile};
use super::way::{Look, OnTheWay, Watch};
use crate::material::Material;
use crate::math::parallel;
use crate::math::statistics::median;
use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Most observations of a block.
const MOST_OBSERVATIONS: usize = 256;
/// Tiles that are solved before what they leave is put together, so that who watches sees them come; of each processor at
/// least so many, so that few wait.
const TILES_AT_ONCE: (usize, usize) = (32, 8);

/// What a tile leaves.
struct TileResult {
    /// Without its pixels.
    tile: Tile,
    residuals: Vec<f32>,
    errors: ErrorSums,
    tails: TailSums,
    /// With less, where that is judged.
    alternatives: Option<TileAlternatives>,
    /// Seconds of one processor until blocks were solved.
    block_seconds: f64,
}

impl SolverScene {
    /// Makes all maps; `watch` sees tiles come. `None` when `stop` was raised: the estimate is of no use then.
    pub fn make_maps(&self, estimate: &mut Estimate, stop: &AtomicBool, watch: &mut Watch) -> Option<StepReport> {
        let planes = self.transport.basis.planes(&estimate.light);
        let at_points = self.point_light(&estimate.texels, &planes);
        let round = self.round(estimate, &planes, &at_points);
        let prior = lobe_families::with_families_of(estimate);
        let mut check = Check::begin(self, &at_points, &prior);
        let mut errors = ErrorSums::new(self.views.len());
        let mut residuals = Vec::new();
        let mut made: Vec<Tile> = Vec::new();
        let mut tails = TailSums::new(self.views.len());
        let tiles = self.tiles();
        let work =
            |blocks: &[&Block]| -> usize { blocks.iter().map(|block| block.observations.min(MOST_OBSERVATIONS)).sum() };
        let whole = tiles.iter().map(|(_, blocks)| work(blocks)).sum::<usize>().max(1) as f64;
        let mut done = 0;
        let (least, of_processor) = TILES_AT_ONCE;
        for group in tiles.chunks(least.max(of_processor * rayon::current_num_threads())) {
            let results = parallel::map_items(group, |(first, blocks)| {
                self.solve_tile(&round, *first, blocks, &prior, check.as_ref(), stop)
            });
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            for result in results {
                residuals.extend(result.residuals);
                errors.merge(&result.errors);
                tails.add(&result.tails);
                if let (Some(check), Some(alternatives)) = (&mut check, result.alternatives) {
                    check.add(&alternatives, result.block_seconds, result.tile.seconds);
                }
                made.push(result.tile);
            }
            done += group.iter().map(|(_, blocks)| work(blocks)).sum::<usize>();
            let look = || {
                let mut texels = estimate.texels.clone();
                made.iter().flat_map(materials).for_each(|(texel, own)| texels[texel] = own);
                Look { texels: Cow::Owned(texels), light: Cow::Borrowed(&estimate.light) }
            };
            // What judges choices and fills the gaps comes after.
            let share = 0.95 * (done as f64 / whole).max(1e-3);
            watch(OnTheWay { look: &look, gains: &[], share, is_reached: false });
        }
        let choices = match check {
            Some(check) => Some(check.end(self, estimate, (&planes, &at_points), stop)?),
            None => None,
        };
        estimate.variances.fill(TexelVariance::default());
        for tile in &made {
            for (index, (texel, own)) in materials(tile).enumerate() {
                let lobe = &tile.lobes[index];
                let [r, g, b, log_width] = lobe.square.map(|value| value as f32);
                let variance = Material { diffuse: tile.variance[index], specular: [r, g, b], log_width };
                estimate.set(texel, own, TexelVariance { variance, lobe_cluster_size: lobe.shared as f32 });
            }
        }
        self.fill_from_neighbours(estimate);
        Some(StepReport {
            residual: median(&mut residuals),
            squared_error: errors.mean(),
            blocks: residuals.len(),
            light_unknowns: 0,
            view_errors: errors.of_views(&self.views),
            choices,
            tails: tails.tails(self.settings.independence),
            ..StepReport::default()
        })
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
        let beliefs = (lobes, LobeSharing::THOROUGH);
        tile.solve(self.settings.map_size, self.observations.mean, self.settings.independence, beliefs);
        let alternatives = check.map(|check| check.of_tile(self, &mut tile));
        let mut errors = ErrorSums::new(self.views.len());
        tile.errors().for_each(|(view, squared)| errors.add(view, squared));
        let tails = tile.tail_sums(self.views.len());
        // They are large.
        tile.drop_pixels();
        TileResult { tile, residuals, errors, tails, alternatives, block_seconds }
    }

    /// Texels without observations take the values of the nearest that has some.
    pub(super) fn fill_from_neighbours(&self, estimate: &mut Estimate) {
        fill_from_solved(&mut estimate.texels, &estimate.variances, self.settings.map_size);
    }
}

/// The texels of a tile on the maps, with what was found of each.
fn materials(tile: &Tile) -> impl Iterator<Item = (usize, Material<f32>)> + '_ {
    tile.texels.iter().zip(tile.rho.iter().zip(&tile.lobes)).map(|(&texel, (&diffuse, lobe))| {
        let specular = [0, 1, 2].map(|c| (lobe.mean[c] as f32).clamp(0.0, 1.0));
        (texel as usize, Material { diffuse, specular, log_width: lobe.mean[3].min(0.0) as f32 })
    })
}
