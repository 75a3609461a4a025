//! The texel under the cursor: its values, the photos that see it, and what each of them says.

use super::views::{role, role_words};
use super::{empty, heading};
use crate::error::{Error, ErrorKind};
use crate::image::value_scale::three_digits;
use crate::insight::record::{RecordSettings, TexelRecord, texel_record};
use crate::job::background;
use crate::render::picture::PictureSettings;
use crate::studio::model::known::Told;
use crate::studio::model::{Cursor, Model};
use crate::studio::theme;
use egui::{Color32, Grid, RichText, ScrollArea, Ui};
use glam::Vec3;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Paths a pixel with which the model's radiance is traced.
const SAMPLES: usize = 32;

/// What the panel keeps.
#[derive(Default)]
pub struct RecordMemory {
    record: Option<(Question, Box<TexelRecord>)>,
    pending: Option<(Question, Receiver<TexelRecord>)>,
    /// A question whose thread fell: it is not asked again.
    failed: Option<Question>,
    /// What the pinned patch is known to reflect.
    known_grey: KnownGrey,
}

/// Reflectance of a grey card.
const GREY_CARD: f32 = 0.18;

/// A reflectance in (0, 1]; that of a grey card at first.
struct KnownGrey(f32);

impl Default for KnownGrey {
    fn default() -> Self {
        KnownGrey(GREY_CARD)
    }
}

/// The texel that is asked about, and a number that changes with whatever the answer depends on.
#[derive(Clone, Copy, PartialEq)]
struct Question {
    place: [u32; 2],
    key: u64,
}

fn place_of(cursor: &Cursor) -> [u32; 2] {
    [cursor.uv.x.to_bits(), cursor.uv.y.to_bits()]
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut RecordMemory) {
    let Some(cursor) = model.cursor else {
        return empty(
            ui,
            "No texel",
            "Point at the viewport, a map or a photo; a click in the viewport pins the texel",
        );
    };
    take_in(model, memory);
    ask(ui, model, &cursor, memory);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.label(RichText::new(if cursor.pinned { "Pinned texel" } else { "Texel under the cursor" }).strong());
            if cursor.pinned && ui.button("Unpin").clicked() {
                model.cursor = None;
            }
        });
        let [x, y, z] = cursor.position.to_array();
        ui.label(
            RichText::new(format!("position {x:.3} {y:.3} {z:.3}, u {:.4} v {:.4}", cursor.uv.x, cursor.uv.y)).weak(),
        );
        let place = place_of(&cursor);
        // What another texel said is not shown for this one; older maps stand until the new ones were asked.
        match memory.record.as_ref().filter(|(own, _)| own.place == place) {
            Some((_, record)) => {
                body(ui, model, record);
                scale(ui, model, &cursor, &mut memory.known_grey.0);
            }
            None if !cursor.pinned => {
                ui.label("Click the surface to list the observations of every photo");
            }
            None if model.project.as_ref().is_none_or(|project| project.maps.is_none()) => {
                ui.label("No maps yet. Start a fit first.");
            }
            None if memory.pending.is_none() && memory.failed.is_some_and(|own| own.place == place) => {
                ui.label("The views could not be queried: see Messages");
            }
            None => {
                ui.label("Querying views…");
            }
        }
    });
}

/// Takes in the record that a thread made, or that it fell.
fn take_in(model: &mut Model, memory: &mut RecordMemory) {
    let Some((question, receiver)) = &memory.pending else { return };
    match receiver.try_recv() {
        Ok(record) => memory.record = Some((*question, Box::new(record))),
        Err(TryRecvError::Empty) => return,
        Err(TryRecvError::Disconnected) => {
            // The thread is gone without a record: the same question would end the same way.
            memory.failed = Some(*question);
            model.log.error(
                &Error::new(ErrorKind::Internal, "the views could not be queried for a texel")
                    .remedy("internal error (please report); other texels can still be queried"),
            );
        }
    }
    memory.pending = None;
}

/// Asks for the record of a pinned texel, once.
fn ask(ui: &Ui, model: &Model, cursor: &Cursor, memory: &mut RecordMemory) {
    let Some(project) = &model.project else { return };
    let (Some(scene), Some(surface), Some(maps)) = (&project.scene, &project.surface, &project.maps) else {
        memory.record = None;
        return;
    };
    if !cursor.pinned {
        memory.record = None;
        return;
    }
    let mut hasher = DefaultHasher::new();
    let place = place_of(cursor);
    (place, Arc::as_ptr(maps) as usize, &model.edits.fit.exclude).hash(&mut hasher);
    let question = Question { place, key: hasher.finish() };
    let is_answered = memory.record.as_ref().is_some_and(|(own, _)| *own == question);
    if memory.pending.is_some() || is_answered || memory.failed == Some(question) {
        return;
    }
    let ray = crate::trace::Ray {
        origin: cursor.position + cursor.normal * 1e-3 * model.eye.distance,
        direction: -cursor.normal,
        t_max: f32::INFINITY,
    };
    let Some(hit) = surface.closest(&ray) else { return };
    let point = surface.point(&hit);
    let Some(parameters) = model.run_parameters() else { return };
    let names: Vec<&String> = scene.views.iter().map(|view| &view.name).collect();
    let settings = RecordSettings {
        picture: PictureSettings { ground: None, ..model.picture_settings(SAMPLES) },
        gains: model.gains(),
        excluded: names.iter().map(|name| model.edits.fit.exclude.contains(name)).collect(),
    };
    let (scene, surface) = (Arc::clone(scene), Arc::clone(surface));
    let (sender, receiver) = channel();
    let context = ui.ctx().clone();
    let spawned = std::thread::Builder::new().name("patina-record".into()).spawn(move || {
        let record = || texel_record(&scene, &surface, &parameters, &point, &settings);
        let _ = sender.send(background::run("patina-record", record));
        context.request_repaint();
    });
    if spawned.is_ok() {
        memory.pending = Some((question, receiver));
    }
}

/// Perceptual roughness of a map's `r = a^2`: the square root of the microfacet width.
fn perceptual(roughness: f32) -> f32 {
    roughness.max(0.0).sqrt().sqrt()
}

/// In place of a figure that only photos tell.
const UNSEEN: &str = "no photo sees it";

/// A figure with its unit, or in words why there is none.
fn figure(value: f32, decimals: usize, unit: &str, otherwise: &str) -> String {
    if value.is_nan() { otherwise.into() } else { format!("{value:.decimals$}{unit}") }
}

fn body(ui: &mut Ui, model: &mut Model, record: &TexelRecord) {
    let (row, column) = record.texel;
    ui.label(format!("Texel row {row}, column {column}"));
    let uncertainty = uncertainty(model, record.texel);
    Grid::new("values").num_columns(2).spacing([12.0, 3.0]).show(ui, |ui| {
        let mut line = |name: &str, value: String, help: &str| {
            ui.label(name).on_hover_text(help);
            ui.label(value);
            ui.end_row();
        };
        line("Diffuse", rgb(record.diffuse), "Diffuse reflectance, linear");
        line("Specular", rgb(record.specular), "Specular reflectance F0, linear");
        let help = format!(
            "Perceptual roughness, as glTF, Blender and Unreal take it: the square root of the microfacet width. That width is \
             a = {:.4}; redner's r = a² is {:.4}",
            record.roughness.max(0.0).sqrt(),
            record.roughness
        );
        line("Roughness", format!("{:.4}", perceptual(record.roughness)), &help);
        for (name, value, help) in uncertainty {
            line(name, value, help);
        }
        line("View count", format!("{} photos", record.rows.len()), "Photos that see the texel");
        line("Texels per photo pixel", figure(record.footprint_texels, 2, "", UNSEEN), "Above 1, no photo resolves single texels here");
        line("View spread", figure(record.view_spread_degrees, 0, "°", UNSEEN), "Small: specular and diffuse cannot be separated");
        let no_highlight = if record.rows.is_empty() { UNSEEN } else { "faces away from the environment" };
        line("Closest half-angle to light", figure(record.highlight_degrees, 0, "°", no_highlight), "Angle between the normal and the nearest half vector of a view and the brightest direction: where it is small, roughness is constrained");
        line("Clipped", figure(100.0 * record.clipped_share, 0, " %", UNSEEN), "Share of these pixels that are clipped and no data");
    });
    heading(ui, "Observations");
    if record.rows.is_empty() {
        ui.label("No photo sees this texel: its values are filled from its neighbours");
        return;
    }
    let largest = record.rows.iter().map(|row| row.residual.length()).fold(1e-6f32, f32::max);
    Grid::new("photos of the texel").num_columns(5).spacing([10.0, 3.0]).striped(true).show(ui, |ui| {
        for (title, help) in [
            ("Photo", "Click to choose it"),
            ("Angle", "Between the normal and the view, in degrees"),
            ("Photo", "Radiance in the photo"),
            ("Render", "Radiance of the render, path traced"),
            ("Residual", "Render minus photo"),
        ] {
            ui.label(RichText::new(title).weak().small()).on_hover_text(help);
        }
        ui.end_row();
        for view in &record.rows {
            let name = RichText::new(&view.name).small();
            let name = if view.is_excluded || view.held_out { name.weak() } else { name };
            let role = role_words(role(view.is_excluded, view.held_out));
            if ui.link(name).on_hover_text(role).clicked()
                && let Some(project) = &mut model.project
            {
                project.chosen_view = view.view;
            }
            ui.label(RichText::new(format!("{:.0}", view.angle_degrees)).small());
            swatch(ui, model, view.photo);
            swatch(ui, model, view.model);
            pull(ui, view.residual, largest);
            ui.end_row();
        }
    });
}

/// Sets the scale that photos leave open by what the pinned patch is known to reflect.
fn scale(ui: &mut Ui, model: &mut Model, cursor: &Cursor, grey: &mut f32) {
    heading(ui, "Scale");
    let can = model.can_rescale();
    let card = ui.add_enabled(can, egui::Button::new("This is 18 % grey"));
    let help = "A grey card: write a copy of the run in which this patch reflects 18 %";
    if card.on_hover_text(help).on_disabled_hover_text("Available when a fit is finished").clicked() {
        model.rescale(cursor.uv, GREY_CARD);
    }
    ui.horizontal(|ui| {
        let label = ui.label("This patch reflects");
        let field = egui::DragValue::new(grey).speed(0.005).range(0.01..=1.0).max_decimals(3);
        ui.add(field).labelled_by(label.id).on_hover_text("Diffuse reflectance: 0.18 is a grey card, 0.9 white paper");
        let button = ui.add_enabled(can, egui::Button::new("Rescale"));
        let help =
            "Write a copy of the run in which it does, with the environment scaled against it; photos leave this open";
        if button.on_hover_text(help).on_disabled_hover_text("Available when a fit is finished").clicked() {
            model.rescale(cursor.uv, *grey);
        }
    });
}

/// What the solver tells of a texel, as lines; none under Adam.
fn uncertainty(model: &Model, (row, column): (usize, usize)) -> Vec<(&'static str, String, &'static str)> {
    let Some(project) = &model.project else { return Vec::new() };
    let named = [
        (Told::Diffuse, "Std. dev. (diffuse)", "Posterior standard deviation, mean of the channels"),
        (Told::Specular, "Std. dev. (specular)", "Posterior standard deviation, mean of the channels"),
        (
            Told::Roughness,
            "Std. dev. (roughness)",
            "Posterior standard deviation of r, the square of the microfacet width",
        ),
        (Told::LobeSharing, "Lobe cluster size", "Number of texels that share this texel's specular lobe"),
        (
            Told::Choice,
            "Lobe model",
            "What the held-out views selected: 1 no lobe, 2 a shared lobe, 3 lobes of their own",
        ),
    ];
    let line = |(what, name, help): (Told, &'static str, &'static str)| {
        let texels = &project.known.layer(what)?.texels;
        let value = (row < texels.height() && column < texels.width()).then(|| texels[(row, column)])?;
        let words = match what {
            _ if !value.is_nan() => three_digits(value),
            Told::Choice => "no held-out view".into(),
            _ => "filled from neighbours".into(),
        };
        Some((name, words, help))
    };
    named.into_iter().filter_map(line).collect()
}

fn rgb(value: Vec3) -> String {
    format!("{:.4} {:.4} {:.4}", value.x, value.y, value.z)
}

fn swatch(ui: &mut Ui, model: &Model, radiance: Vec3) {
    let [r, g, b] = model.edits.display.bytes(radiance, 0, 100);
    let (rect, response) = ui.allocate_exact_size(egui::vec2(46.0, 14.0), egui::Sense::hover());
    ui.painter().rect_filled(rect, 2.0, Color32::from_rgb(r, g, b));
    response.on_hover_text(rgb(radiance));
}

/// A bar to the left where the fit is darker than the photo, to the right where it is brighter.
fn pull(ui: &mut Ui, residual: Vec3, largest: f32) {
    let colours = theme::palette(ui.visuals());
    let (rect, response) = ui.allocate_exact_size(egui::vec2(60.0, 14.0), egui::Sense::hover());
    let mean = residual.element_sum() / 3.0;
    let share = (mean / largest).clamp(-1.0, 1.0);
    let centre = rect.center().x;
    let end = centre + share * rect.width() / 2.0;
    let bar = egui::Rect::from_x_y_ranges(centre.min(end)..=centre.max(end), rect.shrink(2.0).y_range());
    ui.painter().rect_filled(bar, 0.0, if mean > 0.0 { colours.curves[1] } else { colours.curves[2] });
    ui.painter().vline(centre, rect.y_range(), egui::Stroke::new(1.0, ui.visuals().weak_text_color()));
    response.on_hover_text(rgb(residual));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roughness_is_told_as_other_programs_take_it() {
        assert!((perceptual(0.0625) - 0.5).abs() < 1e-6 && perceptual(-1.0) == 0.0);
    }

    #[test]
    fn a_figure_that_is_none_says_why() {
        assert_eq!(figure(12.345, 1, "°", UNSEEN), "12.3°");
        assert_eq!(figure(f32::NAN, 0, " %", UNSEEN), "no photo sees it");
    }
}
