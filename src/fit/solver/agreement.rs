//! Where in the atlas photos agree that one explanation is better than another: what pixels gain, by squares of texels.
//!
//! What is wrong with light, mesh and cameras goes together over the pixels of a photo, so that photos are what can be
//! counted: a square's gain is a [mean over views](ClusteredMean). A square alone has few pixels of each, and surface is
//! seldom so small, so a square is judged together with those around it.

use super::choice::clustered::ClusteredMean;
use super::pixels::Pixels;
use crate::math::parallel;

/// Texels along the side of a square.
pub const SQUARE: usize = 8;
/// Squares to each side that a square is judged with.
const REACH: usize = 1;

/// What the pixels of a view gain within a square.
#[derive(Clone, Copy)]
struct ViewGain {
    view: u32,
    pixels: u32,
    nats: f64,
}

/// Gains by squares, row by row of the atlas.
pub struct SquareGains {
    size_texels: usize,
    across: usize,
    views: usize,
    squares: Vec<Vec<ViewGain>>,
}

impl SquareGains {
    /// Adds up what each pixel gains, in nats, where its first texel lies in an atlas of this size.
    pub fn new(size_texels: usize, pixels: &Pixels, gain_nats: impl Fn(usize) -> f64 + Sync) -> Self {
        let (across, views) = (size_texels.div_ceil(SQUARE), pixels.views());
        let squares = parallel::map(across, |row| {
            let mut sums = vec![(0u32, 0.0f64); across * views];
            for pixel in
                pixels.of_texels(row * SQUARE * size_texels..((row + 1) * SQUARE).min(size_texels) * size_texels)
            {
                let square = pixels.texel(pixel) as usize % size_texels / SQUARE;
                let (count, nats) = &mut sums[square * views + pixels.pixel(pixel).view as usize];
                *count += 1;
                *nats += gain_nats(pixel);
            }
            let of_square = |sums: &[(u32, f64)]| -> Vec<ViewGain> {
                let seen = sums.iter().enumerate().filter(|(_, (pixels, _))| *pixels > 0);
                seen.map(|(view, &(pixels, nats))| ViewGain { view: view as u32, pixels, nats }).collect()
            };
            sums.chunks(views.max(1)).map(of_square).collect::<Vec<_>>()
        });
        Self { size_texels, across, views, squares: squares.into_iter().flatten().collect() }
    }

    /// The texels of squares whose mean gain is one of these.
    pub fn texels_where(&self, is_chosen: impl Fn(&ClusteredMean) -> bool) -> Vec<bool> {
        let squares: Vec<bool> = self.means().iter().map(is_chosen).collect();
        let (size, across) = (self.size_texels, self.across);
        (0..size * size).map(|texel| squares[texel / size / SQUARE * across + texel % size / SQUARE]).collect()
    }

    /// The mean gain a pixel of each square with those around it, row by row; a mean without pixels where no view sees any.
    fn means(&self) -> Vec<ClusteredMean> {
        let reach = |middle: usize| middle.saturating_sub(REACH)..(middle + REACH + 1).min(self.across);
        let of_row = |row: usize| {
            let mut sums = vec![(0u32, 0.0f64); self.views];
            let of_square = move |column: usize| {
                sums.fill((0, 0.0));
                let around = reach(row).flat_map(|row| reach(column).map(move |column| row * self.across + column));
                for own in around.flat_map(|square| &self.squares[square]) {
                    let (pixels, nats) = &mut sums[own.view as usize];
                    *pixels += own.pixels;
                    *nats += own.nats;
                }
                let mut mean = ClusteredMean::default();
                sums.iter().for_each(|&(pixels, nats)| mean.add_view(nats, f64::from(pixels)));
                mean
            };
            (0..self.across).map(of_square).collect::<Vec<_>>()
        };
        parallel::map(self.across, of_row).concat()
    }
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::super::refine::tests::{SIZE, photographed};
    use super::super::solver::Solver;
    use super::*;

    #[test]
    fn a_square_is_judged_by_the_pixels_of_those_around_it() {
        let (solver, _) = photographed(|_| [1.0; 3]);
        let Solver { scene, .. } = &solver;
        let pixels = Pixels::of(scene);
        let across = SIZE.div_ceil(SQUARE);
        let mut count = vec![0.0; across * across];
        for pixel in 0..pixels.count() {
            let texel = pixels.texel(pixel) as usize;
            count[texel / SIZE / SQUARE * across + texel % SIZE / SQUARE] += 1.0;
        }
        let gains = SquareGains::new(SIZE, &pixels, |pixel| f64::from(pixels.pixel(pixel).view));
        for (square, mean) in gains.means().iter().enumerate() {
            let near = |other: &usize| {
                (other / across).abs_diff(square / across) <= 1 && (other % across).abs_diff(square % across) <= 1
            };
            let around: f64 = (0..across * across).filter(near).map(|other| count[other]).sum();
            assert_eq!(mean.pixels(), around);
            assert!(mean.mean() <= (pixels.views() - 1) as f64 && mean.views() <= pixels.views());
        }
        let seen = gains.texels_where(|mean| mean.pixels() > 0.0);
        assert!((0..pixels.count()).all(|pixel| seen[pixels.texel(pixel) as usize]));
        assert!(gains.texels_where(|_| false).iter().all(|chosen| !chosen));
    }
}
