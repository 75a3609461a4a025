//! The arithmetic of a surface hit, for all paths of a packet at once: from two pairs of random numbers to a direction
//! drawn from the light and one drawn from the lobe, with all that is recorded of them.
//!
//! It says for several paths what [`EnvironmentSampler::sample`], [`LobeSampler::sample`](crate::material::LobeSampler),
//! [`LobeGeometry::new`](crate::material::LobeGeometry) and [`tap_of_direction`](crate::math::sphere::tap_of_direction) say
//! for one; the tests of this folder hold it against them.

use super::lanes::Lanes;
use super::light_cells::LightCells;
use crate::light::EnvironmentSampler;
use crate::material::LobeModel;
use crate::math::random::{SampleStream, next_pairs};
use crate::math::vector::elementary::{angle, ln_one_minus, one_minus_exp, sine_and_cosine_of_turns};
use crate::math::vector::{Vector, WIDEST, dot, versions};
use crate::render::taps::Taps;
use std::f32::consts::{LOG2_E, PI};

/// Where paths have met the surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Arrivals {
    /// How many paths; what lies behind them in each list is left over from others.
    pub count: usize,
    /// Their random numbers.
    pub streams: [SampleStream; WIDEST],
    /// Unit shading normal, x, y and z.
    pub normal: [Lanes; 3],
    /// Unit normal of the triangle.
    pub geometric_normal: [Lanes; 3],
    /// Unit direction to where the path comes from.
    pub to_viewer: [Lanes; 3],
    /// Luminance of F0.
    pub specular: Lanes,
    /// Luminance of the diffuse reflectance.
    pub diffuse: Lanes,
    /// Natural logarithm of the microfacet width.
    pub log_width: Lanes,
    /// The lobe that all of them meet.
    pub model: LobeModel,
}

/// A direction for each path, and the lobe about it.
#[derive(Clone, Debug, Default)]
pub(super) struct Directions {
    /// Unit direction towards the light, x, y and z.
    pub direction: [Lanes; 3],
    /// Above 0 where the direction lies above both horizons.
    pub above: Lanes,
    /// Numbers of [`LobeGeometry`](crate::material::LobeGeometry).
    pub cos_in: Lanes,
    /// See there.
    pub ln_cos_half: Lanes,
    /// See there.
    pub half_dot_out: Lanes,
    /// Density with which the lobe's sampler draws it, per steradian.
    pub lobe_density: Lanes,
    /// Texels of the environment that it sees.
    pub taps: Taps,
}

/// What each path of a packet is offered.
#[derive(Clone, Debug, Default)]
pub(super) struct Proposals {
    /// Cosine between shading normal and the direction to where the path comes from.
    pub cos_out: Lanes,
    /// Whether there is a light to draw from.
    pub has_light: bool,
    /// Drawn from the light.
    pub of_light: Directions,
    /// Density with which the light's sampler draws those, per steradian.
    pub light_density: Lanes,
    /// Drawn from the lobe.
    pub of_lobe: Directions,
    /// Angles of those, as of [`angles_of_direction`](crate::math::sphere::angles_of_direction), but phi from -pi to pi.
    pub phi: Lanes,
    /// See there.
    pub theta: Lanes,
}

versions! {
    /// The next pair of random numbers of each of the first `count` streams: the first numbers of all, then the second.
    pub fn camera_pairs(streams: &mut [SampleStream; WIDEST], count: usize) -> [Lanes; 2] = pairs_in;

    /// Draws both directions of each path. `environment_size` is width and height of the environment in texels.
    pub(super) fn propose(
        arrivals: &mut Arrivals,
        light: &EnvironmentSampler,
        environment_size: (usize, usize),
        lobe_strength: f32,
        proposals: &mut Proposals,
    ) = propose_in;
}

#[inline(always)]
fn pairs_in<V: Vector>(streams: &mut [SampleStream; WIDEST], count: usize) -> [Lanes; 2] {
    // Integers, which the compiler makes vectors of.
    const { assert!(WIDEST.is_multiple_of(V::LANES)) };
    next_pairs(streams, count)
}

#[inline(always)]
pub(super) fn propose_in<V: Vector>(
    arrivals: &mut Arrivals,
    light: &EnvironmentSampler,
    environment_size: (usize, usize),
    lobe_strength: f32,
    proposals: &mut Proposals,
) {
    let count = arrivals.count;
    let light_numbers = next_pairs(&mut arrivals.streams, count);
    let lobe_numbers = next_pairs(&mut arrivals.streams, count);
    let mut cells = LightCells::default();
    proposals.has_light = cells.find(light, &light_numbers, count);
    for at in (0..count).step_by(V::LANES) {
        let surface = Surface::<V>::load(arrivals, at, lobe_strength);
        surface.cos_out.store(&mut proposals.cos_out[at..]);
        if proposals.has_light {
            let drawn = cells.draw::<V>(at);
            drawn.density.store(&mut proposals.light_density[at..]);
            surface.describe(drawn.direction, &mut proposals.of_light, at);
            proposals.of_light.taps.find_at_angles(drawn.phi, drawn.theta, environment_size, at);
        }
        let u = [V::load(&lobe_numbers[0][at..]), V::load(&lobe_numbers[1][at..])];
        let direction = surface.draw(u);
        surface.describe(direction, &mut proposals.of_lobe, at);
        let [x, y, z] = direction;
        let phi = angle(x, V::splat(0.0).sub(z));
        let theta = angle(z.mul_add(z, x.mul(x)).sqrt(), y);
        phi.store(&mut proposals.phi[at..]);
        theta.store(&mut proposals.theta[at..]);
        proposals.of_lobe.taps.find_at_angles(phi, theta, environment_size, at);
    }
}

/// The surface under several paths, and the sampler of its lobe.
struct Surface<V> {
    normal: [V; 3],
    geometric_normal: [V; 3],
    to_viewer: [V; 3],
    cos_out: V,
    /// See [`crate::material::LobeSampler`].
    specular_share: V,
    inverse_width_squared: V,
    model: LobeModel,
}

#[inline(always)]
fn load_three<V: Vector>(from: &[Lanes; 3], at: usize) -> [V; 3] {
    [V::load(&from[0][at..]), V::load(&from[1][at..]), V::load(&from[2][at..])]
}

impl<V: Vector> Surface<V> {
    /// See [`crate::material::Material::sampler`].
    #[inline(always)]
    fn load(arrivals: &Arrivals, at: usize, lobe_strength: f32) -> Self {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let normal = load_three::<V>(&arrivals.normal, at);
        let to_viewer = load_three::<V>(&arrivals.to_viewer, at);
        // Above 0 as was asked before, but for rounding.
        let cos_out = dot(normal, to_viewer).min(one).max(V::splat(1e-7));
        let rest = one.sub(cos_out).max(zero);
        let squared = rest.mul(rest);
        let grazing = squared.mul(squared).mul(rest);
        let specular = V::load(&arrivals.specular[at..]);
        let specular = grazing.mul_add(one.sub(specular), specular).mul(V::splat(lobe_strength));
        let diffuse = V::load(&arrivals.diffuse[at..]);
        let share = specular.div(specular.add(diffuse).max(V::splat(1e-6)));
        let share = share.max(V::splat(0.1)).min(V::splat(0.9));
        Surface {
            normal,
            geometric_normal: load_three::<V>(&arrivals.geometric_normal, at),
            to_viewer,
            cos_out,
            specular_share: if lobe_strength == 0.0 { zero } else { share },
            inverse_width_squared: V::load(&arrivals.log_width[at..]).mul(V::splat(-2.0 * LOG2_E)).exp2(),
            model: arrivals.model,
        }
    }

    /// See [`crate::material::LobeSampler::sample`].
    #[inline(always)]
    fn draw(&self, u: [V; 2]) -> [V; 3] {
        let (zero, one, almost) = (V::splat(0.0), V::splat(1.0), V::splat(1.0 - f32::EPSILON / 2.0));
        let share = self.specular_share;
        let is_specular = share.sub(u[0]);
        // Of either lobe: the number that is left, the squared sine and the cosine about the normal.
        let of_specular = u[0].div(share.max(V::splat(1e-6))).min(almost);
        let specular_sine = match self.model {
            LobeModel::BlinnPhong => one_minus_exp(ln_one_minus(of_specular).div(self.inverse_width_squared)),
            LobeModel::Ggx => of_specular.div(one.sub(of_specular).mul_add(self.inverse_width_squared, of_specular)),
        };
        let diffuse_sine = u[0].sub(share).div(one.sub(share)).max(zero).min(almost);
        let sine_squared = is_specular.where_positive(specular_sine, diffuse_sine);
        let sine = sine_squared.sqrt();
        let cosine = one.sub(sine_squared).max(zero).sqrt();
        let (sin_phi, cos_phi) = sine_and_cosine_of_turns(u[1]);
        // The frame of `math::frame`.
        let [x, y, z] = self.normal;
        let sign = z.where_positive(one, zero.sub(one));
        let a = zero.sub(one).div(sign.add(z));
        let b = x.mul(y).mul(a);
        let tangent = [sign.mul(x).mul(x).mul_add(a, one), sign.mul(b), zero.sub(sign.mul(x))];
        let bitangent = [b, y.mul(y).mul_add(a, sign), zero.sub(y)];
        let (along, across) = (sine.mul(cos_phi), sine.mul(sin_phi));
        let mut drawn = [zero; 3];
        for (k, value) in drawn.iter_mut().enumerate() {
            *value = tangent[k].mul_add(along, bitangent[k].mul_add(across, self.normal[k].mul(cosine)));
        }
        // What was drawn for the specular lobe is the half vector.
        let twice = dot(drawn, self.to_viewer).mul(V::splat(2.0));
        let mut direction = [zero; 3];
        for (k, value) in direction.iter_mut().enumerate() {
            let mirrored = drawn[k].mul_add(twice, zero.sub(self.to_viewer[k]));
            *value = is_specular.where_positive(mirrored, drawn[k]);
        }
        direction
    }

    /// Geometry of the lobe and density of its sampler for a direction; see [`crate::material::LobeGeometry::new`].
    #[inline(always)]
    fn describe(&self, direction: [V; 3], directions: &mut Directions, at: usize) {
        let one = V::splat(1.0);
        let cos_in = dot(self.normal, direction);
        let half = [
            direction[0].add(self.to_viewer[0]),
            direction[1].add(self.to_viewer[1]),
            direction[2].add(self.to_viewer[2]),
        ];
        let length_squared = dot(half, half);
        let [x, y, z] = self.normal;
        let cross = [
            y.mul(half[2]).sub(z.mul(half[1])),
            z.mul(half[0]).sub(x.mul(half[2])),
            x.mul(half[1]).sub(y.mul(half[0])),
        ];
        let least = V::splat(1e-12);
        let sine_squared = dot(cross, cross).div(length_squared.max(least)).min(V::splat(1.0 - 1e-7));
        let ln_cos_half = ln_one_minus(sine_squared).mul(V::splat(0.5));
        let half_dot_out = length_squared.sqrt().mul(V::splat(0.5)).min(one);
        let above = cos_in.min(dot(self.geometric_normal, direction)).min(length_squared.sub(least));

        // p(h) = D(h) (n.h), p(i) = p(h) / (4 h.o).
        let falloff = match self.model {
            LobeModel::BlinnPhong => {
                let exponent = self.inverse_width_squared.mul_add(V::splat(2.0), V::splat(-1.0));
                exponent.mul(ln_cos_half).mul(V::splat(LOG2_E)).exp2()
            }
            LobeModel::Ggx => {
                let spread = self.inverse_width_squared.sub(one).mul_add(sine_squared, one);
                one.sub(sine_squared).sqrt().div(spread.mul(spread))
            }
        };
        let of_half = self.inverse_width_squared.mul(V::splat(0.25 / PI)).mul(falloff);
        let specular = self.specular_share.mul(of_half).div(half_dot_out.max(V::splat(1e-6)));
        let diffuse = one.sub(self.specular_share).mul(cos_in).mul(V::splat(1.0 / PI));

        above.store(&mut directions.above[at..]);
        for k in 0..3 {
            direction[k].store(&mut directions.direction[k][at..]);
        }
        cos_in.min(one).store(&mut directions.cos_in[at..]);
        ln_cos_half.store(&mut directions.ln_cos_half[at..]);
        half_dot_out.store(&mut directions.half_dot_out[at..]);
        specular.add(diffuse).store(&mut directions.lobe_density[at..]);
    }
}
