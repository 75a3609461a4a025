//! Highlights that were taken for outliers.
//!
//! Where stripes of gold and paint share a lobe it lies between them, and what gold sends beyond that is so far off that
//! the pixel hardly counts. It never tells, then, that F0 there is higher. Once lobes have their widths it can be asked
//! whether F0 alone would explain such a pixel; if so it counts.

use super::lobe_widths::{KeptStencil, log_widths};
use super::tile::{Tile, forgiven};

/// Least radiance of a lobe of F0 = 1 over that of a white diffuse surface in the same place for a highlight. Where lobes
/// are no brighter any error of the light is explained by F0, as in a deep bowl of plaster.
const LEAST_CONTRAST: f32 = 1.0;
/// How much of what is forgiven for its brightness a highlight loses. Most of what pictures gain they gain so; with all
/// of it roughness gets worse.
const NOT_FORGIVEN: f32 = 0.3;

impl Tile {
    /// Raises the weights of pixels that some F0 would explain, each with the width of its texel: all the way where
    /// errors go together as little as is allowed for, and less where they do more (`tile_independence`). What lobes send
    /// has to be set before.
    pub(super) fn trust_highlights(&mut self, mean_radiance: f32) {
        let trust = self.independence(1.0).sqrt() as f32;
        let widths = log_widths();
        let mut stencils = vec![KeptStencil::default(); self.texels.len()];
        for index in 0..self.pixels.len() {
            let residual = self.residual(&self.pixels[index]);
            let pixel = &mut self.pixels[index];
            let weighs = pixel.terms.weight > 0.0 && !pixel.clipped;
            if !weighs || pixel.withheld {
                continue;
            }
            let log_width = self.lobes[pixel.texel].mean[3];
            let stencil = stencils[pixel.texel].of(&widths, log_width, pixel.nodes.0..pixel.nodes.1);
            let terms = &mut pixel.terms;
            let is_explained = (0..3).all(|c| {
                let base = stencil.of(&terms.base, c);
                let brightest = base + stencil.of(&terms.grazing, c);
                base >= LEAST_CONTRAST * terms.arriving[c] && residual[c] + pixel.lobe[c] <= brightest
            });
            if is_explained {
                let forgiven = forgiven(&terms.radiance, mean_radiance);
                let trusted = forgiven + NOT_FORGIVEN * (1.0 - forgiven);
                terms.weight += trust * (trusted - terms.weight);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tile_lobes::tests::{TRUTH, tile};
    use super::*;

    const MEAN_RADIANCE: f32 = 1.0;

    /// A tile whose lobes are believed to be paint everywhere, and that took all of its pixels for outliers.
    fn doubted() -> Tile {
        let (diffuse, _, _) = TRUTH[0];
        let mut tile = tile([(diffuse, 0.05, -0.9), (0.05, 0.05, -0.5)]);
        tile.set_lobes();
        tile.pixels.iter_mut().for_each(|pixel| pixel.terms.weight = 0.01);
        tile
    }

    #[test]
    fn highlights_count_and_what_no_lobe_explains_does_not() {
        let mut tile = doubted();
        // Brighter than a mirror would be. Each pixel is of a view of its own, so that no errors go together.
        let beyond: Vec<usize> = (0..tile.pixels.len()).step_by(50).collect();
        for &index in &beyond {
            tile.pixels[index].terms.radiance = [1e3; 3];
        }
        tile.trust_highlights(MEAN_RADIANCE);
        let mut raised = 0;
        for (index, pixel) in tile.pixels.iter().enumerate() {
            let terms = &pixel.terms;
            let weight = terms.weight;
            if beyond.contains(&index) {
                assert_eq!(weight, 0.01, "{index}");
                continue;
            }
            let forgiven = forgiven(&terms.radiance, MEAN_RADIANCE);
            let trusted = forgiven + NOT_FORGIVEN * (1.0 - forgiven);
            assert!(weight == 0.01 || (weight - trusted).abs() < 1e-5, "{index}: {weight}, not {trusted}");
            raised += usize::from(weight > 0.01);
        }
        assert!(raised > 20, "{raised} of {}", tile.pixels.len());
    }

    #[test]
    fn where_errors_of_a_view_go_together_highlights_count_less() {
        let weights_of = |shared: bool| {
            let mut tile = doubted();
            for (index, pixel) in tile.pixels.iter_mut().enumerate() {
                let sign = if shared { pixel.view % 2 } else { index as u32 / 20 % 2 };
                pixel.view = index as u32 % 20;
                pixel.terms.weight = 0.5;
                pixel.terms.radiance = pixel.lobe;
                pixel.terms.radiance[1] += if sign == 0 { 0.01 } else { -0.01 };
            }
            tile.rho.fill([0.0; 3]);
            tile.trust_highlights(MEAN_RADIANCE);
            tile.pixels.iter().map(|pixel| pixel.terms.weight).collect::<Vec<f32>>()
        };
        // All of a view's twenty pixels, of half weight, err alike: a design effect of 10, half of the trust.
        let raised: Vec<(f32, f32)> = weights_of(false)
            .into_iter()
            .zip(weights_of(true))
            .map(|(apart, together)| (apart - 0.5, together - 0.5))
            .filter(|(apart, _)| *apart > 0.0)
            .collect();
        assert!(raised.len() > 20, "{}", raised.len());
        assert!(raised.iter().all(|(apart, together)| (together / apart - 0.5).abs() < 0.01), "{raised:?}");
    }

    #[test]
    fn lobes_no_brighter_than_white_paint_are_no_highlights() {
        let mut tile = doubted();
        tile.pixels.iter_mut().for_each(|pixel| pixel.terms.arriving = [1e3; 3]);
        tile.rho.fill([0.0; 3]);
        tile.trust_highlights(MEAN_RADIANCE);
        assert!(tile.pixels.iter().all(|pixel| pixel.terms.weight == 0.01));
    }

    #[test]
    fn pixels_without_weight_clipped_or_withheld_stay_so() {
        let mut tile = doubted();
        for (index, pixel) in tile.pixels.iter_mut().enumerate() {
            match index % 3 {
                0 => pixel.terms.weight = 0.0,
                1 => pixel.clipped = true,
                _ => pixel.withheld = true,
            }
        }
        let before: Vec<f32> = tile.pixels.iter().map(|pixel| pixel.terms.weight).collect();
        tile.trust_highlights(MEAN_RADIANCE);
        assert!(tile.pixels.iter().zip(before).all(|(pixel, before)| pixel.terms.weight == before));
    }
}
