//! Narrow lobes: a frozen quadrature over half vectors.
//!
//! Half vectors of the density `D(h) (n.h)` lie at `ln cos = a^2/2 ln(1 - u)`. The places `u` are fixed and of equal
//! probability, their azimuths follow the golden angle, and the frame turns with the viewer: the sum is a smooth
//! function of normal, viewer and width, without noise. The light and its visibility are read bilinearly, as the hats are.

use super::light_basis::LightBasis;
use super::lobe_sum::{LobePlace, LobeSums};
use crate::math::frame::Frame;
use crate::math::sphere::{BilinearTap, tap_of_angles};
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::OnceLock;

/// Places of the quadrature for the narrowest lobes; it grows with the lobe's solid angle.
const FEWEST_PLACES: usize = 128;
/// Places at the width where sums over hats take over.
const MOST_PLACES: usize = 512;

/// A direction of the quadrature.
struct Place {
    tap: BilinearTap,
    /// Weight of `S0 - S5` and of `S5`.
    weight: [f32; 2],
}

/// How many places a lobe of this width is given: they about keep their distance in texels once it is wider than two or
/// so. A power of two, so that sums do not jump but at a few widths.
pub fn place_count(basis: &LightBasis, width: f32) -> usize {
    let relative = width / super::lobe_sum::wide_from(basis);
    ((MOST_PLACES as f32 * relative * relative) as usize).next_power_of_two().clamp(FEWEST_PLACES, MOST_PLACES)
}

/// `ln(1 - u)`, and cosine and sine of the azimuth, of the places of a quadrature: they are the same for all lobes.
fn places(count: usize) -> &'static [[f32; 3]] {
    const SIZES: usize = 12;
    static TABLES: [OnceLock<Vec<[f32; 3]>>; SIZES] = [const { OnceLock::new() }; SIZES];
    let which = (count.max(1).ilog2() as usize).min(SIZES - 1);
    TABLES[which].get_or_init(|| {
        let count = 1usize << which;
        let golden = 0.618_034_f32;
        (0..count)
            .map(|index| {
                let u = (index as f32 + 0.5) / count as f32;
                let (sin_phi, cos_phi) = (TAU * (index as f32 * golden).fract()).sin_cos();
                [(1.0 - u).ln(), cos_phi, sin_phi]
            })
            .collect()
    })
}

/// Angle of (x, y) in (-pi, pi], to 3e-7: Abramowitz and Stegun 1964, 4.4.49. A third of the time of the exact one.
fn angle_of(y: f32, x: f32) -> f32 {
    let (large, small) = (x.abs().max(y.abs()), x.abs().min(y.abs()));
    let t = if large > 0.0 { small / large } else { 0.0 };
    let t2 = t * t;
    let series = 0.002_866_225_7_f32;
    let series = series * t2 - 0.016_165_737;
    let series = series * t2 + 0.042_909_614;
    let series = series * t2 - 0.075_289_64;
    let series = series * t2 + 0.106_562_64;
    let series = series * t2 - 0.142_089;
    let series = series * t2 + 0.199_935_51;
    let series = series * t2 - 0.333_331_45;
    let mut angle = t + t * t2 * series;
    if y.abs() > x.abs() {
        angle = FRAC_PI_2 - angle;
    }
    // By the sign bit, as the exact one: at the poles, where both are zero, it decides.
    if x.is_sign_negative() {
        angle = PI - angle;
    }
    if y.is_sign_negative() { -angle } else { angle }
}

/// [`tap_of_direction`](crate::math::sphere::tap_of_direction) by fast angles.
fn tap_at(direction: Vec3, width: usize, height: usize) -> BilinearTap {
    let phi = angle_of(direction.x, -direction.z);
    let theta = angle_of((direction.x * direction.x + direction.z * direction.z).sqrt(), direction.y);
    tap_of_angles(phi, theta, width, height)
}

fn for_each_place(basis: &LightBasis, place: &LobePlace, width: f32, count: usize, mut visit: impl FnMut(&Place)) {
    let normal = place.normal;
    let cos_out = normal.dot(place.to_viewer);
    let fallback = Frame::around(normal);
    let tangent = (place.to_viewer - normal * cos_out).try_normalize().unwrap_or(fallback.tangent);
    let bitangent = normal.cross(tangent);
    let k = 0.5 * width;
    let q_out = cos_out * (1.0 - k) + k;
    for &[log_rest, cos_phi, sin_phi] in places(count) {
        // cos - 1, exact near 1.
        let below_one = (0.5 * width * width * log_rest).exp_m1();
        let cos = 1.0 + below_one;
        let sin = (-below_one * (2.0 + below_one)).max(0.0).sqrt();
        let half = tangent * (sin * cos_phi) + bitangent * (sin * sin_phi) + normal * cos;
        let half_dot_out = half.dot(place.to_viewer);
        if half_dot_out <= 0.0 {
            continue;
        }
        let direction: Vec3 = half * (2.0 * half_dot_out) - place.to_viewer;
        let cos_in = normal.dot(direction);
        if cos_in <= 0.0 {
            continue;
        }
        let q_in = cos_in * (1.0 - k) + k;
        let value = cos_in * half_dot_out / (q_in * q_out * cos * count as f32);
        let rest = (1.0 - half_dot_out).max(0.0);
        let schlick = rest * rest * rest * rest * rest;
        visit(&Place {
            tap: tap_at(direction, basis.width, basis.height),
            weight: [value * (1.0 - schlick), value * schlick],
        });
    }
}

/// The sums of a lobe over so many places, without derivatives. Sums that are subtracted from each other need the same
/// number of places, see [`place_count`].
pub fn lobe_sums(basis: &LightBasis, place: &LobePlace, light: &[Vec<f32>; 3], width: f32, count: usize) -> LobeSums {
    let mut sums = LobeSums::default();
    for_each_place(basis, place, width, count, |at| {
        let mut hidden = 1.0;
        let mut radiance = [0.0f32; 3];
        for k in 0..4 {
            let texel = at.tap.index[k] as usize;
            let share = at.tap.weight[k] * f32::from(place.shares[texel]) * (1.0 / 255.0);
            hidden -= share;
            for channel in 0..3 {
                radiance[channel] += share * light[channel][texel];
            }
        }
        for channel in 0..3 {
            sums.base[channel] += at.weight[0] * radiance[channel];
            sums.grazing[channel] += at.weight[1] * radiance[channel];
        }
        for part in 0..2 {
            sums.hidden[part] += at.weight[part] * hidden;
        }
    });
    sums
}

/// Adds the rows of `S0 - S5` and `S5`, times `scales`, to a row over the texels of the light.
pub fn add_lobe_row(basis: &LightBasis, place: &LobePlace, width: f32, scales: [f32; 2], row: &mut [f32]) {
    for_each_place(basis, place, width, place_count(basis, width), |at| {
        let value = (scales[0] * at.weight[0] + scales[1] * at.weight[1]) * (1.0 / 255.0);
        for k in 0..4 {
            let texel = at.tap.index[k] as usize;
            row[texel] += value * at.tap.weight[k] * f32::from(place.shares[texel]);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::math::sphere::tap_of_direction;

    #[test]
    fn fast_taps_read_what_exact_ones_do() {
        let mut random = SequentialRandom::new(5);
        let values: Vec<f32> = (0..64 * 32).map(|_| random.next_number()).collect();
        let mut directions: Vec<Vec3> = (0..20_000)
            .map(|_| Vec3::from_array([(); 3].map(|()| 2.0 * random.next_number() - 1.0)).normalize_or(Vec3::Y))
            .collect();
        directions.extend([Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z]);
        for direction in directions {
            let read = |tap: BilinearTap| (0..4).map(|k| values[tap.index[k] as usize] * tap.weight[k]).sum::<f32>();
            let (fast, exact) = (read(tap_at(direction, 64, 32)), read(tap_of_direction(direction, 64, 32)));
            assert!((fast - exact).abs() < 3e-5, "{direction}: {fast} {exact}");
        }
    }
}
