//! Cameras as pyramids in the world: their lines, their image planes, and which of them the pointer means.

use super::content::StageCamera;
use super::eye::Eye;
use crate::image::display::scale_colour;
use crate::scene::Camera;
use eframe::egui::Color32;
use glam::{Vec2, Vec3, Vec4};

/// A line within this many units of the rectangle is meant by a click on it.
const PICK_REACH: f32 = 6.0;
/// Length of a dash and of the gap after it, in pixels.
const DASH_PIXELS: f32 = 6.0;
/// Grey of cameras whose error is unknown, sRGB in [0, 1].
const UNKNOWN: Vec3 = Vec3::splat(0.66);

/// A line in the world, as the shader takes it.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Line {
    /// Start in the world, and width in pixels.
    pub start_and_width: Vec4,
    /// End in the world, and length of a dash in pixels; 0 is solid.
    pub end_and_dash: Vec4,
    /// sRGB and opacity in [0, 1].
    pub colour: Vec4,
}

/// A corner of a thumbnail, as the shader takes it.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct PictureCorner {
    /// Place in the world.
    pub position: Vec3,
    /// Brightness of the picture in [0, 1].
    pub brightness: f32,
    /// Place in the atlas in [0, 1], v down.
    pub place: Vec2,
}

/// A length for the frustums of a scene, in world units: as long as leaves room between neighbouring cameras, within a
/// small share of the scene's size (`bounds` are the lower and upper corner of the mesh).
pub fn frustum_depth(cameras: &[StageCamera], bounds: Option<(Vec3, Vec3)>) -> f32 {
    let positions: Vec<Vec3> = cameras.iter().map(|camera| camera.camera.position_in_world()).collect();
    let (low, high) = positions.iter().fold(bounds.unwrap_or((Vec3::INFINITY, Vec3::NEG_INFINITY)), |box_, &place| {
        (box_.0.min(place), box_.1.max(place))
    });
    let scene = bounds.map_or((high - low).length(), |(low, high)| (high - low).length());
    if !scene.is_finite() || scene <= 0.0 {
        return if positions.is_empty() { 0.0 } else { 1.0 };
    }
    // Every camera's nearest neighbour; of very many cameras, that of some.
    let stride = positions.len().div_ceil(200).max(1);
    let mut nearest: Vec<f32> = (0..positions.len())
        .step_by(stride)
        .filter_map(|one| {
            let others = positions.iter().enumerate().filter(|&(other, _)| other != one);
            others.map(|(_, place)| place.distance(positions[one])).filter(|d| *d > 0.0).min_by(f32::total_cmp)
        })
        .collect();
    nearest.sort_by(f32::total_cmp);
    let spacing = nearest.get(nearest.len() / 2).copied().unwrap_or(0.1 * scene);
    (0.55 * spacing).clamp(0.015 * scene, 0.12 * scene)
}

/// Apex and the corners of the image plane (upper left, upper right, lower right, lower left) in the world.
pub(super) fn corners(camera: &Camera, depth: f32) -> (Vec3, [Vec3; 4]) {
    let apex = camera.position_in_world();
    let world_from_camera = camera.rotation_camera_from_world.transpose();
    let (width, height) = (camera.width as f32, camera.height as f32);
    let plane = [Vec2::ZERO, Vec2::new(width, 0.0), Vec2::new(width, height), Vec2::new(0.0, height)];
    (
        apex,
        plane.map(|place| {
            let on_plane = (place - camera.centre_pixels) / camera.focal_pixels;
            apex + world_from_camera * on_plane.extend(1.0) * depth
        }),
    )
}

/// Whether an eye at this place is so near that the frustum would be all over the screen: it is neither drawn nor picked.
pub(super) fn is_too_near(camera: &Camera, depth: f32, eye_in_world: Vec3) -> bool {
    !(depth > 0.0) || eye_in_world.distance(camera.position_in_world()) < 0.7 * depth
}

/// The lines of all frustums; widths are for one pixel a point of the screen.
pub(super) fn lines(cameras: &[StageCamera], depth: f32, eye_in_world: Vec3, accent: Color32) -> Vec<Line> {
    let mut lines = Vec::with_capacity(cameras.len() * 10);
    for camera in cameras.iter().filter(|camera| !is_too_near(&camera.camera, depth, eye_in_world)) {
        let (apex, plane) = corners(&camera.camera, depth);
        let (width, dash) = (
            if camera.selected { 2.8 } else { 1.4 },
            if camera.held_out || camera.excluded { DASH_PIXELS } else { 0.0 },
        );
        let rgb = camera.error_0_1.map_or(UNKNOWN, scale_colour);
        let rgb = if camera.selected { vec3_of(accent) } else { rgb };
        let colour = rgb.extend(if camera.excluded && !camera.selected { 0.4 } else { 1.0 });
        let mut draw = |start: Vec3, end: Vec3| {
            lines.push(Line { start_and_width: start.extend(width), end_and_dash: end.extend(dash), colour });
        };
        for corner in 0..4 {
            draw(apex, plane[corner]);
            draw(plane[corner], plane[(corner + 1) % 4]);
        }
        // A roof above the upper edge: this side is up.
        let (left, right) = (plane[0].lerp(plane[1], 0.35), plane[0].lerp(plane[1], 0.65));
        let top = plane[0].midpoint(plane[1]) + (plane[0] - plane[3]) * 0.16;
        draw(left, top);
        draw(top, right);
    }
    lines
}

/// The image planes of cameras with a thumbnail; `tile` gives lower and upper corner of a camera's place in the atlas.
pub(super) fn pictures(
    cameras: &[StageCamera],
    depth: f32,
    eye_in_world: Vec3,
    tile: impl Fn(usize) -> (Vec2, Vec2),
) -> Vec<PictureCorner> {
    let mut vertices = Vec::new();
    for (index, camera) in cameras.iter().enumerate() {
        if camera.thumbnail.is_none() || is_too_near(&camera.camera, depth, eye_in_world) {
            continue;
        }
        let (_, plane) = corners(&camera.camera, depth);
        let (low, high) = tile(index);
        let places = [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)];
        let brightness = if camera.excluded { 0.35 } else { 1.0 };
        vertices.extend([0, 1, 2, 0, 2, 3].map(|corner| PictureCorner {
            position: plane[corner],
            brightness,
            place: places[corner],
        }));
    }
    vertices
}

/// The camera whose frustum the pointer is on, by index; the nearest of several. What the mesh hides can be picked.
///
/// `place` and `rect_size` as in [`Eye::project`]; `depth` is [`super::StageContent::frustum_depth`].
pub fn pick_camera(cameras: &[StageCamera], depth: f32, eye: &Eye, place: Vec2, rect_size: Vec2) -> Option<usize> {
    let eye_in_world = eye.position_in_world();
    let mut best: Option<(bool, f32, usize)> = None;
    for (index, camera) in cameras.iter().enumerate() {
        if is_too_near(&camera.camera, depth, eye_in_world) {
            continue;
        }
        let (apex, plane) = corners(&camera.camera, depth);
        let Some((apex, apex_depth)) = eye.project(apex, rect_size) else { continue };
        let plane = plane.map(|corner| eye.project(corner, rect_size).map(|(place, _)| place));
        let [Some(a), Some(b), Some(c), Some(d)] = plane else { continue };
        let sides = [[apex, a, b], [apex, b, c], [apex, c, d], [apex, d, a], [a, b, c], [a, c, d]];
        let inside = sides.iter().any(|side| is_inside(side, place));
        let near = [(apex, a), (apex, b), (apex, c), (apex, d), (a, b), (b, c), (c, d), (d, a)];
        if !inside && near.iter().all(|&(start, end)| distance_to_line(place, start, end) > PICK_REACH) {
            continue;
        }
        // Inside beats near by; then the nearer one.
        let better = best.is_none_or(|(was_inside, was_depth, _)| {
            (inside && !was_inside) || (inside == was_inside && apex_depth < was_depth)
        });
        if better {
            best = Some((inside, apex_depth, index));
        }
    }
    best.map(|(_, _, index)| index)
}

/// Whether a place is in a triangle of either turn.
fn is_inside(triangle: &[Vec2; 3], place: Vec2) -> bool {
    let side = |corner: usize| {
        let (start, end) = (triangle[corner], triangle[(corner + 1) % 3]);
        (end - start).perp_dot(place - start)
    };
    let sides = [side(0), side(1), side(2)];
    sides.iter().all(|&value| value > 0.0) || sides.iter().all(|&value| value < 0.0)
}

/// Distance of a place from a line between two others.
fn distance_to_line(place: Vec2, start: Vec2, end: Vec2) -> f32 {
    let along = end - start;
    let length_squared = along.length_squared();
    let share = if length_squared > 0.0 { ((place - start).dot(along) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    place.distance(start + share * along)
}

/// sRGB of a colour in [0, 1].
pub(super) fn vec3_of(colour: Color32) -> Vec3 {
    Vec3::new(f32::from(colour.r()), f32::from(colour.g()), f32::from(colour.b())) / 255.0
}

#[cfg(test)]
mod tests {
    use super::super::eye::OrbitEye;
    use super::*;

    fn ring() -> Vec<StageCamera> {
        (0..8)
            .map(|index| {
                let (sin, cos) = (index as f32 * 0.785).sin_cos();
                let place = Vec3::new(3.0 * sin, 1.0, 3.0 * cos);
                StageCamera::new(Camera::looking_at(place, Vec3::ZERO, 64, 48, 0.8))
            })
            .collect()
    }

    #[test]
    fn frustums_leave_room_for_their_neighbours_and_follow_the_scene() {
        let bounds = Some((Vec3::NEG_ONE, Vec3::ONE));
        let depth = frustum_depth(&ring(), bounds);
        assert!(depth > 0.05 && depth < 2.3, "{depth}");
        let large: Vec<_> = ring()
            .into_iter()
            .map(|mut camera| {
                camera.camera.translation_camera_from_world *= 100.0;
                camera
            })
            .collect();
        let ratio = frustum_depth(&large, bounds.map(|(low, high)| (low * 100.0, high * 100.0))) / depth;
        assert!((ratio - 100.0).abs() < 1e-2);
        assert_eq!(frustum_depth(&[], None), 0.0);
        assert!(frustum_depth(&ring()[..1], None) > 0.0);
    }

    #[test]
    fn a_click_on_a_frustum_finds_it_and_a_click_beside_finds_none() {
        let (cameras, size) = (ring(), Vec2::new(800.0, 600.0));
        let eye = Eye::Orbit(OrbitEye { pitch_radians: 0.9, distance: 12.0, ..OrbitEye::default() });
        for (index, camera) in cameras.iter().enumerate() {
            let inside = camera.camera.position_in_world() + 0.4 * camera.camera.forward_in_world();
            let (place, _) = eye.project(inside, size).unwrap();
            assert_eq!(pick_camera(&cameras, 0.5, &eye, place, size), Some(index));
        }
        assert_eq!(pick_camera(&cameras, 0.5, &eye, Vec2::new(2.0, 2.0), size), None);
        assert_eq!(pick_camera(&cameras, 0.0, &eye, Vec2::new(400.0, 300.0), size), None);
    }

    #[test]
    fn looking_through_a_camera_does_not_draw_it() {
        let cameras = ring();
        let eye = cameras[2].camera.position_in_world();
        assert_eq!(lines(&cameras, 0.5, eye, Color32::WHITE).len(), 7 * 10);
    }
}
