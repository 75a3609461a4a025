//! Both reflectances of a tile's texels together, once their lobes are known.
//!
//! Texels that look alike share a lobe (`tile_lobes`), and what is believed of it is a mean over ways to share: where two
//! materials meet inside a pixel it lies between them, and highlights are too dull. With widths as they are a pixel is
//! linear in diffuse reflectance and F0 of all texels under it, so both are solved together here, F0 leaning on what was
//! believed as strongly as that was sure. Pictures come nearer to the photos (under the true light, the vase .0270 to
//! .0231), specular maps a little (.139 to .136).
//!
//! How far F0 may go from what the texels of a lobe share is told by the tile itself: of each texel, half of the views say
//! how far it is from that, the other half say it again, and what both agree in, over all texels, is texture; noise and
//! errors of single views are not.

use super::cell_sums::System;
use super::lobe_widths::KeptStencil;
use super::round::log_widths;
use super::tile::{SWEEPS, Tile, TilePixel};

/// How much more pixels count here than as evidence for lobes. There what they have in common, errors of the model, would
/// otherwise be taken for other lobes; here one texel has few pixels, and F0 is held. With 20 the specular map of `toys`
/// followed the noise (.077 for .075).
const TRUST: f64 = 5.0;
/// Least and most standard deviation of a texel's F0 from that of those it shares its lobe with; without evidence it is the
/// least. With the least in all tiles gilded stripes of the demo's knot are too dull (specular map .1577 for .1533), with .1
/// in all the specular map of `toys` follows the errors of the model (.0749 for .0733).
const SPECULAR_SPREAD: [f64; 2] = [0.03, 0.3];
/// Standard errors that are taken off what is found of it, in squares.
const CAUTION: f64 = 1.0;
/// Least precision of a half's F0, in one over its square, to be asked.
const LEAST_PRECISION: f64 = 1e-9;

/// Part of a pixel that one texel is: the pixel, the weight, and what multiplies F0 per channel.
struct Part {
    pixel: u32,
    weight: f32,
    base: [f32; 3],
}

impl Tile {
    /// Diffuse reflectance and F0 of all texels, by Gauss and Seidel over pairs; widths stay. What lobes send has to be set
    /// before, and is not set anew.
    pub(super) fn solve_reflectances(&mut self, independence: f64) {
        let scale = TRUST * independence / self.noise;
        let parts_of = self.parts_of_texels();
        for c in 0..3 {
            let mut left: Vec<f32> = self.pixels.iter().map(|pixel| self.residual(pixel)[c]).collect();
            let lean = scale * f64::from(self.lean(c));
            let spread_squared = self.specular_spread_squared(&parts_of, &left, [scale, lean], c);
            let believed: Vec<System> = self
                .rho
                .iter()
                .zip(&self.lobes)
                .map(|(rho, lobe)| {
                    let mut sums = System::default();
                    sums.observe(lean, 1.0, 0.0, f64::from(rho[c]));
                    sums.observe(1.0 / (lobe.square[c] + spread_squared), 0.0, 1.0, lobe.mean[c]);
                    sums
                })
                .collect();
            for _ in 0..SWEEPS {
                for (texel, parts) in parts_of.iter().enumerate() {
                    let old = [f64::from(self.rho[texel][c]), self.lobes[texel].mean[c]];
                    let mut sums = believed[texel];
                    for &Part { pixel, weight, base } in parts {
                        let terms = &self.pixels[pixel as usize].terms;
                        let (e, s) = (f64::from(weight * terms.arriving[c]), f64::from(weight * base[c]));
                        let own = f64::from(left[pixel as usize]) + old[0] * e + old[1] * s;
                        sums.observe(scale * f64::from(terms.weight), e, s, own);
                    }
                    let ([rho, specular], _) = sums.solve();
                    self.rho[texel][c] = rho as f32;
                    self.lobes[texel].mean[c] = specular;
                    let [more_diffuse, more_specular] = [rho - old[0], specular - old[1]].map(|value| value as f32);
                    for &Part { pixel, weight, base } in parts {
                        let arriving = self.pixels[pixel as usize].terms.arriving[c];
                        left[pixel as usize] -= weight * (more_diffuse * arriving + more_specular * base[c]);
                    }
                }
            }
        }
    }

    /// Variance of a texel's F0 in channel `c` from what is believed of its lobe, as two halves of the views agree in it:
    /// the mean product of what both find, weighed by how well they tell it, less what the beliefs' own doubt explains.
    fn specular_spread_squared(&self, parts_of: &[Vec<Part>], left: &[f32], [scale, lean]: [f64; 2], c: usize) -> f64 {
        let [least, most] = SPECULAR_SPREAD.map(|deviation| deviation * deviation);
        let (mut weights, mut sum) = (0.0, 0.0);
        for (parts, lobe) in parts_of.iter().zip(&self.lobes) {
            let mut halves = [System::default(); 2];
            for &Part { pixel, weight, base } in parts {
                let TilePixel { terms, view, .. } = &self.pixels[pixel as usize];
                let (e, s) = (f64::from(weight * terms.arriving[c]), f64::from(weight * base[c]));
                let half = &mut halves[(view % 2) as usize];
                half.observe(scale * f64::from(terms.weight), e, s, f64::from(left[pixel as usize]));
            }
            // Of each half how far F0 has to go, diffuse reflectance being free to follow, and how precisely it knows.
            let [(first, first_precision), (second, second_precision)] = halves.map(|half| {
                let System { ss, sy, .. } = half.without_deviation(lean);
                (sy / ss, ss)
            });
            if first_precision > LEAST_PRECISION && second_precision > LEAST_PRECISION {
                let doubt = lobe.square[c];
                let variance = |precision: f64| 1.0 / precision + doubt + least;
                let weight = 1.0 / (variance(first_precision) * variance(second_precision));
                weights += weight;
                sum += weight * (first * second - doubt);
            }
        }
        if weights > 0.0 { ((sum - CAUTION * weights.sqrt()) / weights).clamp(least, most) } else { least }
    }

    fn parts_of_texels(&self) -> Vec<Vec<Part>> {
        let widths = log_widths();
        let part = |stencil: &mut KeptStencil, texel: usize, (pixel, weight): (u32, f32)| {
            let own = &self.pixels[pixel as usize];
            let stencil = stencil.of(&widths, self.lobes[texel].mean[3], own.nodes.0..own.nodes.1);
            Part { pixel, weight, base: [0, 1, 2].map(|c| stencil.of(&own.terms.base, c)) }
        };
        let of_texels = self.pixels_of_texels();
        let of_texel = |texel: usize| {
            let mut stencil = KeptStencil::default();
            of_texels.of(texel).iter().map(|&pixel| part(&mut stencil, texel, pixel)).collect()
        };
        (0..self.texels.len()).map(of_texel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tile_lobes::tests::{TRUTH, tile};
    use super::*;

    #[test]
    fn what_is_believed_loosely_is_found_from_pixels_that_show_both() {
        let [paint, metal] = TRUTH;
        let between = 0.5 * (paint.1 + metal.1);
        let mut tile = tile([(0.3, between, paint.2), (0.3, between, metal.2)]);
        for lobe in &mut tile.lobes {
            lobe.square = [0.25; 4];
        }
        tile.noise = 1e-3;
        for _ in 0..10 {
            tile.set_lobes();
            tile.solve_reflectances(0.05);
        }
        for (texel, (diffuse, specular, _)) in TRUTH.into_iter().enumerate() {
            let found = [f64::from(tile.rho[texel][1]), tile.lobes[texel].mean[1]];
            assert!((found[0] - f64::from(diffuse)).abs() < 0.02 && (found[1] - specular).abs() < 0.02, "{found:?}");
        }
    }

    /// Texels whose F0 is off in all views alike, and texels of which each view says something else: both as far.
    #[test]
    fn texture_spreads_and_what_single_views_say_does_not() {
        let spread_of = |agrees: bool| {
            let mut tile = tile(TRUTH);
            tile.noise = 1e-4;
            tile.set_lobes();
            for pixel in &mut tile.pixels {
                let off = if agrees || pixel.view % 4 < 2 { 0.2 } else { -0.2 };
                pixel.view /= 2;
                for c in 0..3 {
                    pixel.terms.radiance[c] += off * pixel.terms.base[4][c];
                }
            }
            let parts_of = tile.parts_of_texels();
            let left: Vec<f32> = tile.pixels.iter().map(|pixel| tile.residual(pixel)[1]).collect();
            let lean = f64::from(tile.lean(1));
            tile.specular_spread_squared(&parts_of, &left, [1e4, 1e4 * lean], 1).sqrt()
        };
        assert_eq!(spread_of(false), SPECULAR_SPREAD[0]);
        let agreeing = spread_of(true);
        assert!(agreeing > 2.0 * SPECULAR_SPREAD[0] && agreeing <= SPECULAR_SPREAD[1], "{agreeing}");
        assert_eq!(Tile::default().specular_spread_squared(&[], &[], [1.0; 2], 0).sqrt(), SPECULAR_SPREAD[0]);
    }

    #[test]
    fn one_step_from_what_is_believed_firmly_stays_near_it() {
        let [paint, metal] = TRUTH;
        let mut tile = tile([(0.3, 0.3, paint.2), (0.3, 0.3, metal.2)]);
        tile.noise = 10.0;
        tile.set_lobes();
        tile.solve_reflectances(0.05);
        for lobe in &tile.lobes {
            assert!((lobe.mean[1] - 0.3).abs() < 0.02, "{lobe:?}");
        }
    }
}
