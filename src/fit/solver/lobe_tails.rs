//! Whether highlights reach further than the model's lobes do: a sign that the surface has lobes of another shape.
//!
//! Blinn-Phong lobes end soon; those of GGX, and of most that was measured, have long tails. Maps take the nearest lobe,
//! and nothing in their intervals tells of it. So once maps are made each pixel is asked what would change if a small
//! share of its lobe went into one three times as wide. What reflectances and the width could have done themselves is
//! taken out of that, texel by texel and tile by tile; what is left is held against the residuals, and gives the share by
//! least squares. Errors of a view go together (its camera, its gain), so views make the error of the share (White 1980,
//! with clusters), and so do the few pixels that count as independent.

use super::choice::clustered::ClusteredMean;
use super::lobe_widths::{KeptStencil, WidthStencil, log_widths};
use super::tile::{Tile, TilePixel};

/// How many times as wide as its lobe a tail is.
const TAIL: f64 = 3.0;
/// Half the difference of the logarithms of two widths, between which the derivative is taken.
const STEP: f64 = 0.1;
/// Determinants smaller than this, relative, do not tell diffuse reflectance from F0.
const LEAST_DETERMINANT: f64 = 1e-6;
/// From this share on lobes have tails. This and the next two were chosen so that no scene of the model's own lobes is told of,
/// however small its photos, and about half of the small ones with GGX are.
const LEAST_SHARE: f64 = 0.14;
/// And from so many standard errors on,
const LEAST_ERRORS: f64 = 1.45;
/// where the error is at most this: what is less sure has hardly seen a lobe that may have a tail.
const MOST_ERROR: f64 = 0.15;
/// Fewer views do not tell how they differ.
const LEAST_VIEWS: usize = 4;

/// The share of lobes that would have to be three times as wide for highlights to be as the photos show them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeTails {
    /// The share; less than zero where lobes end sooner than the model's.
    pub share: f64,
    /// Its standard error.
    pub error: f64,
}

impl LobeTails {
    /// Whether lobes have tails, as far as scenes of the model's own lobes tell, and enough to matter.
    pub fn are_there(&self) -> bool {
        self.share >= LEAST_SHARE && self.share >= LEAST_ERRORS * self.error && self.error <= MOST_ERROR
    }
}

/// What pixels say of the share, view by view: their pull on it, and how precisely they know it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TailSums(Vec<[f64; 2]>);

impl TailSums {
    /// Nothing yet, of so many views.
    pub(super) fn new(views: usize) -> Self {
        TailSums(vec![[0.0; 2]; views])
    }

    /// Adds another's, of as many views.
    pub(super) fn add(&mut self, other: &TailSums) {
        for (own, other) in self.0.iter_mut().zip(&other.0) {
            own.iter_mut().zip(other).for_each(|(own, other)| *own += other);
        }
    }

    /// The share. `None` where hardly any view sees a lobe. `independence` is the share of pixels that count as independent
    /// evidence: lobes as wide as can be have no tails, and what little they say of them is what else is wrong.
    pub(super) fn tails(&self, independence: f64) -> Option<LobeTails> {
        let mut mean = ClusteredMean::default();
        self.0.iter().for_each(|&[pull, precision]| mean.add_view(pull, precision));
        let by_pixels = 1.0 / (independence * mean.pixels()).sqrt();
        let tails = LobeTails { share: mean.mean(), error: mean.deviation().hypot(by_pixels) };
        (mean.views() >= LEAST_VIEWS && tails.share.is_finite()).then_some(tails)
    }
}

/// A channel of a pixel: what multiplies diffuse reflectance, F0, the logarithm of the width and the share of the tail, and
/// the residual.
type Regressors = [f64; 5];

/// What a texel's own reflectances leave of the last three of [`Regressors`]: of the width's, the tail's, and the residual.
type Left = [f64; 3];

/// Sums over a texel's channel: products of what multiplies (diffuse reflectance, F0) with all [`Regressors`].
#[derive(Clone, Copy, Default)]
struct Products {
    with_diffuse: Regressors,
    with_specular: Regressors,
}

impl Products {
    fn add(&mut self, weight: f64, regressors: &Regressors) {
        for (k, regressor) in regressors.iter().enumerate() {
            self.with_diffuse[k] += weight * regressors[0] * regressor;
            self.with_specular[k] += weight * regressors[1] * regressor;
        }
    }

    /// How much of (diffuse reflectance, F0) is in each of the last three; `None` where the two are not told apart.
    fn shares(&self) -> Option<[[f64; 2]; 3]> {
        let ([ee, es, ..], [_, ss, ..]) = (self.with_diffuse, self.with_specular);
        let determinant = ee * ss - es * es;
        (determinant > LEAST_DETERMINANT * ee * ss).then(|| {
            [2, 3, 4].map(|k| {
                let (e, s) = (self.with_diffuse[k], self.with_specular[k]);
                [(ss * e - es * s) / determinant, (ee * s - es * e) / determinant]
            })
        })
    }
}

/// The stencils of a texel's lobe: its width, one narrower, one wider, and its tail's.
#[derive(Clone, Copy, Default)]
struct LobeStencils([KeptStencil; 4]);

impl LobeStencils {
    fn of(&mut self, nodes: &[f64], log_width: f64, pixel: &TilePixel) -> [WidthStencil; 4] {
        let offsets = [0.0, -STEP, STEP, TAIL.ln()];
        std::array::from_fn(|k| self.0[k].of(nodes, log_width + offsets[k], pixel.nodes.0..pixel.nodes.1))
    }
}

impl Tile {
    /// What the tile's pixels say of tails, once it is solved, of so many views.
    pub(super) fn tail_sums(&self, views: usize) -> TailSums {
        let counted: Vec<&TilePixel> =
            self.pixels.iter().filter(|pixel| pixel.terms.weight > 0.0 && !pixel.clipped).collect();
        let regressors = self.tail_regressors(&counted);
        let mut products = vec![[Products::default(); 3]; self.texels.len()];
        for (pixel, channels) in counted.iter().zip(&regressors) {
            for (products, regressors) in products[pixel.texel].iter_mut().zip(channels) {
                products.add(f64::from(pixel.terms.weight), regressors);
            }
        }
        let shares: Vec<[Option<[[f64; 2]; 3]>; 3]> =
            products.iter().map(|channels| channels.map(|products| products.shares())).collect();
        let left = |pixel: &TilePixel, channels: &[Regressors; 3], c: usize| -> Option<Left> {
            let [e, s, rest @ ..] = channels[c];
            let shares = shares[pixel.texel][c]?;
            Some(std::array::from_fn(|k| rest[k] - shares[k][0] * e - shares[k][1] * s))
        };
        // One width moves in the whole tile: texels share lobes.
        let mut with_width = [0.0f64; 3];
        for (pixel, channels) in counted.iter().zip(&regressors) {
            for left in (0..3).filter_map(|c| left(pixel, channels, c)) {
                let weight = f64::from(pixel.terms.weight) * left[0];
                with_width.iter_mut().zip(left).for_each(|(sum, left)| *sum += weight * left);
            }
        }
        let [power, ..] = with_width;
        let of_width = with_width.map(|product| if power > 0.0 { product / power } else { 0.0 });
        let mut sums = TailSums::new(views);
        for (pixel, channels) in counted.iter().zip(&regressors) {
            let own = &mut sums.0[pixel.view as usize];
            let weight = f64::from(pixel.terms.weight) / self.noise;
            for [width, tail, residual] in (0..3).filter_map(|c| left(pixel, channels, c)) {
                let (tail, residual) = (tail - of_width[1] * width, residual - of_width[2] * width);
                own[0] += weight * tail * residual;
                own[1] += weight * tail * tail;
            }
        }
        sums
    }

    /// Those of pixels, with the lobe of the texel that each covers most.
    fn tail_regressors(&self, pixels: &[&TilePixel]) -> Vec<[Regressors; 3]> {
        let nodes = log_widths();
        let mut stencils = vec![LobeStencils::default(); self.texels.len()];
        let of_pixel = |pixel: &&TilePixel| {
            let mean = &self.lobes[pixel.texel].mean;
            let stencils = stencils[pixel.texel].of(&nodes, mean[3], pixel);
            let residual = self.residual(pixel);
            [0, 1, 2].map(|c| {
                let base = stencils.map(|stencil| f64::from(stencil.of(&pixel.terms.base, c)));
                let grazing = stencils.map(|stencil| f64::from(stencil.of(&pixel.terms.grazing, c)));
                let [own, narrower, wider, tail] = std::array::from_fn(|k| mean[c] * base[k] + grazing[k]);
                let of_width = (wider - narrower) / (2.0 * STEP);
                [f64::from(pixel.terms.arriving[c]), base[0], of_width, tail - own, f64::from(residual[c])]
            })
        };
        pixels.iter().map(of_pixel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tile_lobes::tests::{TRUTH, tile};
    use super::*;

    /// A tile whose pixels lie inside its texels and send `share` of their lobes three times as wide, with reflectances
    /// and widths that are a little off, seen by eight views.
    fn tile_with_tails(share: f64) -> Tile {
        let mut tile = tile(TRUTH);
        tile.noise = 1e-6;
        let nodes = log_widths();
        for pixel in &mut tile.pixels {
            let (rho, specular, log_width) = TRUTH[pixel.texel];
            pixel.view %= 8;
            // Views differ in how bright lobes are, but not in their tails.
            let bright = 1.0 + 0.1 * pixel.view as f32;
            for terms in pixel.terms.base.iter_mut().chain(&mut pixel.terms.grazing) {
                terms.iter_mut().for_each(|value| *value *= bright);
            }
            let at = |log_width: f64| WidthStencil::new(&nodes, log_width, 0..nodes.len());
            for c in 0..3 {
                let [own, tail] = [at(log_width), at(log_width + TAIL.ln())].map(|stencil| {
                    specular as f32 * stencil.of(&pixel.terms.base, c) + stencil.of(&pixel.terms.grazing, c)
                });
                pixel.terms.radiance[c] = rho * pixel.terms.arriving[c] + own + share as f32 * (tail - own);
            }
            let taps = &mut tile.taps[pixel.taps.clone()];
            taps.iter_mut().for_each(|(texel, weight)| *weight = f32::from(*texel as usize == pixel.texel));
        }
        for (texel, lobe) in tile.lobes.iter_mut().enumerate() {
            tile.rho[texel] = [TRUTH[texel].0 + 0.01; 3];
            lobe.mean[0] -= 0.01;
            lobe.mean[3] += 0.01;
        }
        tile.set_lobes();
        tile
    }

    #[test]
    fn the_share_of_tails_is_found_whatever_reflectances_and_widths_are_off_by() {
        for share in [0.0, 0.05, 0.3] {
            let tails = tile_with_tails(share).tail_sums(8).tails(0.05).unwrap();
            assert!((tails.share - share).abs() < 0.02, "{share}: {tails:?}");
            assert!(tails.error < 0.02, "{tails:?}");
            assert_eq!(tails.are_there(), share == 0.3);
        }
    }

    #[test]
    fn what_few_views_say_is_doubted() {
        // Three of eight views see tails, the others none.
        let (with, without) = (tile_with_tails(1.5), tile_with_tails(0.0));
        let mut sums = without.tail_sums(8);
        sums.0[..3].copy_from_slice(&with.tail_sums(8).0[..3]);
        let tails = sums.tails(0.05).unwrap();
        assert!(tails.share > LEAST_SHARE && tails.error > 0.4 * tails.share && !tails.are_there(), "{tails:?}");
        // Three views alone are too few to tell, and so are those that see nothing.
        let mut few = TailSums::new(8);
        few.0[..3].copy_from_slice(&sums.0[..3]);
        assert_eq!(
            (few.tails(0.05), TailSums::new(8).tails(0.05), Tile::default().tail_sums(4).tails(0.05)),
            (None, None, None)
        );
    }
}
