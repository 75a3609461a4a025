//! The stage panel: what is drawn from the model, and what the mouse does to it.

mod frame;
mod gauges;
mod relit;
mod traced;

use crate::error::Finding;
use crate::image::value_scale::{Palette, ValueScale, three_digits};
use crate::insight::cursor::place_in_view;
use crate::studio::act::Act;
use crate::studio::layout::Panel;
use crate::studio::model::edits::PhotoLook;
use crate::studio::model::laid::CachedOf;
use crate::studio::model::log::{Message, capitalised};
use crate::studio::model::tasks::TaskKind;
use crate::studio::model::{Cursor, FitStatus, Model};
use crate::studio::picture::scale_bar::scale_bar;
use crate::studio::stage::eye::Eye;
use crate::studio::stage::{self, Layer, Stage, StageFrame};
use crate::studio::theme;
use egui::{Align2, Color32, CursorIcon, FontId, Pos2, Rect, Response, Stroke, StrokeKind, Ui, pos2, vec2};
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
    /// What the stage could not show as it is, as last told.
    told: Vec<Finding>,
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
    let moved = memory.last_eye.as_ref() != Some(&eye);
    if moved {
        memory.last_moved = Some(Instant::now());
        memory.last_eye = Some(eye);
    }
    let settled = memory.last_moved.is_none_or(|then| then.elapsed().as_secs_f32() > SETTLED_SECONDS);
    if !settled {
        ui.ctx().request_repaint_after(std::time::Duration::from_secs_f32(SETTLED_SECONDS));
    }
    let mut frame = memory.cache.frame(model, eye, ui.visuals());
    if model.software_adapter && !settled {
        // While something moves, a quarter of the pixels is soon enough on a processor.
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

/// Lines, captions and the linked cursor over the stage.
fn decorate(ui: &mut Ui, model: &Model, frame: &StageFrame, rect: Rect, traced: &str) {
    let colours = theme::palette(ui.visuals());
    let painter = ui.painter_at(rect);
    let size = Vec2::new(rect.width(), rect.height());
    let caption = |anchor: Align2, text: &str| {
        if text.is_empty() {
            return;
        }
        let at = anchor.pos_in_rect(&rect.shrink(10.0));
        let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(13.0), Color32::WHITE);
        let text_rect = anchor.anchor_size(at, galley.size());
        painter.rect_filled(text_rect.expand(4.0), 4.0, Color32::from_black_alpha(140));
        painter.galley(text_rect.min, galley, Color32::WHITE);
    };
    let shown = model.shown_layer();
    let name = Layer::NAMED.iter().find(|(layer, _)| *layer == shown).map_or("", |(_, name)| name);
    let lit = shown == Layer::Lit;
    let relight = &model.edits.relight;
    let told = frame::told_by(shown);
    caption(
        Align2::LEFT_TOP,
        &match told.and_then(|what| model.project.as_ref()?.known.layer(what)) {
            _ if lit => relight.first.label(),
            Some(layer) => format!("{name}: {} to {}", three_digits(layer.range[0]), three_digits(layer.range[1])),
            None => name.to_owned(),
        },
    );
    if let (Some(second), Some(share), true) = (&relight.second, frame.look.light_wipe, lit) {
        caption(Align2::RIGHT_TOP, &second.label());
        handle(&painter, rect, share, colours.accent);
    }
    if let (PhotoLook::Wipe(share), Eye::Photo(_)) = (model.edits.photo, &frame.eye) {
        handle(&painter, rect, share, colours.accent);
    }
    let mut left = match model.project.as_ref().and_then(|project| project.chosen_name()) {
        Some(name) if model.switches.looking_through => format!("Camera view: {name}"),
        _ => String::new(),
    };
    if lit && relight.turn_degrees != 0.0 {
        let turned = format!("environment rotated by {:.0}°", relight.turn_degrees);
        left = if left.is_empty() { capitalised(&turned) } else { format!("{left}, {turned}") };
    }
    caption(Align2::LEFT_BOTTOM, &left);
    let quick = lit && frame.content.traced.is_none();
    let clay = model.project.as_ref().is_some_and(|project| project.maps.is_none());
    let is_untold = told.is_some_and(|what| !model.project.as_ref().is_some_and(|own| own.known.has(what)));
    let is_measured = shown.is_quantity() && told.is_none();
    let right = match (quick, clay) {
        _ if is_untold => model.why_untold(),
        _ if is_measured && frame.content.quantity.is_none() => match model.tasks.is_running(&TaskKind::Residuals) {
            true => "Computing residuals…",
            false => "Not computed: View › Compute residuals",
        },
        _ if shown == Layer::Photos && model.project.as_ref().is_some_and(|own| own.laid.is_none()) => {
            "Projecting photos…"
        }
        (_, true) if shown == Layer::Photos && model.fit.status.is_live() => {
            "The mean of the photos · materials are on their way"
        }
        (_, true) if lit && model.fit.status.is_live() => "Materials are on their way",
        (_, true) if lit || shown == Layer::Photos => match model.can_resume() {
            true => "No materials yet. Press Resume.",
            false => "No materials yet. Press Start.",
        },
        // Also while a fit runs.
        _ if lit && !traced.is_empty() => traced,
        (true, _) if matches!(model.fit.status, FitStatus::Running | FitStatus::Pausing) => {
            "Raster preview (no shadows) · pause for path tracing"
        }
        (true, _) if !model.switches.traced => "Raster preview (no shadows)",
        _ => traced,
    };
    caption(Align2::RIGHT_BOTTOM, right);
    if let Some(cursor) = &model.cursor
        && let Some((place, _)) = frame.eye.project(cursor.position, size)
    {
        let at = rect.min + vec2(place.x, place.y);
        let stroke = Stroke::new(1.5, colours.accent);
        painter.circle_stroke(at, if cursor.pinned { 7.0 } else { 4.0 }, stroke);
        painter.circle_stroke(at, if cursor.pinned { 8.5 } else { 5.5 }, Stroke::new(1.0, Color32::BLACK));
    }
    let border = ui.visuals().widgets.noninteractive.bg_stroke;
    painter.rect_stroke(rect, 0.0, border, StrokeKind::Inside);
}

/// The colours of the quantity that is shown, with their values and unit, at the lower left of the stage.
fn colour_bar(ui: &mut Ui, frame: &StageFrame, rect: Rect) {
    let layer = frame.look.layer;
    let (Some(quantity), true) = (&frame.content.quantity, layer.is_quantity()) else { return };
    let Some((name, unit)) = unit_of(layer) else { return };
    let logarithmic = layer == Layer::LobeSharing;
    let [low, high] = if logarithmic { quantity.range.map(f32::exp2) } else { quantity.range };
    let width = (0.45 * rect.width()).clamp(120.0, 360.0);
    let place = Rect::from_min_size(pos2(rect.min.x + 10.0, rect.max.y - 62.0), vec2(width, 32.0));
    if !rect.contains_rect(place) {
        return;
    }
    ui.painter().rect_filled(place.expand(6.0), 4.0, ui.visuals().panel_fill.gamma_multiply(0.85));
    ui.scope_builder(egui::UiBuilder::new().max_rect(place), |ui| {
        let scale = ValueScale { low, high, logarithmic };
        scale_bar(ui, &format!("{name}, colour scale"), &scale, Palette::Scale, unit);
    });
}

/// Name of a quantity, and its unit; `None` for layers of colours.
fn unit_of(layer: Layer) -> Option<(&'static str, &'static str)> {
    let name = Layer::NAMED.iter().find(|(own, _)| *own == layer)?.1;
    let unit = match layer {
        Layer::PhotoError => "linear radiance",
        Layer::Coverage => "share of the photos",
        Layer::TimesSeen => "photos",
        Layer::Disagreement => "0 to 1",
        Layer::DiffuseDeviation | Layer::SpecularDeviation => "reflectance",
        Layer::RoughnessDeviation => "r = a²",
        Layer::LobeSharing => "texels",
        Layer::Choice => "1 none, 2 shared, 3 own",
        _ => return None,
    };
    Some((name, unit))
}

/// The grip of a line that can be dragged.
fn handle(painter: &egui::Painter, rect: Rect, share: f32, colour: Color32) {
    let x = rect.min.x + share * rect.width();
    painter.line_segment([pos2(x, rect.min.y), pos2(x, rect.max.y)], Stroke::new(1.5, colour));
    let grip = Rect::from_center_size(pos2(x, rect.center().y), vec2(10.0, 34.0));
    painter.rect_filled(grip, 4.0, colour);
    painter.rect_stroke(grip, 4.0, Stroke::new(1.0, Color32::BLACK), StrokeKind::Outside);
}

/// Where the linked cursor falls in a view, in pixels of its photo.
pub fn cursor_in_view(model: &Model, view: usize) -> Option<Vec2> {
    let scene = model.project.as_ref()?.scene.as_ref()?;
    place_in_view(scene, view, model.cursor?.position)
}
