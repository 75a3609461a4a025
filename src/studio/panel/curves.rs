//! Error curves: the held-out error over seconds, with the phases of the fit as bands. Training error, parts of the
//! objective, steps and single phases stand under Details.

mod series;

use super::{act_button_named, empty};
use crate::fit::LossRow;
use crate::insight::report::number;
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::theme;
use egui::{Align2, Button, Color32, ComboBox, RichText, Sense, Slider, Stroke, Ui, vec2};
use egui_plot::{GridMark, HoverPosition, Line, Plot, PlotPoint, PlotPoints, Points, Polygon, Text};
use series::{Series, identity, series};

/// More bands than this are named only where there is room.
const MOST_NAMED_BANDS: usize = 4;

/// What the panel keeps.
pub struct CurvesMemory {
    details: bool,
    over_seconds: bool,
    logarithmic: bool,
    stage: Option<String>,
    /// The finished plot lines and what they were made of.
    made: Option<MadeOf>,
    lines: Series,
}

/// What plot lines depend on.
#[derive(PartialEq)]
struct MadeOf {
    rows: usize,
    run: [u64; 4],
    over_seconds: bool,
    logarithmic: bool,
    stage: Option<String>,
}

impl Default for CurvesMemory {
    fn default() -> Self {
        CurvesMemory {
            details: false,
            over_seconds: true,
            logarithmic: true,
            stage: None,
            made: None,
            lines: Series::default(),
        }
    }
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut CurvesMemory) {
    let rows = &model.fit.losses;
    if rows.is_empty() {
        (memory.made, memory.stage) = (None, None);
        return empty(ui, "No data", "The error appears here once a fit runs");
    }
    let mut stages: Vec<String> = rows.iter().map(|row| row.stage.clone()).collect();
    stages.dedup();
    // A stage of another run is none of this one.
    memory.stage = memory.stage.take().filter(|stage| stages.contains(stage));
    ui.horizontal_wrapped(|ui| {
        let switch = ui.checkbox(&mut memory.details, "Details");
        let help = "Training error, parts of the objective, steps and single phases";
        if switch.on_hover_text(help).changed() && !memory.details {
            (memory.over_seconds, memory.logarithmic, memory.stage) = (true, true, None);
        }
        super::curve_copies::show(ui, rows);
        if !memory.details {
            main_figure(ui, rows);
            return;
        }
        ui.separator();
        ui.selectable_value(&mut memory.over_seconds, false, "X axis: Steps");
        ui.selectable_value(&mut memory.over_seconds, true, "X axis: Time");
        ui.separator();
        ui.checkbox(&mut memory.logarithmic, "Log axis");
        ui.separator();
        let chosen = memory.stage.as_deref().map_or_else(|| "All phases".into(), stage_words);
        let list = ComboBox::from_id_salt("stage of curves").selected_text(chosen).show_ui(ui, |ui| {
            ui.selectable_value(&mut memory.stage, None, "All phases");
            for stage in &stages {
                ui.selectable_value(&mut memory.stage, Some(stage.clone()), stage_words(stage));
            }
        });
        list.response.accessible_name("Phase of the fit").on_hover_text("The phase whose curve is shown");
        figures(ui, rows);
    });
    let key = MadeOf {
        rows: rows.len(),
        run: identity(rows),
        over_seconds: memory.over_seconds,
        logarithmic: memory.logarithmic,
        stage: memory.stage.clone(),
    };
    if memory.made.as_ref() != Some(&key) {
        memory.lines = series(rows, memory.over_seconds, memory.logarithmic, memory.stage.as_deref());
        memory.made = Some(key);
    }
    timeline(ui, model);
    plot(ui, memory);
}

/// A slider over the kept states: viewport and maps show the fit as it was.
fn timeline(ui: &mut Ui, model: &mut Model) {
    let count = model.timeline.states().len();
    if count < 2 {
        return;
    }
    let mut at = model.timeline.shown().unwrap_or(count - 1);
    ui.horizontal(|ui| {
        let label = ui.label("Timeline").on_hover_text("Viewport and maps show the fit as it was; the fit goes on");
        let slider = ui.add(Slider::new(&mut at, 0..=count - 1).show_value(false)).labelled_by(label.id);
        if slider.changed() {
            model.look_back(Some(at));
        }
        let is_past = model.timeline.shown().is_some();
        if ui.add_enabled(is_past, Button::new("Latest")).on_hover_text("Show the newest maps again").clicked() {
            model.look_back(None);
        }
        act_button_named(ui, model, Act::SaveFitFilm, "Film…");
        let own = &model.timeline.states()[model.timeline.shown().unwrap_or(count - 1)];
        let words = format!("{} s, {}", number::fixed(own.seconds, 1), stage_words(&own.stage).to_lowercase());
        let words = RichText::new(words);
        ui.label(if is_past { words.strong() } else { words.weak() });
    });
}

/// The newest held-out error; the training error where no photo is held out.
fn main_figure(ui: &mut Ui, rows: &[LossRow]) {
    ui.separator();
    let colours = theme::palette(ui.visuals()).curves;
    let (words, value, colour, help) = match rows.iter().rev().find_map(|row| row.held_out_rmse) {
        Some(rmse) => {
            ("Held-out RMSE", Some(rmse), colours[1], "Unclipped surface pixels of held-out photos, downsampled")
        }
        None => {
            let rmse = rows.iter().rev().find_map(|row| row.surface_rmse);
            (
                "Training RMSE",
                rmse,
                colours[0],
                "No photo was held out so far: unclipped surface pixels of the step's photos",
            )
        }
    };
    let (rect, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
    ui.painter().circle_filled(rect.center(), 4.0, colour);
    let value = value.map_or_else(|| "not computed yet".to_owned(), |rmse| format!("{rmse:.4}"));
    ui.label(RichText::new(format!("{words} {value}")).strong()).on_hover_text(help);
}

/// A phase of a fit as it is called on screen, such as `Light (coarse) ½` for `wide light 1/2`.
pub fn stage_words(stage: &str) -> String {
    let (kind, level) = match stage.rsplit_once(" 1/") {
        Some((kind, "1")) => (kind, String::new()),
        Some((kind, "2")) => (kind, " ½".to_owned()),
        Some((kind, "4")) => (kind, " ¼".to_owned()),
        Some((kind, "8")) => (kind, " ⅛".to_owned()),
        Some((kind, level)) => (kind, format!(" 1/{level}")),
        None => (stage, String::new()),
    };
    let words = match kind {
        "wide light" => "Light (coarse)".to_owned(),
        "narrow light" => "Light (fine)".to_owned(),
        other => crate::studio::model::words::capitalised(other),
    };
    words + &level
}

/// The newest figures, each with a dot in the colour of its curve: they are the legend.
fn figures(ui: &mut Ui, rows: &[LossRow]) {
    ui.separator();
    let colours = theme::palette(ui.visuals()).curves;
    let dot = |ui: &mut Ui, colour: Color32| {
        let (rect, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
        ui.painter().circle_filled(rect.center(), 4.0, colour);
    };
    if let Some(row) = rows.last() {
        dot(ui, faint(colours[0]));
        ui.label(format!("Objective (RMS) {:.4}", row.image_loss.max(0.0).sqrt())).on_hover_text(
            "Square root of the image term of the objective: every used pixel, background and clipped ones included",
        );
        if let Some(surface) = row.surface_rmse {
            dot(ui, colours[0]);
            ui.label(format!("Training RMSE {surface:.4}"))
                .on_hover_text("Unclipped surface pixels of the step's photos, as for held-out photos");
        }
        if row.consistency > 0.0 {
            dot(ui, colours[2]);
            ui.label(format!("MVCL {:.2e}", row.consistency))
                .on_hover_text("Disagreement of the views' gradients, in [0, 1]: Joy and Poullis 2023, eq. 3");
        }
    }
    if let Some(held_out) = rows.iter().rev().find_map(|row| row.held_out_rmse) {
        dot(ui, colours[1]);
        ui.label(RichText::new(format!("Held-out RMSE {held_out:.4}")).strong())
            .on_hover_text("Unclipped surface pixels of held-out photos, downsampled");
    }
}

fn plot(ui: &mut Ui, memory: &CurvesMemory) {
    let colours = theme::palette(ui.visuals()).curves;
    let weak = ui.visuals().weak_text_color();
    let logarithmic = memory.logarithmic;
    let value = move |y: f64| if logarithmic { 10f64.powf(y) } else { y };
    let unit = if memory.over_seconds { "time (s)" } else { "steps" };
    let over_seconds = memory.over_seconds;
    Plot::new("loss curves")
        // Room for the names of the stages above the curves.
        .set_margin_fraction(vec2(0.02, 0.14))
        .x_axis_label(unit)
        .y_axis_label("RMSE, linear radiance")
        .y_axis_formatter(move |mark: GridMark, _: &_| number(value(mark.value)))
        .label_formatter(move |hover: &HoverPosition<'_>| {
            // Only points of curves have something to tell.
            let HoverPosition::NearDataPoint { plot_name, position, .. } = hover else { return None };
            let x = if over_seconds { format!("{:.1} s", position.x) } else { format!("step {:.0}", position.x) };
            Some(format!("{plot_name}\n{x}: {}", number(value(position.y))))
        })
        .allow_scroll(false)
        .show(ui, |plot| {
            let (top, bottom) = (memory.lines.top(memory.details), memory.lines.bottom(memory.details));
            let end = memory.lines.end();
            let many = memory.lines.borders.len() > MOST_NAMED_BANDS;
            for (index, (x, stage)) in memory.lines.borders.iter().enumerate() {
                let right = memory.lines.borders.get(index + 1).map_or(end, |(next, _)| *next);
                // Without a name a line or band is not in the legend.
                if index % 2 == 1 {
                    let corners = vec![[*x, bottom], [right, bottom], [right, top], [*x, top]];
                    let band = Polygon::new("", PlotPoints::from(corners)).fill_color(weak.gamma_multiply(0.10));
                    plot.polygon(band.stroke(Stroke::NONE).allow_hover(false));
                }
                // A name that has no room would lie over the next.
                let is_wide = (right - x) > 0.09 * (end - memory.lines.begin());
                if !many || is_wide {
                    let label = RichText::new(format!(" {}", stage_words(stage))).color(weak).small();
                    // Not at the border of what is shown: text counts among what is to be shown, and the plot would grow for ever.
                    plot.text(Text::new("", PlotPoint::new(*x, top), label).anchor(Align2::LEFT_BOTTOM));
                }
            }
            let line = |name: &str, points: &Vec<[f64; 2]>, colour, width: f32| {
                Line::new(name.to_owned(), PlotPoints::from(points.clone())).color(colour).width(width)
            };
            if memory.details {
                plot.line(line("Objective (RMS)", &memory.lines.all, faint(colours[0]), 1.5));
            }
            let has_held_out = !memory.lines.held_out.is_empty();
            if memory.details || !has_held_out {
                plot.line(line(
                    "Training photos",
                    &memory.lines.surface,
                    colours[0],
                    if has_held_out { 2.0 } else { 3.0 },
                ));
            }
            if has_held_out {
                plot.line(line("Held-out photos", &memory.lines.held_out, colours[1], 3.5));
                let dots = PlotPoints::from(memory.lines.held_out.clone());
                plot.points(Points::new("Held-out photos", dots).color(colours[1]).radius(4.0));
            }
            if memory.details && !memory.lines.consistency.is_empty() {
                plot.line(line("MVCL (own scale)", &memory.lines.consistency, colours[2], 1.5));
            }
        });
}

/// The colour of a curve that is there for comparison.
fn faint(colour: Color32) -> Color32 {
    colour.gamma_multiply(0.4)
}

/// A number with three digits, however small.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e4).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.1e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_have_names_a_person_reads() {
        for (stage, words) in [
            ("wide light 1/2", "Light (coarse) ½"),
            ("narrow light", "Light (fine)"),
            ("maps 1/4", "Maps ¼"),
            ("diffuse 1/1", "Diffuse"),
            ("all 1/16", "All 1/16"),
        ] {
            assert_eq!(stage_words(stage), words);
        }
    }
}
