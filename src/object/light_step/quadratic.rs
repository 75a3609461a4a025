//! The quadratic that touches the objective at a light, and its minimum by conjugate gradients.

use super::terms::LightTerms;
use crate::object::likelihood::Likelihood;
use crate::object::matrices::LightMatrix;
use crate::object::prior::{LogLight, shares};

/// The quadratic around a light: derivatives, and what its matrix is made of.
pub(super) struct Quadratic<'a> {
    matrix: &'a LightMatrix,
    terms: &'a LightTerms,
    radiance: [Vec<f32>; 3],
    curvature: Vec<[f32; 3]>,
    edges: Option<[Vec<f32>; 3]>,
    /// Diagonal that belongs to no other part: the tie, and a little for texels that nothing holds.
    ridge: Vec<f32>,
    slopes: [Vec<f32>; 3],
    diagonal: [Vec<f32>; 3],
    pub(super) not_finite: usize,
}

impl<'a> Quadratic<'a> {
    pub(super) fn new(
        matrix: &'a LightMatrix,
        likelihood: &Likelihood,
        terms: &'a LightTerms,
        light: &LogLight,
    ) -> Self {
        let radiance = light.radiance();
        let state = likelihood.slopes(&matrix.forward(&radiance));
        let shares = shares(light.width, light.height);
        let mut slopes = matrix.adjoint(&state.by_pixel);
        let mut diagonal = matrix.squared_adjoint(&state.curvature);
        for channel in 0..3 {
            for texel in 0..radiance[channel].len() {
                slopes[channel][texel] *= radiance[channel][texel];
                diagonal[channel][texel] *= radiance[channel][texel].powi(2);
            }
        }
        let edges = terms.gradient.as_ref().map(|prior| {
            let weights = [0, 1, 2].map(|channel| {
                let mut weights = prior.edge_weights(&light.channels[channel]);
                weights.iter_mut().for_each(|weight| *weight /= 3.0);
                weights
            });
            for channel in 0..3 {
                prior.add_product(&weights[channel], &light.channels[channel], &mut slopes[channel]);
                prior.add_diagonal(&weights[channel], &mut diagonal[channel]);
            }
            weights
        });
        let mut ridge: Vec<f32> = shares.iter().map(|share| 1e-5 * share).collect();
        if let Some((weight, target)) = &terms.tie {
            for (texel, share) in shares.iter().enumerate() {
                ridge[texel] += (*weight / 3.0) as f32 * share;
                for channel in 0..3 {
                    let pull = (*weight / 3.0) as f32 * share;
                    slopes[channel][texel] += pull * (light.channels[channel][texel] - target[channel][texel]);
                }
            }
        }
        for channel in &mut diagonal {
            channel.iter_mut().zip(&ridge).for_each(|(sum, value)| *sum += value);
        }
        if terms.grey {
            average(&mut slopes);
            average(&mut diagonal);
        }
        let not_finite = state.not_finite;
        Quadratic { matrix, terms, radiance, curvature: state.curvature, edges, ridge, slopes, diagonal, not_finite }
    }

    /// The matrix of the quadratic times a direction.
    fn product(&self, direction: &[Vec<f32>; 3]) -> [Vec<f32>; 3] {
        let scaled = [0, 1, 2].map(|channel| {
            direction[channel].iter().zip(&self.radiance[channel]).map(|(a, b)| a * b).collect::<Vec<f32>>()
        });
        let mut picture = self.matrix.forward(&scaled);
        for (pixel, curvature) in picture.iter_mut().zip(&self.curvature) {
            (0..3).for_each(|channel| pixel[channel] *= curvature[channel]);
        }
        let mut product = self.matrix.adjoint(&picture);
        for channel in 0..3 {
            for texel in 0..self.ridge.len() {
                product[channel][texel] = product[channel][texel] * self.radiance[channel][texel]
                    + self.ridge[texel] * direction[channel][texel];
            }
            if let (Some(prior), Some(edges)) = (&self.terms.gradient, &self.edges) {
                prior.add_product(&edges[channel], &direction[channel], &mut product[channel]);
            }
        }
        if self.terms.grey {
            average(&mut product);
        }
        product
    }

    /// Solves for the step by conjugate gradients with the diagonal as preconditioner, channel by channel.
    pub(super) fn step(&self, products: usize) -> [Vec<f32>; 3] {
        let texels = self.ridge.len();
        let mut step = [0; 3].map(|_| vec![0.0f32; texels]);
        let mut residual = self.slopes.clone();
        residual.iter_mut().flatten().for_each(|value| *value = -*value);
        let precondition = |residual: &[Vec<f32>; 3]| {
            [0, 1, 2].map(|channel| {
                let pairs = residual[channel].iter().zip(&self.diagonal[channel]);
                pairs.map(|(value, diagonal)| value / diagonal.max(1e-20)).collect::<Vec<f32>>()
            })
        };
        let mut direction = precondition(&residual);
        let mut along = dots(&residual, &direction);
        let first = along;
        for _ in 0..products {
            let product = self.product(&direction);
            let curvature = dots(&direction, &product);
            for channel in 0..3 {
                if !(curvature[channel] > 0.0) || along[channel] < 1e-8 * first[channel] {
                    continue;
                }
                let length = (along[channel] / curvature[channel]) as f32;
                for texel in 0..texels {
                    step[channel][texel] += length * direction[channel][texel];
                    residual[channel][texel] -= length * product[channel][texel];
                }
            }
            let scaled = precondition(&residual);
            let next = dots(&residual, &scaled);
            for channel in 0..3 {
                let ratio = if along[channel] > 0.0 { (next[channel] / along[channel]) as f32 } else { 0.0 };
                let pairs = direction[channel].iter_mut().zip(&scaled[channel]);
                pairs.for_each(|(value, scaled)| *value = scaled + ratio * *value);
            }
            along = next;
        }
        step
    }
}

fn dots(a: &[Vec<f32>; 3], b: &[Vec<f32>; 3]) -> [f64; 3] {
    [0, 1, 2].map(|channel| a[channel].iter().zip(&b[channel]).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum())
}

/// Replaces the channels by their mean.
pub(super) fn average(channels: &mut [Vec<f32>; 3]) {
    for texel in 0..channels[0].len() {
        let mean = (channels[0][texel] + channels[1][texel] + channels[2][texel]) / 3.0;
        (0..3).for_each(|channel| channels[channel][texel] = mean);
    }
}
