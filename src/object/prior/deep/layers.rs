//! The layers of the net: convolution, group normalisation with a leaky ramp; each with its way back.
//!
//! Products are taken over fixed numbers of rows and summed in order: the bits do not depend on the number of threads.

use super::planes::Planes;
use crate::math::parallel;
use crate::neural::product::{Rows, multiply};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Pixels of one task, about: each has its own sum of derivatives by the weights.
const PIXELS_A_TASK: usize = 2048;
/// Pixels of one product, about: their taps, a few hundred numbers each, stay in the second cache.
const PIXELS_A_BLOCK: usize = 128;
/// Slope of the ramp below zero, as released.
const LEAK: f32 = 0.2;
/// Channels that are normalised together.
const GROUP: usize = 8;
/// Added to a variance.
const VARIANCE_FLOOR: f32 = 1e-5;

/// A convolution with 1 or 3 x 3 taps; its weights lie in a slice of `(in * taps + 1) * out` numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Convolution {
    /// Channels that come in.
    pub inputs: usize,
    /// Channels that go out.
    pub outputs: usize,
    /// Taps a side: 1 or 3.
    pub side: usize,
    /// Step between outputs: 1, or 2 with three taps.
    pub stride: usize,
}

impl Convolution {
    /// Numbers of the weights and offsets.
    pub fn weight_count(&self) -> usize {
        self.outputs * (self.columns() + 1)
    }

    /// Products a value that goes out.
    pub fn columns(&self) -> usize {
        self.inputs * self.side * self.side
    }

    /// The size that comes out of what taps read.
    fn size(&self, source: &Planes) -> (usize, usize) {
        let border = self.side - 1;
        ((source.height - border) / self.stride, (source.width - border) / self.stride)
    }

    /// What taps read: the planes, padded when there are three taps a side.
    pub fn source(&self, planes: Arc<Planes>) -> Arc<Planes> {
        if self.side == 3 { Arc::new(planes.padded()) } else { planes }
    }

    /// Stretches of output rows, one a task.
    fn tasks(&self, height: usize, width: usize) -> Vec<Range<usize>> {
        let step = (PIXELS_A_TASK / width).max(1);
        (0..height).step_by(step).map(|start| start..(start + step).min(height)).collect()
    }

    /// Lays the taps of some output rows side by side: one row a tap, one column a pixel. `source` is padded when
    /// there are three taps a side.
    fn unroll(&self, source: &Planes, first: usize, rows: usize, width: usize, columns: &mut Vec<f32>) {
        columns.clear();
        columns.reserve(self.columns() * rows * width);
        for channel in 0..self.inputs {
            let plane = source.channel(channel);
            for tap in 0..self.side * self.side {
                let (down, across) = (tap / self.side, tap % self.side);
                for row in first..first + rows {
                    let line = &plane[(row * self.stride + down) * source.width + across..];
                    if self.stride == 1 {
                        columns.extend_from_slice(&line[..width]);
                    } else {
                        columns.extend(line.iter().step_by(self.stride).take(width));
                    }
                }
            }
        }
    }

    /// The convolution of planes whose sides are multiples of the stride, given as [`Convolution::source`] makes them.
    pub fn forward(&self, weights: &[f32], source: &Planes) -> Planes {
        let (height, width) = self.size(source);
        let (matrix, offsets) = weights.split_at(self.outputs * self.columns());
        let tasks = self.tasks(height, width);
        let parts: Vec<Vec<f32>> = parallel::map_items(&tasks, |task| {
            let mut part = Vec::with_capacity(self.outputs * task.len() * width);
            let (mut columns, mut product) = (Vec::new(), Vec::new());
            for rows in blocks(task, width) {
                let pixels = rows.len() * width;
                self.unroll(source, rows.start, rows.len(), width, &mut columns);
                product.resize(self.outputs * pixels, 0.0);
                let left = Rows::new(matrix, self.outputs, self.columns());
                multiply(left, Rows::new(&columns, self.columns(), pixels), &mut product, false);
                part.extend_from_slice(&product);
            }
            part
        });
        let mut result = Planes::zeros(self.outputs, height, width);
        for (task, part) in tasks.iter().zip(&parts) {
            let mut at = 0;
            for rows in blocks(task, width) {
                let pixels = rows.len() * width;
                for output in 0..self.outputs {
                    let target = &mut result.values[output * height * width + rows.start * width..][..pixels];
                    for (value, sum) in target.iter_mut().zip(&part[at..]) {
                        *value = sum + offsets[output];
                    }
                    at += pixels;
                }
            }
        }
        result
    }

    /// Adds the derivatives by the weights to `d_weights` and returns those by the planes that came in.
    pub fn backward(&self, weights: &[f32], source: &Planes, d_result: &Planes, d_weights: &mut [f32]) -> Planes {
        let (height, width) = self.size(source);
        let matrix = &weights[..self.outputs * self.columns()];
        let turned = Rows::new(matrix, self.outputs, self.columns()).transpose();
        let tasks = self.tasks(height, width);
        let parts: Vec<(Vec<f32>, Planes)> = parallel::map_items(&tasks, |task| {
            let (mut d_part, mut columns) = (Vec::new(), Vec::new());
            let mut d_matrix = vec![0.0; matrix.len()];
            let strip_height = (task.len() - 1) * self.stride + self.side;
            let mut strip = Planes::zeros(self.inputs, strip_height, source.width);
            for rows in blocks(task, width) {
                let pixels = rows.len() * width;
                d_part.clear();
                for output in 0..self.outputs {
                    d_part.extend_from_slice(&d_result.channel(output)[rows.start * width..][..pixels]);
                }
                self.unroll(source, rows.start, rows.len(), width, &mut columns);
                let d_rows = Rows::new(&d_part, self.outputs, pixels);
                multiply(d_rows, Rows::new(&columns, self.columns(), pixels).transpose(), &mut d_matrix, true);
                // The taps are read: their place takes their derivatives.
                multiply(turned, d_rows, &mut columns, false);
                self.roll(&columns, rows.start - task.start, rows.len(), width, &mut strip);
            }
            (d_matrix, strip)
        });
        let mut d_source = Planes::zeros(self.inputs, source.height, source.width);
        let (d_matrix, d_offsets) = d_weights.split_at_mut(matrix.len());
        for (task, (d_part, strip)) in tasks.iter().zip(&parts) {
            d_matrix.iter_mut().zip(d_part).for_each(|(sum, value)| *sum += value);
            let area = d_source.area();
            for channel in 0..self.inputs {
                let target = &mut d_source.values[channel * area + task.start * self.stride * source.width..];
                target.iter_mut().zip(strip.channel(channel)).for_each(|(sum, value)| *sum += value);
            }
        }
        for (output, d_offset) in d_offsets.iter_mut().enumerate() {
            *d_offset += d_result.channel(output).iter().sum::<f32>();
        }
        if self.side == 3 { d_source.unpadded() } else { d_source }
    }

    /// The transpose of [`Convolution::unroll`]: adds to a strip of the rows that are read, from its `first` output row
    /// on.
    fn roll(&self, columns: &[f32], first: usize, rows: usize, width: usize, strip: &mut Planes) {
        let (area, line_width) = (strip.area(), strip.width);
        let mut at = 0;
        for channel in 0..self.inputs {
            let plane = &mut strip.values[channel * area..(channel + 1) * area];
            for tap in 0..self.side * self.side {
                let (down, across) = (tap / self.side, tap % self.side);
                for row in first..first + rows {
                    let line = &mut plane[(row * self.stride + down) * line_width + across..];
                    let values = &columns[at..at + width];
                    if self.stride == 1 {
                        line.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
                    } else {
                        line.iter_mut().step_by(self.stride).zip(values).for_each(|(sum, value)| *sum += value);
                    }
                    at += width;
                }
            }
        }
    }
}

/// Stretches of the rows of a task whose taps stay near the processor.
fn blocks(task: &Range<usize>, width: usize) -> impl Iterator<Item = Range<usize>> + use<> {
    let (end, step) = (task.end, (PIXELS_A_BLOCK / width).max(1));
    (task.start..end).step_by(step).map(move |start| start..(start + step).min(end))
}

/// What a normalisation leaves for its way back.
#[derive(Clone, Debug, Default)]
pub struct NormTape {
    normalised: Planes,
    inverse_deviation: Vec<f32>,
}

/// Normalises groups of channels to mean 0 and variance 1 (Wu and He 2018), scales and moves each channel by
/// `weights` (scales, then offsets), and bends what is below zero.
///
/// Unlike a batch's statistics, those of a group are defined for one picture, and for one of few pixels.
pub fn norm_forward(weights: &[f32], planes: Planes) -> (Planes, NormTape) {
    let (channels, area) = (planes.channels, planes.area());
    let (scales, offsets) = weights.split_at(channels);
    let mut normalised = planes;
    let inverse_deviation: Vec<f32> = normalised
        .values
        .par_chunks_mut(GROUP * area)
        .map(|values| {
            let count = values.len() as f64;
            let mean = sum(values, values, |value, _| value) / count;
            let variance = sum(values, values, |value, _| (value - mean) * (value - mean)) / count;
            let inverse = 1.0 / (variance as f32 + VARIANCE_FLOOR).sqrt();
            values.iter_mut().for_each(|value| *value = (*value - mean as f32) * inverse);
            inverse
        })
        .collect();
    let mut result = normalised.clone();
    parallel::each_chunk(&mut result.values, area, &|channel, values| {
        for value in values {
            let moved = *value * scales[channel] + offsets[channel];
            *value = if moved > 0.0 { moved } else { LEAK * moved };
        }
    });
    (result, NormTape { normalised, inverse_deviation })
}

/// The way back of [`norm_forward`]; `result` is what it gave.
pub fn norm_backward(
    weights: &[f32],
    tape: &NormTape,
    result: &Planes,
    mut d_result: Planes,
    d_weights: &mut [f32],
) -> Planes {
    let (channels, area) = (result.channels, result.area());
    let (d_scales, d_offsets) = d_weights.split_at_mut(channels);
    // By channel: the ramp, then scale and offset.
    let sums: Vec<(f32, f32)> = d_result
        .values
        .par_chunks_mut(area)
        .enumerate()
        .map(|(channel, values)| {
            let (outcome, own) = (result.channel(channel), tape.normalised.channel(channel));
            for (value, &outcome) in values.iter_mut().zip(outcome) {
                *value = if outcome > 0.0 { *value } else { LEAK * *value };
            }
            let by_scale = sum(values, own, |slope, own| slope * own);
            let by_offset = sum(values, own, |slope, _| slope);
            values.iter_mut().for_each(|value| *value *= weights[channel]);
            (by_scale as f32, by_offset as f32)
        })
        .collect();
    for (channel, (by_scale, by_offset)) in sums.into_iter().enumerate() {
        d_scales[channel] += by_scale;
        d_offsets[channel] += by_offset;
    }
    // By group: mean and variance move with every value.
    parallel::each_chunk(&mut d_result.values, GROUP * area, &|group, values| {
        let normalised = &tape.normalised.values[group * GROUP * area..][..values.len()];
        let count = values.len() as f64;
        let mean = sum(values, normalised, |value, _| value) / count;
        let along = sum(values, normalised, |value, own| value * own) / count;
        let inverse = tape.inverse_deviation[group];
        for (value, own) in values.iter_mut().zip(normalised) {
            *value = inverse * (*value - mean as f32 - own * along as f32);
        }
    });
    d_result
}

/// The sum of a function of pairs, in eight lanes and a fixed order.
fn sum(a: &[f32], b: &[f32], of: impl Fn(f64, f64) -> f64) -> f64 {
    let mut lanes = [0.0f64; 8];
    let (a_parts, b_parts) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest = a_parts.remainder().iter().zip(b_parts.remainder());
    let rest: f64 = rest.map(|(&a, &b)| of(f64::from(a), f64::from(b))).sum();
    for (a, b) in a_parts.zip(b_parts) {
        for lane in 0..8 {
            lanes[lane] += of(f64::from(a[lane]), f64::from(b[lane]));
        }
    }
    lanes.iter().sum::<f64>() + rest
}
