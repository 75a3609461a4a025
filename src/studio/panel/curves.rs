//! Loss curves: parts of the loss and the held-out error, over steps or seconds, stage by stage.

use super::empty;
use crate::fit::LossRow;
use crate::studio::model::Model;
use crate::studio::theme;
use egui::{Align2, Color32, ComboBox, RichText, Sense, Ui, vec2};
use egui_plot::{GridMark, HoverPosition, Line, Plot, PlotPoint, PlotPoints, Points, Text, VLine};

/// What the panel keeps.
pub struct CurvesMemory {
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
        CurvesMemory { over_seconds: false, logarithmic: true, stage: None, made: None, lines: Series::default() }
    }
}

/// Points of each curve.
#[derive(Default)]
struct Series {
    all: Vec<[f64; 2]>,
    surface: Vec<[f64; 2]>,
    held_out: Vec<[f64; 2]>,
    consistency: Vec<[f64; 2]>,
    borders: Vec<(f64, String)>,
}

impl Series {
    /// The highest value of any curve.
    fn top(&self) -> f64 {
        let points = [&self.all, &self.surface, &self.held_out].into_iter().flatten();
        points.map(|point| point[1]).fold(f64::NEG_INFINITY, f64::max).max(-300.0)
    }
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut CurvesMemory) {
    let rows = &model.fit.losses;
    if rows.is_empty() {
        (memory.made, memory.stage) = (None, None);
        return empty(ui, "No curve yet", "The error of every step appears here once a fit runs");
    }
    let mut stages: Vec<String> = rows.iter().map(|row| row.stage.clone()).collect();
    stages.dedup();
    // A stage of another run is none of this one.
    memory.stage = memory.stage.take().filter(|stage| stages.contains(stage));
    ui.horizontal_wrapped(|ui| {
        ui.selectable_value(&mut memory.over_seconds, false, "Over steps");
        ui.selectable_value(&mut memory.over_seconds, true, "Over seconds");
        ui.separator();
        ui.checkbox(&mut memory.logarithmic, "Log axis");
        ui.separator();
        let chosen = memory.stage.clone().unwrap_or_else(|| "All stages".into());
        let list = ComboBox::from_id_salt("stage of curves").selected_text(chosen).show_ui(ui, |ui| {
            ui.selectable_value(&mut memory.stage, None, "All stages");
            for stage in &stages {
                ui.selectable_value(&mut memory.stage, Some(stage.clone()), stage);
            }
        });
        list.response.accessible_name("Stage of the fit").on_hover_text("The stage whose curve is shown");
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
    plot(ui, memory);
}

/// Tells curves of one length apart: those of another run differ in time and loss of their first or last step.
fn identity(rows: &[LossRow]) -> [u64; 4] {
    let of = |row: Option<&LossRow>| row.map_or([0, 0], |row| [row.seconds.to_bits(), row.loss.to_bits()]);
    let [[first_seconds, first_loss], [last_seconds, last_loss]] = [of(rows.first()), of(rows.last())];
    [first_seconds, first_loss, last_seconds, last_loss]
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
        ui.label(format!("Loss {:.4}", row.image_loss.max(0.0).sqrt())).on_hover_text(
            "Root of what the fit lowers: every pixel that is evidence, background and clipped ones included",
        );
        if let Some(surface) = row.surface_rmse {
            dot(ui, colours[0]);
            ui.label(format!("Training RMSE {surface:.4}"))
                .on_hover_text("Unclipped surface pixels of the step's photos, as held-out photos are judged");
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
            .on_hover_text("Unclipped surface pixels of photos that the fit never sees, shrunk");
    }
}

/// Points of the curves. On a logarithmic axis values are powers of ten, and what is not above zero is left out.
fn series(rows: &[LossRow], over_seconds: bool, logarithmic: bool, stage: Option<&str>) -> Series {
    let mut lines = Series::default();
    let (mut mean_all, mut mean_surface) = (None, None);
    let mut last_stage = "";
    for row in rows.iter().filter(|row| stage.is_none_or(|stage| row.stage == stage)) {
        let x = if over_seconds { row.seconds } else { row.step as f64 };
        if row.stage != last_stage {
            lines.borders.push((x, row.stage.clone()));
            last_stage = &row.stage;
            // Another resolution, another error: a mean over the border would mean nothing.
            (mean_all, mean_surface) = (None, None);
        }
        let put = |line: &mut Vec<[f64; 2]>, value: f64| match logarithmic {
            true if value > 0.0 => line.push([x, value.log10()]),
            true => {}
            false => line.push([x, value]),
        };
        put(&mut lines.all, smoothed(&mut mean_all, row.image_loss));
        if let Some(rmse) = row.surface_rmse {
            put(&mut lines.surface, smoothed(&mut mean_surface, rmse * rmse));
        }
        if let Some(held_out) = row.held_out_rmse {
            put(&mut lines.held_out, held_out);
        }
        if row.consistency > 0.0 {
            put(&mut lines.consistency, row.consistency);
        }
    }
    lines
}

/// The root of the mean of squared errors up to here, in which each older step counts less.
fn smoothed(mean: &mut Option<f64>, squared: f64) -> f64 {
    let mean = mean.insert(mean.map_or(squared, |mean| mean + 0.15 * (squared - mean)));
    mean.max(0.0).sqrt()
}

fn plot(ui: &mut Ui, memory: &CurvesMemory) {
    let colours = theme::palette(ui.visuals()).curves;
    let weak = ui.visuals().weak_text_color();
    let logarithmic = memory.logarithmic;
    let value = move |y: f64| if logarithmic { 10f64.powf(y) } else { y };
    let unit = if memory.over_seconds { "seconds of work" } else { "steps" };
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
            let top = memory.lines.top();
            for (x, stage) in &memory.lines.borders {
                // Without a name a line is not in the legend.
                plot.vline(VLine::new("", *x).color(weak.gamma_multiply(0.6)).width(1.0));
                let label = RichText::new(format!(" {stage}")).color(weak).small();
                // Not at the border of what is shown: text counts among what is to be shown, and the plot would grow for ever.
                plot.text(Text::new("", PlotPoint::new(*x, top), label).anchor(Align2::LEFT_BOTTOM));
            }
            let line = |name: &str, points: &Vec<[f64; 2]>, colour, width: f32| {
                Line::new(name.to_owned(), PlotPoints::from(points.clone())).color(colour).width(width)
            };
            plot.line(line("Loss, all pixels", &memory.lines.all, faint(colours[0]), 1.5));
            plot.line(line("Training photos", &memory.lines.surface, colours[0], 2.0));
            if !memory.lines.held_out.is_empty() {
                plot.line(line("Held-out photos", &memory.lines.held_out, colours[1], 2.0));
                let dots = PlotPoints::from(memory.lines.held_out.clone());
                plot.points(Points::new("Held-out photos", dots).color(colours[1]).radius(3.0));
            }
            if !memory.lines.consistency.is_empty() {
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
    fn smoothing_stops_at_stage_borders_and_nothing_below_zero_reaches_a_log_axis() {
        let row = |step: usize, stage: &str, image_loss: f64| LossRow {
            step,
            stage: stage.into(),
            seconds: step as f64 * 2.0,
            loss: image_loss,
            image_loss,
            consistency: 0.0,
            surface_rmse: Some(2.0 * image_loss.max(0.0).sqrt()),
            held_out_rmse: (step == 3).then_some(0.5),
        };
        let rows = [row(1, "coarse", 0.04), row(2, "coarse", -0.01), row(3, "fine", 0.25)];
        assert_ne!(identity(&rows), identity(&[row(1, "coarse", 0.04), row(2, "coarse", 0.01), row(3, "fine", 0.5)]));
        let lines = series(&rows, true, true, None);
        assert_eq!(lines.borders.len(), 2);
        assert_eq!(lines.all[0], [2.0, 0.2f64.log10()]);
        assert_eq!(lines.all.last(), Some(&[6.0, 0.5f64.log10()]), "the mean begins anew");
        assert_eq!(lines.surface.last(), Some(&[6.0, 0.0]), "errors of the surface are a curve of their own");
        assert_eq!(lines.top(), 0.0);
        let below = series(&rows[1..2], true, true, None);
        assert_eq!(below.all.len(), 0, "a step below zero has no logarithm");
        assert_eq!(lines.held_out, [[6.0, 0.5f64.log10()]]);
        assert_eq!(series(&rows, false, false, Some("fine")).all, [[3.0, 0.5]]);
    }
}
