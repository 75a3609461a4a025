//! Photos laid on the surface: a colour for every vertex or texel before there is any fit.
//!
//! What a photo shows of a point is the radiance that left it towards that camera; the mean over the photos that see the
//! point is no material, but it is true, and there within a second. Which photos see a point is told by depth maps of some
//! hundred pixels (Williams 1978), drawn from triangles alone: neither an atlas nor rays are needed.

use crate::image::Image;
use crate::material::MaterialMaps;
use crate::math::parallel;
use crate::render::Surface;
use crate::render::cached::VisibilityGrid;
use crate::scene::{Camera, Mesh, Scene};
use glam::{Vec2, Vec3};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Photos that are looked at, at most, spread over all of them.
const MOST_VIEWS: usize = 24;
/// Pixels along the longer side of a depth map, at most.
const DEPTH_SIDE: usize = 384;
/// Least cosine between the normal of a point and the direction to a camera that is taken to see it.
const LEAST_COSINE: f32 = 0.15;
/// What a clipped pixel counts beside one that is not.
const CLIPPED_WEIGHT: f32 = 0.02;
/// Widths of the texel colours, least and most.
const TEXEL_SIDES: (usize, usize) = (128, 1024);

/// Depth maps of some photos of a scene.
pub struct ProjectedPhotos {
    scene: Arc<Scene>,
    views: Vec<DepthView>,
}

struct DepthView {
    view: usize,
    camera: Camera,
    /// Depth along the view direction of what is nearest, row by row; infinite where there is no surface.
    depth: Vec<f32>,
}

/// A colour in linear radiance times its weight, and the weight: 1 where some photo sees the point, else 0.
pub type WeightedColour = [f32; 4];

impl ProjectedPhotos {
    /// Draws the depth maps of a scene's photos; `None` when `stop` was raised.
    pub fn new(scene: Arc<Scene>, stop: &AtomicBool) -> Option<Self> {
        // Evenly spread, the first and the last among them.
        let count = scene.views.len().min(MOST_VIEWS);
        let views = parallel::map(count, |k| {
            let view = k * (scene.views.len() - 1) / (count - 1).max(1);
            let camera = scene.views[view].camera;
            let factor = camera.width.max(camera.height).div_ceil(DEPTH_SIDE).max(1);
            let camera = camera.shrunk(factor);
            let depth = if stop.load(Ordering::Relaxed) { Vec::new() } else { depth_map(&scene.mesh, &camera) };
            DepthView { view, camera, depth }
        });
        (!stop.load(Ordering::Relaxed)).then_some(ProjectedPhotos { scene, views })
    }

    /// The colour of a point of the surface with this unit normal.
    pub fn colour(&self, position_in_world: Vec3, normal: Vec3) -> WeightedColour {
        let (mut sum, mut total) = (Vec3::ZERO, 0.0f32);
        for own in &self.views {
            let Some(weight) = own.weight(position_in_world, normal) else { continue };
            let view = &self.scene.views[own.view];
            let Some(place) = view.camera.place_in_picture(position_in_world) else { continue };
            let (row, column) = (place.y as usize, place.x as usize);
            if row >= view.photo.height() || column >= view.photo.width() {
                continue;
            }
            let state = view.states[(row, column)];
            if !state.is_surface() {
                continue;
            }
            let weight = if state.is_clipped() { CLIPPED_WEIGHT * weight } else { weight };
            sum += view.photo.radiance(row, column) * weight;
            total += weight;
        }
        if total > 0.0 && sum.is_finite() { (sum / total).extend(1.0).to_array() } else { [0.0; 4] }
    }

    /// The colour of every vertex of a mesh that has normals.
    pub fn of_vertices(&self, mesh: &Mesh) -> Vec<WeightedColour> {
        let colour = |vertex: usize| match mesh.normals.get(vertex) {
            Some(&normal) => self.colour(mesh.positions[vertex], normal),
            None => [0.0; 4],
        };
        parallel::map_small(mesh.positions.len(), colour)
    }

    /// The colours of the texels of an atlas as a diffuse map of about this width, and which texels some photo sees.
    pub fn of_texels(&self, surface: &Surface, map_size: usize) -> (MaterialMaps, Image<bool>) {
        let side = map_size.clamp(TEXEL_SIDES.0, TEXEL_SIDES.1);
        let grid = VisibilityGrid::new(surface, side);
        let colours = parallel::map_small(grid.points.len(), |index| {
            self.colour(grid.points[index].position, grid.points[index].shading_normal)
        });
        let mut diffuse = Image::filled(side, side, Vec3::ZERO);
        let mut seen = Image::filled(side, side, false);
        for (point, [red, green, blue, weight]) in grid.points.iter().zip(colours) {
            let place = (point.texel as usize / side, point.texel as usize % side);
            diffuse[place] = Vec3::new(red, green, blue);
            seen[place] = weight > 0.0;
        }
        let maps = MaterialMaps {
            diffuse,
            specular: Image::filled(side, side, Vec3::ZERO),
            roughness: Image::filled(side, side, 1.0),
        };
        (maps, seen)
    }

    /// The scene whose photos they are.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }
}

impl DepthView {
    /// How much the photo counts for a point; `None` where it does not see it. A photo counts by how many of its pixels
    /// show a piece of the surface there.
    fn weight(&self, position: Vec3, normal: Vec3) -> Option<f32> {
        let camera = &self.camera;
        let (place, depth) = camera.project(position)?;
        let inside = place.x >= 0.0 && place.y >= 0.0;
        let (row, column) = (place.y as usize, place.x as usize);
        if !inside || row >= camera.height || column >= camera.width {
            return None;
        }
        let cosine = normal.dot((camera.position_in_world() - position).normalize_or_zero());
        if !(cosine > LEAST_COSINE) {
            return None;
        }
        let nearest = *self.depth.get(row * camera.width + column)?;
        // Within a pixel of the depth map a slanted surface lies at many depths.
        let pixel = depth * camera.pixel_angle_radians();
        if depth > nearest + 3.0 * pixel / cosine {
            return None;
        }
        Some(cosine / (depth * depth))
    }
}

/// Depth of the nearest triangle in the middle of each pixel.
fn depth_map(mesh: &Mesh, camera: &Camera) -> Vec<f32> {
    let (width, height) = (camera.width, camera.height);
    let mut depth = vec![f32::INFINITY; width * height];
    let projected: Vec<Option<(Vec2, f32)>> = mesh.positions.iter().map(|&position| camera.project(position)).collect();
    for triangle in &mesh.triangles {
        // What reaches behind the camera stands beside the picture nearly always.
        let [Some((a, a_depth)), Some((b, b_depth)), Some((c, c_depth))] =
            triangle.map(|vertex| projected.get(vertex as usize).copied().flatten())
        else {
            continue;
        };
        let area = (b - a).perp_dot(c - a);
        if !area.is_finite() || area == 0.0 {
            continue;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if high.x < 0.0 || high.y < 0.0 || low.x >= width as f32 || low.y >= height as f32 {
            continue;
        }
        let first = |low: f32| (low - 0.5).ceil().max(0.0) as usize;
        let end = |high: f32, side: usize| ((high - 0.5).floor() + 1.0).clamp(0.0, side as f32) as usize;
        let inverse = [a_depth, b_depth, c_depth].map(|depth| 1.0 / depth);
        for row in first(low.y)..end(high.y, height) {
            for column in first(low.x)..end(high.x, width) {
                let place = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let u = (place - a).perp_dot(c - a) / area;
                let v = (b - a).perp_dot(place - a) / area;
                if u < 0.0 || v < 0.0 || u + v > 1.0 {
                    continue;
                }
                let own = 1.0 / (inverse[0] * (1.0 - u - v) + inverse[1] * u + inverse[2] * v);
                let nearest = &mut depth[row * width + column];
                if own < *nearest {
                    *nearest = own;
                }
            }
        }
    }
    depth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
    use crate::render::Parameters;
    use crate::render::picture::{PictureSettings, render};
    use crate::scene::demo::{DemoSettings, build};

    fn small() -> Arc<Scene> {
        let settings =
            DemoSettings { views: 8, held_out: 0, width: 96, height: 72, map_size: 128, seed: 1, ..Default::default() };
        let mut scene = build(&settings).unwrap().scene;
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let truth = scene.truth.clone().unwrap();
        let side = truth.maps.diffuse.width();
        let weights = PyramidWeights::flat(side, side);
        let texels = TexelPyramid::from_base(texels_from_maps(&truth.maps), &weights);
        let lit = Parameters::new(texels, &truth.environment);
        let settings = PictureSettings { samples: 8, max_bounces: 2, ..PictureSettings::default() };
        for view in 0..scene.views.len() {
            let camera = scene.views[view].camera;
            let picture = render(&surface, &camera, &lit, view as u32, &settings, &AtomicBool::new(false));
            scene.set_photo(view, picture.radiance).unwrap();
        }
        Arc::new(scene)
    }

    /// Rays of the path tracer say which photos see a texel: depth maps say so too, but for some at silhouettes.
    #[test]
    fn depth_maps_see_what_rays_see() {
        let scene = small();
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let photos = ProjectedPhotos::new(Arc::clone(&scene), &AtomicBool::new(false)).unwrap();
        let grid = VisibilityGrid::new(&surface, 64);
        let (mut both, mut rays_alone, mut maps_alone) = (0, 0, 0);
        for point in &grid.points {
            for own in &photos.views {
                let eye = own.camera.position_in_world();
                let towards = eye - point.position;
                let cosine = point.shading_normal.dot(towards.normalize());
                if cosine < 0.3 || scene.views[own.view].camera.place_in_picture(point.position).is_none() {
                    continue;
                }
                let origin = surface.bvh().offset_origin(point.position, point.geometric_normal, towards.normalize());
                let ray = crate::trace::Ray { origin, direction: towards.normalize(), t_max: towards.length() };
                match (!surface.bvh().is_occluded(&ray), own.weight(point.position, point.shading_normal).is_some()) {
                    (true, true) => both += 1,
                    (true, false) => rays_alone += 1,
                    (false, true) => maps_alone += 1,
                    (false, false) => {}
                }
            }
        }
        println!("both {both}, rays alone {rays_alone}, maps alone {maps_alone}");
        assert!(both > 1000 && rays_alone * 20 < both && maps_alone * 10 < both);
    }

    #[test]
    fn texels_have_about_the_radiance_that_photos_show_of_them() {
        let scene = small();
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let photos = ProjectedPhotos::new(Arc::clone(&scene), &AtomicBool::new(false)).unwrap();
        let (maps, seen) = photos.of_texels(&surface, 128);
        assert!(seen.pixels().iter().filter(|&&seen| seen).count() > 1000);
        // A photo, and the mean of all of them where its rays meet the surface.
        let view = &scene.views[0];
        let (mut difference, mut whole) = (0.0f64, 0.0f64);
        for row in (0..view.photo.height()).step_by(3) {
            for column in (0..view.photo.width()).step_by(3) {
                let ray = view.camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
                let Some(hit) = surface.closest(&ray) else { continue };
                let uv = surface.point(&hit).uv;
                let place = (((1.0 - uv.y) * 128.0) as usize, (uv.x * 128.0) as usize);
                if place.0 >= 128 || place.1 >= 128 || !seen[place] {
                    continue;
                }
                let own = view.photo.radiance(row, column);
                difference += f64::from((maps.diffuse[place] - own).length());
                whole += f64::from(own.length());
            }
        }
        println!("mean difference {:.3} of the mean", difference / whole);
        assert!(difference < 0.35 * whole, "{difference} {whole}");
        // Vertices are coloured alike, and what faces no camera is not.
        let colours = photos.of_vertices(surface.mesh());
        assert_eq!(colours.len(), surface.mesh().positions.len());
        assert!(colours.iter().any(|colour| colour[3] == 1.0));
        assert_eq!(photos.colour(Vec3::new(0.0, -1e6, 0.0), Vec3::NEG_Y), [0.0; 4]);
        let stopped = AtomicBool::new(true);
        assert!(ProjectedPhotos::new(scene, &stopped).is_none());
    }
}
