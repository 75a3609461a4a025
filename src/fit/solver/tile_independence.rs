//! How much of a tile's evidence is independent, as its own residuals tell.
//!
//! Light that is a little wrong, a gain, a normal: such errors are alike in all pixels of one view of a tile, and however
//! many pixels there are, they are one error. Counted as many, they are explained by lobes: on photographs whole tiles of
//! stone come out as rough metal over black beside others of the same stone that do not. By how much the mean residual of
//! a view varies more than it would if pixels were independent is the design effect (Kish 1965, Survey Sampling, section
//! 5.4); its median over tiles is below 2 where the model holds, and several times that on photographs.

use super::tile::Tile;
use std::collections::BTreeMap;

/// Design effect up to which errors go together no more than [`super::SolverSettings::independence`] allows for.
const ALLOWED_FOR: f64 = 5.0;
/// Least weight of a view's pixels to be asked, and least number of such views.
const LEAST: (f64, usize) = (1.0, 3);

/// Weighed sums over a tile's pixels of one view.
#[derive(Default)]
struct ViewSums {
    weight: f64,
    residual: [f64; 3],
    squared: f64,
}

impl Tile {
    /// The share of pixels that counts as independent evidence, at most `most`, by their residuals and weights as they are.
    ///
    /// It falls with the square of the design effect: once since so many pixels are one, and once more since what they
    /// share is a fault of the model, which pixels of other views are not free of. With the first power squares stay
    /// visible on photographs, and specular maps gain less.
    pub(super) fn independence(&self, most: f64) -> f64 {
        most * (ALLOWED_FOR / self.design_effect().max(ALLOWED_FOR)).powi(2)
    }

    /// Mean square of the views' mean residuals, relative to what it would be if pixels were independent; 1 where too few
    /// views show the tile.
    fn design_effect(&self) -> f64 {
        let mut of_views: BTreeMap<u32, ViewSums> = BTreeMap::new();
        for pixel in self.pixels.iter().filter(|pixel| !pixel.clipped) {
            let own = of_views.entry(pixel.view).or_default();
            let weight = f64::from(pixel.terms.weight);
            own.weight += weight;
            for (sum, residual) in own.residual.iter_mut().zip(self.residual(pixel)) {
                *sum += weight * f64::from(residual);
                own.squared += weight * f64::from(residual).powi(2);
            }
        }
        let asked: Vec<ViewSums> = of_views.into_values().filter(|own| own.weight > LEAST.0).collect();
        let total = |of: &dyn Fn(&ViewSums) -> f64| asked.iter().map(of).sum::<f64>();
        let squared = total(&|own| own.squared);
        if asked.len() < LEAST.1 || squared <= 0.0 {
            return 1.0;
        }
        let between = total(&|own| own.residual.iter().map(|sum| sum * sum).sum::<f64>() / own.weight);
        (between / asked.len() as f64) / (squared / total(&|own| own.weight))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tile_lobes::tests::{TRUTH, tile};
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Residuals of a standard deviation of one, of which `shared` is alike in all pixels of a view.
    fn with_errors(shared: f32) -> Tile {
        let mut tile = tile(TRUTH);
        tile.set_lobes();
        let mut random = SequentialRandom::new(5);
        let mut noise = move || 12.0f32.sqrt() * (random.next_number() - 0.5);
        let of_views: Vec<f32> = (0..20).map(|_| noise()).collect();
        for (index, pixel) in tile.pixels.iter_mut().enumerate() {
            pixel.view = index as u32 % 20;
            for radiance in &mut pixel.terms.radiance {
                *radiance += shared.sqrt() * of_views[pixel.view as usize] + (1.0 - shared).sqrt() * noise();
            }
        }
        tile
    }

    #[test]
    fn errors_that_views_share_count_less_and_others_as_much_as_before() {
        let apart = with_errors(0.0);
        assert!((apart.design_effect() - 1.0).abs() < 0.3, "{}", apart.design_effect());
        assert_eq!(apart.independence(0.05), 0.05);
        // Twenty pixels a view: a share s of the variance in common makes it 1 + 19 s.
        for shared in [0.3f32, 0.6, 1.0] {
            let together = with_errors(shared);
            let (found, expected) = (together.design_effect(), 1.0 + 19.0 * f64::from(shared));
            assert!((found / expected - 1.0).abs() < 0.3, "{shared}: {found} beside {expected}");
            let independence = together.independence(0.05);
            assert!((independence / (0.05 * (ALLOWED_FOR / found).powi(2)) - 1.0).abs() < 1e-9, "{independence}");
        }
    }

    #[test]
    fn too_few_views_and_exact_pixels_say_nothing() {
        let mut two_views = with_errors(1.0);
        two_views.pixels.retain(|pixel| pixel.view < 2);
        assert_eq!(two_views.independence(0.05), 0.05);
        let mut exact = tile(TRUTH);
        exact.pixels.iter_mut().for_each(|pixel| pixel.terms.radiance = [0.0; 3]);
        exact.rho.fill([0.0; 3]);
        assert_eq!(exact.independence(0.05), 0.05);
        assert_eq!(Tile::default().independence(0.05), 0.05);
    }
}
