//! Which texels the cameras see.

use crate::error::Result;
use crate::image::Image;
use crate::math::parallel;
use crate::math::random::{SampleStream, StreamKey};
use crate::scene::camera::Camera;
use crate::scene::mesh::Mesh;
use crate::trace::Bvh;
use glam::Vec2;

/// The texels of a `width x height` map in the bilinear footprint of a camera ray that meets the front of the surface
/// first; `samples` rays a pixel.
///
/// # Errors
/// Those of [`Bvh::build`]: a mesh without area, or with corners out of range or not finite.
pub fn texels_seen(mesh: &Mesh, cameras: &[Camera], width: usize, height: usize, samples: u32) -> Result<Image<bool>> {
    let bvh = Bvh::build(&mesh.positions, &mesh.triangles)?;
    let mut seen = Image::filled(width, height, false);
    if mesh.uvs.len() != mesh.positions.len() || width == 0 || height == 0 {
        return Ok(seen);
    }
    let per_camera: Vec<Vec<u32>> = parallel::map(cameras.len(), |view| {
        let camera = &cameras[view];
        let mut texels = Vec::new();
        for pixel in 0..camera.width * camera.height {
            for sample in 0..samples {
                let jitter = SampleStream::new(StreamKey::new(0, 0, view as u32, pixel as u32), sample).next_pair();
                let corner = Vec2::new((pixel % camera.width) as f32, (pixel / camera.width) as f32);
                let ray = camera.ray_through(corner + Vec2::from_array(jitter));
                let Some(hit) = bvh.closest_hit(&ray) else { continue };
                let corners = mesh.triangles[hit.triangle as usize].map(|vertex| vertex as usize);
                let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
                let from_front = mesh.area_vector(hit.triangle as usize).dot(ray.direction) < 0.0;
                let uv: Vec2 = (0..3).map(|corner| weights[corner] * mesh.uvs[corners[corner]]).sum();
                if from_front && uv.is_finite() {
                    let place = Vec2::new(uv.x * width as f32, (1.0 - uv.y) * height as f32) - 0.5;
                    let clamp = |x: f32, size: usize| (x.max(0.0) as usize).min(size - 1);
                    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                        let column = clamp(place.x.floor() + dx, width);
                        texels.push((clamp(place.y.floor() + dy, height) * width + column) as u32);
                    }
                }
            }
        }
        texels.sort_unstable();
        texels.dedup();
        texels
    });
    for texel in per_camera.into_iter().flatten() {
        seen.pixels_mut()[texel as usize] = true;
    }
    Ok(seen)
}
