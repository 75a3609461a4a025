//! The lobes of a tile: what they send to its pixels, and what pixels tell of them.
//!
//! A pixel tells of the lobe of the one texel it covers most, once it is relieved of what the others under it send: across
//! the border of two materials gold would otherwise be fitted with the paint's highlights.

use super::lobe_evidence::LobeBelief;
use super::lobe_prior::LobePrior;
use super::lobe_sums::{LobeSumsOfGroup, WidthWeights};
use super::lobe_tree::{LobeSharing, TreeTexel, beliefs};
use super::lobe_widths::{KeptStencil, LOBE_WIDTHS, log_widths, weighed_log_widths};
use super::tile::{TILE, Tile};
use std::time::Instant;

/// What is believed of diffuse reflectance before looking: this standard deviation.
const DIFFUSE_SPREAD: f64 = 0.35;
/// Standard deviation of a texel's diffuse reflectance from that of the group that shares its lobe. With four times as
/// much dark texels go below zero in what is weighed, under lobes that are too bright.
const TEXEL_SPREAD: f64 = 0.05;
/// By how much a width that was not looked at counts as worse, per unit of its logarithm.
const UNSEEN_WIDTH: f64 = 20.0;

/// What no number of pixels tells better, since it is wrong in all of them: lobes between widths are interpolated, and
/// light reaches pixels through a cache. Standard deviations of F0 relative to itself, of F0 relative to the diffuse
/// reflectance under it, and of the logarithm of the width.
const MODEL_ERROR: [f64; 3] = [0.05, 0.01, 0.05];

impl Tile {
    /// What the lobes of the texels under each pixel send to it, as they are believed now.
    pub(super) fn set_lobes(&mut self) {
        let widths = log_widths();
        let mut stencils = vec![KeptStencil::default(); self.texels.len()];
        for pixel in &mut self.pixels {
            let mut of_texel = |texel: usize| {
                let mean = &self.lobes[texel].mean;
                let stencil = stencils[texel].of(&widths, mean[3], pixel.nodes.0..pixel.nodes.1);
                let of =
                    |c: usize| mean[c] as f32 * stencil.of(&pixel.terms.base, c) + stencil.of(&pixel.terms.grazing, c);
                [0, 1, 2].map(of)
            };
            let own = of_texel(pixel.texel);
            let mut beside = [0.0f32; 3];
            for &(texel, weight) in &self.taps[pixel.taps.clone()] {
                if texel as usize != pixel.texel {
                    let lobe = of_texel(texel as usize);
                    (0..3).for_each(|c| beside[c] += weight * (lobe[c] - own[c]));
                }
            }
            pixel.beside = beside;
            pixel.lobe = [0, 1, 2].map(|c| own[c] + beside[c]);
        }
    }

    /// What is believed of the lobes, from what is left of the pixels. `independence` is the share of pixels that count as
    /// independent evidence, `sharing` which ways of sharing lobes are looked at.
    pub(super) fn solve_lobes(
        &mut self,
        map_size: usize,
        independence: f64,
        (prior, sharing): (&LobePrior, LobeSharing),
    ) {
        let began = Instant::now();
        let scale = independence / self.noise;
        let count = self.texels.len();
        let widths = weighed_log_widths();
        let weights = WidthWeights::new();
        let integrated = log_widths();
        let mut raw = vec![LobeSumsOfGroup::default(); count];
        let mut first = vec![0usize; count];
        for pixel in &self.pixels {
            first[pixel.texel] = first[pixel.texel].max(pixel.nodes.0);
            let weight = scale * f64::from(pixel.terms.weight);
            if weight == 0.0 {
                continue;
            }
            let radiance = [0, 1, 2].map(|c| {
                let neighbours = self.under(pixel, c) - self.rho[pixel.texel][c];
                let beside = pixel.beside[c] + pixel.terms.arriving[c] * neighbours;
                pixel.terms.radiance[c] - beside
            });
            // A width that was not looked at is the narrowest that was, and worse.
            raw[pixel.texel].observe(weight, &pixel.terms, (pixel.nodes.0, &weights), radiance);
        }
        let sums: Vec<LobeSumsOfGroup> = raw
            .iter()
            .zip(&first)
            .map(|(raw, &first)| {
                let worse = widths.map(|width| UNSEEN_WIDTH * (integrated[first] - width).max(0.0));
                raw.without_deviation(1.0 / (TEXEL_SPREAD * TEXEL_SPREAD), &worse)
            })
            .collect();
        let texels: Vec<TreeTexel> = self
            .texels
            .iter()
            .zip(&self.rho)
            .map(|(&texel, &colour)| TreeTexel {
                row: (texel as usize / map_size % TILE) as u16,
                column: (texel as usize % map_size % TILE) as u16,
                colour,
            })
            .collect();
        self.seconds[0] += began.elapsed().as_secs_f64();
        let began = Instant::now();
        (self.lobes, self.one_lobe) = beliefs(&texels, &sums, TILE, &widths, (prior, sharing));
        self.seconds[1] += began.elapsed().as_secs_f64();
        for (LobeBelief { mean, square, .. }, rho) in self.lobes.iter_mut().zip(&self.rho) {
            for c in 0..3 {
                square[c] += (MODEL_ERROR[0] * mean[c]).powi(2) + (MODEL_ERROR[1] * f64::from(rho[c])).powi(2);
            }
            square[3] += MODEL_ERROR[2] * MODEL_ERROR[2];
        }
        let ridge = 1.0 / (DIFFUSE_SPREAD * DIFFUSE_SPREAD);
        for (texel, lobe) in self.lobes.iter().enumerate() {
            let node = widths.partition_point(|&width| width < lobe.mean[3]).min(LOBE_WIDTHS - 1);
            self.variance[texel] = [0, 1, 2].map(|c| {
                let (ee, es) = raw[texel].diffuse(c, node);
                (1.0 / (ee + ridge) + (es / (ee + ridge)).powi(2) * lobe.square[c]) as f32
            });
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::lobe_widths::WidthStencil;
    use super::super::pixel_terms::PixelTerms;
    use super::super::tile::TilePixel;
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Diffuse reflectance, F0 and the logarithm of the width: a paint, and a metal beside it.
    pub const TRUTH: [(f32, f64, f64); 2] = [(0.5, 0.05, -0.9), (0.05, 0.6, -0.5)];

    /// Two texels, in squares beside each other that may have lobes of their own, and pixels that show a share of the
    /// second: exact sums of what the two send.
    pub fn tile(believed: [(f32, f64, f64); 2]) -> Tile {
        let widths = log_widths();
        let mut tile = Tile { texels: vec![0, 2], ..Tile::default() };
        for (rho, specular, log_width) in believed {
            tile.rho.push([rho; 3]);
            tile.lobes.push(LobeBelief { mean: [specular, specular, specular, log_width], ..LobeBelief::default() });
        }
        tile.variance = vec![[0.0; 3]; 2];
        let mut random = SequentialRandom::new(3);
        for index in 0..400u32 {
            let share = [0.0, 0.3, 0.45, 0.55, 0.7, 1.0][index as usize % 6];
            let angle = f64::from(random.next_number());
            let lobe = |log_width: f64| {
                let width = log_width.exp();
                (0.2 * (-(angle / width).powi(2)).exp() / (width * width)) as f32
            };
            let base = widths.map(|width| [lobe(width); 3]);
            let grazing = base.map(|base| base.map(|base| 0.02 * base));
            let arriving = [0.5 + random.next_number(); 3];
            let radiance = [0, 1, 2].map(|c| {
                let of_material = |(rho, specular, log_width): (f32, f64, f64)| {
                    let stencil = WidthStencil::new(&widths, log_width, 0..widths.len());
                    rho * arriving[c] + specular as f32 * stencil.of(&base, c) + stencil.of(&grazing, c)
                };
                (1.0 - share) * of_material(TRUTH[0]) + share * of_material(TRUTH[1])
            });
            let start = tile.taps.len();
            tile.taps.extend([(0, 1.0 - share), (1, share)]);
            tile.pixels.push(TilePixel {
                terms: PixelTerms { arriving, base, grazing, radiance, cell: 0, weight: 1.0 },
                nodes: (0, widths.len()),
                texel: usize::from(share > 0.5),
                observation: index,
                view: index,
                clipped: false,
                taps: start..start + 2,
                lobe: [0.0; 3],
                beside: [0.0; 3],
                withheld: false,
            });
        }
        tile
    }

    #[test]
    fn pixels_across_a_border_send_what_both_materials_send() {
        let mut tile = tile(TRUTH);
        tile.set_lobes();
        let mut most_beside = 0.0f32;
        for pixel in &tile.pixels {
            let residual = tile.residual(pixel);
            assert!(residual.iter().all(|e| e.abs() < 1e-5), "{residual:?} of {:?}", pixel.terms.radiance);
            most_beside = most_beside.max(pixel.beside[0].abs() / pixel.terms.radiance[0]);
        }
        assert!(most_beside > 0.2, "pixels were of one material each: {most_beside}");
    }

    /// As if all of a pixel were of one material, the paint's F0 comes out as 0.19.
    #[test]
    fn a_metal_beside_paint_is_found_from_pixels_that_show_both() {
        let mut tile = tile([(0.3, 0.2, -0.7); 2]);
        for _ in 0..3 {
            tile.solve(TILE, 1.0, 1.0, (&LobePrior::default(), LobeSharing::QUICK));
        }
        for (texel, (rho, specular, log_width)) in TRUTH.into_iter().enumerate() {
            let (found, lobe) = (tile.rho[texel], tile.lobes[texel].mean);
            println!("texel {texel}: diffuse {found:?}, lobe {lobe:?}");
            assert!((found[0] - rho).abs() < 0.02 && (lobe[0] - specular).abs() < 0.04, "{texel}: {found:?} {lobe:?}");
            assert!((lobe[3] - log_width).abs() < 0.1, "{texel}: {lobe:?}");
        }
    }
}
