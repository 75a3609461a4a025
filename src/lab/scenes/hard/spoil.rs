//! From a photographed scene to what a fit is given.

use super::objects::{CELLS, EXTRA, OBJECT};
use super::{HardCase, HardScene};
use crate::error::Result;
use crate::image::Image;
use crate::image::transfer::srgb8_from_linear_value;
use crate::math::random::SequentialRandom;
use crate::scene::{Camera, Mesh, Photo, PixelState, Scene, View};
use crate::trace::Bvh;
use glam::{Mat3, Vec2, Vec3};

/// Share of pixels whose mask is wrong.
const WRONG_MASKS: f64 = 0.03;
/// Width and height of a wrong patch of a mask in pixels.
const PATCH: usize = 3;
/// A jump of exposure.
const JUMP: f32 = 1.3;
/// Standard deviation of wrong normals, in radians, along each of two axes.
const NORMAL_NOISE: f32 = 0.12;

impl HardScene {
    /// What a fit is given of `photographed`, which is [`HardScene::scene`] with its photos: without the truth, and with
    /// what is hard.
    ///
    /// # Errors
    /// Those of a mesh that no ray can be traced against.
    pub fn spoil(&self, photographed: &Scene) -> Result<Scene> {
        let mut scene = photographed.clone();
        scene.truth = None;
        let mut random = SequentialRandom::new(self.seed ^ 0x5901);
        match self.case {
            HardCase::Masks => wrong_masks(&mut scene, &mut random)?,
            HardCase::OnePixel => shake(&mut scene.views, 1.0, &mut random),
            HardCase::TwoPixels => shake(&mut scene.views, 2.0, &mut random),
            HardCase::Exposure => {
                for (index, view) in scene.views.iter_mut().enumerate().filter(|(_, view)| !view.held_out) {
                    let gain = [JUMP, 1.0 / JUMP, 1.0][index % 3];
                    view.photo = Photo::Linear32(view.photo.to_linear().map(|&radiance| radiance * gain));
                }
            }
            HardCase::EightBit => scene.views.iter_mut().for_each(eight_bit),
            HardCase::Missing => {
                let parts = &self.triangle_part;
                let triangles = scene.mesh.triangles.iter().zip(parts);
                scene.mesh.triangles =
                    triangles.filter(|(_, part)| **part != EXTRA).map(|(corners, _)| *corners).collect();
            }
            HardCase::Decimated => self.decimate(&mut scene.mesh),
            HardCase::NoisyNormals => {
                for normal in &mut scene.mesh.normals {
                    let mut draw = || NORMAL_NOISE * random.next_normal();
                    let (right, up) = normal.any_orthonormal_pair();
                    *normal = (*normal + draw() * right + draw() * up).try_normalize().unwrap_or(*normal);
                }
            }
            _ => {}
        }
        if matches!(self.case, HardCase::Missing | HardCase::Decimated) {
            drop_unused(&mut scene.mesh);
        }
        Ok(scene)
    }

    /// Every third point of the grids of the object's charts; the rest of the mesh stays. Texture coordinates stay too.
    fn decimate(&self, mesh: &mut Mesh) {
        let is_object = |triangle: usize| self.triangle_part[triangle] == OBJECT;
        let mut triangles: Vec<[u32; 3]> =
            (0..mesh.triangles.len()).filter(|&index| !is_object(index)).map(|index| mesh.triangles[index]).collect();
        let row_of_points = CELLS + 1;
        for chart in 0..6 {
            let vertex = |column: usize, row: usize| {
                (chart * row_of_points * row_of_points + row * row_of_points + column) as u32
            };
            for row in (0..CELLS).step_by(3) {
                for column in (0..CELLS).step_by(3) {
                    let (a, b) = (vertex(column, row), vertex(column + 3, row));
                    let (c, d) = (vertex(column + 3, row + 3), vertex(column, row + 3));
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        mesh.triangles = triangles;
    }
}

/// Takes out vertices that no triangle has any more: they would give away what was done.
fn drop_unused(mesh: &mut Mesh) {
    let mut is_used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&vertex| is_used[vertex as usize] = true);
    let mut count = 0;
    let new_index: Vec<u32> = is_used
        .iter()
        .map(|&used| {
            count += u32::from(used);
            count.saturating_sub(1)
        })
        .collect();
    mesh.triangles.iter_mut().flatten().for_each(|vertex| *vertex = new_index[*vertex as usize]);
    let mut keep = is_used.iter().copied();
    mesh.positions.retain(|_| keep.next().unwrap_or(true));
    let mut keep = is_used.iter().copied();
    mesh.normals.retain(|_| keep.next().unwrap_or(true));
    let mut keep = is_used.iter().copied();
    mesh.uvs.retain(|_| keep.next().unwrap_or(true));
}

/// Masks by the rays through the middle of pixels, with patches where they say the contrary.
fn wrong_masks(scene: &mut Scene, random: &mut SequentialRandom) -> Result<()> {
    let bvh = Bvh::build(&scene.mesh.positions, &scene.mesh.triangles)?;
    for view in scene.views.iter_mut().filter(|view| !view.held_out) {
        let (width, height) = (view.camera.width, view.camera.height);
        let camera = view.camera;
        view.states = Image::from_fn(width, height, |row, column| {
            let ray = camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
            if bvh.closest_hit(&ray).is_some() { PixelState::Surface } else { PixelState::Background }
        });
        let patches = (WRONG_MASKS * (width * height) as f64 / (PATCH * PATCH) as f64).ceil() as usize;
        for _ in 0..patches {
            let place = |size: usize, number: f32| (number * size as f32) as usize;
            let (top, left) = (place(height, random.next_number()), place(width, random.next_number()));
            for row in top..(top + PATCH).min(height) {
                for column in left..(left + PATCH).min(width) {
                    let state = &mut view.states[(row, column)];
                    *state = match *state {
                        PixelState::Surface => PixelState::Background,
                        _ => PixelState::Surface,
                    };
                }
            }
        }
    }
    Ok(())
}

/// Turns each camera so that its picture moves by so many pixels, into a direction of its own.
fn shake(views: &mut [View], pixels: f32, random: &mut SequentialRandom) {
    for view in views.iter_mut().filter(|view| !view.held_out) {
        let (sin, cos) = (std::f32::consts::TAU * random.next_number()).sin_cos();
        let turn = Mat3::from_axis_angle(Vec3::new(cos, sin, 0.0), pixels / view.camera.focal_pixels.x);
        let camera = view.camera;
        view.camera = Camera {
            rotation_camera_from_world: turn * camera.rotation_camera_from_world,
            translation_camera_from_world: turn * camera.translation_camera_from_world,
            ..camera
        };
    }
}

/// Bytes in sRGB; what is at the end of the range is clipped.
fn eight_bit(view: &mut View) {
    let bytes = view.photo.to_linear().map(|radiance| radiance.to_array().map(srgb8_from_linear_value));
    view.states = bytes.map(|pixel| match pixel.contains(&255) {
        true => PixelState::SurfaceClipped,
        false => PixelState::Surface,
    });
    view.photo = Photo::Srgb8(bytes);
}

#[cfg(test)]
mod tests {
    use super::super::{HardSettings, build};
    use super::*;

    fn spoiled(case: HardCase) -> (Scene, Scene) {
        let settings = HardSettings { size: 24, views: 6, held_out: 1, ..Default::default() };
        let mut hard = build(case, &settings).unwrap();
        for view in 0..hard.scene.views.len() {
            let picture = Image::from_fn(24, 24, |row, column| Vec3::splat((row * 24 + column) as f32 / 500.0));
            hard.scene.set_photo(view, picture).unwrap();
        }
        let given = hard.spoil(&hard.scene).unwrap();
        (hard.scene, given)
    }

    #[test]
    fn each_case_spoils_what_it_says_and_nothing_else() {
        let (real, given) = spoiled(HardCase::Plain);
        assert!(given.truth.is_none() && given.mesh == real.mesh && given.views[0].photo == real.views[0].photo);
        let (real, given) = spoiled(HardCase::Missing);
        assert_eq!(real.mesh.triangles.len() - given.mesh.triangles.len(), 6 * 2 * 6 * 6);
        let (real, given) = spoiled(HardCase::Decimated);
        let objects = 6 * 2 * CELLS * CELLS;
        assert_eq!(given.mesh.triangles.len(), real.mesh.triangles.len() - objects + objects / 9);
        given.mesh.validate().unwrap();
        assert!(
            given.mesh.positions.len() < real.mesh.positions.len() / 2
                && given.mesh.normals.len() == given.mesh.uvs.len()
        );
        let area = |mesh: &Mesh| (0..mesh.triangles.len()).map(|index| mesh.area_vector(index).length()).sum::<f32>();
        assert!(area(&given.mesh) / area(&real.mesh) > 0.95, "the decimated object has about the same area");
        let (real, given) = spoiled(HardCase::EightBit);
        let clipped = given.views[0].states.pixels().iter().filter(|state| state.is_clipped()).count();
        assert!((40..120).contains(&clipped), "{clipped}");
        assert!((given.views[0].photo.radiance(5, 5) - real.views[0].photo.radiance(5, 5)).length() < 0.01);
    }

    #[test]
    fn cameras_move_by_the_pixels_they_are_said_to() {
        let (real, given) = spoiled(HardCase::TwoPixels);
        for (real, given) in real.views.iter().zip(&given.views) {
            let (before, _) = real.camera.project(Vec3::new(0.0, 0.5, 0.0)).unwrap();
            let (after, _) = given.camera.project(Vec3::new(0.0, 0.5, 0.0)).unwrap();
            let moved = before.distance(after);
            let expected = if real.held_out { 0.0 } else { 2.0 };
            assert!((moved - expected).abs() < 0.1, "{moved}");
        }
    }

    #[test]
    fn three_percent_of_a_mask_is_wrong() {
        let (real, given) = spoiled(HardCase::Masks);
        let bvh = Bvh::build(&real.mesh.positions, &real.mesh.triangles).unwrap();
        let view = &given.views[0];
        let mut wrong = 0;
        for (index, state) in view.states.pixels().iter().enumerate() {
            let place = Vec2::new((index % 24) as f32 + 0.5, (index / 24) as f32 + 0.5);
            let is_hit = bvh.closest_hit(&view.camera.ray_through(place)).is_some();
            wrong += usize::from(is_hit != (*state == PixelState::Surface));
        }
        assert!((9..25).contains(&wrong), "{wrong} of 576");
    }
}
