//! Diffuse light at a point: a masked sum over the hats of the light, its row and its transpose.
//!
//! `E = 1/pi ∑_j share_j max(0, n . moment_j) L_j`: what a white Lambert surface sends back. It is linear in the light.
//!
//! Over the same hats `V = 1/pi ∑_j share_j moment_j L_j` is the vector irradiance over pi (Arvo 1994, "The irradiance Jacobian
//! for partially occluded polyhedral sources"): `V . n` is `E`, and to first order that of surface whose normal is near.

use super::light_basis::LightBasis;
use crate::math::vector::{Vector, versions};
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

versions! {
    /// `E` per channel of a point with this unit normal and these visible shares, under a light in planes of the basis.
    pub fn irradiance(basis: &LightBasis, normal: Vec3, shares: &[u8], light: &[Vec<f32>; 3]) -> [f32; 3]
        = irradiance_in;
    /// Vector irradiance over pi per channel: times the normal it is [`irradiance`].
    pub fn vector_irradiance(basis: &LightBasis, normal: Vec3, shares: &[u8], light: &[Vec<f32>; 3]) -> [Vec3; 3]
        = vector_in;
    /// The transpose of [`irradiance`]: adds the derivative by the light, given that by `E`.
    pub fn irradiance_backward(
        basis: &LightBasis,
        normal: Vec3,
        shares: &[u8],
        d_irradiance: [f32; 3],
        d_light: &mut [Vec<f32>; 3],
    ) = backward_in;
    /// Adds `scale` times the row of [`irradiance`] to a row over the padded texels of the light.
    pub fn add_irradiance_row(basis: &LightBasis, normal: Vec3, shares: &[u8], scale: f32, row: &mut [f32]) = row_in;
}

/// `n . moment` of the next hats; `None` when all lie below the horizon.
#[inline(always)]
fn cosines<V: Vector>(basis: &LightBasis, normal: [V; 3], at: usize) -> Option<V> {
    let [x, y, z] = &basis.moment;
    let cosine = normal[0].mul(V::load(&x[at..at + V::LANES]));
    let cosine = normal[1].mul_add(V::load(&y[at..at + V::LANES]), cosine);
    let cosine = normal[2].mul_add(V::load(&z[at..at + V::LANES]), cosine);
    cosine.any_positive().then_some(cosine)
}

/// `share (n . moment)+` of the next hats, in units of 1/255; `None` when all lie below the horizon.
#[inline(always)]
fn weights<V: Vector>(basis: &LightBasis, normal: [V; 3], shares: &[u8], at: usize) -> Option<V> {
    let cosine = cosines(basis, normal, at)?;
    Some(cosine.max(V::splat(0.0)).mul(V::load_bytes(&shares[at..at + V::LANES])))
}

#[inline(always)]
fn irradiance_in<V: Vector>(basis: &LightBasis, normal: Vec3, shares: &[u8], light: &[Vec<f32>; 3]) -> [f32; 3] {
    let normal = normal.to_array().map(V::splat);
    let mut sums = [V::splat(0.0); 3];
    for at in (0..basis.padded()).step_by(V::LANES) {
        let Some(weight) = weights(basis, normal, shares, at) else { continue };
        for channel in 0..3 {
            sums[channel] = weight.mul_add(V::load(&light[channel][at..at + V::LANES]), sums[channel]);
        }
    }
    sums.map(|sum| sum.sum() * (FRAC_1_PI / 255.0))
}

#[inline(always)]
fn vector_in<V: Vector>(basis: &LightBasis, normal: Vec3, shares: &[u8], light: &[Vec<f32>; 3]) -> [Vec3; 3] {
    let normal = normal.to_array().map(V::splat);
    let mut sums = [[V::splat(0.0); 3]; 3];
    for at in (0..basis.padded()).step_by(V::LANES) {
        let Some(cosine) = cosines(basis, normal, at) else { continue };
        let share = cosine.where_positive(V::load_bytes(&shares[at..at + V::LANES]), V::splat(0.0));
        for (channel, sums) in sums.iter_mut().enumerate() {
            let radiance = share.mul(V::load(&light[channel][at..at + V::LANES]));
            for (axis, sum) in sums.iter_mut().enumerate() {
                *sum = radiance.mul_add(V::load(&basis.moment[axis][at..at + V::LANES]), *sum);
            }
        }
    }
    let mut vectors = [Vec3::ZERO; 3];
    for (vector, sums) in vectors.iter_mut().zip(&sums) {
        for (axis, sum) in sums.iter().enumerate() {
            vector[axis] = sum.sum() * (FRAC_1_PI / 255.0);
        }
    }
    vectors
}

#[inline(always)]
fn backward_in<V: Vector>(basis: &LightBasis, normal: Vec3, shares: &[u8], d: [f32; 3], d_light: &mut [Vec<f32>; 3]) {
    let normal = normal.to_array().map(V::splat);
    let d = d.map(|value| V::splat(value * (FRAC_1_PI / 255.0)));
    for at in (0..basis.padded()).step_by(V::LANES) {
        let Some(weight) = weights(basis, normal, shares, at) else { continue };
        for channel in 0..3 {
            let place = &mut d_light[channel][at..at + V::LANES];
            weight.mul_add(d[channel], V::load(place)).store(place);
        }
    }
}

#[inline(always)]
fn row_in<V: Vector>(basis: &LightBasis, normal: Vec3, shares: &[u8], scale: f32, row: &mut [f32]) {
    let normal = normal.to_array().map(V::splat);
    let scale = V::splat(scale * (FRAC_1_PI / 255.0));
    for at in (0..basis.padded()).step_by(V::LANES) {
        let Some(weight) = weights(basis, normal, shares, at) else { continue };
        let place = &mut row[at..at + V::LANES];
        weight.mul_add(scale, V::load(place)).store(place);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::math::vector::Plain;

    #[test]
    fn versions_agree_and_the_transpose_is_one() {
        let basis = LightBasis::new(64, 32);
        let mut random = SequentialRandom::new(3);
        let mut plane = || (0..basis.padded()).map(|_| random.next_number()).collect::<Vec<f32>>();
        let light = [plane(), plane(), plane()];
        let shares: Vec<u8> = plane().iter().map(|value| (value * 300.0).min(255.0) as u8).collect();
        let d_light = [plane(), plane(), plane()];
        for normal in [Vec3::Y, Vec3::new(0.36, 0.48, -0.8), Vec3::NEG_X] {
            let fast = irradiance(&basis, normal, &shares, &light);
            let vectors = vector_irradiance(&basis, normal, &shares, &light);
            let plain_vectors = vector_in::<Plain>(&basis, normal, &shares, &light);
            let plain = irradiance_in::<Plain>(&basis, normal, &shares, &light);
            let truth: [f64; 3] = [0, 1, 2].map(|channel| {
                (0..basis.count())
                    .map(|j| {
                        let cosine: f64 =
                            (0..3).map(|axis| f64::from(basis.moment[axis][j]) * f64::from(normal[axis])).sum();
                        cosine.max(0.0) * f64::from(shares[j]) / 255.0 * f64::from(light[channel][j])
                    })
                    .sum::<f64>()
                    / std::f64::consts::PI
            });
            let mut row = vec![0.0; basis.padded()];
            add_irradiance_row(&basis, normal, &shares, 1.0, &mut row);
            let d = [0.3f32, -1.0, 2.0];
            let mut transposed = [(); 3].map(|()| vec![0.0; basis.padded()]);
            irradiance_backward(&basis, normal, &shares, d, &mut transposed);
            for channel in 0..3 {
                assert!((f64::from(fast[channel]) / truth[channel] - 1.0).abs() < 1e-6);
                assert!((f64::from(plain[channel]) / truth[channel] - 1.0).abs() < 3e-6);
                assert!((f64::from(vectors[channel].dot(normal)) / truth[channel] - 1.0).abs() < 3e-6);
                assert!((vectors[channel] - plain_vectors[channel]).length() < 3e-6 * vectors[channel].length());
                let dot =
                    |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum() };
                let by_row = dot(&row, &light[channel]);
                assert!((by_row / truth[channel] - 1.0).abs() < 1e-6);
                // <A x, d> = <x, A' d>, with another x than the light.
                let forward = f64::from(irradiance(&basis, normal, &shares, &d_light)[channel] * d[channel]);
                let backward = dot(&transposed[channel], &d_light[channel]);
                assert!((forward / backward - 1.0).abs() < 1e-6, "{forward} {backward}");
            }
        }
    }
}
