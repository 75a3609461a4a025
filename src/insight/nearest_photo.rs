//! The nearest photo, seen from another place: what a picture can be that knows the mesh and nothing of materials.
//!
//! Each pixel takes its colour from the photo whose camera looks at the point from the least other direction, among those
//! from which nothing hides it. What this has beyond any texture is detail of the photo itself, and what it lacks is what
//! depends on where one looks from; both say what mesh and cameras are worth.

use crate::image::{Image, RgbImage};
use crate::math::parallel;
use crate::render::Surface;
use crate::scene::{Camera, PixelState, Scene};
use glam::{Vec2, Vec3};

/// A picture and where it is known.
#[derive(Clone, Debug)]
pub struct Reprojected {
    /// Linear radiance; black where no photo shows the point.
    pub radiance: RgbImage,
    /// Where a photo does.
    pub known: Image<bool>,
}

/// The picture of a camera from the photos of these views.
pub fn reprojected(scene: &Scene, surface: &Surface, camera: &Camera, views: &[usize]) -> Reprojected {
    let eyes: Vec<(usize, Vec3)> =
        views.iter().map(|&view| (view, scene.views[view].camera.position_in_world())).collect();
    let pixel = |row: usize, column: usize| {
        let place = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
        let ray = camera.ray_through(place);
        let point = surface.point_facing(&surface.closest(&ray)?, -ray.direction);
        let mut nearest: Vec<(f32, usize, Vec3)> = eyes
            .iter()
            .map(|&(view, eye)| ((eye - point.position).normalize_or_zero().dot(-ray.direction), view, eye))
            .filter(|&(_, _, eye)| (eye - point.position).dot(point.geometric_normal) > 0.0)
            .collect();
        nearest.sort_by(|a, b| b.0.total_cmp(&a.0));
        nearest.into_iter().find_map(|(_, view, eye)| {
            let place = scene.views[view].camera.place_in_picture(point.position)?;
            let colour = sampled(scene, view, place)?;
            (!surface.bvh().is_hidden_from(point.position, point.geometric_normal, eye)).then_some(colour)
        })
    };
    let (width, count) = (camera.width, camera.width * camera.height);
    let pixels = parallel::map_small(count, |index| pixel(index / width, index % width));
    let image = |pixels: Vec<Vec3>| Image::from_pixels(camera.width, camera.height, pixels);
    Reprojected {
        known: Image::from_pixels(camera.width, camera.height, pixels.iter().map(Option::is_some).collect()),
        radiance: image(pixels.into_iter().map(Option::unwrap_or_default).collect()),
    }
}

/// Bilinear radiance of a photo at a place in pixels; `None` unless all four pixels show surface that is not clipped.
fn sampled(scene: &Scene, view: usize, place: Vec2) -> Option<Vec3> {
    let view = &scene.views[view];
    let (x, y) = (place.x - 0.5, place.y - 0.5);
    if !(x >= 0.0 && y >= 0.0) {
        return None;
    }
    let (column, row) = (x as usize, y as usize);
    if column + 1 >= view.camera.width || row + 1 >= view.camera.height {
        return None;
    }
    let (u, v) = (x - column as f32, y - row as f32);
    let mut sum = Vec3::ZERO;
    for (step, weight) in
        [((0, 0), (1.0 - u) * (1.0 - v)), ((0, 1), u * (1.0 - v)), ((1, 0), (1.0 - u) * v), ((1, 1), u * v)]
    {
        let at = (row + step.0, column + step.1);
        if view.states[at] != PixelState::Surface {
            return None;
        }
        sum += weight * view.photo.radiance(at.0, at.1);
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::demo::{DemoSettings, build};

    #[test]
    fn a_photo_seen_from_its_own_place_is_itself_and_a_hidden_point_is_none() {
        let settings =
            DemoSettings { views: 3, held_out: 0, width: 24, height: 18, map_size: 64, seed: 1, ..Default::default() };
        let mut scene = build(&settings).unwrap().scene;
        for view in 0..3 {
            let photo = Image::from_fn(24, 18, |row, column| Vec3::new(row as f32, column as f32, view as f32 + 1.0));
            scene.set_photo(view, photo).unwrap();
        }
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let camera = scene.views[1].camera;
        let own = reprojected(&scene, &surface, &camera, &[0, 1, 2]);
        let mut seen = 0;
        for row in 1..17 {
            for column in 1..23 {
                if own.known[(row, column)] && own.radiance[(row, column)].z == 2.0 {
                    seen += 1;
                    let expected = Vec3::new(row as f32, column as f32, 2.0);
                    assert!((own.radiance[(row, column)] - expected).length() < 0.05, "{row} {column}");
                }
            }
        }
        assert!(seen > 40, "{seen}");
        let others = reprojected(&scene, &surface, &camera, &[]);
        assert!(others.known.pixels().iter().all(|known| !known));
    }
}
