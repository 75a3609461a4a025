//! The layers of the net: convolution, group normalisation with a leaky ramp; each with its way back.
//!
//! Products are taken over fixed numbers of rows and summed in order: the bits do not depend on the number of threads.

use super::planes::Planes;
use crate::neural::product::{Rows, multiply};
use rayon::prelude::*;
use std::borrow::Cow;

/// Pixels of one product, about.
const PIXELS_A_TASK: usize = 2048;
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

    /// The size that comes out of a size.
    fn size(&self, planes: &Planes) -> (usize, usize) {
        (planes.height / self.stride, planes.width / self.stride)
    }

    /// What taps read: the planes, padded when there are three taps a side.
    fn source<'a>(&self, planes: &'a Planes) -> Cow<'a, Planes> {
        if self.side == 3 { Cow::Owned(planes.padded()) } else { Cow::Borrowed(planes) }
    }

    fn rows_a_task(&self, width: usize) -> usize {
        (PIXELS_A_TASK / width).max(1)
    }

    /// Lays the taps of some output rows side by side: one row a tap, one column a pixel. `source` is padded when
    /// there are three taps a side.
    fn unroll(&self, source: &Planes, first: usize, rows: usize, width: usize) -> Vec<f32> {
        let mut columns = Vec::with_capacity(self.columns() * rows * width);
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
        columns
    }

    /// The convolution of planes whose sides are multiples of the stride.
    pub fn forward(&self, weights: &[f32], planes: &Planes) -> Planes {
        let (height, width) = self.size(planes);
        let source = &*self.source(planes);
        let (matrix, offsets) = weights.split_at(self.outputs * self.columns());
        let rows_a_task = self.rows_a_task(width);
        let firsts: Vec<usize> = (0..height).step_by(rows_a_task).collect();
        let parts: Vec<Vec<f32>> = firsts
            .par_iter()
            .map(|&first| {
                let rows = rows_a_task.min(height - first);
                let columns = self.unroll(source, first, rows, width);
                let mut part = vec![0.0; self.outputs * rows * width];
                let left = Rows::new(matrix, self.outputs, self.columns());
                multiply(left, Rows::new(&columns, self.columns(), rows * width), &mut part, false);
                part
            })
            .collect();
        let mut result = Planes::zeros(self.outputs, height, width);
        for (&first, part) in firsts.iter().zip(&parts) {
            let length = part.len() / self.outputs;
            for output in 0..self.outputs {
                let target = &mut result.values[output * height * width + first * width..][..length];
                for (value, sum) in target.iter_mut().zip(&part[output * length..]) {
                    *value = sum + offsets[output];
                }
            }
        }
        result
    }

    /// Adds the derivatives by the weights to `d_weights` and returns those by the planes that came in.
    pub fn backward(&self, weights: &[f32], planes: &Planes, d_result: &Planes, d_weights: &mut [f32]) -> Planes {
        let (height, width) = self.size(planes);
        let source = &*self.source(planes);
        let matrix = &weights[..self.outputs * self.columns()];
        let rows_a_task = self.rows_a_task(width);
        let firsts: Vec<usize> = (0..height).step_by(rows_a_task).collect();
        let parts: Vec<(Vec<f32>, Planes)> = firsts
            .par_iter()
            .map(|&first| {
                let rows = rows_a_task.min(height - first);
                let pixels = rows * width;
                let mut d_part = Vec::with_capacity(self.outputs * pixels);
                for output in 0..self.outputs {
                    d_part.extend_from_slice(&d_result.channel(output)[first * width..first * width + pixels]);
                }
                let columns = self.unroll(source, first, rows, width);
                let d_rows = Rows::new(&d_part, self.outputs, pixels);
                let mut d_matrix = vec![0.0; matrix.len()];
                multiply(d_rows, Rows::new(&columns, self.columns(), pixels).transpose(), &mut d_matrix, false);
                let mut d_columns = columns;
                let turned = Rows::new(matrix, self.outputs, self.columns()).transpose();
                multiply(turned, d_rows, &mut d_columns, false);
                (d_matrix, self.roll(&d_columns, source, rows, width))
            })
            .collect();
        let mut d_source = Planes::zeros(self.inputs, source.height, source.width);
        let (d_matrix, d_offsets) = d_weights.split_at_mut(matrix.len());
        for (&first, (d_part, strip)) in firsts.iter().zip(&parts) {
            d_matrix.iter_mut().zip(d_part).for_each(|(sum, value)| *sum += value);
            let area = d_source.area();
            for channel in 0..self.inputs {
                let target = &mut d_source.values[channel * area + first * self.stride * source.width..];
                target.iter_mut().zip(strip.channel(channel)).for_each(|(sum, value)| *sum += value);
            }
        }
        for (output, d_offset) in d_offsets.iter_mut().enumerate() {
            *d_offset += d_result.channel(output).iter().sum::<f32>();
        }
        if self.side == 3 { d_source.unpadded() } else { d_source }
    }

    /// The transpose of [`Convolution::unroll`], into a strip of the rows it reads.
    fn roll(&self, columns: &[f32], source: &Planes, rows: usize, width: usize) -> Planes {
        let strip_height = (rows - 1) * self.stride + self.side;
        let mut strip = Planes::zeros(self.inputs, strip_height, source.width);
        let area = strip.area();
        let mut at = 0;
        for channel in 0..self.inputs {
            let plane = &mut strip.values[channel * area..(channel + 1) * area];
            for tap in 0..self.side * self.side {
                let (down, across) = (tap / self.side, tap % self.side);
                for row in 0..rows {
                    let line = &mut plane[(row * self.stride + down) * source.width + across..];
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
        strip
    }
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
pub fn norm_forward(weights: &[f32], planes: &Planes) -> (Planes, NormTape) {
    let (channels, area) = (planes.channels, planes.area());
    let (scales, offsets) = weights.split_at(channels);
    let mut normalised = planes.clone();
    let inverse_deviation: Vec<f32> = normalised
        .values
        .par_chunks_mut(GROUP * area)
        .map(|values| {
            let count = values.len() as f64;
            let mean = values.iter().map(|&value| f64::from(value)).sum::<f64>() / count;
            let variance = values.iter().map(|&value| (f64::from(value) - mean).powi(2)).sum::<f64>() / count;
            let inverse = 1.0 / (variance as f32 + VARIANCE_FLOOR).sqrt();
            values.iter_mut().for_each(|value| *value = (*value - mean as f32) * inverse);
            inverse
        })
        .collect();
    let mut result = normalised.clone();
    result.values.par_chunks_mut(area).enumerate().for_each(|(channel, values)| {
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
            let (mut by_scale, mut by_offset) = (0.0f64, 0.0f64);
            let (outcome, own) = (result.channel(channel), tape.normalised.channel(channel));
            for ((value, &outcome), &own) in values.iter_mut().zip(outcome).zip(own) {
                let slope = if outcome > 0.0 { *value } else { LEAK * *value };
                by_scale += f64::from(slope * own);
                by_offset += f64::from(slope);
                *value = slope * weights[channel];
            }
            (by_scale as f32, by_offset as f32)
        })
        .collect();
    for (channel, (by_scale, by_offset)) in sums.into_iter().enumerate() {
        d_scales[channel] += by_scale;
        d_offsets[channel] += by_offset;
    }
    // By group: mean and variance move with every value.
    d_result
        .values
        .par_chunks_mut(GROUP * area)
        .zip(tape.normalised.values.par_chunks(GROUP * area))
        .enumerate()
        .for_each(|(group, (values, normalised))| {
            let count = values.len() as f64;
            let mean = values.iter().map(|&value| f64::from(value)).sum::<f64>() / count;
            let pairs = values.iter().zip(normalised);
            let along = pairs.map(|(&value, &own)| f64::from(value) * f64::from(own)).sum::<f64>() / count;
            let inverse = tape.inverse_deviation[group];
            for (value, own) in values.iter_mut().zip(normalised) {
                *value = inverse * (*value - mean as f32 - own * along as f32);
            }
        });
    d_result
}
