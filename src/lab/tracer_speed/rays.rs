//! The rays that are timed, and how another program gets them.

use crate::error::Result;
use crate::math::frame::{Frame, sample_cosine_hemisphere};
use crate::math::random::{SampleStream, StreamKey};
use crate::render::Surface;
use crate::scene::Scene;
use crate::trace::Ray;
use glam::Vec2;
use rayon::prelude::*;
use std::path::Path;

/// Rays of a fit, by kind.
#[derive(Clone, Debug, Default)]
pub struct RaySets {
    /// Through the middle of every pixel.
    pub camera: Vec<Ray>,
    /// From where those meet a front, into cosine-weighted directions.
    pub bounce: Vec<Ray>,
    /// From there into others, of which only whether something is in the way is asked.
    pub shadow: Vec<Ray>,
}

impl RaySets {
    /// The rays of some views.
    pub fn of(scene: &Scene, surface: &Surface, views: &[usize]) -> RaySets {
        let mut sets = RaySets::default();
        for &view in views {
            let camera = &scene.views[view].camera;
            for pixel in 0..camera.width * camera.height {
                let place = Vec2::new((pixel % camera.width) as f32 + 0.5, (pixel / camera.width) as f32 + 0.5);
                let ray = camera.ray_through(place);
                sets.camera.push(ray);
                let Some(hit) = surface.closest(&ray) else { continue };
                let point = surface.point(&hit);
                let normal = point.geometric_normal;
                if normal.dot(ray.direction) >= 0.0 {
                    continue;
                }
                let mut stream = SampleStream::new(StreamKey::new(1, 0, view as u32, pixel as u32), 0);
                let frame = Frame::around(normal);
                for rays in [&mut sets.bounce, &mut sets.shadow] {
                    let [a, b] = stream.next_pair();
                    rays.push(surface.ray_from(&point, frame.outer_from_local(sample_cosine_hemisphere([a, b]))));
                }
            }
        }
        sets
    }

    /// How many rays there are of each kind.
    pub fn counts(&self) -> [usize; 3] {
        [self.camera.len(), self.bounce.len(), self.shadow.len()]
    }

    /// Traces the rays of one kind, by its place in [`RaySets::counts`]; how many met something.
    pub fn trace(&self, kind: usize, surface: &Surface) -> usize {
        let closest = |rays: &[Ray]| rays.par_iter().filter(|ray| surface.closest(ray).is_some()).count();
        match kind {
            0 => closest(&self.camera),
            1 => closest(&self.bounce),
            _ => self.shadow.par_iter().filter(|ray| surface.bvh().is_occluded(ray)).count(),
        }
    }

    /// Writes mesh and rays as `tests/embree/time_rays.c` reads them: five u32 (points, triangles, rays of each kind),
    /// points, triangles, rays as origin, direction and end, all little endian.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, scene: &Scene, path: &Path) -> Result<()> {
        let mesh = &scene.mesh;
        let counts = [mesh.positions.len(), mesh.triangles.len()].into_iter().chain(self.counts());
        let mut words: Vec<[u8; 4]> = counts.map(|count| (count as u32).to_le_bytes()).collect();
        words.extend(mesh.positions.iter().flat_map(|point| point.to_array()).map(f32::to_le_bytes));
        words.extend(mesh.triangles.iter().flatten().map(|corner| corner.to_le_bytes()));
        let rays = [&self.camera, &self.bounce, &self.shadow].into_iter().flatten();
        let numbers = rays.flat_map(|ray| {
            let Ray { origin: from, direction: to, t_max } = ray;
            [from.x, from.y, from.z, to.x, to.y, to.z, *t_max]
        });
        words.extend(numbers.map(f32::to_le_bytes));
        crate::files::write_bytes(path, words.as_flattened())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;
    use glam::{Vec2, Vec3};

    #[test]
    fn mesh_and_rays_are_written_in_the_order_that_the_other_program_reads() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y],
            triangles: vec![[0, 1, 2]],
        };
        let scene = Scene {
            mesh: mesh.clone(),
            ..crate::lab::scale::scene(crate::lab::scale::ScaleCase { triangles: 8, views: 1, map_size: 4 })
        };
        let ray = |origin: Vec3, t_max| Ray { origin, direction: Vec3::NEG_Z, t_max };
        let inside = Vec3::new(0.25, 0.25, 1.0);
        let sets = RaySets {
            camera: vec![ray(inside, f32::INFINITY)],
            bounce: vec![ray(-inside, 2.0), ray(Vec3::X + Vec3::ONE, 2.0)],
            shadow: vec![ray(inside, 0.5)],
        };
        let surface = Surface::new(mesh).unwrap();
        assert_eq!([0, 1, 2].map(|kind| sets.trace(kind, &surface)), [1, 0, 0]);
        let file = tempfile::NamedTempFile::new().unwrap();
        sets.write(&scene, file.path()).unwrap();
        let bytes = std::fs::read(file.path()).unwrap();
        let words: Vec<u32> = bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
        assert_eq!(words[..5], [3, 1, 1, 2, 1]);
        assert_eq!(words[14..17], [0, 1, 2]);
        assert_eq!(words.len(), 5 + 9 + 3 + 4 * 7);
        assert_eq!(
            words[17..24].iter().map(|&bits| f32::from_bits(bits)).collect::<Vec<_>>(),
            [0.25, 0.25, 1.0, 0.0, 0.0, -1.0, f32::INFINITY]
        );
    }
}
