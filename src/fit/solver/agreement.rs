//! Where in the atlas photos agree that one explanation is better than another: what pixels gain, by squares of texels.
//!
//! What is wrong with light, mesh and cameras goes together over the pixels of a photo, so that photos are what can be
//! counted: a square's gain is a [mean over views](ClusteredMean). A square alone has few pixels of each, and surface is
//! seldom so small, so a square is judged together with those around it.

use super::choice::clustered::ClusteredMean;
use super::pixels::Pixels;
use rayon::prelude::*;

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
    across: usize,
    views: usize,
    squares: Vec<Vec<ViewGain>>,
}

impl SquareGains {
    /// Adds up what each pixel gains, in nats, where its first texel lies in an atlas of this size.
    pub fn new(size_texels: usize, pixels: &Pixels, gain_nats: impl Fn(usize) -> f64 + Sync) -> Self {
        let (across, views) = (size_texels.div_ceil(SQUARE), pixels.views());
        let squares = (0..across).into_par_iter().flat_map_iter(|row| {
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
        Self { across, views, squares: squares.collect() }
    }

    /// The mean gain a pixel of each square with those around it, row by row; a mean without pixels where no view sees any.
    pub fn means(&self) -> Vec<ClusteredMean> {
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
            (0..self.across).map(of_square)
        };
        (0..self.across).into_par_iter().flat_map_iter(of_row).collect()
    }
}
