//! How far a texel's F0 and width may go from what the texels of a lobe share, as the tile itself tells it.
//!
//! Of each texel half of the views say how far it is from what is shared, and the other half say it again. What both agree
//! in, over all texels, is texture; noise and errors of single views are not.

use super::texel_system::{Part, TexelSystem};
use super::tile::Tile;

/// Least and most standard deviation of a texel's F0 from that of those it shares its lobe with; without evidence it is the
/// least. With the least in all tiles fine stripes of metal are too dull; with three times as much in all of them the specular
/// map follows the errors of the model.
const OF_SPECULAR: [f64; 2] = [0.03, 0.3];
/// The same of the logarithm of the width. With more in all tiles the roughness is further off, and its stated intervals hold
/// the truth too seldom.
const OF_WIDTH: [f64; 2] = [0.03, 0.3];
/// Standard errors that are taken off what is found of it, in squares.
const CAUTION: f64 = 1.0;
/// Least precision of what a half says, in one over its square, to be asked.
const LEAST_PRECISION: f64 = 1e-9;

/// Variances of texels from what is believed of their lobes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    /// Of F0, per channel.
    pub(super) specular: [f64; 3],
    /// Of the logarithm of the width.
    pub(super) log_width: f64,
}

/// What two halves of the views agree in, summed over texels.
struct Agreement {
    least_and_most: [f64; 2],
    weights: f64,
    sum: f64,
}

impl Agreement {
    /// Between these standard deviations.
    fn within(deviations: [f64; 2]) -> Self {
        Agreement { least_and_most: deviations.map(|deviation| deviation * deviation), weights: 0.0, sum: 0.0 }
    }

    /// Adds what both halves say of a texel, each with its precision. `doubt` is the variance of what is believed of it.
    fn add(&mut self, halves: [(f64, f64); 2], doubt: f64) {
        if halves.iter().any(|&(_, precision)| precision <= LEAST_PRECISION) {
            return;
        }
        let variance = |precision: f64| 1.0 / precision + doubt + self.least_and_most[0];
        let [(first, first_precision), (second, second_precision)] = halves;
        let weight = 1.0 / (variance(first_precision) * variance(second_precision));
        self.weights += weight;
        self.sum += weight * (first * second - doubt);
    }

    /// The mean product of what both find, weighed by how well they tell it, less what the beliefs' own doubt explains.
    fn variance(&self) -> f64 {
        let [least, most] = self.least_and_most;
        let Agreement { weights, sum, .. } = *self;
        if weights > 0.0 { ((sum - CAUTION * weights.sqrt()) / weights).clamp(least, most) } else { least }
    }
}

impl Tile {
    /// How far the texels of the tile spread. `left` is what is left of its pixels, `scale` how much their weights count,
    /// `leans` how strongly each channel's diffuse reflectance leans on what it is.
    pub(super) fn spread(&self, parts_of: &[Vec<Part>], left: &[[f32; 3]], scale: f64, leans: [f64; 3]) -> Spread {
        let halves_of = |parts: &Vec<Part>| {
            let mut halves = [TexelSystem::default(); 2];
            for part in parts {
                let pixel = &self.pixels[part.pixel as usize];
                let half = &mut halves[(pixel.view % 2) as usize];
                for (c, &left) in left[part.pixel as usize].iter().enumerate() {
                    half.observe(scale * f64::from(pixel.terms.weight), c, part.terms(c), f64::from(left));
                }
            }
            halves
        };
        let mut halves: Vec<[TexelSystem; 2]> = parts_of.iter().map(halves_of).collect();
        // How far F0 has to go, diffuse reflectance being free to follow.
        let mut specular = [(); 3].map(|()| Agreement::within(OF_SPECULAR));
        for (halves, lobe) in halves.iter().zip(&self.lobes) {
            for (c, agreement) in specular.iter_mut().enumerate() {
                let of_half = |half: &TexelSystem| {
                    let sums = half.channels[c].without_deviation(leans[c]);
                    (sums.sy / sums.ss, sums.ss)
                };
                agreement.add([of_half(&halves[0]), of_half(&halves[1])], lobe.square[c]);
            }
        }
        let specular = specular.map(|agreement| agreement.variance());
        // How far the width has to go, both reflectances being free to follow as far as they may.
        let mut log_width = Agreement::within(OF_WIDTH);
        for (halves, lobe) in halves.iter_mut().zip(&self.lobes) {
            let of_half = |half: &mut TexelSystem| {
                for c in 0..3 {
                    half.believe_reflectances(c, [leans[c], 1.0 / (lobe.square[c] + specular[c])], [0.0; 2]);
                }
                half.width()
            };
            let [first, second] = halves;
            log_width.add([of_half(first), of_half(second)], lobe.square[3]);
        }
        Spread { specular, log_width: log_width.variance() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pixel_terms::PixelTerms;
    use super::super::tile_lobes::tests::{TRUTH, tile};
    use super::*;

    fn spread_of(tile: &Tile) -> Spread {
        let left: Vec<[f32; 3]> = tile.pixels.iter().map(|pixel| tile.residual(pixel)).collect();
        let leans = [0, 1, 2].map(|c| 1e4 * f64::from(tile.lean(c)));
        tile.spread(&tile.parts_of_texels(), &left, 1e4, leans)
    }

    /// The tile of two materials, with what `more` adds to the radiance of a pixel for the sign of its view: the same in all
    /// views, or one in two views and the other in the next two.
    fn off_by(agrees: bool, more: impl Fn(&PixelTerms) -> [f32; 3]) -> Tile {
        let mut tile = tile(TRUTH);
        tile.noise = 1e-4;
        tile.set_lobes();
        for pixel in &mut tile.pixels {
            let sign = if agrees || pixel.view % 4 < 2 { 1.0 } else { -1.0 };
            pixel.view /= 2;
            let more = more(&pixel.terms);
            (0..3).for_each(|c| pixel.terms.radiance[c] += sign * more[c]);
        }
        tile
    }

    /// The variance is the least unless views agree, and then well above it.
    fn assert_agreement_counts([least, most]: [f64; 2], variance: impl Fn(bool) -> f64) {
        assert!((variance(false).sqrt() - least).abs() < 1e-12);
        let agreeing = variance(true).sqrt();
        assert!(agreeing > 2.0 * least && agreeing <= most, "{agreeing}");
    }

    /// Texels whose F0 is off in all views alike, and texels of which each view says something else: both as far.
    #[test]
    fn texture_spreads_and_what_single_views_say_does_not() {
        let brighter = |terms: &PixelTerms| terms.base[4].map(|base| 0.2 * base);
        assert_agreement_counts(OF_SPECULAR, |agrees| spread_of(&off_by(agrees, brighter)).specular[1]);
    }

    #[test]
    fn widths_that_all_views_say_spread_as_well() {
        // A lobe of the same F0 that is wider than is believed.
        let wider = |terms: &PixelTerms| [1; 3].map(|c: usize| terms.base[6][c] - terms.base[5][c]);
        assert_agreement_counts(OF_WIDTH, |agrees| spread_of(&off_by(agrees, wider)).log_width);
    }

    #[test]
    fn no_texels_spread_as_little_as_can_be() {
        let spread = Tile::default().spread(&[], &[], 1.0, [1.0; 3]);
        let [specular, log_width] = [OF_SPECULAR, OF_WIDTH].map(|[least, _]| least * least);
        assert_eq!(spread, Spread { specular: [specular; 3], log_width });
    }
}
