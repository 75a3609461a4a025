//! The modified Cook-Torrance lobe: Lambert plus microfacets.
//!
//! `f = rho_d / pi + D F G / (4 (n.i)(n.o))` with
//! * `F = F0 + (1 - F0)(1 - h.o)^5` (Schlick 1994, eq. 15);
//! * `D` and `G` of [`blinn_phong`], which the paper has, or of [`ggx`], which other renderers have: [`LobeModel`].
//!
//! `F0 = 0` still leaves a grazing lobe; a surface without one is drawn with a [`Material`] evaluated at
//! `lobe_strength` 0.

pub mod blinn_phong;
pub mod ggx;
mod model;
pub mod nearest;

pub use model::LobeModel;

use crate::math::frame::{Frame, sample_cosine_hemisphere};
use crate::math::luminance;
use crate::math::real::Real;
use glam::Vec3;
use std::f32::consts::PI;

/// Smallest microfacet width: a mirror for every purpose of a 32x64 environment, yet far from overflow in `f32`.
pub const MIN_WIDTH: f32 = 0.005;
/// Smallest roughness `r = a^2`.
pub const MIN_ROUGHNESS: f32 = MIN_WIDTH * MIN_WIDTH;

/// What a texel says of the surface: its seven numbers. Derivatives by them and variances of them have the same shape.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Material<R> {
    /// Diffuse reflectance, linear RGB in [0, 1].
    pub diffuse: [R; 3],
    /// Reflectance at normal incidence F0, linear RGB in [0, 1].
    pub specular: [R; 3],
    /// Natural logarithm of the microfacet width `a`, in `[ln MIN_WIDTH, 0]`.
    pub log_width: R,
}

/// Everything about two directions and a normal that the lobe needs; fixed while materials change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeGeometry {
    /// `n.i`, cosine of the incident direction, in (0, 1].
    pub cos_in: f32,
    /// `n.o`, cosine of the outgoing direction, in (0, 1].
    pub cos_out: f32,
    /// `ln(n.h)`, at most 0. From the sine of the angle, so that `(n.h)^e` keeps its digits for `e` of 10^4 and more.
    pub ln_cos_half: f32,
    /// `h.o`, cosine between half vector and outgoing direction, in (0, 1].
    pub half_dot_out: f32,
}

impl LobeGeometry {
    /// The geometry of unit directions towards the light and towards the viewer about a unit normal.
    /// `None` below the horizon of the normal, where the lobe is zero.
    #[inline]
    pub fn new(normal: Vec3, towards_light: Vec3, towards_viewer: Vec3) -> Option<Self> {
        let cos_in = normal.dot(towards_light);
        let cos_out = normal.dot(towards_viewer);
        // Written so that NaN fails too.
        if !(cos_in > 0.0 && cos_out > 0.0) {
            return None;
        }
        let half = towards_light + towards_viewer;
        let length_squared = half.length_squared();
        if !(length_squared > 1e-12) {
            return None;
        }
        let sin_squared = (normal.cross(half).length_squared() / length_squared).min(1.0 - 1e-7);
        Some(LobeGeometry {
            cos_in: cos_in.min(1.0),
            cos_out: cos_out.min(1.0),
            ln_cos_half: 0.5 * (-sin_squared).ln_1p(),
            half_dot_out: (0.5 * length_squared.sqrt()).min(1.0),
        })
    }

    /// `(1 - h.o)^5` of Schlick's approximation.
    #[inline(always)]
    fn schlick(&self) -> f32 {
        let base = 1.0 - self.half_dot_out;
        let squared = base * base;
        squared * squared * base
    }
}

impl<R: Real> Material<R> {
    /// The seven numbers in the order diffuse RGB, specular RGB, log width.
    #[inline(always)]
    pub fn to_array(self) -> [R; 7] {
        let ([a, b, c], [d, e, f]) = (self.diffuse, self.specular);
        [a, b, c, d, e, f, self.log_width]
    }

    /// The material of [`Material::to_array`].
    #[inline(always)]
    pub fn from_array([a, b, c, d, e, f, log_width]: [R; 7]) -> Self {
        Material { diffuse: [a, b, c], specular: [d, e, f], log_width }
    }

    /// The same with each number changed, perhaps into another type.
    #[inline(always)]
    pub fn map<S: Real>(self, change: impl FnMut(R) -> S) -> Material<S> {
        Material::from_array(self.to_array().map(change))
    }

    /// Adds another's numbers.
    #[inline(always)]
    pub fn add(&mut self, other: &Material<R>) {
        for channel in 0..3 {
            self.diffuse[channel] += other.diffuse[channel];
            self.specular[channel] += other.specular[channel];
        }
        self.log_width += other.log_width;
    }

    /// Adds `factor` times another's numbers.
    #[inline(always)]
    pub fn add_scaled(&mut self, other: &Material<R>, factor: R) {
        for channel in 0..3 {
            self.diffuse[channel] += other.diffuse[channel] * factor;
            self.specular[channel] += other.specular[channel] * factor;
        }
        self.log_width += other.log_width * factor;
    }

    /// [`Material::reflect_by`] with the lobe of [`LobeModel::BlinnPhong`].
    #[inline(always)]
    pub fn reflect(&self, geometry: &LobeGeometry, lobe_strength: f32) -> [R; 3] {
        self.reflect_by(LobeModel::BlinnPhong, geometry, lobe_strength)
    }

    /// `f(i, o) (n.i)` in 1/sr per channel. `lobe_strength` in [0, 1] scales the specular lobe as a whole.
    #[inline(always)]
    pub fn reflect_by(&self, model: LobeModel, geometry: &LobeGeometry, lobe_strength: f32) -> [R; 3] {
        let diffuse = R::from_f32(geometry.cos_in * (1.0 / PI));
        if lobe_strength == 0.0 {
            return self.diffuse.map(|value| value * diffuse);
        }
        let base = model.value(geometry, self.log_width) * R::from_f32(lobe_strength);
        let schlick = geometry.schlick();
        let (rest, schlick) = (R::from_f32(1.0 - schlick), R::from_f32(schlick));
        std::array::from_fn(|channel| {
            // F = F0 + (1 - F0) s = F0 (1 - s) + s.
            let fresnel = self.specular[channel] * rest + schlick;
            self.diffuse[channel] * diffuse + fresnel * base
        })
    }

    /// [`Material::reflect_backward_by`] with the lobe of [`LobeModel::BlinnPhong`].
    #[inline(always)]
    pub fn reflect_backward(&self, geometry: &LobeGeometry, lobe_strength: f32, d_value: [R; 3]) -> Material<R> {
        self.reflect_backward_by(LobeModel::BlinnPhong, geometry, lobe_strength, d_value)
    }

    /// The derivative of the loss by this material, from that by the value of [`Material::reflect_by`].
    #[inline(always)]
    pub fn reflect_backward_by(
        &self,
        model: LobeModel,
        geometry: &LobeGeometry,
        lobe_strength: f32,
        d_value: [R; 3],
    ) -> Material<R> {
        let diffuse = R::from_f32(geometry.cos_in * (1.0 / PI));
        let mut d_material = Material { diffuse: d_value.map(|d| d * diffuse), ..Default::default() };
        if lobe_strength == 0.0 {
            return d_material;
        }
        let base = model.value(geometry, self.log_width) * R::from_f32(lobe_strength);
        let schlick = geometry.schlick();
        let (rest, schlick) = (R::from_f32(1.0 - schlick), R::from_f32(schlick));
        let mut d_base = R::zero();
        for channel in 0..3 {
            let fresnel = self.specular[channel] * rest + schlick;
            d_material.specular[channel] = d_value[channel] * rest * base;
            d_base += d_value[channel] * fresnel;
        }
        let slope = model.slope(geometry, self.log_width);
        d_material.log_width = d_base * base * slope;
        d_material
    }
}

impl Material<f32> {
    /// The material of file values: reflectances clamped to [0, 1], roughness to `[MIN_ROUGHNESS, 1]`.
    pub fn from_maps(diffuse: Vec3, specular: Vec3, roughness: f32) -> Self {
        Material {
            diffuse: diffuse.clamp(Vec3::ZERO, Vec3::ONE).to_array(),
            specular: specular.clamp(Vec3::ZERO, Vec3::ONE).to_array(),
            log_width: 0.5 * roughness.clamp(MIN_ROUGHNESS, 1.0).ln(),
        }
    }

    /// What sampling towards one viewer shares, whose direction has the cosine `cos_out` to the normal.
    #[inline]
    pub fn sampler(&self, model: LobeModel, cos_out: f32, lobe_strength: f32) -> LobeSampler {
        if lobe_strength == 0.0 {
            return LobeSampler { specular_share: 0.0, inverse_width_squared: 0.0, model };
        }
        // By the luminance of both parts, kept off 0 and 1.
        let grazing = (1.0 - cos_out).clamp(0.0, 1.0).powi(5);
        let fresnel = Vec3::from_array(self.specular) * (1.0 - grazing) + Vec3::splat(grazing);
        let specular = luminance(fresnel) * lobe_strength;
        let diffuse = luminance(Vec3::from_array(self.diffuse));
        LobeSampler {
            specular_share: (specular / (specular + diffuse).max(1e-6)).clamp(0.1, 0.9),
            inverse_width_squared: (-2.0 * self.log_width).exp(),
            model,
        }
    }
}

/// The largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Draws directions towards the light in proportion to what a material sends to one viewer, nearly.
#[derive(Clone, Copy, Debug)]
pub struct LobeSampler {
    /// Probability of sampling the specular lobe.
    specular_share: f32,
    /// `1 / a^2`.
    inverse_width_squared: f32,
    /// The microfacets that are drawn.
    pub model: LobeModel,
}

impl LobeSampler {
    /// A direction towards the light for the unit direction towards the viewer, from two numbers uniform in [0, 1);
    /// `None` when it falls below the horizon. Its density is [`LobeSampler::density`].
    ///
    /// The first number chooses the lobe as well, and what is left of it is uniform again: evenly spread pairs stay so.
    #[inline]
    pub fn sample(&self, frame: &Frame, towards_viewer: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let share = self.specular_share;
        let light = if u[0] < share {
            let u = [(u[0] / share).min(BELOW_ONE), u[1]];
            let sin_squared = self.model.sine_squared_of_sample(u[0], self.inverse_width_squared);
            let sin = sin_squared.sqrt();
            let (sin_phi, cos_phi) = (std::f32::consts::TAU * u[1]).sin_cos();
            let half = Vec3::new(sin * cos_phi, sin * sin_phi, (1.0 - sin_squared).sqrt());
            let viewer = frame.local_from_outer(towards_viewer);
            half * (2.0 * viewer.dot(half)) - viewer
        } else {
            sample_cosine_hemisphere([((u[0] - share) / (1.0 - share)).min(BELOW_ONE), u[1]])
        };
        (light.z > 0.0).then(|| frame.outer_from_local(light))
    }

    /// Density of [`LobeSampler::sample`] per steradian, for a geometry with the same viewer.
    #[inline]
    pub fn density(&self, geometry: &LobeGeometry) -> f32 {
        let diffuse = geometry.cos_in * (1.0 / PI);
        if self.specular_share == 0.0 {
            return diffuse;
        }
        // p(h) = D(h) (n.h), p(i) = p(h) / (4 h.o).
        let half = self.model.density_of_half(geometry.ln_cos_half, self.inverse_width_squared);
        self.specular_share * half / (4.0 * geometry.half_dot_out) + (1.0 - self.specular_share) * diffuse
    }
}

#[cfg(test)]
mod tests;
