//! A tile of the maps: blocks that were solved one by one, put right together.
//!
//! Blocks book a pixel at the one texel it covers most. Here diffuse reflectance is solved with the footprints inside the
//! tile, pixels are relieved of what they cover of the neighbours, of their diffuse reflectance and of what their lobes
//! send, and what is left tells of the lobe of the one texel (`tile_lobes`). Where all texels begin from then on is here:
//! the descent goes on with all of them at once ([`super::descent`]).

use super::lobe_evidence::LobeBelief;
use super::lobe_prior::LobePrior;
use super::lobe_tree::LobeSharing;
use super::pixel_terms::PixelTerms;
use super::round::{BlockWork, Round};
use std::ops::Range;

/// Texels along a tile's side.
pub const TILE: usize = 32;
/// Times that reflectance and lobes are solved in turn.
const PASSES: usize = 2;
/// Sweeps of Gauss and Seidel over the reflectances of a tile.
const SWEEPS: usize = 8;
/// Residuals of bright pixels are forgiven: at the mean radiance a fifth of the noise's variance goes with the radiance.
/// With half of it highlights are too dull.
const RELATIVE_NOISE: f32 = 0.5;
/// A pixel this many times further off than the median (squared) counts half.
const TOLERANCE: f32 = 30.0;
/// Least noise, relative to the mean of the photos.
const LEAST_NOISE: f64 = 0.005;

/// A pixel of a tile.
pub(super) struct TilePixel {
    pub(super) terms: PixelTerms,
    /// First and last but one width whose terms are set.
    pub(super) nodes: (usize, usize),
    pub(super) texel: usize,
    pub(super) observation: u32,
    pub(super) view: u32,
    pub(super) clipped: bool,
    /// Where its taps lie.
    pub(super) taps: Range<usize>,
    /// What the lobes of the texels it shows send.
    pub(super) lobe: [f32; 3],
    /// How much more that is than if all of it had the lobe of its own texel.
    pub(super) beside: [f32; 3],
    /// Takes no part: it judges.
    pub(super) withheld: bool,
}

/// A tile at work.
#[derive(Default)]
pub struct Tile {
    /// Row-major texels of the maps.
    pub texels: Vec<u32>,
    /// Diffuse reflectance of the texels.
    pub rho: Vec<[f32; 3]>,
    /// What is believed of their lobes.
    pub lobes: Vec<LobeBelief>,
    /// Variance of diffuse reflectance.
    pub variance: Vec<[f32; 3]>,
    /// What would be believed of one lobe that the whole tile shares.
    pub one_lobe: LobeBelief,
    /// Seconds of one processor that sums over pixels took, and the beliefs from them.
    pub seconds: [f64; 2],
    pub(super) pixels: Vec<TilePixel>,
    /// Texels of the tile that pixels show, and their weights.
    pub(super) taps: Vec<(u32, f32)>,
    /// Place of each texel of the square in `texels`, or `u32::MAX`.
    pub(super) local: Vec<u32>,
    pub(super) noise: f64,
}

/// Part of a pixel that one texel is: what multiplies the texel's diffuse reflectance, and the pixel.
struct DiffusePart {
    arriving: [f32; 3],
    pixel: u32,
}

/// Parts of pixels, texel after texel.
struct ByTexel<P> {
    parts: Vec<P>,
    ranges: Vec<Range<u32>>,
}

impl<P> ByTexel<P> {
    /// Those of a texel.
    fn of(&self, texel: usize) -> &[P] {
        let Range { start, end } = self.ranges[texel];
        &self.parts[start as usize..end as usize]
    }
}

/// Least variance of the noise, in squared radiance.
pub(super) fn least_noise(mean_radiance: f32) -> f64 {
    (LEAST_NOISE * f64::from(mean_radiance).max(1e-6)).powi(2)
}

/// By how much the squared residual of a pixel of this radiance is forgiven for its brightness, in (0, 1].
pub(super) fn forgiven(radiance: &[f32; 3], mean_radiance: f32) -> f32 {
    let bright = RELATIVE_NOISE * (radiance[0] + radiance[1] + radiance[2]) / 3.0;
    let mean = mean_radiance.max(1e-6);
    mean * mean / (mean * mean + bright * bright)
}

impl Tile {
    /// A tile of solved blocks. `first` is the row and column of its corner in maps of `map_size` texels.
    pub fn new(
        round: &Round,
        first: (usize, usize),
        map_size: usize,
        blocks: Vec<(&super::plan::Block, BlockWork)>,
    ) -> Self {
        let mut tile = Tile { local: vec![u32::MAX; TILE * TILE], ..Tile::default() };
        let place = |texel: usize| {
            let (row, column) = ((texel / map_size).wrapping_sub(first.0), (texel % map_size).wrapping_sub(first.1));
            (row < TILE && column < TILE).then(|| row * TILE + column)
        };
        for (block, work) in &blocks {
            for &(texel, cell) in &block.texels {
                let Some(place) = place(texel as usize) else { continue };
                tile.local[place] = tile.texels.len() as u32;
                tile.texels.push(texel);
                tile.rho.push(work.solution.cells[usize::from(cell)]);
                let [a, b, c] = work.solution.specular.map(f64::from);
                let mean = [a, b, c, f64::from(work.solution.log_width)];
                tile.lobes.push(LobeBelief { mean, ..LobeBelief::default() });
            }
        }
        for (_, work) in blocks {
            for (terms, &used) in work.terms.iter().zip(&work.used) {
                let observation = &round.observations.list[used as usize];
                let Some(own) = place(observation.texel as usize).map(|place| tile.local[place]) else { continue };
                if own == u32::MAX {
                    continue;
                }
                let start = tile.taps.len();
                let view = &round.footprints[observation.view as usize];
                for &(texel, weight) in view.texels_of(&view.points[observation.point as usize]) {
                    // What lies outside counts as what the pixel covers most. What no pixel covers most begins as the
                    // texel beside it: maps may be finer than photos.
                    let inside = place(texel as usize).map_or(u32::MAX, |place| {
                        if tile.local[place] == u32::MAX {
                            tile.local[place] = tile.texels.len() as u32;
                            tile.texels.push(texel);
                            tile.rho.push(tile.rho[own as usize]);
                            tile.lobes.push(tile.lobes[own as usize]);
                        }
                        tile.local[place]
                    });
                    tile.taps.push((if inside == u32::MAX { own } else { inside }, weight));
                }
                tile.pixels.push(TilePixel {
                    terms: *terms,
                    nodes: (work.nodes.start, work.nodes.end),
                    texel: own as usize,
                    observation: used,
                    view: observation.view,
                    clipped: observation.clipped,
                    taps: start..tile.taps.len(),
                    lobe: [0.0; 3],
                    beside: [0.0; 3],
                    withheld: false,
                });
            }
        }
        tile.variance = vec![[0.0; 3]; tile.texels.len()];
        tile
    }

    /// Solves reflectances and lobes in turn, each texel by itself in the end. `independence` is the share of pixels
    /// that count as independent evidence, at most, `sharing` how lobes are shared in the end; before it is one tree.
    pub fn solve(
        &mut self,
        map_size: usize,
        mean_radiance: f32,
        independence: f64,
        (prior, sharing): (&LobePrior, LobeSharing),
    ) {
        if self.pixels.is_empty() {
            return;
        }
        for pass in 0..PASSES {
            self.set_lobes();
            self.solve_diffuse();
            self.weigh(mean_radiance);
            let trees = if pass + 1 < PASSES { 1 } else { sharing.trees };
            self.solve_lobes(map_size, self.independence(independence), (prior, LobeSharing { trees, ..sharing }));
        }
        self.end();
    }

    /// Once lobes are known: diffuse reflectance beside what they send.
    pub(super) fn end(&mut self) {
        self.set_lobes();
        self.solve_diffuse();
    }

    /// Squared residuals of the pixels that count, mean over channels, with their views.
    pub fn errors(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.pixels.iter().filter(|pixel| !pixel.clipped && pixel.terms.weight > 0.0).map(|pixel| {
            let square: f32 = self.residual(pixel).iter().map(|left| left * left).sum();
            (pixel.view as usize, f64::from(square) / 3.0)
        })
    }

    /// Frees the pixels, which are large.
    pub fn drop_pixels(&mut self) {
        self.pixels = Vec::new();
        self.taps = Vec::new();
    }

    /// Mean reflectance under a pixel.
    pub(super) fn under(&self, pixel: &TilePixel, c: usize) -> f32 {
        self.taps[pixel.taps.clone()].iter().map(|&(texel, weight)| weight * self.rho[texel as usize][c]).sum()
    }

    pub(super) fn residual(&self, pixel: &TilePixel) -> [f32; 3] {
        [0, 1, 2].map(|c| pixel.terms.radiance[c] - pixel.lobe[c] - pixel.terms.arriving[c] * self.under(pixel, c))
    }

    /// The pixels that show each texel, and how much of them it is.
    fn pixels_of_texels(&self) -> ByTexel<(u32, f32)> {
        let mut first = vec![0u32; self.texels.len() + 1];
        for &(texel, _) in &self.taps {
            first[texel as usize + 1] += 1;
        }
        for texel in 0..self.texels.len() {
            first[texel + 1] += first[texel];
        }
        let mut ranges: Vec<Range<u32>> = first[..self.texels.len()].iter().map(|&first| first..first).collect();
        let mut parts = vec![(0, 0.0); self.taps.len()];
        for (index, pixel) in self.pixels.iter().enumerate() {
            for &(texel, weight) in &self.taps[pixel.taps.clone()] {
                let range = &mut ranges[texel as usize];
                // What lies outside of the tile counts as the texel the pixel covers most, more than once perhaps.
                match parts[range.start as usize..range.end as usize].last_mut() {
                    Some(last) if last.0 == index as u32 => last.1 += weight,
                    _ => {
                        parts[range.end as usize] = (index as u32, weight);
                        range.end += 1;
                    }
                }
            }
        }
        ByTexel { parts, ranges }
    }

    /// How strongly diffuse reflectance leans on what it was, in units of the pixels' weights.
    fn lean(&self, c: usize) -> f32 {
        let power = |pixel: &TilePixel| pixel.terms.weight * pixel.terms.arriving[c] * pixel.terms.arriving[c];
        0.02 * self.pixels.iter().map(power).sum::<f32>() / self.texels.len().max(1) as f32 + 1e-12
    }

    /// Gauss and Seidel over the texels, leaning weakly on what they were.
    pub(super) fn solve_diffuse(&mut self) {
        let parts = self.diffuse_parts();
        let lean = [0, 1, 2].map(|c| self.lean(c));
        // Of each pixel what is left of its radiance, and its weight.
        let mut left: Vec<[f32; 4]> = self
            .pixels
            .iter()
            .map(|pixel| {
                let [r, g, b] = self.residual(pixel);
                [r, g, b, pixel.terms.weight]
            })
            .collect();
        let start = self.rho.clone();
        let held: Vec<[f32; 3]> = (0..start.len())
            .map(|texel| {
                parts.of(texel).iter().fold(lean, |sum, part| {
                    let weight = left[part.pixel as usize][3];
                    [0, 1, 2].map(|c| sum[c] + weight * part.arriving[c] * part.arriving[c])
                })
            })
            .collect();
        for _ in 0..SWEEPS {
            for (texel, rho) in self.rho.iter_mut().enumerate() {
                let old = *rho;
                let mut pull = [0, 1, 2].map(|c| lean[c] * (start[texel][c] - old[c]));
                for part in parts.of(texel) {
                    let left = &left[part.pixel as usize];
                    for c in 0..3 {
                        pull[c] += left[3] * part.arriving[c] * left[c];
                    }
                }
                *rho = [0, 1, 2].map(|c| (old[c] + pull[c] / held[texel][c]).clamp(0.0, 1.0));
                let moved = [0, 1, 2].map(|c| rho[c] - old[c]);
                for part in parts.of(texel) {
                    let left = &mut left[part.pixel as usize];
                    for c in 0..3 {
                        left[c] -= moved[c] * part.arriving[c];
                    }
                }
            }
        }
    }

    /// What each texel's diffuse reflectance sends to the pixels that show it, texel after texel: sweeps go over it many
    /// times, and pixels with all their terms are too large for that.
    fn diffuse_parts(&self) -> ByTexel<DiffusePart> {
        let ByTexel { parts, ranges } = self.pixels_of_texels();
        let part = |(pixel, weight): (u32, f32)| DiffusePart {
            arriving: self.pixels[pixel as usize].terms.arriving.map(|arriving| weight * arriving),
            pixel,
        };
        ByTexel { parts: parts.into_iter().map(part).collect(), ranges }
    }

    /// Weights of the pixels by how well they fit (Cauchy), and the noise.
    pub(super) fn weigh(&mut self, mean_radiance: f32) {
        let scale_of = |terms: &PixelTerms| forgiven(&terms.radiance, mean_radiance);
        let squared: Vec<f32> = self
            .pixels
            .iter()
            .map(|pixel| {
                let e = self.residual(pixel);
                scale_of(&pixel.terms) * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]) / 3.0
            })
            .collect();
        let taking_part = squared.iter().zip(&self.pixels).filter(|(_, pixel)| !pixel.withheld);
        let mut sorted: Vec<f32> = taking_part.map(|(&square, _)| square).collect();
        let least = least_noise(mean_radiance);
        let middle = sorted.len() / 2;
        if sorted.is_empty() {
            self.noise = least;
            return;
        }
        let median = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
        let (mut sum, mut count) = (0.0f64, 0.0f64);
        for index in 0..self.pixels.len() {
            let darker = self.residual(&self.pixels[index]).iter().all(|&e| e > 0.0);
            let pixel = &mut self.pixels[index];
            if pixel.withheld {
                pixel.terms.weight = 0.0;
                continue;
            }
            let robust = 1.0 / (1.0 + squared[index] / (TOLERANCE * median + least as f32));
            // A clipped pixel says nothing until the model is darker than it.
            pixel.terms.weight = if pixel.clipped && !darker { 0.0 } else { robust * scale_of(&pixel.terms) };
            if !pixel.clipped {
                sum += f64::from(robust * squared[index]);
                count += f64::from(robust);
            }
        }
        // Each texel has taken a share of the pixels' freedom.
        let freedom = (count - self.texels.len() as f64).max(0.25 * count);
        self.noise = (sum / freedom.max(1e-9)).max(least);
    }
}
