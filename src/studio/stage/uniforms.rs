//! What the shaders are told: of the scene ([`ViewUniform`], whose change means drawing it anew) and of the screen
//! ([`ScreenUniform`], which only changes how the drawn scene is shown). What no number says is in `variants`.

use super::content::{Backdrop, Crossfade, PhotoMode, StageFrame, StageLight};
use super::eye::Eye;
use super::frustum::vec3_of;
use glam::{Mat4, Vec2, Vec3, Vec4};

/// `View` of `view.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct ViewUniform {
    clip_from_world: Mat4,
    world_from_camera: Mat4,
    focal_centre: Vec4,
    size: Vec4,
    light: Vec4,
    other_light: Vec4,
    shading: Vec4,
    backdrop: Vec4,
    crossfade: Vec4,
}

/// `Screen` of `display.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct ScreenUniform {
    photo_rect: Vec4,
    numbers: Vec4,
    marks: Vec4,
    size: Vec4,
}

/// The sizes of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sizes {
    /// The rectangle in pixels of the screen.
    pub screen: [u32; 2],
    /// The targets in pixels.
    pub target: [u32; 2],
    /// Pixels of the screen a point.
    pub pixels_per_point: f32,
}

impl Sizes {
    fn target_pixels_per_point(&self) -> f32 {
        self.pixels_per_point * self.target[1] as f32 / self.screen[1].max(1) as f32
    }
}

fn vec2_of(size: [u32; 2]) -> Vec2 {
    Vec2::new(size[0] as f32, size[1] as f32)
}

/// The near plane for an eye before a scene: thin against the scene, and before what an orbit turns about.
fn near_plane(eye: &Eye, bounds: Option<(Vec3, Vec3)>) -> f32 {
    let scene = bounds.map_or(1.0, |(low, high)| (high - low).length());
    let near = 5e-4 * if scene > 0.0 && scene.is_finite() { scene } else { 1.0 };
    match eye {
        Eye::Orbit(orbit) => near.min(0.02 * orbit.distance),
        Eye::Photo(_) => near,
    }
}

fn of_light(light: Option<&StageLight>) -> Vec4 {
    light.map_or(Vec4::ZERO, |light| {
        let (sin, cos) = light.rotation_radians.sin_cos();
        let turn = if sin.is_finite() { Vec2::new(cos, sin) } else { Vec2::X };
        let strength = if light.strength.is_finite() { light.strength.max(0.0) } else { 0.0 };
        Vec4::new(turn.x, turn.y, strength, 1.0)
    })
}

impl ViewUniform {
    pub fn new(frame: &StageFrame, sizes: &Sizes, bounds: Option<(Vec3, Vec3)>) -> Self {
        let (content, look) = (&frame.content, &frame.look);
        let target = vec2_of(sizes.target);
        let (world_from_camera, focal, centre) = frame.eye.frame(target);
        let near = near_plane(&frame.eye, bounds);
        let [lowest, highest] = content.quantity.as_ref().map_or([0.0, 1.0], |quantity| quantity.range);
        let per_unit = 1.0 / (highest - lowest);
        let wipe = light_wipe(frame).map_or(f32::MAX, |place| place * target.x);
        let clip_from_world = frame.eye.clip_from_world(target, near);
        ViewUniform {
            // A photo's camera that is no camera shows nothing, rather than what an adapter makes of NaN.
            clip_from_world: if clip_from_world.is_finite() { clip_from_world } else { Mat4::ZERO },
            world_from_camera: Mat4::from_cols(
                world_from_camera.x_axis.extend(0.0),
                world_from_camera.y_axis.extend(0.0),
                world_from_camera.z_axis.extend(0.0),
                frame.eye.position_in_world().extend(1.0),
            ),
            focal_centre: Vec4::new(focal.x, focal.y, centre.x, centre.y),
            size: target.extend(sizes.target_pixels_per_point()).extend(near),
            light: of_light(content.light.as_ref()),
            other_light: of_light(content.other_light.as_ref()),
            shading: Vec4::new(
                wipe,
                content.lobe_strength.clamp(0.0, 1.0),
                lowest,
                if per_unit.is_finite() { per_unit } else { 0.0 },
            ),
            backdrop: match look.backdrop {
                Backdrop::Colour(colour) => vec3_of(colour).extend(0.0),
                Backdrop::Light | Backdrop::BlurredLight => Vec4::ZERO,
            },
            // The exposure alone would have every scene drawn anew that one sets it for.
            crossfade: match frame.crossfade() {
                None => Vec4::ZERO,
                Some(Crossfade::Traced(_)) => Vec4::new(1.0, 0.0, 0.0, 0.0),
                Some(Crossfade::Diffuse(share) | Crossfade::Lit(share)) => {
                    Vec4::new(share, look.display.exposure_stops.exp2(), 0.0, 0.0)
                }
            },
        }
    }
}

/// Place of the wipe between the lights in [0, 1], where there are two.
pub(super) fn light_wipe(frame: &StageFrame) -> Option<f32> {
    let place = frame.look.light_wipe.filter(|place| place.is_finite())?;
    (frame.content.light.is_some() && frame.content.other_light.is_some()).then_some(place.clamp(0.0, 1.0))
}

impl ScreenUniform {
    /// `photo` and `traced` are the sizes of what is uploaded. Also whether their pixels are those of the target.
    pub fn new(
        frame: &StageFrame,
        sizes: &Sizes,
        photo: Option<[u32; 2]>,
        traced: Option<[u32; 2]>,
    ) -> (Self, [Option<bool>; 2]) {
        let look = &frame.look;
        let target = vec2_of(sizes.target);
        let (corner, picture) = frame.eye.picture_rect(target);
        let (opacity, wipe) = match look.photo_mode {
            PhotoMode::Over(opacity) => (opacity, 0.0),
            PhotoMode::Wipe(place) => (0.0, place.clamp(0.0, 1.0)),
            PhotoMode::Off | PhotoMode::Under => (0.0, 0.0),
        };
        // Level of detail: how many pixels of a picture fall on one of the target.
        let level = |size: Option<[u32; 2]>, shown: Vec2| {
            size.map_or(0.0, |size| (vec2_of(size) / shown.max(Vec2::ONE)).max_element().max(1.0).log2())
        };
        let is_exact = |size: [u32; 2], shown: Vec2, corner: Vec2| vec2_of(size) == shown && corner == corner.floor();
        let uniform = ScreenUniform {
            photo_rect: Vec4::new(corner.x, corner.y, picture.x, picture.y),
            numbers: Vec4::new(
                look.display.exposure_stops.exp2(),
                opacity,
                level(photo, picture),
                level(traced, target),
            ),
            marks: Vec4::new(
                light_wipe(frame).map_or(0.0, |place| place * target.x),
                wipe * target.x,
                sizes.target_pixels_per_point().max(0.1),
                if let Some(Crossfade::Traced(share)) = frame.crossfade() { share } else { 1.0 },
            ),
            size: target.extend(0.0).extend(0.0),
        };
        let exact =
            [photo.map(|size| is_exact(size, picture, corner)), traced.map(|size| is_exact(size, target, Vec2::ZERO))];
        (uniform, exact)
    }
}
