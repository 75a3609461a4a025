//! Radiance over a traced path, and its derivative.
//!
//! With `f_k` the lobe towards the connection, `g_k` the lobe towards the bounce over its density, `w` the weights and
//! `L` the light, the radiance from vertex k onwards is
//! `S_k = f_k L w_k + g_k X_k`, where `X_k` is `L w` if the bounce escapes and `S_(k+1)` otherwise.
//! The derivative walks the same recursion the other way: `d S_(k+1) = d S_k g_k`.

use super::path::{Bounce, MAX_BOUNCES, PathArena, PathHead};
use crate::light::Environment;
use crate::material::texels::PyramidWeights;
use crate::material::{GradientPyramid, Material, TexelPyramid, TextureTap};
use crate::math::real::Real;
use crate::math::sphere::BilinearTap;
use glam::Vec3;

/// What is fitted: the maps and the light.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters<R> {
    /// The maps with their mip chain.
    pub texels: TexelPyramid<R>,
    /// Radiance of the environment's texels, row-major.
    pub light: Vec<[R; 3]>,
    /// Width and height of the environment in texels.
    pub environment_size: (usize, usize),
}

impl Parameters<f32> {
    /// Parameters of a chain of texels and an environment.
    pub fn new(texels: TexelPyramid<f32>, environment: &Environment) -> Self {
        let radiance = &environment.radiance;
        Parameters {
            texels,
            light: radiance.pixels().iter().map(|pixel| pixel.to_array()).collect(),
            environment_size: (radiance.width(), radiance.height()),
        }
    }

    /// The environment.
    pub fn environment(&self) -> Environment {
        let (width, height) = self.environment_size;
        let pixels = self.light.iter().map(|&radiance| Vec3::from_array(radiance)).collect();
        Environment { radiance: crate::image::Image::from_pixels(width, height, pixels) }
    }
}

impl<R: Real> Parameters<R> {
    /// The same parameters in another number type.
    pub fn convert<S: Real>(&self, convert: impl Fn(R) -> S) -> Parameters<S> {
        Parameters {
            texels: self.texels.convert(&convert),
            light: self.light.iter().map(|radiance| radiance.map(&convert)).collect(),
            environment_size: self.environment_size,
        }
    }

    /// Radiance of the environment at a tap.
    #[inline(always)]
    pub fn light_at(&self, tap: &BilinearTap) -> [R; 3] {
        let mut sum = [R::zero(); 3];
        for k in 0..4 {
            let weight = R::from_f32(tap.weight[k]);
            let radiance = &self.light[tap.index[k] as usize];
            for channel in 0..3 {
                sum[channel] += radiance[channel] * weight;
            }
        }
        sum
    }
}

/// Derivatives of the loss by the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterGradient<R> {
    /// Derivatives by the maps, on all levels of their mip chain.
    pub texels: GradientPyramid<R>,
    /// Derivative by the radiance of the environment's texels, row-major.
    pub light: Vec<[R; 3]>,
}

impl<R: Real> ParameterGradient<R> {
    /// No derivative yet, by maps with these weights and an environment of so many texels.
    pub fn zeros(weights: &PyramidWeights, light_texels: usize) -> Self {
        ParameterGradient { texels: GradientPyramid::zeros(weights), light: vec![[R::zero(); 3]; light_texels] }
    }

    /// The same derivatives in another number type.
    pub fn convert<S: Real>(&self, convert: impl Fn(R) -> S) -> ParameterGradient<S> {
        ParameterGradient {
            texels: self.texels.convert(&convert),
            light: self.light.iter().map(|radiance| radiance.map(&convert)).collect(),
        }
    }
}

/// Where derivatives go.
pub trait GradientSink<R> {
    /// Adds the derivative by the material at a tap.
    fn add_material(&mut self, tap: &TextureTap, d_material: &Material<R>);
    /// Adds the derivative by the radiance of the environment at a tap.
    fn add_light(&mut self, tap: &BilinearTap, d_radiance: [R; 3]);
}

#[inline(always)]
fn multiply<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

#[inline(always)]
fn add<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn scale<R: Real>(a: [R; 3], factor: f32) -> [R; 3] {
    let factor = R::from_f32(factor);
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

/// Radiance along a traced path.
pub fn radiance<R: Real>(parameters: &Parameters<R>, arena: &PathArena, path: &PathHead, lobe_strength: f32) -> [R; 3] {
    if let Some(tap) = &path.background {
        return parameters.light_at(tap);
    }
    let mut onwards = [R::zero(); 3];
    for vertex in arena.vertices_of(path).iter().rev() {
        let material = parameters.texels.fetch(&vertex.texture);
        let mut sum = [R::zero(); 3];
        if let Some(bounce) = &vertex.bounce {
            let arriving = arriving_at(parameters, bounce, onwards);
            let reflected = material.reflect_by(parameters.texels.model, &bounce.geometry, lobe_strength);
            sum = scale(multiply(reflected, arriving), bounce.inverse_density);
        }
        if let Some(connection) = &vertex.connection {
            let reflected = material.reflect_by(parameters.texels.model, &connection.geometry, lobe_strength);
            sum = add(sum, scale(multiply(reflected, parameters.light_at(&connection.light)), connection.weight));
        }
        onwards = sum;
    }
    onwards
}

/// Radiance that arrives along a bounce.
#[inline(always)]
fn arriving_at<R: Real>(parameters: &Parameters<R>, bounce: &Bounce, onwards: [R; 3]) -> [R; 3] {
    match &bounce.escape {
        Some((tap, weight)) => scale(parameters.light_at(tap), *weight),
        None => onwards,
    }
}

/// Adds the derivatives of the loss by maps and light along a traced path, given that by the path's radiance.
pub fn radiance_backward<R: Real>(
    parameters: &Parameters<R>,
    arena: &PathArena,
    path: &PathHead,
    lobe_strength: f32,
    d_radiance: [R; 3],
    sink: &mut impl GradientSink<R>,
) {
    if let Some(tap) = &path.background {
        sink.add_light(tap, d_radiance);
        return;
    }
    let vertices = arena.vertices_of(path);

    // Walk back to learn what arrives at each vertex along its bounce.
    let mut arriving = [[R::zero(); 3]; MAX_BOUNCES];
    let mut reflected = [[R::zero(); 3]; MAX_BOUNCES];
    let mut onwards = [R::zero(); 3];
    for (k, vertex) in vertices.iter().enumerate().rev() {
        let mut sum = [R::zero(); 3];
        if vertex.bounce.is_some() || k > 0 {
            let material = parameters.texels.fetch(&vertex.texture);
            if let Some(bounce) = &vertex.bounce {
                arriving[k] = arriving_at(parameters, bounce, onwards);
                reflected[k] = scale(
                    material.reflect_by(parameters.texels.model, &bounce.geometry, lobe_strength),
                    bounce.inverse_density,
                );
                sum = multiply(reflected[k], arriving[k]);
            }
            if k > 0
                && let Some(connection) = &vertex.connection
            {
                let value = material.reflect_by(parameters.texels.model, &connection.geometry, lobe_strength);
                sum = add(sum, scale(multiply(value, parameters.light_at(&connection.light)), connection.weight));
            }
        }
        onwards = sum;
    }

    // Walk forth with the derivative by what leaves each vertex.
    let mut d_leaving = d_radiance;
    for (k, vertex) in vertices.iter().enumerate() {
        let material = parameters.texels.fetch(&vertex.texture);
        let mut d_material = Material::default();
        if let Some(connection) = &vertex.connection {
            let d_weighted = scale(d_leaving, connection.weight);
            let light = parameters.light_at(&connection.light);
            let value = material.reflect_by(parameters.texels.model, &connection.geometry, lobe_strength);
            sink.add_light(&connection.light, multiply(d_weighted, value));
            let d_value = multiply(d_weighted, light);
            d_material =
                material.reflect_backward_by(parameters.texels.model, &connection.geometry, lobe_strength, d_value);
        }
        let Some(bounce) = &vertex.bounce else {
            sink.add_material(&vertex.texture, &d_material);
            return;
        };
        let d_value = scale(multiply(d_leaving, arriving[k]), bounce.inverse_density);
        let d_bounce = material.reflect_backward_by(parameters.texels.model, &bounce.geometry, lobe_strength, d_value);
        d_material.add(&d_bounce);
        sink.add_material(&vertex.texture, &d_material);
        d_leaving = multiply(d_leaving, reflected[k]);
        if let Some((tap, weight)) = &bounce.escape {
            sink.add_light(tap, scale(d_leaving, *weight));
        }
    }
}

/// Adds to texels by index: the plainest sink, for tests and audits.
impl<R: Real> GradientSink<R> for ParameterGradient<R> {
    fn add_material(&mut self, tap: &TextureTap, d_material: &Material<R>) {
        let texels = &mut self.texels.levels[tap.level as usize].texels;
        for k in 0..4 {
            texels[tap.index[k] as usize].add_weighted(d_material, tap.weight[k]);
        }
    }

    fn add_light(&mut self, tap: &BilinearTap, d_radiance: [R; 3]) {
        for k in 0..4 {
            let weight = R::from_f32(tap.weight[k]);
            for channel in 0..3 {
                self.light[tap.index[k] as usize][channel] += d_radiance[channel] * weight;
            }
        }
    }
}
