//! An eye that goes around a point.

use crate::scene::Camera;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, TAU};

/// The pitch of an orbit stays this far from straight up and down, in radians: there is always an upper side.
const POLE_MARGIN_RADIANS: f32 = 1e-3;
/// Narrowest and widest vertical field of view of an orbit, in radians.
const FIELD_OF_VIEW_RADIANS: (f32, f32) = (0.02, 2.6);

/// An eye that goes around a target, with +y of the world up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitEye {
    /// The point in the middle of the view, in the world.
    pub target: Vec3,
    /// Distance from the target, in world units; above 0.
    pub distance: f32,
    /// Angle about +y, in radians; 0 stands at +z of the target, a quarter turn at +x.
    pub yaw_radians: f32,
    /// Height above the horizon of the target, in radians; within a quarter turn up and down.
    pub pitch_radians: f32,
    /// Angle from the lower to the upper border of the view, in radians.
    pub vertical_field_of_view_radians: f32,
}

impl Default for OrbitEye {
    fn default() -> Self {
        OrbitEye {
            target: Vec3::ZERO,
            distance: 4.0,
            yaw_radians: 0.6,
            pitch_radians: 0.4,
            vertical_field_of_view_radians: 0.7,
        }
    }
}

impl OrbitEye {
    /// An eye that sees a whole box (lower and upper corner, in the world) from the default side.
    pub fn around(bounds: (Vec3, Vec3)) -> Self {
        let mut eye = OrbitEye::default();
        eye.fit(bounds, 1.5);
        eye
    }

    /// Turns about the target: positive x turns the scene to the right, positive y tips its upper side towards the eye.
    pub fn orbit(&mut self, radians: Vec2) {
        if radians.is_finite() {
            self.yaw_radians = (self.yaw_radians - radians.x).rem_euclid(TAU);
            self.pitch_radians += radians.y;
        }
        self.settle();
    }

    /// Moves sideways: the scene at the target's depth follows by this many heights of the view, x right and y down.
    pub fn pan(&mut self, heights: Vec2) {
        if heights.is_finite() {
            let [right, down, _] = self.axes();
            let height = 2.0 * self.distance * (0.5 * self.vertical_field_of_view_radians).tan();
            self.target -= (right * heights.x + down * heights.y) * height;
        }
        self.settle();
    }

    /// Scales the distance by `factor` (below 1 goes nearer). A point given stays where it is on the screen.
    pub fn zoom(&mut self, factor: f32, towards_in_world: Option<Vec3>) {
        let factor = if factor.is_finite() { factor.clamp(0.05, 20.0) } else { 1.0 };
        let before = self.distance;
        self.distance = (before * factor).clamp(1e-6, 1e9);
        if let Some(point) = towards_in_world.filter(|point| point.is_finite()) {
            self.target = point + (self.target - point) * (self.distance / before);
        }
        self.settle();
    }

    /// Keeps the direction and moves so that a box (lower and upper corner) fills a view of this width over height.
    pub fn fit(&mut self, (low, high): (Vec3, Vec3), aspect: f32) {
        self.settle();
        let half_height = (0.5 * self.vertical_field_of_view_radians).tan();
        let half_width = half_height * if aspect.is_finite() { aspect.max(0.1) } else { 1.0 };
        let [right, down, forward] = self.axes();
        let half = 0.5 * (high - low);
        // A corner is inside when its distance from the axis is within the view at its depth.
        let needed = (0..8).map(|corner| {
            let sign = |axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
            let offset = half * Vec3::new(sign(0), sign(1), sign(2));
            let beside = (offset.dot(right).abs() / half_width).max(offset.dot(down).abs() / half_height);
            beside - offset.dot(forward)
        });
        self.target = 0.5 * (low + high);
        self.distance = 1.05 * needed.fold(1e-6, f32::max);
        self.settle();
    }

    /// The eye that stands where a camera stands and looks where it looks, without its roll; the target is at the depth
    /// of the middle of the scene's box, so that turning goes about the scene.
    pub fn from_camera(camera: &Camera, (low, high): (Vec3, Vec3)) -> Self {
        let (position, forward) = (camera.position_in_world(), camera.forward_in_world());
        let depth = (0.5 * (low + high) - position).dot(forward);
        let distance = depth.max(0.05 * (high - low).length()).max(1e-6);
        let mut eye = OrbitEye {
            target: position + distance * forward,
            distance,
            yaw_radians: (-forward.x).atan2(-forward.z).rem_euclid(TAU),
            pitch_radians: (-forward.y).clamp(-1.0, 1.0).asin(),
            vertical_field_of_view_radians: 2.0 * (0.5 * camera.height as f32 / camera.focal_pixels.y).atan(),
        };
        eye.settle();
        eye
    }

    /// Where the eye is, in the world.
    pub fn position_in_world(&self) -> Vec3 {
        let [_, _, forward] = self.axes();
        self.target - self.distance * forward
    }

    /// Right, down and forward in the world; unit length, from the angles alone and so never undefined.
    pub(super) fn axes(&self) -> [Vec3; 3] {
        let (sin_yaw, cos_yaw) = self.yaw_radians.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch_radians.sin_cos();
        let forward = -Vec3::new(cos_pitch * sin_yaw, sin_pitch, cos_pitch * cos_yaw);
        let right = Vec3::new(cos_yaw, 0.0, -sin_yaw);
        [right, forward.cross(right), forward]
    }

    /// The eye with every number in its range: the fields are public.
    pub(super) fn settled(mut self) -> Self {
        self.settle();
        self
    }

    /// Brings every number back into its range, whatever was done to it.
    pub(super) fn settle(&mut self) {
        let usual = OrbitEye::default();
        let finite = |value: f32, otherwise: f32| if value.is_finite() { value } else { otherwise };
        let steepest = FRAC_PI_2 - POLE_MARGIN_RADIANS;
        self.target = if self.target.is_finite() { self.target } else { usual.target };
        self.distance = finite(self.distance, usual.distance).clamp(1e-6, 1e9);
        self.yaw_radians = finite(self.yaw_radians, 0.0);
        self.pitch_radians = finite(self.pitch_radians, 0.0).clamp(-steepest, steepest);
        let (narrow, wide) = FIELD_OF_VIEW_RADIANS;
        self.vertical_field_of_view_radians =
            finite(self.vertical_field_of_view_radians, usual.vertical_field_of_view_radians).clamp(narrow, wide);
    }
}
