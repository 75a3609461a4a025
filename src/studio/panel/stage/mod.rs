//! The stage panel: what is drawn from the model, and what the mouse does to it.

mod decorate;
mod frame;
mod gauges;
mod pictured;
mod relit;
mod traced;

use crate::error::Finding;
use crate::insight::cursor::place_in_view;
use crate::studio::act::Act;
use crate::studio::model::edits::PhotoLook;
use crate::studio::model::laid::CachedOf;
use crate::studio::model::lights::LightName;
use crate::studio::model::log::Message;
use crate::studio::model::{Cursor, Model};
use crate::studio::stage::eye::Eye;
use crate::studio::stage::{self, Backdrop, Layer, Stage, StageFrame};
use crate::studio::workspace::Panel;
use decorate::{colour_bar, decorate};
use egui::{CursorIcon, Pos2, Rect, Response, Ui};
use frame::FrameCache;
use gauges::Gauges;
use glam::Vec2;
use relit::Relit;
use std::time::Instant;
use traced::Traced;

/// What the panel keeps.
#[derive(Default)]
pub struct StageMemory {
    /// What draws in 3-D; `None` where nothing can.
    pub stage: Option<Stage>,
    /// Where it was drawn last, in points; for `patina bench studio`.
    pub rect: Option<Rect>,
    cache: FrameCache,
    traced: Traced,
    relit: Relit,
    gauges: Gauges,
    dragging: Option<Dragging>,
    last_moved: Option<Instant>,
    last_eye: Option<Eye>,
    last_changed: Option<Instant>,
    last_look: Option<Look>,
    /// What the stage could not show as it is, as last told.
    told: Vec<Finding>,
}

/// What a person may change, beside the eye, for which the scene is drawn anew. News of a fit are no part of it.
#[derive(PartialEq)]
struct Look {
    layer: Layer,
    backdrop: Backdrop,
    wipe: Option<f32>,
    crossfade: f32,
    lights: (LightName, Option<LightName>),
    turn_degrees: f32,
    strength_stops: f32,
    chosen_view: Option<usize>,
}

impl Look {
    fn of(model: &Model, frame: &StageFrame) -> Self {
        let relight = &model.edits.relight;
        Look {
            layer: frame.look.layer,
            backdrop: frame.look.backdrop,
            wipe: frame.look.light_wipe,
            crossfade: frame.look.crossfade,
            lights: (relight.first.clone(), relight.second.clone()),
            turn_degrees: relight.turn_degrees,
            strength_stops: relight.strength_stops,
            chosen_view: model.project.as_ref().map(|project| project.chosen_view),
        }
    }
}

/// What a drag moves.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Dragging {
    /// The line between two lights.
    LightWipe,
    /// The line between photo and stage.
    PhotoWipe,
    /// The light about the up axis.
    Light,
    /// The eye.
    Eye,
}

/// Seconds without movement after which the picture is drawn in full.
const SETTLED_SECONDS: f32 = 0.15;
/// Points within which a line is taken by the mouse.
const GRIP: f32 = 6.0;
/// Samples a pixel from which a path-traced picture is shown in place of one that was relit from the cache: below, its
/// noise is larger than what the cache errs.
const ENOUGH_SAMPLES: usize = 64;
/// Degrees by which a drag over a point turns the light.
const DEGREES_PER_POINT: f32 = 0.4;

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut StageMemory) {
    if model.project.is_none() {
        return super::empty(ui, "No project open", "Open a scene or the built-in demo");
    }
    let eye = model.eye_in_force();
    let now = Instant::now();
    if memory.last_eye.replace(eye) != Some(eye) {
        memory.last_moved = Some(now);
    }
    let mut frame = memory.cache.frame(model, eye, ui.visuals());
    let look = Look::of(model, &frame);
    if memory.last_look.as_ref() != Some(&look) {
        memory.last_changed = Some(now);
        memory.last_look = Some(look);
    }
    let rests = |since: Option<Instant>| since.is_none_or(|then| then.elapsed().as_secs_f32() > SETTLED_SECONDS);
    let settled = rests(memory.last_moved);
    let is_sharp = !model.software_adapter || (settled && rests(memory.last_changed));
    if !(settled && is_sharp) {
        ui.ctx().request_repaint_after(std::time::Duration::from_secs_f32(SETTLED_SECONDS));
    }
    if !is_sharp {
        // While something changes, a quarter of the pixels is soon enough on a processor.
        frame.look.resolution_scale = 0.5;
    }
    let size = ui.available_size();
    let mut traced = memory.traced.update(ui, model, &frame, size, settled);
    if let Some(relit) = memory.relit.update(ui, model, &frame, size, settled) {
        match &traced.picture {
            Some(picture) if traced.is_done && relit.is_current => memory.relit.compare(&relit.picture, picture),
            _ => {}
        }
        if traced.picture.is_none() || traced.samples < ENOUGH_SAMPLES {
            let still = if traced.caption.is_empty() { String::new() } else { format!(" · {}", traced.caption) };
            (traced.picture, traced.caption) = (Some(relit.picture), relit.caption + &still);
        }
    }
    frame.content.traced = traced.picture;
    let Some(stage) = &memory.stage else {
        return super::empty(ui, "No 3-D rendering available", "Maps, curves, photos and renders still work");
    };
    let response = stage.show(ui, &frame);
    let findings = stage.status().findings;
    for finding in findings.iter().filter(|finding| !memory.told.contains(finding)) {
        model.log.add(Message::from(finding));
    }
    memory.told = findings;
    memory.rect = Some(response.rect);
    let response = response.on_hover_cursor(CursorIcon::Crosshair);
    interact(ui, model, memory, &frame, &response);
    decorate(ui, model, &frame, response.rect, &traced.caption);
    gauges::show(ui, model, &mut memory.gauges, (&frame, response.rect, settled));
    colour_bar(ui, &frame, response.rect);
}

fn place_in(rect: Rect, at: Pos2) -> Vec2 {
    Vec2::new(at.x - rect.min.x, at.y - rect.min.y)
}

fn interact(ui: &mut Ui, model: &mut Model, memory: &mut StageMemory, frame: &StageFrame, response: &Response) {
    let rect = response.rect;
    let size = Vec2::new(rect.width(), rect.height());
    let pointer = response.interact_pointer_pos().or(response.hover_pos());
    let shift = ui.input(|input| input.modifiers.shift);
    if response.drag_started()
        && let Some(at) = pointer
    {
        // What is gripped lies where the button went down: a quick hand is elsewhere once it counts as a drag.
        let from = ui.input(|input| input.pointer.press_origin()).unwrap_or(at);
        // The middle button always moves the eye.
        let is_middle = response.dragged_by(egui::PointerButton::Middle);
        memory.dragging = Some(if is_middle { Dragging::Eye } else { grip(model, frame, rect, from, shift) });
    }
    if response.dragged()
        && let (Some(dragging), Some(at)) = (memory.dragging, pointer)
    {
        let share = ((at.x - rect.min.x) / rect.width().max(1.0)).clamp(0.02, 0.98);
        match dragging {
            Dragging::LightWipe => model.edits.relight.wipe = share,
            Dragging::PhotoWipe => model.edits.photo = PhotoLook::Wipe(share),
            Dragging::Light => {
                let turned = model.edits.relight.turn_degrees + response.drag_delta().x * DEGREES_PER_POINT;
                model.edits.relight.turn_degrees = turned.rem_euclid(360.0);
            }
            Dragging::Eye => move_eye(model, response),
        }
    } else if response.hovered() {
        move_eye(model, response);
    }
    if response.drag_stopped() {
        memory.dragging = None;
    }
    let Some(at) = response.hover_pos() else { return };
    let place = place_in(rect, at);
    let camera = stage::pick_camera(&frame.content.cameras, frame.content.frustum_depth, &frame.eye, place, size);
    if let Some(index) = camera.filter(|_| !response.dragged()) {
        hover_camera(ui, model, response, index);
        return;
    }
    let cursor = surface_under(model, &frame.eye, place, size);
    if response.double_clicked() {
        if let Some(cursor) = cursor {
            model.eye = frame.eye.in_orbit(bounds_of(model));
            model.eye.target = cursor.position;
            model.switches.looking_through = false;
        }
    } else if response.clicked() {
        pin(model, cursor);
    } else if !response.dragged() {
        model.move_cursor(cursor);
    }
}

/// What a drag that begins here moves.
fn grip(model: &Model, frame: &StageFrame, rect: Rect, at: Pos2, shift: bool) -> Dragging {
    let near = |share: f32| (at.x - rect.min.x - share * rect.width()).abs() < GRIP;
    if matches!(model.edits.photo, PhotoLook::Wipe(share) if near(share)) && matches!(frame.eye, Eye::Photo(_)) {
        Dragging::PhotoWipe
    } else if frame.look.light_wipe.is_some_and(near) {
        Dragging::LightWipe
    } else if shift {
        Dragging::Light
    } else {
        Dragging::Eye
    }
}

fn bounds_of(model: &Model) -> (glam::Vec3, glam::Vec3) {
    let bounds = model.project.as_ref().and_then(|project| project.mesh.bounds());
    bounds.unwrap_or((glam::Vec3::NEG_ONE, glam::Vec3::ONE))
}

fn move_eye(model: &mut Model, response: &Response) {
    let bounds = bounds_of(model);
    let mut eye = model.eye_in_force();
    if stage::navigate(response, &mut eye, Some(bounds), model.preferences.navigation) {
        model.eye = eye.in_orbit(bounds);
        if model.switches.looking_through {
            // The photo no longer lies on what is seen.
            model.look_through(false);
            model.eye = eye.in_orbit(bounds);
        }
    }
}

/// A camera under the mouse: its name and error, and a click looks through it.
fn hover_camera(ui: &mut Ui, model: &mut Model, response: &Response, index: usize) {
    let Some(project) = &mut model.project else { return };
    let Some(view) = project.scene.as_ref().and_then(|scene| scene.views.get(index)) else { return };
    let error = project.view_errors.get(index).copied().flatten();
    let error = error.map_or_else(|| "residual not computed yet".to_owned(), |rmse| format!("RMSE {rmse:.4}"));
    let text = format!("{}\n{error}\nClick for its camera view", view.name);
    ui.ctx().set_cursor_icon(CursorIcon::PointingHand);
    response.clone().on_hover_text_at_pointer(text);
    if response.clicked() {
        project.chosen_view = index;
        model.look_through(true);
    }
}

/// The surface under a place of the stage.
fn surface_under(model: &Model, eye: &Eye, place: Vec2, size: Vec2) -> Option<Cursor> {
    let surface = model.project.as_ref()?.surface.as_ref()?;
    let ray = eye.ray_through(place, size);
    let point = surface.point(&surface.closest(&ray)?);
    let (position, normal, uv) = (point.position, point.shading_normal, point.uv);
    Some(Cursor { over: Panel::Stage, position, normal, uv, pinned: false })
}

/// Pins the texel that was clicked; a click beside the surface lets it go.
fn pin(model: &mut Model, cursor: Option<Cursor>) {
    model.cursor = cursor.map(|cursor| Cursor { pinned: true, ..cursor });
    if model.cursor.is_some() {
        model.act(Act::PanelRecord);
    }
}

/// Where the linked cursor falls in a view, in pixels of its photo.
pub fn cursor_in_view(model: &Model, view: usize) -> Option<Vec2> {
    let scene = model.project.as_ref()?.scene.as_ref()?;
    place_in_view(scene, view, model.cursor?.position)
}
