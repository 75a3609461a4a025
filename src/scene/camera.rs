//! A pinhole camera in the OpenCV convention.

use crate::error::{Error, ErrorKind, Result};
use crate::trace::Ray;
use glam::{Mat3, Vec2, Vec3};

/// A pinhole camera: x right, y down, z forward. Pixel (row i, column j) covers `[j, j+1) x [i, i+1)`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Camera {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Focal lengths in pixels along x and y.
    pub focal_pixels: Vec2,
    /// Principal point in pixels; the centre of a picture is `(width/2, height/2)`.
    pub centre_pixels: Vec2,
    /// Rotation part of `camera_from_world`.
    pub rotation_camera_from_world: Mat3,
    /// Translation part of `camera_from_world`, in world units.
    pub translation_camera_from_world: Vec3,
}

impl Camera {
    /// Where the camera stands, in the world.
    pub fn position_in_world(&self) -> Vec3 {
        self.rotation_camera_from_world.transpose() * -self.translation_camera_from_world
    }

    /// The direction it looks along, in the world; unit length.
    pub fn forward_in_world(&self) -> Vec3 {
        self.rotation_camera_from_world.transpose() * Vec3::Z
    }

    /// The ray through a place on the picture, in pixels from the upper left corner; unit direction.
    pub fn ray_through(&self, place_pixels: Vec2) -> Ray {
        let on_plane = (place_pixels - self.centre_pixels) / self.focal_pixels;
        let direction = self.rotation_camera_from_world.transpose() * on_plane.extend(1.0);
        Ray { origin: self.position_in_world(), direction: direction / direction.length(), t_max: f32::INFINITY }
    }

    /// Where a point of the world falls on the picture, in pixels, and its depth along the view direction.
    /// `None` when it lies behind the camera.
    pub fn project(&self, point_in_world: Vec3) -> Option<(Vec2, f32)> {
        let point = self.rotation_camera_from_world * point_in_world + self.translation_camera_from_world;
        (point.z > 0.0).then(|| (point.truncate() / point.z * self.focal_pixels + self.centre_pixels, point.z))
    }

    /// Where a point of the world falls on the picture, in pixels; `None` when it lies behind the camera or beyond the
    /// picture's border.
    pub fn place_in_picture(&self, point_in_world: Vec3) -> Option<Vec2> {
        let (place, _) = self.project(point_in_world)?;
        let (width, height) = (self.width as f32, self.height as f32);
        (place.x >= 0.0 && place.y >= 0.0 && place.x < width && place.y < height).then_some(place)
    }

    /// Angle that one pixel covers at the centre of the picture, in radians.
    pub fn pixel_angle_radians(&self) -> f32 {
        1.0 / (self.focal_pixels.x * self.focal_pixels.y).sqrt()
    }

    /// The same camera with a picture `factor` times smaller: the size is rounded down, at least one pixel.
    pub fn shrunk(&self, factor: usize) -> Self {
        let factor_f32 = factor as f32;
        Camera {
            width: (self.width / factor).max(1),
            height: (self.height / factor).max(1),
            focal_pixels: self.focal_pixels / factor_f32,
            centre_pixels: self.centre_pixels / factor_f32,
            ..*self
        }
    }

    /// How many times the picture is halved until it has at most so many pixels (no fewer than one); at most 12 times.
    pub fn level_within(&self, most_pixels: usize) -> usize {
        let most_pixels = most_pixels.max(1);
        (0..12).find(|level| (self.width >> level) * (self.height >> level) <= most_pixels).unwrap_or(12)
    }

    /// A camera at `eye` that looks at `target`, with +y of the world up on the picture.
    pub fn looking_at(eye: Vec3, target: Vec3, width: usize, height: usize, field_of_view_x_radians: f32) -> Self {
        let forward = (target - eye).try_normalize().unwrap_or(Vec3::NEG_Z);
        let right = forward.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
        let down = forward.cross(right);
        let rotation = Mat3::from_cols(right, down, forward).transpose();
        let focal = 0.5 * width as f32 / (0.5 * field_of_view_x_radians).tan();
        Camera {
            width,
            height,
            focal_pixels: Vec2::splat(focal),
            centre_pixels: Vec2::new(0.5 * width as f32, 0.5 * height as f32),
            rotation_camera_from_world: rotation,
            translation_camera_from_world: -(rotation * eye),
        }
    }

    /// Checks that numbers are finite, the focal lengths positive and the rotation a rotation within `tolerance`.
    pub fn validate(&self, tolerance: f32) -> Result<()> {
        let finite = self.focal_pixels.is_finite()
            && self.centre_pixels.is_finite()
            && self.rotation_camera_from_world.is_finite()
            && self.translation_camera_from_world.is_finite();
        if !finite {
            return Err(Error::new(ErrorKind::NonFinite, "a number of the camera is not finite")
                .remedy("remove the view or export its camera again"));
        }
        if self.width == 0 || self.height == 0 || self.focal_pixels.min_element() <= 0.0 {
            return Err(Error::new(ErrorKind::InvalidScene, "the camera has no size or no positive focal length")
                .remedy("check the order of width, height and intrinsics"));
        }
        let rotation = self.rotation_camera_from_world;
        let gram = rotation * rotation.transpose();
        let departure =
            (0..3).map(|column| (gram.col(column) - Mat3::IDENTITY.col(column)).length()).fold(0.0, f32::max);
        if departure > tolerance {
            return Err(Error::new(
                ErrorKind::InvalidScene,
                format!("the camera's rotation is off an orthonormal matrix by {departure:.2e}"),
            )
            .remedy("the extrinsics carry a scale or a shear: export rigid transforms"));
        }
        if rotation.determinant() < 0.0 {
            return Err(Error::new(ErrorKind::InvalidScene, "the camera's rotation is a mirror")
                .remedy("one axis is flipped: export OpenCV cameras (x right, y down, z forward)"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projection_inverts_the_ray() {
        let camera = Camera::looking_at(Vec3::new(3.0, 2.0, 5.0), Vec3::new(0.1, 0.4, 0.0), 320, 200, 0.7);
        camera.validate(1e-5).unwrap();
        for place in [Vec2::new(0.5, 0.5), Vec2::new(160.0, 100.0), Vec2::new(319.0, 3.25)] {
            let ray = camera.ray_through(place);
            let (again, _) = camera.project(ray.origin + 4.0 * ray.direction).unwrap();
            assert!((again - place).length() < 1e-3);
        }
        let above = camera.project(Vec3::new(0.1, 1.0, 0.0)).unwrap().0;
        assert!(above.y < 100.0, "up in the world is up on the picture");
        assert!(camera.project(camera.position_in_world() - camera.forward_in_world()).is_none());
    }
}
