//! The usual hand movements: drag to turn, drag with another button to move, wheel to go nearer.

use super::eye::Eye;
use eframe::egui;
use glam::{Vec2, Vec3};

/// A drag over the height of the view turns by this many radians.
const RADIANS_PER_HEIGHT: f32 = 4.0;
/// This many points of the wheel change the distance by a factor of e.
const WHEEL_POINTS: f32 = 400.0;

/// Moves the eye by what the pointer did on the stage; whether it moved.
///
/// Left or middle drag orbits; right drag, Shift and middle drag, or Ctrl and left drag, pans; the wheel goes nearer to what is under
/// the pointer. Shift and left drag is left to whoever turns the light, a click and a double click to whoever picks. Looking
/// through a photo ends with the first movement, from where one stood: `bounds` (lower and upper corner of the scene)
/// says what to turn about.
pub fn navigate(response: &egui::Response, eye: &mut Eye, bounds: Option<(Vec3, Vec3)>) -> bool {
    let size = Vec2::new(response.rect.width(), response.rect.height());
    if size.min_element() < 1.0 {
        return false;
    }
    let (shift, command) = response.ctx.input(|input| (input.modifiers.shift, input.modifiers.command));
    let drag = Vec2::new(response.drag_delta().x, response.drag_delta().y) / size.y;
    let middle = response.dragged_by(egui::PointerButton::Middle);
    let primary = !shift && (middle || response.dragged_by(egui::PointerButton::Primary));
    let other = response.dragged_by(egui::PointerButton::Secondary) || middle;
    let wheel = if response.contains_pointer() {
        response.ctx.input(|input| (-input.smooth_scroll_delta().y / WHEEL_POINTS).exp() / input.zoom_delta().max(1e-3))
    } else {
        1.0
    };
    let dragged = drag != Vec2::ZERO && (primary || other);
    if !dragged && (wheel == 1.0 || !wheel.is_finite()) {
        return false;
    }
    let mut orbit = eye.in_orbit(bounds.unwrap_or((Vec3::NEG_ONE, Vec3::ONE)));
    if dragged && primary && !command {
        orbit.orbit(drag * RADIANS_PER_HEIGHT);
    } else if dragged {
        orbit.pan(drag);
    }
    if wheel != 1.0 && wheel.is_finite() {
        // Nothing is known of the surface here: the point is taken at the depth of the target.
        let under_pointer = response.hover_pos().map(|place| {
            let place = Vec2::new(place.x - response.rect.min.x, place.y - response.rect.min.y);
            let here = Eye::Orbit(orbit);
            let (ray, ahead) = (here.ray_through(place, size), here.ray_through(0.5 * size, size));
            ray.origin + ray.direction * (orbit.distance / ray.direction.dot(ahead.direction).max(1e-3))
        });
        orbit.zoom(wheel, under_pointer);
    }
    *eye = Eye::Orbit(orbit);
    true
}
