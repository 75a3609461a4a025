//! The usual hand movements: drag to turn, drag with another button to move, wheel to go nearer; as in the program that
//! a person comes from.

use super::eye::Eye;
use eframe::egui::{self, Modifiers, PointerButton};
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// A drag over the height of the view turns by this many radians.
const RADIANS_PER_HEIGHT: f32 = 4.0;
/// This many points of the wheel change the distance by a factor of e.
const WHEEL_POINTS: f32 = 400.0;
/// A zooming drag over the height of the view changes the distance by this power of e.
const ZOOM_PER_HEIGHT: f32 = 3.0;

/// Whose hand movements the stage follows: fingers know those of the program they come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Navigation {
    /// Left or middle drag orbits; right drag, Shift and middle drag, or Ctrl and left drag pans.
    #[default]
    Patina,
    /// Middle drag orbits, with Shift it pans, with Ctrl it zooms.
    Blender,
    /// With Alt held: left drag orbits, middle drag pans, right drag zooms.
    Maya,
}

impl Navigation {
    /// All of them with their names and what the hand does.
    pub const NAMED: [(Navigation, &str, &str); 3] = [
        (
            Navigation::Patina,
            "Patina",
            "Drag to orbit (middle-drag too), right-drag or Shift-middle-drag to pan, wheel to zoom",
        ),
        (
            Navigation::Blender,
            "Blender",
            "Middle-drag to orbit, Shift-middle-drag to pan, Ctrl-middle-drag or wheel to zoom",
        ),
        (Navigation::Maya, "Maya", "Alt-drag to orbit, Alt-middle-drag to pan, Alt-right-drag or wheel to zoom"),
    ];

    /// What the hand does.
    pub fn words(self) -> &'static str {
        Self::NAMED.iter().find(|(own, ..)| *own == self).map_or("", |(.., words)| words)
    }

    /// What a drag with a button and these modifiers does to the eye.
    fn of_drag(self, button: PointerButton, held: Modifiers) -> Option<Movement> {
        use Movement::{Orbit, Pan, Zoom};
        let (shift, command, alt) = (held.shift, held.command || held.ctrl, held.alt);
        match (self, button) {
            // Shift and left drag is left to whoever turns the light.
            (Navigation::Patina, PointerButton::Primary) if shift => None,
            (Navigation::Patina, PointerButton::Primary) if command => Some(Pan),
            (Navigation::Patina, PointerButton::Primary) => Some(Orbit),
            (Navigation::Patina, PointerButton::Middle) if shift || command => Some(Pan),
            (Navigation::Patina, PointerButton::Middle) => Some(Orbit),
            (Navigation::Patina, PointerButton::Secondary) => Some(Pan),
            (Navigation::Blender, PointerButton::Middle) if shift => Some(Pan),
            (Navigation::Blender, PointerButton::Middle) if command => Some(Zoom),
            (Navigation::Blender, PointerButton::Middle) => Some(Orbit),
            (Navigation::Maya, PointerButton::Primary) if alt => Some(Orbit),
            (Navigation::Maya, PointerButton::Middle) if alt => Some(Pan),
            (Navigation::Maya, PointerButton::Secondary) if alt => Some(Zoom),
            _ => None,
        }
    }
}

/// What a drag does to the eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Movement {
    Orbit,
    Pan,
    Zoom,
}

/// Moves the eye by what the pointer did on the stage; whether it moved.
///
/// Drags are those of a [`Navigation`]; the wheel goes nearer to what is under the pointer. A click and a double click are
/// left to whoever picks. Looking through a photo ends with the first movement, from where one stood: `bounds` (lower and
/// upper corner of the scene) says what to turn about.
pub fn navigate(
    response: &egui::Response,
    eye: &mut Eye,
    bounds: Option<(Vec3, Vec3)>,
    navigation: Navigation,
) -> bool {
    let size = Vec2::new(response.rect.width(), response.rect.height());
    if size.min_element() < 1.0 {
        return false;
    }
    let held = response.ctx.input(|input| input.modifiers);
    let drag = Vec2::new(response.drag_delta().x, response.drag_delta().y) / size.y;
    let buttons = [PointerButton::Primary, PointerButton::Middle, PointerButton::Secondary];
    let button = buttons.into_iter().find(|button| response.dragged_by(*button));
    let movement = button.filter(|_| drag != Vec2::ZERO).and_then(|button| navigation.of_drag(button, held));
    let wheel = if response.contains_pointer() {
        response.ctx.input(|input| (-input.smooth_scroll_delta().y / WHEEL_POINTS).exp() / input.zoom_delta().max(1e-3))
    } else {
        1.0
    };
    let wheel = if wheel.is_finite() { wheel } else { 1.0 };
    if movement.is_none() && wheel == 1.0 {
        return false;
    }
    let mut orbit = eye.in_orbit(bounds.unwrap_or((Vec3::NEG_ONE, Vec3::ONE)));
    match movement {
        Some(Movement::Orbit) => orbit.orbit(drag * RADIANS_PER_HEIGHT),
        Some(Movement::Pan) => orbit.pan(drag),
        // To the right and up goes nearer.
        Some(Movement::Zoom) => orbit.zoom((ZOOM_PER_HEIGHT * (drag.y - drag.x)).exp(), None),
        None => {}
    }
    if wheel != 1.0 {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_program_s_fingers_find_orbit_and_pan_and_the_light_keeps_its_drag() {
        let of = |navigation: Navigation, button, held| navigation.of_drag(button, held);
        let (none, shift, ctrl, alt) = (Modifiers::NONE, Modifiers::SHIFT, Modifiers::COMMAND, Modifiers::ALT);
        use PointerButton::{Middle, Primary, Secondary};
        assert_eq!(of(Navigation::Patina, Primary, none), Some(Movement::Orbit));
        assert_eq!(of(Navigation::Patina, Middle, none), Some(Movement::Orbit));
        assert_eq!(of(Navigation::Patina, Middle, shift), Some(Movement::Pan));
        assert_eq!(of(Navigation::Patina, Primary, ctrl), Some(Movement::Pan));
        assert_eq!(of(Navigation::Blender, Middle, none), Some(Movement::Orbit));
        assert_eq!(of(Navigation::Blender, Middle, shift), Some(Movement::Pan));
        assert_eq!(of(Navigation::Blender, Middle, ctrl), Some(Movement::Zoom));
        assert_eq!(of(Navigation::Blender, Primary, none), None);
        assert_eq!(of(Navigation::Maya, Primary, alt), Some(Movement::Orbit));
        assert_eq!(of(Navigation::Maya, Middle, alt), Some(Movement::Pan));
        assert_eq!(of(Navigation::Maya, Secondary, alt), Some(Movement::Zoom));
        assert_eq!(of(Navigation::Maya, Primary, none), None);
        for (navigation, ..) in Navigation::NAMED {
            assert_eq!(of(navigation, Primary, shift), None, "the light is turned");
            assert!(!navigation.words().is_empty());
        }
    }
}
