//! Both reflectances of a tile's texels together, once their lobes are known.
//!
//! Texels that look alike share a lobe (`tile_lobes`), and what is believed of it is a mean over ways to share: where two
//! materials meet inside a pixel it lies between them, and highlights are too dull. With widths as they are a pixel is
//! linear in diffuse reflectance and F0 of all texels under it, so both are solved together here, F0 leaning on what was
//! believed as strongly as that was sure. Pictures come nearer to the photos (under the true light, the vase .0270 to
//! .0231), specular maps a little (.139 to .136).

use super::cell_sums::System;
use super::lobe_widths::KeptStencil;
use super::round::log_widths;
use super::tile::{SWEEPS, Tile};

/// How much more pixels count here than as evidence for lobes. There what they have in common, errors of the model, would
/// otherwise be taken for other lobes; here one texel has few pixels, and F0 is held. With 20 the specular map of `toys`
/// followed the noise (.077 for .075).
const TRUST: f64 = 5.0;
/// Standard deviation of a texel's F0 from that of those it shares its lobe with.
const SPECULAR_SPREAD: f64 = 0.03;

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
            let believed: Vec<System> = self
                .rho
                .iter()
                .zip(&self.lobes)
                .map(|(rho, lobe)| {
                    let mut sums = System::default();
                    sums.observe(lean, 1.0, 0.0, f64::from(rho[c]));
                    sums.observe(1.0 / (lobe.square[c] + SPECULAR_SPREAD * SPECULAR_SPREAD), 0.0, 1.0, lobe.mean[c]);
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
