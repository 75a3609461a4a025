//! By how much a photo is shifted and rolled against the model's picture.
//!
//! Gauss and Newton on `photo(x) = model(x - d(x))` with `d` a shift and a turn about the centre of the picture (Lucas and
//! Kanade 1981), from wide to narrow smoothing. In each block of pixels a constant and a factor of the model are free, so
//! that shading which the model gets a little wrong, or a background that is brighter than its own, moves nothing. Weights
//! are Huber's. Gradients are of two pictures with independent noise, and their products are taken across the two: noise
//! in a gradient would make every shift too small. The standard error is the jackknife's over blocks (Efron 1982):
//! residuals of neighbouring pixels go together, so pixels are not independent and blocks nearly are.

use super::smooth::smoothed;
use crate::image::{Image, RgbImage};
use crate::math::statistics::deviation_of_triples;
use glam::{DMat3, DVec3, Vec3};

/// Width and height of a block in pixels.
pub const BLOCK: usize = 8;
/// Pixels that a block needs.
const FEWEST_PIXELS: usize = 16;
/// Blocks that a figure needs.
pub const FEWEST_BLOCKS: usize = 8;
/// Standard deviation in pixels of the smoothing, and how many steps are done with it.
const LEVELS: [(f32, usize); 3] = [(2.0, 4), (1.4, 3), (0.8, 4)];
/// Longest step in pixels.
const LONGEST_STEP: f64 = 1.5;
/// A shift beyond this many pixels is not believed: what is compared would not be the same place.
const LONGEST_SHIFT: f64 = 12.0;
/// Where Huber's weight begins to fall, in standard deviations (95 % efficient for normal noise).
const HUBER: f64 = 1.345;

/// How a photo lies against the model's picture, with standard errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shift {
    /// Right and down in pixels: where the photo shows what the model shows at the centre.
    pub pixels: [f64; 2],
    /// Standard error of each.
    pub pixels_error: [f64; 2],
    /// Turn of the photo, clockwise as seen, in radians.
    pub roll_radians: f64,
    /// Its standard error.
    pub roll_error_radians: f64,
    /// Half of the picture's diagonal in pixels: how far the corners move for a roll of 1.
    pub corner_pixels: f64,
    /// Which share of what photo and picture differ by, squared, the shift and the roll explain: 1 is all. Small where the
    /// model misses something else.
    pub explained: f64,
}

impl Shift {
    /// No shift at all, for pictures of this size.
    fn zero(width: usize, height: usize) -> Self {
        Shift {
            pixels: [0.0; 2],
            pixels_error: [f64::NAN; 2],
            roll_radians: 0.0,
            roll_error_radians: f64::NAN,
            corner_pixels: 0.5 * ((width * width + height * height) as f64).sqrt(),
            explained: 0.0,
        }
    }

    /// Length of the shift in pixels, and its standard error.
    pub fn length(&self) -> (f64, f64) {
        let [x, y] = self.pixels;
        let length = x.hypot(y);
        let error = if length > 0.0 {
            (x * self.pixels_error[0] / length).hypot(y * self.pixels_error[1] / length)
        } else {
            self.pixels_error[0].hypot(self.pixels_error[1])
        };
        (length, error)
    }

    /// How far the corners of the picture move by the roll, in pixels, and the standard error of that.
    pub fn roll_pixels(&self) -> (f64, f64) {
        (self.roll_radians.abs() * self.corner_pixels, self.roll_error_radians * self.corner_pixels)
    }

    /// The shift at a place, in pixels right and down; the place is given from the centre.
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        (self.pixels[0] - self.roll_radians * y, self.pixels[1] + self.roll_radians * x)
    }

    /// The model's picture as it looks from where the photo was taken.
    pub fn moved(&self, picture: &RgbImage) -> RgbImage {
        let (width, height) = (picture.width(), picture.height());
        let (centre_x, centre_y) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
        Image::from_fn(width, height, |row, column| {
            let (x, y) = self.at(column as f64 - centre_x, row as f64 - centre_y);
            bilinear(picture, (column as f64 - x) as f32, (row as f64 - y) as f32)
        })
    }
}

/// The value at a place between pixel centres, held at the border.
fn bilinear(picture: &RgbImage, x: f32, y: f32) -> Vec3 {
    let x = x.clamp(0.0, picture.width() as f32 - 1.0);
    let y = y.clamp(0.0, picture.height() as f32 - 1.0);
    let (column, row) = (x as usize, y as usize);
    let (right, below) = ((column + 1).min(picture.width() - 1), (row + 1).min(picture.height() - 1));
    let (u, v) = (x - column as f32, y - row as f32);
    let upper = picture[(row, column)].lerp(picture[(row, right)], u);
    upper.lerp(picture[(below, column)].lerp(picture[(below, right)], u), v)
}

/// Normal equations of one block.
#[derive(Clone, Copy)]
struct BlockSums {
    matrix: DMat3,
    side: DVec3,
    /// Weighted sum of squared residuals.
    energy: f64,
}

/// How `photo` lies against the model's picture, given twice with independent noise. Only pixels of `valid` count. All
/// have one size, values are of a bounded range, such as [0, 1). `None` where fewer than eight blocks say something, or
/// the pictures are too unlike.
pub fn shift_between(photo: &RgbImage, halves: [&RgbImage; 2], valid: &Image<bool>) -> Option<Shift> {
    let (width, height) = (photo.width(), photo.height());
    let mut shift = Shift::zero(width, height);
    let mut weights = vec![1.0; width * height];
    let mut blocks = Vec::new();
    for (sigma, steps) in LEVELS {
        let photo = smoothed(photo, valid, sigma);
        let halves = halves.map(|half| smoothed(half, valid, sigma));
        for _ in 0..steps {
            let moved = halves.each_ref().map(|half| shift.moved(half));
            blocks = sums_of_blocks(&photo, &moved, valid, &mut weights, shift.corner_pixels);
            if blocks.len() < FEWEST_BLOCKS {
                return None;
            }
            let step = solve(&blocks, None)?;
            let length = step.length();
            let step = if length > LONGEST_STEP { step * (LONGEST_STEP / length) } else { step };
            shift.pixels[0] += step.x;
            shift.pixels[1] += step.y;
            shift.roll_radians += step.z / shift.corner_pixels;
        }
    }
    shift.explained = explained_by(&shift, photo, halves, valid, &weights);
    // The last step once more with each block left out.
    let count = blocks.len() as f64;
    let without: Vec<DVec3> = (0..blocks.len()).filter_map(|block| solve(&blocks, Some(block))).collect();
    let mean = without.iter().sum::<DVec3>() / without.len().max(1) as f64;
    let squares = without.iter().map(|step| (*step - mean) * (*step - mean)).sum::<DVec3>();
    let error = (squares * ((count - 1.0) / count)).to_array().map(f64::sqrt);
    shift.pixels_error = [error[0], error[1]];
    shift.roll_error_radians = error[2] / shift.corner_pixels;
    let believed =
        without.len() == blocks.len() && shift.length().0 < LONGEST_SHIFT && error.iter().all(|e| e.is_finite());
    believed.then_some(shift)
}

/// Which share of the squared differences a shift explains, at the narrowest smoothing.
fn explained_by(shift: &Shift, photo: &RgbImage, halves: [&RgbImage; 2], valid: &Image<bool>, weights: &[f64]) -> f64 {
    let sigma = LEVELS[LEVELS.len() - 1].0;
    let photo = smoothed(photo, valid, sigma);
    let halves = halves.map(|half| smoothed(half, valid, sigma));
    let energy = |halves: &[RgbImage; 2]| {
        let blocks = sums_of_blocks(&photo, halves, valid, &mut weights.to_vec(), shift.corner_pixels);
        blocks.iter().map(|block| block.energy).sum::<f64>()
    };
    let (before, after) = (energy(&halves), energy(&halves.each_ref().map(|half| shift.moved(half))));
    if before > 0.0 { 1.0 - after / before } else { 0.0 }
}

/// The step that the blocks ask for, of all of them or of all but one: right, down, and the roll as pixels at the corners.
fn solve(blocks: &[BlockSums], without: Option<usize>) -> Option<DVec3> {
    let (mut matrix, mut side) = (DMat3::ZERO, DVec3::ZERO);
    for (_, block) in blocks.iter().enumerate().filter(|(index, _)| Some(*index) != without) {
        matrix += block.matrix;
        side += block.side;
    }
    let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
    // A direction that no edge crosses stays where it is.
    matrix += DMat3::from_diagonal(DVec3::splat(1e-4 * trace));
    let is_definite = matrix.x_axis.x > 0.0
        && matrix.x_axis.x * matrix.y_axis.y > matrix.x_axis.y * matrix.y_axis.x
        && matrix.determinant() > 0.0;
    let step = if is_definite { matrix.inverse() * side } else { DVec3::NAN };
    step.is_finite().then_some(step)
}

/// One pixel and channel of a block: residual, derivatives of both halves by the three unknowns, the model's value.
struct Entry {
    weight: f64,
    /// Residual, three derivatives of the first half, three of the second.
    columns: [f64; 7],
    model: f64,
    pixel: usize,
}

/// Sums of all blocks with enough pixels, in the order of rows; `weights` are renewed for the next step.
fn sums_of_blocks(
    photo: &RgbImage,
    moved: &[RgbImage; 2],
    valid: &Image<bool>,
    weights: &mut [f64],
    corner_pixels: f64,
) -> Vec<BlockSums> {
    let (width, height) = (photo.width(), photo.height());
    let mut blocks = Vec::new();
    let mut residual = vec![f64::NAN; width * height];
    let mut entries: Vec<Entry> = Vec::new();
    for top in (1..height.saturating_sub(1)).step_by(BLOCK) {
        for left in (1..width.saturating_sub(1)).step_by(BLOCK) {
            let mut block = BlockSums { matrix: DMat3::ZERO, side: DVec3::ZERO, energy: 0.0 };
            let mut is_full = false;
            for channel in 0..3 {
                entries.clear();
                for row in top..(top + BLOCK).min(height - 1) {
                    for column in left..(left + BLOCK).min(width - 1) {
                        if valid[(row, column)] {
                            let pixel = row * width + column;
                            entries.push(entry(photo, moved, (row, column), channel, weights[pixel], corner_pixels));
                        }
                    }
                }
                if entries.len() < FEWEST_PIXELS {
                    break;
                }
                is_full = true;
                take_out_level_and_factor(&mut entries);
                for Entry { weight, columns: [rest, a, b, c, d, e, f], pixel, .. } in &entries {
                    let (first, second) = (DVec3::new(*a, *b, *c), DVec3::new(*d, *e, *f));
                    let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
                    block.matrix += 0.5 * *weight * (outer(first, second) + outer(second, first));
                    block.side += 0.5 * *weight * *rest * (first + second);
                    block.energy += weight * rest * rest;
                    let so_far = if residual[*pixel].is_nan() { 0.0 } else { residual[*pixel] };
                    residual[*pixel] = so_far + rest * rest;
                }
            }
            if is_full {
                blocks.push(block);
            }
        }
    }
    let sizes: Vec<f64> = residual.iter().filter(|square| !square.is_nan()).map(|square| square.sqrt()).collect();
    let knee = HUBER * deviation_of_triples(&sizes);
    for (weight, square) in weights.iter_mut().zip(&residual) {
        let size = square.sqrt();
        *weight = if size > knee { knee / size } else { 1.0 };
    }
    blocks
}

fn entry(
    photo: &RgbImage,
    moved: &[RgbImage; 2],
    (row, column): (usize, usize),
    channel: usize,
    weight: f64,
    corner_pixels: f64,
) -> Entry {
    let [first, second] = moved;
    let value = |picture: &RgbImage, row: usize, column: usize| f64::from(picture[(row, column)][channel]);
    let x = (column as f64 - 0.5 * (photo.width() as f64 - 1.0)) / corner_pixels;
    let y = (row as f64 - 0.5 * (photo.height() as f64 - 1.0)) / corner_pixels;
    // The picture moves against its gradient.
    let derivatives = |picture: &RgbImage| {
        let right = 0.5 * (value(picture, row, column + 1) - value(picture, row, column - 1));
        let down = 0.5 * (value(picture, row + 1, column) - value(picture, row - 1, column));
        [-right, -down, y * right - x * down]
    };
    let model = 0.5 * (value(first, row, column) + value(second, row, column));
    let [a, b, c] = derivatives(first);
    let [d, e, f] = derivatives(second);
    let columns = [value(photo, row, column) - model, a, b, c, d, e, f];
    Entry { weight, columns, model, pixel: row * photo.width() + column }
}

/// Takes out of every column what a constant and a factor of the model explain.
fn take_out_level_and_factor(entries: &mut [Entry]) {
    let total: f64 = entries.iter().map(|entry| entry.weight).sum();
    let mean_of = |pick: &dyn Fn(&Entry) -> f64, entries: &[Entry]| {
        entries.iter().map(|entry| entry.weight * pick(entry)).sum::<f64>() / total
    };
    let mean = mean_of(&|entry| entry.model, entries);
    let variance = mean_of(&|entry| (entry.model - mean) * (entry.model - mean), entries);
    for column in 0..7 {
        let level = mean_of(&|entry| entry.columns[column], entries);
        let slope = mean_of(&|entry| entry.columns[column] * (entry.model - mean), entries) / variance.max(1e-9);
        for entry in entries.iter_mut() {
            entry.columns[column] -= level + slope * (entry.model - mean);
        }
    }
}

#[cfg(test)]
mod tests;
