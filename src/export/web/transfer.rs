//! What each vertex lets through of the sky: precomputed transfer in spherical harmonics of bands 0 to 2 (Sloan, Kautz and
//! Snyder 2002, without light between surfaces).
//!
//! The polar axis is +y, so that a light that turns about it only turns the two functions of each order within each other.

use crate::error::Result;
use crate::light::Environment;
use crate::math::frame::{Frame, sample_cosine_hemisphere};
use crate::math::parallel;
use crate::math::sphere::{direction_of_texel, solid_angle_of_texel};
use crate::scene::Mesh;
use crate::trace::{Bvh, Ray};
use glam::Vec3;

/// Functions of bands 0 to 2.
pub const COUNT: usize = 9;
/// Largest transfer that a byte holds; none is larger but at places that see next to nothing.
pub const LARGEST: f32 = 0.6;
/// Rays from a vertex along each side of the square that spreads them.
const SIDE: usize = 12;

/// Real spherical harmonics of a unit direction, in the order (0, 0), (1, -1), (1, 0), (1, 1), (2, -2), ... (2, 2).
pub fn harmonics(direction: Vec3) -> [f32; COUNT] {
    // x, y and z of the usual definition.
    let [x, y, z] = [direction.z, direction.x, direction.y];
    [
        0.282_094_8,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * z * z - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (x * x - y * y),
    ]
}

/// The light's coefficients: integrals of radiance times each function.
pub fn coefficients(light: &Environment) -> [Vec3; COUNT] {
    let (width, height) = (light.width(), light.height());
    let mut sums = [glam::DVec3::ZERO; COUNT];
    for (index, radiance) in light.radiance.pixels().iter().enumerate() {
        let direction = direction_of_texel(index / width, index % width, width, height);
        let weight = solid_angle_of_texel(index / width, width, height);
        for (sum, value) in sums.iter_mut().zip(harmonics(direction)) {
            *sum += radiance.as_dvec3() * (weight * f64::from(value));
        }
    }
    sums.map(|sum| sum.as_vec3())
}

/// For each vertex the integral over the directions it sees of cosine over pi times each function: times a light's
/// coefficients, summed, it is the irradiance over pi that reaches the vertex past the mesh itself.
///
/// # Errors
/// A mesh in which no rays can be traced.
pub fn transfer(mesh: &Mesh) -> Result<Vec<[f32; COUNT]>> {
    let bvh = Bvh::build(&mesh.positions, &mesh.triangles)?;
    let (low, high) = bvh.bounds();
    let lift = 1e-4 * (high - low).length();
    let of_vertex = |vertex: usize| {
        let (position, normal) = (mesh.positions[vertex], mesh.normals[vertex].try_normalize().unwrap_or(Vec3::Y));
        let frame = Frame::around(normal);
        let mut sum = [0.0; COUNT];
        for index in 0..SIDE * SIDE {
            let u = [(index / SIDE) as f32 + 0.5, (index % SIDE) as f32 + 0.5].map(|place| place / SIDE as f32);
            let direction = frame.outer_from_local(sample_cosine_hemisphere(u));
            if !bvh.is_occluded(&Ray { origin: position + normal * lift, direction, t_max: f32::INFINITY }) {
                sum.iter_mut().zip(harmonics(direction)).for_each(|(sum, value)| *sum += value);
            }
        }
        sum.map(|sum| sum / (SIDE * SIDE) as f32)
    };
    Ok(parallel::map(mesh.positions.len().min(mesh.normals.len()), of_vertex))
}

/// Share of the sky, by the cosine, that a vertex sees.
pub fn openness(transfer: &[f32; COUNT]) -> f32 {
    transfer[0] / harmonics(Vec3::Y)[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonics_are_orthonormal() {
        let (width, height) = (64, 32);
        let mut products = [[0.0f64; COUNT]; COUNT];
        for index in 0..width * height {
            let values = harmonics(direction_of_texel(index / width, index % width, width, height));
            let weight = solid_angle_of_texel(index / width, width, height);
            for (row, one) in products.iter_mut().zip(values) {
                row.iter_mut().zip(values).for_each(|(sum, other)| *sum += weight * f64::from(one * other));
            }
        }
        for (row, line) in products.iter().enumerate() {
            for (column, product) in line.iter().enumerate() {
                let wanted = if row == column { 1.0 } else { 0.0 };
                assert!((product - wanted).abs() < 0.01, "{row} {column}: {product}");
            }
        }
    }

    #[test]
    fn a_vertex_in_the_open_gets_the_irradiance_of_a_smooth_light_and_one_in_a_corner_what_it_sees() {
        // Radiance 1 + y over the sphere: over pi the irradiance of an upward surface is 1 + 2/3.
        let light = Environment {
            radiance: crate::image::Image::from_fn(64, 32, |row, column| {
                Vec3::splat(1.0 + direction_of_texel(row, column, 64, 32).y)
            }),
        };
        let coefficients = coefficients(&light);
        let at = |transfer: &[f32; COUNT]| -> f32 { transfer.iter().zip(&coefficients).map(|(t, l)| t * l.x).sum() };
        let floor = |x: f32, z: f32| Vec3::new(x, 0.0, z);
        let mut mesh = Mesh {
            positions: vec![floor(-9.0, -9.0), floor(9.0, -9.0), floor(9.0, 9.0), floor(-9.0, 9.0), Vec3::ZERO],
            triangles: vec![[0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]],
            ..Mesh::default()
        };
        mesh.normals = vec![Vec3::Y; 5];
        let open = transfer(&mesh).unwrap()[4];
        assert!((at(&open) - 5.0 / 3.0).abs() < 0.02 && (openness(&open) - 1.0).abs() < 1e-6, "{}", at(&open));
        // A high wall beside it hides the half of +x: it sees half of the sky, and of this light half of the irradiance.
        let wall = |y: f32, z: f32| Vec3::new(0.05, y, z);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([wall(0.0, -500.0), wall(0.0, 500.0), wall(500.0, 500.0), wall(500.0, -500.0)]);
        mesh.normals.extend([Vec3::NEG_X; 4]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        let beside = transfer(&mesh).unwrap()[4];
        assert!((openness(&beside) - 0.5).abs() < 0.02, "{}", openness(&beside));
        assert!((at(&beside) - 5.0 / 6.0).abs() < 0.03, "{}", at(&beside));
        // And a light from +x alone reaches it no more.
        assert!(beside[1] < -0.1, "{beside:?}");
    }
}
