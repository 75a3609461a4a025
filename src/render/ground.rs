//! A level ground under the surface that is not there but for the shadow that falls on it.
//!
//! A pixel beside the surface shows the environment; where its ray meets the ground first, the environment is dimmed by the
//! share of the ground's irradiance that the surface keeps away (differential rendering, Debevec 1998, for a diffuse ground
//! as bright as what lies behind it). No light goes from the ground back to the surface: pictures of the surface stay what
//! they are without it.

use super::surface::Surface;
use crate::light::{Environment, EnvironmentSampler};
use crate::math::luminance;
use crate::math::random::SampleStream;
use crate::trace::Ray;
use glam::Vec3;

/// So far above the ground a shadow ray begins, as a share of its distance from the eye: the ground is exact, but the surface
/// may stand in it.
const LIFT: f32 = 1e-4;

/// The ground of a picture.
pub struct Ground<'a> {
    surface: &'a Surface,
    light: &'a EnvironmentSampler,
    environment: &'a Environment,
    height: f32,
}

impl<'a> Ground<'a> {
    /// A ground at a height (y of the world) below a surface, under an environment.
    pub fn new(surface: &'a Surface, light: &'a EnvironmentSampler, environment: &'a Environment, height: f32) -> Self {
        Ground { surface, light, environment, height }
    }

    /// Share of the irradiance that reaches the ground where a ray meets it, in [0, 1], over `samples` directions towards
    /// the light; 1 for a ray that goes above the horizon or meets the surface.
    pub fn lit_share(&self, ray: &Ray, samples: usize, stream: &mut SampleStream) -> f32 {
        let distance = (self.height - ray.origin.y) / ray.direction.y;
        // Seen from below there is no ground.
        if ray.direction.y >= 0.0 || !(distance.is_finite() && distance > 0.0) || self.surface.closest(ray).is_some() {
            return 1.0;
        }
        let place = ray.origin + distance * ray.direction + LIFT * distance * Vec3::Y;
        let (mut all, mut reached) = (0.0, 0.0);
        for _ in 0..samples.max(1) {
            let Some(towards) = self.light.sample(stream.next_pair()) else { return 1.0 };
            if towards.direction.y <= 0.0 {
                continue;
            }
            let radiance = luminance(self.environment.radiance_towards(towards.direction));
            let value = radiance * towards.direction.y / towards.density;
            all += value;
            let to_light = Ray { origin: place, direction: towards.direction, t_max: f32::INFINITY };
            if self.surface.closest(&to_light).is_none() {
                reached += value;
            }
        }
        if all > 0.0 { reached / all } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::StreamKey;
    use crate::scene::Mesh;

    /// A square of 2 x 2 units at height 1 over the origin, seen from both sides.
    fn roof() -> Surface {
        let corner = |x: f32, z: f32| Vec3::new(x, 1.0, z);
        let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(glam::Vec2::from_array).to_vec();
        let mut mesh = Mesh { positions, triangles: vec![[0, 2, 1], [0, 3, 2]], uvs: uv, ..Mesh::default() };
        mesh.compute_normals();
        Surface::new(mesh).unwrap()
    }

    fn share_at(x: f32, environment: &Environment, samples: usize) -> f32 {
        let surface = roof();
        let sampler = EnvironmentSampler::new(environment);
        let ground = Ground::new(&surface, &sampler, environment, 0.0);
        // From under the roof, so that it is not in the way.
        let origin = Vec3::new(x, 0.5, 0.0);
        let ray = Ray { origin, direction: Vec3::NEG_Y, t_max: f32::INFINITY };
        ground.lit_share(&ray, samples, &mut SampleStream::new(StreamKey::new(1, 0, 0, 0), 0))
    }

    #[test]
    fn under_a_roof_an_even_sky_is_dimmed_by_the_form_factor() {
        // Configuration factor of a square of half side 1 seen from 1 below its middle (Howell, C-11): 0.5541.
        let sky = Environment::constant(32, 16, Vec3::ONE);
        let share = share_at(0.0, &sky, 20_000);
        assert!((share - (1.0 - 0.5541)).abs() < 0.01, "{share}");
        assert!(share_at(30.0, &sky, 2000) > 0.99, "far away nothing is in the way");
    }

    #[test]
    fn a_sun_overhead_throws_a_full_shadow_and_looks_above_the_horizon_see_none() {
        let mut sun = Environment::constant(32, 16, Vec3::ZERO);
        for column in 0..32 {
            sun.radiance[(0, column)] = Vec3::splat(100.0);
        }
        assert!(share_at(0.0, &sun, 200) < 0.01);
        assert!(share_at(3.0, &sun, 200) > 0.99);
        let surface = roof();
        let sampler = EnvironmentSampler::new(&sun);
        let ground = Ground::new(&surface, &sampler, &sun, 0.0);
        let mut stream = SampleStream::new(StreamKey::new(1, 0, 0, 0), 0);
        for direction in [Vec3::X, Vec3::Y, Vec3::new(0.6, 0.8, 0.0)] {
            let ray = Ray { origin: Vec3::new(5.0, 0.5, 0.0), direction, t_max: f32::INFINITY };
            assert_eq!(ground.lit_share(&ray, 8, &mut stream), 1.0, "{direction}");
        }
    }
}
