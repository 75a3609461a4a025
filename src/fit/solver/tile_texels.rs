//! All that is unknown of a tile's texels together, once what they share is known.
//!
//! Texels that look alike share a lobe (`tile_lobes`), and what is believed of it is a mean over ways to share: where two
//! materials meet inside a pixel it lies between them, and highlights are too dull. Here each texel goes from there to
//! where its own pixels want it, as far as texels of the tile spread (`tile_spread`): diffuse reflectance, F0 and the width
//! of all texels under a pixel at once, texel by texel (`texel_system`). In its unknowns but the width a pixel is linear; in
//! the width it is taken as linear, and once more from where that led. Pixels count anew in between, by what is left of
//! them then.

use super::lobe_evidence::LobeBelief;
use super::lobe_widths::{KeptStencil, WidthStencil, log_widths};
use super::texel_system::{Part, TexelSystem};
use super::tile::{SWEEPS, Tile};
use super::tile_spread::Spread;

/// How much more pixels count here than as evidence for lobes. There what they have in common, errors of the model, would
/// otherwise be taken for other lobes; here one texel has few pixels, and F0 is held. With four times as much the specular map
/// follows the noise.
const TRUST: f64 = 5.0;
/// Times that it is solved. A third time brings pictures nearer by little, and roughness no nearer.
const PASSES: usize = 2;
/// How far the logarithm of a width may go in one sweep, and from what was believed of it: farther off its slope is another.
const WIDTH_REACH: [f64; 2] = [0.2, 0.3];
/// Half of the distance of the logarithms of widths between which slopes are taken.
const STEP: f64 = 0.02;

impl Tile {
    /// Solves all texels from what is believed of their lobes. What lobes send has to be set before, and is set anew.
    pub(super) fn solve_texels(&mut self, mean_radiance: f32, independence: f64) {
        let believed = self.lobes.clone();
        let mut spread = None;
        for _ in 0..PASSES {
            self.solve_texels_once(&believed, &mut spread, independence);
            self.set_lobes();
            self.weigh(mean_radiance);
            self.trust_highlights(mean_radiance);
        }
    }

    /// By Gauss and Seidel over the texels. How far they spread is asked where it is not known yet.
    fn solve_texels_once(&mut self, believed: &[LobeBelief], spread: &mut Option<Spread>, independence: f64) {
        let scale = TRUST * independence / self.noise;
        let leans = [0, 1, 2].map(|c| scale * f64::from(self.lean(c)));
        let parts_of = self.parts_of_texels();
        let mut left: Vec<[f32; 3]> = self.pixels.iter().map(|pixel| self.residual(pixel)).collect();
        let spread = *spread.get_or_insert_with(|| self.spread(&parts_of, &left, scale, leans));
        let start = self.rho.clone();
        let narrowest = log_widths()[0];
        for _ in 0..SWEEPS {
            for (texel, parts) in parts_of.iter().enumerate() {
                let (old_rho, old) = (self.rho[texel], self.lobes[texel].mean);
                let LobeBelief { mean, square, .. } = &believed[texel];
                let mut sums = TexelSystem::default();
                for c in 0..3 {
                    let precisions = [leans[c], 1.0 / (square[c] + spread.specular[c])];
                    sums.believe_reflectances(c, precisions, [f64::from(start[texel][c]), mean[c]]);
                }
                sums.believe_width(1.0 / (square[3] + spread.log_width), mean[3] - old[3]);
                for part in parts {
                    let weight = scale * f64::from(self.pixels[part.pixel as usize].terms.weight);
                    for c in 0..3 {
                        let terms = part.terms(c);
                        let own = f64::from(old_rho[c]) * terms.arriving + old[c] * terms.base;
                        sums.observe(weight, c, terms, f64::from(left[part.pixel as usize][c]) + own);
                    }
                }
                let [at_once, in_all] = WIDTH_REACH;
                // `max` and `min`: `clamp` would panic where what is believed is not a number.
                let log_width = (old[3] + sums.width().0.clamp(-at_once, at_once))
                    .max(mean[3] - in_all)
                    .min(mean[3] + in_all)
                    .clamp(narrowest, 0.0);
                let wider = log_width - old[3];
                self.lobes[texel].mean[3] = log_width;
                let mut more = [[0.0f32; 2]; 3];
                for (c, more) in more.iter_mut().enumerate() {
                    let [rho, specular] = sums.reflectances(c, wider);
                    *more = [rho - f64::from(old_rho[c]), specular - old[c]].map(|value| value as f32);
                    self.rho[texel][c] = rho as f32;
                    self.lobes[texel].mean[c] = specular;
                }
                for part in parts {
                    for (c, left) in left[part.pixel as usize].iter_mut().enumerate() {
                        *left -=
                            more[c][0] * part.arriving[c] + more[c][1] * part.base[c] + wider as f32 * part.slope[c];
                    }
                }
            }
        }
    }

    /// What the unknowns of each texel send to the pixels that show it, with lobes as they are.
    pub(super) fn parts_of_texels(&self) -> Vec<Vec<Part>> {
        let widths = log_widths();
        let of_texels = self.pixels_of_texels();
        let of_texel = |texel: usize| {
            let lobe = self.lobes[texel].mean;
            let mut kept = [KeptStencil::default(); 3];
            let part = |&(pixel, weight): &(u32, f32)| {
                let own = &self.pixels[pixel as usize];
                let mut stencil_at = |place: usize, off: f64| -> WidthStencil {
                    kept[place].of(&widths, lobe[3] + off, own.nodes.0..own.nodes.1)
                };
                let (middle, narrower, wider) = (stencil_at(0, 0.0), stencil_at(1, -STEP), stencil_at(2, STEP));
                let slope = |c: usize| {
                    let sent = |stencil: &WidthStencil| {
                        lobe[c] as f32 * stencil.of(&own.terms.base, c) + stencil.of(&own.terms.grazing, c)
                    };
                    weight * (sent(&wider) - sent(&narrower)) / (2.0 * STEP) as f32
                };
                Part {
                    pixel,
                    arriving: own.terms.arriving.map(|arriving| weight * arriving),
                    base: [0, 1, 2].map(|c| weight * middle.of(&own.terms.base, c)),
                    slope: [0, 1, 2].map(slope),
                }
            };
            of_texels.of(texel).iter().map(part).collect()
        };
        (0..self.texels.len()).map(of_texel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tile_lobes::tests::{TRUTH, tile};
    use super::*;

    /// Errors of what is found: diffuse reflectance, F0 and the logarithm of the width of both materials.
    fn errors(tile: &Tile) -> [[f64; 3]; 2] {
        std::array::from_fn(|texel| {
            let ((rho, specular, log_width), mean) = (TRUTH[texel], tile.lobes[texel].mean);
            [f64::from(tile.rho[texel][1] - rho), mean[1] - specular, mean[3] - log_width].map(f64::abs)
        })
    }

    #[test]
    fn what_is_believed_loosely_is_found_from_pixels_that_show_both() {
        let [paint, metal] = TRUTH;
        let between = 0.5 * (paint.1 + metal.1);
        // Both lobes are half of the way, and their widths off as well.
        let mut tile = tile([(0.3, between, paint.2 + 0.1), (0.3, between, metal.2 - 0.1)]);
        for lobe in &mut tile.lobes {
            lobe.square = [0.25; 4];
        }
        tile.noise = 1e-3;
        for _ in 0..10 {
            tile.set_lobes();
            tile.solve_texels(1.0, 0.05);
        }
        let errors = errors(&tile);
        assert!(errors.iter().flatten().all(|&error| error < 0.02), "{errors:?}");
    }

    #[test]
    fn one_step_from_what_is_believed_firmly_stays_near_it() {
        let [paint, metal] = TRUTH;
        let mut tile = tile([(0.3, 0.3, paint.2 + 0.1), (0.3, 0.3, metal.2 + 0.1)]);
        tile.noise = 10.0;
        tile.set_lobes();
        let believed: Vec<[f64; 4]> = tile.lobes.iter().map(|lobe| lobe.mean).collect();
        tile.solve_texels_once(&tile.lobes.clone(), &mut None, 0.05);
        for (lobe, believed) in tile.lobes.iter().zip(believed) {
            assert!((0..4).all(|k| (lobe.mean[k] - believed[k]).abs() < 0.02), "{lobe:?} {believed:?}");
        }
    }

    #[test]
    fn widths_stay_within_reach_whatever_pixels_say() {
        let [paint, metal] = TRUTH;
        let mut tile = tile([(0.5, 0.05, paint.2 + 0.9), (0.05, 0.6, metal.2 - 0.9)]);
        let believed: Vec<f64> = tile.lobes.iter().map(|lobe| lobe.mean[3]).collect();
        for lobe in &mut tile.lobes {
            lobe.square = [100.0; 4];
        }
        tile.noise = 1e-6;
        tile.set_lobes();
        tile.solve_texels(1.0, 1.0);
        for (lobe, believed) in tile.lobes.iter().zip(believed) {
            assert!((lobe.mean[3] - believed).abs() <= WIDTH_REACH[1] + 1e-12, "{lobe:?} {believed}");
            assert!(lobe.mean.iter().all(|value| value.is_finite()), "{lobe:?}");
        }
    }
}
