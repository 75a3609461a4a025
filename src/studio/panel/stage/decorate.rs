//! What is written and drawn over the 3-D picture.

use super::frame;
use crate::image::value_scale::{Palette, ValueScale, three_digits};
use crate::studio::model::edits::PhotoLook;
use crate::studio::model::tasks::TaskKind;
use crate::studio::model::words::capitalised;
use crate::studio::model::{FitStatus, Model};
use crate::studio::picture::scale_bar::scale_bar;
use crate::studio::stage::eye::Eye;
use crate::studio::stage::{Layer, StageFrame};
use crate::studio::theme;
use egui::{Align2, Color32, FontId, Rect, Stroke, StrokeKind, Ui, pos2, vec2};
use glam::Vec2;

/// Lines, captions and the linked cursor over the stage.
pub(super) fn decorate(ui: &mut Ui, model: &Model, frame: &StageFrame, rect: Rect, traced: &str) {
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
    let lit = model.shows_light();
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
pub(super) fn colour_bar(ui: &mut Ui, frame: &StageFrame, rect: Rect) {
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
