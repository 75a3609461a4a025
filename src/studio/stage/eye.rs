//! Where the stage is looked at from: an orbit about a point, or exactly through the camera of a photo.
//!
//! Both are a pinhole in the convention of [`Camera`] (x right, y down, z forward), laid on a rectangle of the screen.
//! Everything else follows from it: the matrix of the rasteriser, rays through the pointer, the camera of a path-traced
//! picture of the same view. They cannot disagree.

pub use super::orbit::OrbitEye;
use crate::scene::Camera;
use crate::trace::Ray;
use glam::{Mat3, Mat4, Vec2, Vec3, Vec4};

/// What the stage is looked at with. Places are counted from the upper left corner of the rectangle it is drawn in, in
/// whatever unit the size of the rectangle is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Eye {
    /// An orbit about a point.
    Orbit(OrbitEye),
    /// Exactly a photo's camera, its picture as large as fits in the middle of the rectangle. Around it the scene goes on.
    Photo(Camera),
}

impl Default for Eye {
    fn default() -> Self {
        Eye::Orbit(OrbitEye::default())
    }
}

/// A pinhole laid on a rectangle; the numbers of a [`Camera`] without a whole number of pixels.
#[derive(Clone, Copy, Debug)]
struct Pinhole {
    focal: Vec2,
    centre: Vec2,
    rotation_camera_from_world: Mat3,
    translation_camera_from_world: Vec3,
}

impl Eye {
    fn pinhole(&self, rect_size: Vec2) -> Pinhole {
        let size = rect_size.max(Vec2::ONE);
        match self {
            Eye::Orbit(orbit) => {
                let orbit = orbit.settled();
                let [right, down, forward] = orbit.axes();
                let rotation = Mat3::from_cols(right, down, forward).transpose();
                let focal = 0.5 * size.y / (0.5 * orbit.vertical_field_of_view_radians).tan();
                Pinhole {
                    focal: Vec2::splat(focal),
                    centre: 0.5 * size,
                    rotation_camera_from_world: rotation,
                    translation_camera_from_world: -(rotation * orbit.position_in_world()),
                }
            }
            Eye::Photo(camera) => {
                let (corner, scale) = letterbox(camera, size);
                Pinhole {
                    focal: camera.focal_pixels * scale,
                    centre: corner + camera.centre_pixels * scale,
                    rotation_camera_from_world: camera.rotation_camera_from_world,
                    translation_camera_from_world: camera.translation_camera_from_world,
                }
            }
        }
    }

    /// Upper left corner and size of the photo in the rectangle; the whole rectangle for an orbit.
    pub fn picture_rect(&self, rect_size: Vec2) -> (Vec2, Vec2) {
        match self {
            Eye::Orbit(_) => (Vec2::ZERO, rect_size),
            Eye::Photo(camera) => {
                let (corner, scale) = letterbox(camera, rect_size.max(Vec2::ONE));
                (corner, scale * Vec2::new(camera.width as f32, camera.height as f32))
            }
        }
    }

    /// The matrix of the rasteriser: x and y in [-1, 1] with y up, depth `near / z` in (0, 1], larger is nearer. There is
    /// no far plane; `near` in world units.
    pub fn clip_from_world(&self, rect_size: Vec2, near: f32) -> Mat4 {
        let size = rect_size.max(Vec2::ONE);
        let pinhole = self.pinhole(size);
        let (focal, centre) = (2.0 * pinhole.focal / size, 2.0 * pinhole.centre / size - 1.0);
        let clip_from_camera = Mat4::from_cols(
            Vec4::new(focal.x, 0.0, 0.0, 0.0),
            Vec4::new(0.0, -focal.y, 0.0, 0.0),
            Vec4::new(centre.x, -centre.y, 0.0, 1.0),
            Vec4::new(0.0, 0.0, near, 0.0),
        );
        let rotation = Mat4::from_mat3(pinhole.rotation_camera_from_world);
        clip_from_camera * Mat4::from_translation(pinhole.translation_camera_from_world) * rotation
    }

    /// The ray through a place of the rectangle; unit direction.
    pub fn ray_through(&self, place: Vec2, rect_size: Vec2) -> Ray {
        let pinhole = self.pinhole(rect_size);
        let on_plane = (place - pinhole.centre) / pinhole.focal;
        let direction = pinhole.rotation_camera_from_world.transpose() * on_plane.extend(1.0);
        Ray { origin: self.position_in_world(), direction: direction / direction.length(), t_max: f32::INFINITY }
    }

    /// Where a point of the world falls in the rectangle, and its depth along the view; `None` behind the eye.
    pub fn project(&self, point_in_world: Vec3, rect_size: Vec2) -> Option<(Vec2, f32)> {
        let pinhole = self.pinhole(rect_size);
        let point = pinhole.rotation_camera_from_world * point_in_world + pinhole.translation_camera_from_world;
        (point.z > 0.0).then(|| (point.truncate() / point.z * pinhole.focal + pinhole.centre, point.z))
    }

    /// A camera whose picture of this size is what the rectangle of the same shape shows, letterbox included.
    pub fn as_camera(&self, width: usize, height: usize) -> Camera {
        let (width, height) = (width.max(1), height.max(1));
        let pinhole = self.pinhole(Vec2::new(width as f32, height as f32));
        Camera {
            width,
            height,
            focal_pixels: pinhole.focal,
            centre_pixels: pinhole.centre,
            rotation_camera_from_world: pinhole.rotation_camera_from_world,
            translation_camera_from_world: pinhole.translation_camera_from_world,
        }
    }

    /// Where the eye is, in the world.
    pub fn position_in_world(&self) -> Vec3 {
        match self {
            Eye::Orbit(orbit) => orbit.settled().position_in_world(),
            Eye::Photo(camera) => camera.position_in_world(),
        }
    }

    /// An orbit that continues from here: itself, or [`OrbitEye::from_camera`].
    pub fn in_orbit(&self, bounds: (Vec3, Vec3)) -> OrbitEye {
        match self {
            Eye::Orbit(orbit) => *orbit,
            Eye::Photo(camera) => OrbitEye::from_camera(camera, bounds),
        }
    }

    /// Right, down and forward in the world, and focal length and centre in units of the rectangle.
    pub(super) fn frame(&self, rect_size: Vec2) -> (Mat3, Vec2, Vec2) {
        let pinhole = self.pinhole(rect_size);
        (pinhole.rotation_camera_from_world.transpose(), pinhole.focal, pinhole.centre)
    }
}

/// Upper left corner and scale of a camera's picture in the middle of a rectangle.
fn letterbox(camera: &Camera, size: Vec2) -> (Vec2, f32) {
    let picture = Vec2::new(camera.width.max(1) as f32, camera.height.max(1) as f32);
    let scale = (size / picture).min_element();
    // On whole pixels where the picture is shown one to one, so that a photo over it is not blurred.
    let corner = 0.5 * (size - picture * scale);
    (if scale == 1.0 { corner.floor() } else { corner }, scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    const SIZE: Vec2 = Vec2::new(900.0, 500.0);

    fn eyes() -> [Eye; 3] {
        let mut camera = Camera::looking_at(Vec3::new(2.0, 1.0, 3.0), Vec3::new(0.1, 0.4, 0.0), 320, 200, 0.9);
        camera.focal_pixels.y *= 1.1;
        camera.centre_pixels += Vec2::new(7.0, -3.0);
        let orbit = OrbitEye { target: Vec3::new(0.3, 0.1, -0.2), yaw_radians: 2.0, ..OrbitEye::default() };
        let steep = OrbitEye { pitch_radians: FRAC_PI_2, ..orbit };
        [Eye::Orbit(orbit), Eye::Orbit(steep), Eye::Photo(camera)]
    }

    #[test]
    fn rays_projection_matrix_and_camera_agree() {
        for eye in eyes() {
            let matrix = eye.clip_from_world(SIZE, 0.01);
            let camera = eye.as_camera(900, 500);
            assert!(camera.validate(1e-5).is_ok());
            for place in [Vec2::ZERO, Vec2::new(450.0, 250.0), Vec2::new(899.5, 3.25), Vec2::new(12.0, 480.0)] {
                let ray = eye.ray_through(place, SIZE);
                let point = ray.origin + 3.0 * ray.direction;
                let (again, depth) = eye.project(point, SIZE).unwrap();
                assert!((again - place).length() < 2e-2, "{eye:?}: {place} {again}");
                let (by_camera, camera_depth) = camera.project(point).unwrap();
                assert!((by_camera - place).length() < 2e-2 && (camera_depth - depth).abs() < 1e-5);
                let clip = matrix * point.extend(1.0);
                let on_screen = Vec2::new(0.5 + 0.5 * clip.x / clip.w, 0.5 - 0.5 * clip.y / clip.w) * SIZE;
                assert!((on_screen - place).length() < 2e-2, "{on_screen} {place}");
                assert!((clip.z / clip.w - 0.01 / depth).abs() < 1e-6 && (clip.w - depth).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_photo_lies_in_the_middle_and_its_pixels_are_the_cameras() {
        let [_, _, eye] = eyes();
        let Eye::Photo(camera) = eye else { panic!("the third is a photo") };
        let (corner, size) = eye.picture_rect(SIZE);
        assert_eq!((corner, size), (Vec2::new(50.0, 0.0), Vec2::new(800.0, 500.0)));
        let point = Vec3::new(0.2, 0.3, -0.4);
        let (in_photo, _) = camera.project(point).unwrap();
        let (in_rect, _) = eye.project(point, SIZE).unwrap();
        assert!((corner + in_photo * 2.5 - in_rect).length() < 1e-2);
        let exactly = Vec2::new(320.0, 200.0);
        assert!((eye.project(point, exactly).unwrap().0 - in_photo).length() < 1e-4);
    }

    #[test]
    fn leaving_a_photo_continues_from_where_one_stood() {
        let camera = Camera::looking_at(Vec3::new(2.0, 1.0, 3.0), Vec3::ZERO, 320, 200, 0.9);
        let orbit = OrbitEye::from_camera(&camera, (Vec3::splat(-1.0), Vec3::splat(1.0)));
        assert!((orbit.position_in_world() - camera.position_in_world()).length() < 1e-4);
        let (eye, place) = (Eye::Orbit(orbit), Vec3::new(0.3, -0.2, 0.1));
        let before = camera.project(place).unwrap().0;
        assert!((eye.project(place, Vec2::new(320.0, 200.0)).unwrap().0 - before).length() < 1e-2);
    }

    #[test]
    fn the_eye_never_turns_upside_down_and_bears_any_number() {
        let mut eye = OrbitEye::default();
        for step in 0..200 {
            eye.orbit(Vec2::new(0.3, if step < 100 { 0.2 } else { -0.3 }));
            let [_, down, _] = eye.axes();
            assert!(down.y < 0.0 && eye.pitch_radians.abs() < FRAC_PI_2);
        }
        for hard in [f32::NAN, f32::INFINITY, -1e30, 0.0] {
            eye.orbit(Vec2::splat(hard));
            eye.pan(Vec2::splat(hard));
            eye.zoom(hard, Some(Vec3::splat(hard)));
            eye.fit((Vec3::splat(hard), Vec3::splat(hard)), hard);
            assert!(eye.position_in_world().is_finite() && eye.distance > 0.0, "{hard}: {eye:?}");
        }
    }

    #[test]
    fn zooming_keeps_the_point_under_the_pointer_and_panning_follows_it() {
        let mut orbit = OrbitEye::default();
        let point = Eye::Orbit(orbit).ray_through(Vec2::new(700.0, 100.0), SIZE);
        let point = point.origin + orbit.distance * point.direction;
        orbit.zoom(0.5, Some(point));
        assert!((Eye::Orbit(orbit).project(point, SIZE).unwrap().0 - Vec2::new(700.0, 100.0)).length() < 1e-2);
        let before = Eye::Orbit(orbit).project(orbit.target, SIZE).unwrap().0;
        let target = orbit.target;
        orbit.pan(Vec2::new(0.1, -0.2));
        let after = Eye::Orbit(orbit).project(target, SIZE).unwrap().0;
        assert!((after - before - Vec2::new(50.0, -100.0)).length() < 1e-2);
    }

    #[test]
    fn fitting_shows_the_whole_box_in_wide_and_tall_rectangles() {
        for size in [SIZE, Vec2::new(200.0, 700.0)] {
            let mut orbit = OrbitEye { yaw_radians: 1.0, ..OrbitEye::default() };
            let (low, high) = (Vec3::new(-3.0, 0.0, -1.0), Vec3::new(3.0, 2.0, 1.0));
            orbit.fit((low, high), size.x / size.y);
            for corner in 0..8 {
                let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                let point = Vec3::new(pick(0), pick(1), pick(2));
                let (place, _) = Eye::Orbit(orbit).project(point, size).unwrap();
                assert!(place.min_element() >= 0.0 && (size - place).min_element() >= 0.0, "{place} in {size}");
            }
            assert_eq!(orbit.yaw_radians, 1.0);
        }
    }
}
