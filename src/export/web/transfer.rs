//! What each vertex gets of a light, past the mesh and by way of it: precomputed transfer in spherical harmonics of bands 0
//! to 2 (Sloan, Kautz and Snyder 2002).
//!
//! The polar axis is +y, so that a light that turns about it only turns the two functions of each order within each other.

use crate::error::Result;
use crate::image::RgbImage;
use crate::light::Environment;
use crate::material::texels::texel_of_uv;
use crate::math::frame::{Frame, sample_cosine_hemisphere};
use crate::math::parallel;
use crate::math::sphere::{direction_of_texel, solid_angle_of_texel};
use crate::scene::Mesh;
use crate::trace::{Bvh, Ray};
use glam::{Vec2, Vec3};

/// Functions of bands 0 to 2.
pub const COUNT: usize = 9;
/// Largest transfer that a byte holds; none is larger but at places that see next to nothing.
pub const LARGEST: f32 = 0.6;
/// The same of light that comes by way of other surface.
pub const LARGEST_BETWEEN: f32 = 0.3;
/// How often light goes from surface to surface.
const BOUNCES: usize = 2;
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

/// What a vertex gets of a light: times the light's coefficients, summed, it is irradiance over pi.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transfer {
    /// Past the mesh itself: the integral over directions that see the sky of cosine over pi times each function.
    pub direct: [f32; COUNT],
    /// By way of other surface, channel by channel.
    pub between: [[f32; COUNT]; 3],
    /// Share of the sky, by the cosine, that the back of the surface sees.
    pub openness_behind: f32,
}

impl Transfer {
    const NONE: Self = Transfer { direct: [0.0; COUNT], between: [[0.0; COUNT]; 3], openness_behind: 0.0 };

    /// Share of the sky, by the cosine, that the vertex sees.
    pub fn openness(&self) -> f32 {
        self.direct[0] / harmonics(Vec3::Y)[0]
    }
}

/// The transfer of each vertex. Backs of surface send nothing on.
///
/// # Errors
/// A mesh in which no rays can be traced.
pub fn transfer(mesh: &Mesh, diffuse: &RgbImage) -> Result<Vec<Transfer>> {
    let gatherer = Gatherer::new(mesh, diffuse)?;
    let count = mesh.positions.len().min(mesh.normals.len());
    let mut all = parallel::map(count, |vertex| gatherer.of_sky(vertex));
    for _ in 0..BOUNCES {
        let between = parallel::map(count, |vertex| gatherer.of_surface(vertex, &all));
        all.iter_mut().zip(between).for_each(|(own, between)| own.between = between);
    }
    Ok(all)
}

struct Gatherer<'a> {
    mesh: &'a Mesh,
    diffuse: &'a RgbImage,
    bvh: Bvh,
    lift: f32,
}

impl<'a> Gatherer<'a> {
    fn new(mesh: &'a Mesh, diffuse: &'a RgbImage) -> Result<Self> {
        let bvh = Bvh::build(&mesh.positions, &mesh.triangles)?;
        let (low, high) = bvh.bounds();
        Ok(Gatherer { mesh, diffuse, lift: 1e-4 * (high - low).length(), bvh })
    }

    /// Rays from a vertex, spread by the cosine about this normal.
    fn rays(&self, vertex: usize, normal: Vec3) -> impl Iterator<Item = Ray> {
        let origin = self.mesh.positions[vertex] + normal * self.lift;
        let frame = Frame::around(normal);
        (0..SIDE * SIDE).map(move |index| {
            let u = [(index / SIDE) as f32 + 0.5, (index % SIDE) as f32 + 0.5].map(|place| place / SIDE as f32);
            Ray { origin, direction: frame.outer_from_local(sample_cosine_hemisphere(u)), t_max: f32::INFINITY }
        })
    }

    fn normal(&self, vertex: usize) -> Vec3 {
        self.mesh.normals[vertex].try_normalize().unwrap_or(Vec3::Y)
    }

    fn of_sky(&self, vertex: usize) -> Transfer {
        const SHARE: f32 = 1.0 / (SIDE * SIDE) as f32;
        let mut own = Transfer::NONE;
        for ray in self.rays(vertex, self.normal(vertex)).filter(|ray| !self.bvh.is_occluded(ray)) {
            own.direct.iter_mut().zip(harmonics(ray.direction)).for_each(|(sum, value)| *sum += SHARE * value);
        }
        let open = self.rays(vertex, -self.normal(vertex)).filter(|ray| !self.bvh.is_occluded(ray)).count();
        Transfer { openness_behind: SHARE * open as f32, ..own }
    }

    /// What arrives from other surface, of what arrives there by now.
    fn of_surface(&self, vertex: usize, all: &[Transfer]) -> [[f32; COUNT]; 3] {
        let mut sums = [[0.0; COUNT]; 3];
        for ray in self.rays(vertex, self.normal(vertex)) {
            let Some(hit) = self.bvh.closest_hit(&ray) else { continue };
            let corners = self.mesh.triangles[hit.triangle as usize].map(|corner| corner as usize);
            let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
            let there = || corners.into_iter().zip(weights);
            let normal: Vec3 = there().map(|(corner, weight)| weight * self.mesh.normals[corner]).sum();
            if normal.dot(ray.direction) >= 0.0 {
                continue;
            }
            let uv: Vec2 = there().map(|(corner, weight)| weight * self.mesh.uvs[corner]).sum();
            let albedo = self.diffuse[texel_of_uv(uv, self.diffuse.width(), self.diffuse.height())].to_array();
            for (corner, weight) in there().filter(|(corner, _)| *corner < all.len()) {
                let own = &all[corner];
                for (channel, sums) in sums.iter_mut().enumerate() {
                    let share = albedo[channel] * weight / (SIDE * SIDE) as f32;
                    let arriving = own.direct.iter().zip(&own.between[channel]);
                    sums.iter_mut()
                        .zip(arriving)
                        .for_each(|(sum, (direct, between))| *sum += share * (direct + between));
                }
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

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
            radiance: Image::from_fn(64, 32, |row, column| {
                Vec3::splat(1.0 + direction_of_texel(row, column, 64, 32).y)
            }),
        };
        let coefficients = coefficients(&light);
        let lit = |transfer: &[f32; COUNT]| -> f32 { transfer.iter().zip(&coefficients).map(|(t, l)| t * l.x).sum() };
        let black = Image::filled(4, 4, Vec3::ZERO);
        let floor = |x: f32, z: f32| Vec3::new(x, 0.0, z);
        let mut mesh = Mesh {
            positions: vec![floor(-9.0, -9.0), floor(9.0, -9.0), floor(9.0, 9.0), floor(-9.0, 9.0), Vec3::ZERO],
            triangles: vec![[0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]],
            ..Mesh::default()
        };
        mesh.normals = vec![Vec3::Y; 5];
        mesh.uvs = vec![Vec2::splat(0.5); 9];
        let open = transfer(&mesh, &black).unwrap()[4];
        assert!((lit(&open.direct) - 5.0 / 3.0).abs() < 0.02 && (open.openness() - 1.0).abs() < 1e-6, "{open:?}");
        assert_eq!(open.openness_behind, 1.0);
        // A high wall beside it hides the half of +x: it sees half of the sky, and of this light half of the irradiance.
        let wall = |y: f32, z: f32| Vec3::new(0.05, y, z);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([wall(0.0, -500.0), wall(0.0, 500.0), wall(500.0, 500.0), wall(500.0, -500.0)]);
        mesh.normals.extend([Vec3::NEG_X; 4]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        let beside = transfer(&mesh, &black).unwrap()[4];
        assert!((beside.openness() - 0.5).abs() < 0.02, "{}", beside.openness());
        assert!((lit(&beside.direct) - 5.0 / 6.0).abs() < 0.03, "{}", lit(&beside.direct));
        // And a light from +x alone reaches it no more.
        assert!(beside.direct[1] < -0.1, "{beside:?}");
        assert_eq!(beside.between, [[0.0; COUNT]; 3]);
    }

    #[test]
    fn light_goes_between_two_faces_in_the_colour_of_the_surface() {
        let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let face = |y: f32| [corner(-1.0, y, -1.0), corner(1.0, y, -1.0), corner(1.0, y, 1.0), corner(-1.0, y, 1.0)];
        let mut mesh = Mesh { positions: [face(0.0), face(0.5)].concat(), ..Mesh::default() };
        mesh.triangles = vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]];
        mesh.normals = [[Vec3::Y; 4], [Vec3::NEG_Y; 4]].concat();
        mesh.uvs = vec![Vec2::splat(0.5); 8];
        let [white, red] = [Vec3::ONE, Vec3::X].map(|rgb| transfer(&mesh, &Image::filled(2, 2, 0.5 * rgb)).unwrap());
        for (white, red) in white.iter().zip(&red) {
            assert_eq!((white.direct, white.openness_behind), (red.direct, 1.0));
            let even = |between: &[f32; COUNT]| between[0] / harmonics(Vec3::Y)[0];
            let [one, none] = [even(&red.between[0]), even(&red.between[1])];
            // A corner sees a part of the other face, which has as much of the sky as it, and some of what that reflects.
            let hidden = 1.0 - white.openness();
            let (least, most) = (0.5 * hidden * white.openness(), 0.5 * hidden / (1.0 - 0.5 * hidden));
            assert!(none == 0.0 && one > least && one < most, "{one} {least} {most}");
            assert_eq!(red.between[0], white.between[2]);
        }
    }
}
