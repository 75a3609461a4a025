//! What tells of the light over the stage: a handle at its sun, and a chrome and a grey ball.

use super::place_in;
use crate::image::RgbImage;
use crate::image::display::DisplaySettings;
use crate::light::Environment;
use crate::light::ball::{matte_ball, mirror_ball};
use crate::light::day::Day;
use crate::scene::Camera;
use crate::studio::model::{LightName, Model};
use crate::studio::panel::relight::colour_image;
use crate::studio::stage::StageFrame;
use egui::{Color32, ColorImage, CursorIcon, Painter, Rect, Sense, Stroke, TextureHandle, TextureOptions, Ui, vec2};
use glam::{Mat3, Quat, Vec2, Vec3};
use std::sync::Arc;

/// A light whose brightest texel is so many times its mean has a sun.
const SUN_OVER_MEAN: f32 = 20.0;
/// Radius of the handle's disc in points.
const SUN_RADIUS: f32 = 7.0;
/// How far from the border of the stage a sun outside it is shown, in points.
const INSET: f32 = 26.0;
/// Degrees by which one movement of the mouse may turn the light: beyond them lie places that look alike.
const MOST_DEGREES: i32 = 60;
/// Turns of a degree that are tried.
const TURNS_PER_DEGREE: i32 = 4;
/// Side of a ball in points and pixels.
const BALL_SIDE: usize = 84;
/// Reflectance of the grey ball: the middle grey of photographers' cards.
const GREY: f32 = 0.18;

/// What the balls show depends on these.
struct BallKey {
    environment: Arc<Environment>,
    /// The light whose brightness it is brought to.
    reference: Option<Arc<Environment>>,
    turn_degrees: f32,
    strength_stops: f32,
    world_from_ball: Quat,
    display: DisplaySettings,
}

impl BallKey {
    /// Whether both are the same; lights are told apart by where they lie, not by their texels.
    fn is(&self, other: &BallKey) -> bool {
        let address = |light: &Option<Arc<Environment>>| light.as_ref().map(Arc::as_ptr);
        Arc::ptr_eq(&self.environment, &other.environment)
            && address(&self.reference) == address(&other.reference)
            && (self.turn_degrees, self.strength_stops) == (other.turn_degrees, other.strength_stops)
            && (self.world_from_ball, self.display) == (other.world_from_ball, other.display)
    }
}

/// What is kept of it.
#[derive(Default)]
pub(super) struct Gauges {
    /// Of which light the sun was sought, and where it was found.
    sun: Option<(Arc<Environment>, Option<Vec3>)>,
    balls: Option<(BallKey, [TextureHandle; 2])>,
}

/// Draws both, and turns the light where the sun is dragged.
pub(super) fn show(
    ui: &mut Ui,
    model: &mut Model,
    memory: &mut Gauges,
    (frame, rect, is_settled): (&StageFrame, Rect, bool),
) {
    let has_maps = model.project.as_ref().is_some_and(|project| project.maps.is_some());
    if !model.shows_light() || !has_maps || rect.width().min(rect.height()) < 4.0 * INSET {
        return;
    }
    let name = model.edits.relight.first.clone();
    let Some(own) = model.shelf.find(&name).map(|light| Arc::clone(&light.environment)) else { return };
    if model.edits.relight.balls {
        balls(ui, model, memory, (&name, &own), (frame, rect, is_settled));
    }
    if name == LightName::Day {
        return handle(ui, model, Sun::OfDay, frame, rect);
    }
    if memory.sun.as_ref().is_none_or(|(of, _)| !Arc::ptr_eq(of, &own)) {
        memory.sun = Some((Arc::clone(&own), sun_of(&own)));
    }
    if let Some((_, Some(sun))) = memory.sun {
        handle(ui, model, Sun::Towards(sun), frame, rect);
    }
}

/// What is dragged.
#[derive(Clone, Copy)]
enum Sun {
    /// The sun of a light that turns about the up axis.
    Towards(Vec3),
    /// The sun of a sky by the hour, which goes along its way over the day.
    OfDay,
}

/// Direction of a light's sun; `None` where no texel stands out.
fn sun_of(environment: &Environment) -> Option<Vec3> {
    let brightest = environment.brightest_direction()?;
    let [peak, mean] =
        [environment.radiance_towards(brightest), environment.mean_radiance()].map(crate::math::luminance);
    (peak > SUN_OVER_MEAN * mean).then_some(brightest)
}

/// Where a direction of the world is shown: its place on the stage, or the place on the border towards it.
fn place_of(direction: Vec3, camera: &Camera, size: Vec2) -> (Vec2, bool) {
    let seen = camera.rotation_camera_from_world * direction;
    let (middle, half) = (0.5 * size, 0.5 * size - INSET);
    let straight = (seen.z > 1e-3).then(|| seen.truncate() / seen.z * camera.focal_pixels + camera.centre_pixels);
    if let Some(place) = straight
        && (place - middle).abs().cmple(half).all()
    {
        return (place, true);
    }
    let towards = straight.map_or(seen.truncate(), |place| place - middle);
    let reach = (half / towards.abs().max(Vec2::splat(1e-6))).min_element();
    (middle + towards * reach, false)
}

/// The sun, which is dragged about the up axis, or along its way over the day.
fn handle(ui: &mut Ui, model: &mut Model, sun: Sun, frame: &StageFrame, rect: Rect) {
    let size = Vec2::new(rect.width(), rect.height());
    let camera = frame.eye.as_camera(size.x as usize, size.y as usize);
    let turned = |sun: Vec3, degrees: f32| Quat::from_rotation_y(degrees.to_radians()) * sun;
    let (turn, day) = (model.edits.relight.turn_degrees, model.edits.relight.day);
    let towards = match sun {
        Sun::Towards(sun) => sun,
        Sun::OfDay => day.towards_sun(),
    };
    let (place, is_on_stage) = place_of(turned(towards, turn), &camera, size);
    let at = rect.min + vec2(place.x, place.y);
    let grip = Rect::from_center_size(at, vec2(1.0, 1.0) * 4.0 * SUN_RADIUS);
    let response = ui.interact(grip, ui.scope_id().with("sun"), Sense::drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "Sun"));
    if response.dragged()
        && let Some(pointer) = response.interact_pointer_pos()
    {
        let wanted = place_in(rect, pointer);
        let distance =
            |sun: Vec3, degrees: f32| place_of(turned(sun, degrees), &camera, size).0.distance_squared(wanted);
        let steps = -MOST_DEGREES * TURNS_PER_DEGREE..=MOST_DEGREES * TURNS_PER_DEGREE;
        // The sky turns by 15 degrees an hour.
        let of_step = |step: i32| step as f32 / TURNS_PER_DEGREE as f32;
        match sun {
            Sun::Towards(sun) => {
                let nearest = steps.map(|step| turn + of_step(step));
                let nearest = nearest.min_by(|a, b| distance(sun, *a).total_cmp(&distance(sun, *b)));
                model.edits.relight.turn_degrees = nearest.unwrap_or(turn).rem_euclid(360.0);
            }
            Sun::OfDay => {
                let (rise, set) = day.daylight().unwrap_or((12.0, 12.0));
                let at = |hour: f32| Day { hour, ..day }.towards_sun();
                let nearest = steps.map(|step| (day.hour + of_step(step) / 15.0).clamp(rise, set));
                let nearest = nearest.min_by(|a, b| distance(at(*a), turn).total_cmp(&distance(at(*b), turn)));
                model.edits.relight.day.hour = nearest.unwrap_or(day.hour);
            }
        }
    }
    let is_held = response.hovered() || response.dragged();
    draw_sun(&ui.painter_at(rect), at, is_on_stage, is_held);
    response.on_hover_cursor(CursorIcon::Grab).on_hover_text(match sun {
        Sun::Towards(_) => "The brightest direction of the environment\nDrag it to rotate the environment",
        Sun::OfDay => "The sun\nDrag it along its way over the day to set the hour",
    });
}

fn draw_sun(painter: &Painter, at: egui::Pos2, is_on_stage: bool, is_held: bool) {
    let colour = Color32::from_rgb(255, 210, 74);
    let radius = if is_held { 1.25 * SUN_RADIUS } else { SUN_RADIUS };
    for (width, colour) in [(4.0, Color32::from_black_alpha(160)), (2.0, colour)] {
        for ray in 0..8 {
            let direction = egui::Vec2::angled(std::f32::consts::TAU * ray as f32 / 8.0);
            painter.line_segment(
                [at + 1.5 * radius * direction, at + 2.1 * radius * direction],
                Stroke::new(width, colour),
            );
        }
        painter.circle_stroke(at, radius, Stroke::new(width, colour));
    }
    if is_on_stage {
        painter.circle_filled(at, radius, colour);
    }
}

/// The two balls, at the upper left. While the eye moves they stay as they were: they take longer than a frame may.
fn balls(
    ui: &mut Ui,
    model: &Model,
    memory: &mut Gauges,
    (name, own): (&LightName, &Arc<Environment>),
    (frame, rect, is_settled): (&StageFrame, Rect, bool),
) {
    let relight = &model.edits.relight;
    let rotation = frame.eye.as_camera(BALL_SIDE, BALL_SIDE).rotation_camera_from_world;
    // The camera looks along z with y down; a ball is seen from +z with y up.
    let world_from_camera = Quat::from_mat3(&rotation.transpose());
    let world_from_ball = world_from_camera * Quat::from_mat3(&Mat3::from_diagonal(Vec3::new(1.0, -1.0, -1.0)));
    let key = BallKey {
        environment: Arc::clone(own),
        reference: model
            .shelf
            .find(&LightName::Fitted)
            .filter(|_| relight.matched)
            .map(|light| Arc::clone(&light.environment)),
        turn_degrees: relight.turn_degrees,
        strength_stops: relight.strength_stops,
        world_from_ball,
        display: model.edits.display,
    };
    let is_known = memory.balls.as_ref().is_some_and(|(own, _)| own.is(&key));
    if !is_known
        && (is_settled || memory.balls.is_none())
        && let Some(environment) = model.stage_light(name)
    {
        let within_light = Quat::from_rotation_y(-relight.turn_degrees.to_radians()) * world_from_ball;
        let strength = relight.strength_stops.exp2();
        let chrome = mirror_ball(&environment, BALL_SIDE, within_light).map(|radiance| *radiance * strength);
        let grey = matte_ball(&environment, BALL_SIDE, within_light).map(|radiance| *radiance * GREY * strength);
        let textures = [("chrome ball", chrome), ("grey ball", grey)].map(|(name, picture)| {
            ui.ctx().load_texture(name, cut_out(&picture, &key.display), TextureOptions::LINEAR)
        });
        memory.balls = Some((key, textures));
    }
    let Some((_, textures)) = &memory.balls else { return };
    for (place, (texture, name)) in textures.iter().zip(["Chrome ball", "Grey ball, 18 %"]).enumerate() {
        let side = BALL_SIDE as f32;
        let own = Rect::from_min_size(rect.min + vec2(10.0 + place as f32 * (side + 8.0), 40.0), vec2(side, side));
        let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
        ui.painter_at(rect).image(texture.id(), own, whole, Color32::WHITE);
        let response = ui.interact(own, ui.scope_id().with(name), Sense::hover());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, name));
        response.on_hover_text(format!("{name}, in this environment, without shadows of the scene"));
    }
}

/// A ball as it is shown, clear beside it.
fn cut_out(picture: &RgbImage, display: &DisplaySettings) -> ColorImage {
    let mut image = colour_image(picture, display);
    let (width, radius) = (picture.width(), 0.5 * picture.width() as f32);
    for (index, pixel) in image.pixels.iter_mut().enumerate() {
        let place = Vec2::new((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
        let cover = (radius - place.distance(Vec2::splat(radius)) + 0.5).clamp(0.0, 1.0);
        *pixel = pixel.gamma_multiply(cover);
    }
    image
}
