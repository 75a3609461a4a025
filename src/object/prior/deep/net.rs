//! The net: an hourglass with skips, made for maps of light.
//!
//! Chen, Nobuhara and Nishino 2020, section 5, with the shape of what they released (the "skip" net of Ulyanov,
//! Vedaldi and Lempitsky 2018): strided convolutions down, bilinear doubling up, 1 x 1 skips at every level. Changed:
//! as many levels as leave four rows at the bottom, so that any map from 16 x 32 works; padding that knows the sphere,
//! so that there is neither a seam nor a pole; group normalisation.

use super::layers::{Convolution, NormTape, norm_backward, norm_forward};
use super::planes::Planes;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::math::random::SequentialRandom;
use std::ops::Range;
use std::sync::Arc;

/// Channels of the fixed random input, as released.
pub const INPUT_CHANNELS: usize = 8;
/// Channels that a skip carries, as released.
const SKIP_CHANNELS: usize = 16;

/// A convolution with a normalisation behind it.
#[derive(Clone, Debug)]
struct Block {
    convolution: Convolution,
    weights: Range<usize>,
    norm: Range<usize>,
}

/// What a block leaves for its way back.
struct BlockTape {
    source: Arc<Planes>,
    norm: NormTape,
    result: Arc<Planes>,
}

/// The layout of the net; its weights lie in one slice.
#[derive(Clone, Debug)]
pub struct Net {
    width: usize,
    height: usize,
    skips: Vec<Block>,
    down: Vec<[Block; 2]>,
    up: Vec<[Block; 2]>,
    last: (Convolution, Range<usize>),
    weight_count: usize,
}

/// What a pass leaves for the way back.
pub struct NetTape {
    skips: Vec<BlockTape>,
    down: Vec<[BlockTape; 2]>,
    up: Vec<[BlockTape; 2]>,
    last_input: Arc<Planes>,
}

/// How often a map is halved: while at least four rows are left and both sides stay whole, with even columns for the
/// poles.
///
/// # Errors
/// As [`Net::new`].
pub fn levels_of(width: usize, height: usize) -> Result<usize> {
    let invalid = |message: String| {
        Err(Error::new(ErrorKind::InvalidSetting, message)
            .at(Place::Setting("light-height".into()))
            .remedy("give an even number of rows from 16 on, such as --light-height 32, or take --prior gradient"))
    };
    if height < 16 || width < 32 {
        return invalid(format!("an environment of {height} rows is too small for the deep prior"));
    }
    let most = height.ilog2() as usize - 2;
    let divides = |levels: usize| height.is_multiple_of(1 << levels) && width.is_multiple_of(2 << levels);
    match (1..=most).rev().find(|&levels| divides(levels)) {
        Some(levels) => Ok(levels),
        None => invalid(format!("an environment of {height} rows cannot be halved, as the deep prior has to")),
    }
}

impl Net {
    /// A net for maps of `width x height` texels with this many channels inside (128 as released).
    ///
    /// # Errors
    /// `InvalidSetting` below 32 x 16 texels, or for a width that is not even.
    pub fn new(width: usize, height: usize, channels: usize) -> Result<Self> {
        let levels = levels_of(width, height)?;
        let mut weight_count = 0;
        let mut take = |count: usize| {
            weight_count += count;
            weight_count - count..weight_count
        };
        let mut block = |inputs, outputs, side, stride| {
            let convolution = Convolution { inputs, outputs, side, stride };
            Block { convolution, weights: take(convolution.weight_count()), norm: take(2 * outputs) }
        };
        let inputs = |level: usize| if level == 0 { INPUT_CHANNELS } else { channels };
        let skips = (0..levels).map(|level| block(inputs(level), SKIP_CHANNELS, 1, 1)).collect();
        let down =
            (0..levels).map(|level| [block(inputs(level), channels, 3, 2), block(channels, channels, 3, 1)]).collect();
        let up = (0..levels)
            .map(|_| [block(channels + SKIP_CHANNELS, channels, 3, 1), block(channels, channels, 1, 1)])
            .collect();
        let last = Convolution { inputs: channels, outputs: 3, side: 1, stride: 1 };
        let last = (last, take(last.weight_count()));
        Ok(Net { width, height, skips, down, up, last, weight_count })
    }

    /// Number of weights.
    pub fn weight_count(&self) -> usize {
        self.weight_count
    }

    /// How often the map is halved.
    pub fn levels(&self) -> usize {
        self.down.len()
    }

    /// Weights to start from: convolutions uniform in plus or minus `1 / sqrt(taps)`, norms neutral, a last layer that
    /// gives little.
    pub fn start(&self, random: &mut SequentialRandom) -> Vec<f32> {
        let mut weights = vec![0.0; self.weight_count];
        let mut fill = |range: &Range<usize>, convolution: &Convolution, gain: f32| {
            let bound = gain / (convolution.columns() as f32).sqrt();
            for weight in &mut weights[range.start..range.start + convolution.outputs * convolution.columns()] {
                *weight = bound * (2.0 * random.next_number() - 1.0);
            }
        };
        let blocks = || self.skips.iter().chain(self.down.iter().flatten()).chain(self.up.iter().flatten());
        blocks().for_each(|block| fill(&block.weights, &block.convolution, 1.0));
        fill(&self.last.1, &self.last.0, 0.1);
        for block in blocks() {
            weights[block.norm.start..block.norm.start + block.convolution.outputs].fill(1.0);
        }
        weights
    }

    /// Three maps of the size of the net for an input of [`INPUT_CHANNELS`].
    pub fn forward(&self, weights: &[f32], input: &Planes) -> (Planes, NetTape) {
        debug_assert_eq!((input.width, input.height, input.channels), (self.width, self.height, INPUT_CHANNELS));
        let (mut skips, mut down) = (Vec::new(), Vec::new());
        let mut planes = Arc::new(input.clone());
        for (skip, [first, second]) in self.skips.iter().zip(&self.down) {
            skips.push(skip.forward(weights, Arc::clone(&planes)));
            let first = first.forward(weights, planes);
            let second = second.forward(weights, Arc::clone(&first.result));
            planes = Arc::clone(&second.result);
            down.push([first, second]);
        }
        let mut up = Vec::new();
        for level in (0..self.levels()).rev() {
            let joined = planes.doubled().joined(&skips[level].result);
            let first = self.up[level][0].forward(weights, Arc::new(joined));
            let second = self.up[level][1].forward(weights, Arc::clone(&first.result));
            planes = Arc::clone(&second.result);
            up.push([first, second]);
        }
        up.reverse();
        let result = self.last.0.forward(&weights[self.last.1.clone()], &planes);
        (result, NetTape { skips, down, up, last_input: planes })
    }

    /// Adds the derivatives by the weights to `d_weights`.
    pub fn backward(&self, weights: &[f32], tape: NetTape, d_result: &Planes, d_weights: &mut [f32]) {
        let range = self.last.1.clone();
        let mut d_planes =
            self.last.0.backward(&weights[range.clone()], &tape.last_input, d_result, &mut d_weights[range]);
        let mut d_skips = Vec::new();
        for (level, [first, second]) in tape.up.into_iter().enumerate() {
            d_planes = self.up[level][1].backward(weights, second, d_planes, d_weights);
            let d_joined = self.up[level][0].backward(weights, first, d_planes, d_weights);
            let (d_doubled, d_skip) = d_joined.parted(self.up[level][1].convolution.outputs);
            d_planes = d_doubled.doubled_transposed();
            d_skips.push(d_skip);
        }
        let levels = tape.skips.into_iter().zip(tape.down).enumerate().rev();
        for (level, (skip, [first, second])) in levels {
            d_planes = self.down[level][1].backward(weights, second, d_planes, d_weights);
            d_planes = self.down[level][0].backward(weights, first, d_planes, d_weights);
            let d_skip = std::mem::take(&mut d_skips[level]);
            let d_skip = self.skips[level].backward(weights, skip, d_skip, d_weights);
            d_planes.values.iter_mut().zip(d_skip.values).for_each(|(sum, value)| *sum += value);
        }
    }
}

impl Block {
    fn forward(&self, weights: &[f32], input: Arc<Planes>) -> BlockTape {
        let source = self.convolution.source(input);
        let planes = self.convolution.forward(&weights[self.weights.clone()], &source);
        let (result, norm) = norm_forward(&weights[self.norm.clone()], planes);
        BlockTape { source, norm, result: Arc::new(result) }
    }

    fn backward(&self, weights: &[f32], tape: BlockTape, d_result: Planes, d_weights: &mut [f32]) -> Planes {
        let (own, norm) = (self.weights.clone(), self.norm.clone());
        let d_planes = norm_backward(&weights[norm.clone()], &tape.norm, &tape.result, d_result, &mut d_weights[norm]);
        self.convolution.backward(&weights[own.clone()], &tape.source, &d_planes, &mut d_weights[own])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(width: usize, height: usize, seed: u64) -> Planes {
        let mut random = SequentialRandom::new(seed);
        let mut planes = Planes::zeros(INPUT_CHANNELS, height, width);
        planes.values.iter_mut().for_each(|value| *value = random.next_number());
        planes
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let net = Net::new(32, 16, 8).unwrap();
        let mut random = SequentialRandom::new(5);
        let weights = net.start(&mut random);
        let input = input(32, 16, 1);
        let (result, tape) = net.forward(&weights, &input);
        let mut d_result = result.clone();
        d_result.values.iter_mut().for_each(|value| *value = 2.0 * random.next_number() - 1.0);
        let loss = |weights: &[f32]| -> f64 {
            let (result, _) = net.forward(weights, &input);
            result.values.iter().zip(&d_result.values).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let mut gradient = vec![0.0; weights.len()];
        net.backward(&weights, tape, &d_result, &mut gradient);
        // Every weight takes part in each direction. A difference in f32 that passes kinks of the ramp is not exact:
        // the middle of many trials is.
        let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt() * 0.577;
        let mut errors: Vec<f64> = (0..21)
            .map(|trial| {
                let mut random = SequentialRandom::new(100 + trial);
                let direction: Vec<f32> = weights.iter().map(|_| 2.0 * random.next_number() - 1.0).collect();
                let step = 1e-3f32;
                let moved = |sign: f32| -> Vec<f32> {
                    weights.iter().zip(&direction).map(|(w, d)| w + sign * step * d).collect()
                };
                let difference = (loss(&moved(1.0)) - loss(&moved(-1.0))) / (2.0 * f64::from(step));
                let derivative: f64 = gradient.iter().zip(&direction).map(|(g, d)| f64::from(*g) * f64::from(*d)).sum();
                (difference - derivative).abs() / norm
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        assert!(errors[10] < 0.06 && errors[20] < 0.3, "{errors:?}");
    }

    #[test]
    fn single_weights_of_every_layer_agree_with_differences() {
        let net = Net::new(32, 16, 8).unwrap();
        let mut random = SequentialRandom::new(7);
        let weights = net.start(&mut random);
        let input = input(32, 16, 2);
        let (result, tape) = net.forward(&weights, &input);
        let mut gradient = vec![0.0; weights.len()];
        net.backward(&weights, tape, &result, &mut gradient);
        let loss = |weights: &[f32]| -> f64 {
            net.forward(weights, &input).0.values.iter().map(|v| 0.5 * f64::from(*v).powi(2)).sum()
        };
        let blocks = net.skips.iter().chain(net.down.iter().flatten()).chain(net.up.iter().flatten());
        let ranges = blocks.flat_map(|block| [block.weights.clone(), block.norm.clone()]).chain([net.last.1.clone()]);
        for range in ranges {
            // The weight of the layer that matters most: differences in f32 see no others.
            let size = |index: &usize| gradient[*index].abs();
            let index = range.max_by(|a, b| size(a).total_cmp(&size(b))).unwrap();
            let step = 2e-3f32;
            let at = |sign: f32| {
                let mut moved = weights.clone();
                moved[index] += sign * step;
                loss(&moved)
            };
            let difference = (at(1.0) - at(-1.0)) / (2.0 * f64::from(step));
            let derivative = f64::from(gradient[index]);
            let close = (difference - derivative).abs() < 0.06 * derivative.abs() + 1e-4;
            assert!(close, "weight {index}: {derivative} {difference}");
        }
    }

    #[test]
    fn half_a_turn_of_the_input_turns_the_light_and_there_is_no_seam() {
        let (width, height) = (64, 32);
        let net = Net::new(width, height, 16).unwrap();
        assert_eq!(net.levels(), 3);
        let weights = net.start(&mut SequentialRandom::new(3));
        let straight = input(width, height, 9);
        let mut turned = straight.clone();
        for (line, source) in turned.values.chunks_exact_mut(width).zip(straight.values.chunks_exact(width)) {
            (0..width).for_each(|column| line[column] = source[(column + width / 2) % width]);
        }
        let (first, second) = (net.forward(&weights, &straight).0, net.forward(&weights, &turned).0);
        for (line, source) in second.values.chunks_exact(width).zip(first.values.chunks_exact(width)) {
            for column in 0..width {
                assert!((line[column] - source[(column + width / 2) % width]).abs() < 1e-4);
            }
        }
        // Steps over the seam are no larger than steps elsewhere.
        let step = |from: usize, to: usize| -> f32 {
            first.values.chunks_exact(width).map(|line| (line[from] - line[to]).abs()).sum()
        };
        let others = (0..width - 1).map(|column| step(column, column + 1)).sum::<f32>() / (width - 1) as f32;
        assert!(step(width - 1, 0) < 2.5 * others, "{} {others}", step(width - 1, 0));
    }

    #[test]
    fn any_map_from_sixteen_rows_has_a_net_and_smaller_ones_an_error() {
        for (width, height, levels) in [(32, 16, 2), (64, 32, 3), (128, 64, 4), (256, 128, 5), (96, 48, 3)] {
            assert_eq!(Net::new(width, height, 8).unwrap().levels(), levels, "{width} x {height}");
        }
        assert_eq!(Net::new(16, 8, 8).unwrap_err().kind(), ErrorKind::InvalidSetting);
        // As released: 128 channels, 2.27 million weights; ours differs by level counts and norms.
        let count = Net::new(256, 128, 128).unwrap().weight_count();
        assert!((2_000_000..2_600_000).contains(&count), "{count}");
    }
}
