//! The objective over the steps, term by term.

use crate::object::progress::{ObjectiveRow, StepKind};
use crate::studio::model::Model;
use crate::studio::panel::empty;
use crate::studio::theme;
use egui::{RichText, Sense, Ui, vec2};
use egui_plot::{GridMark, HoverPosition, Line, Plot, PlotPoints, Points};

/// What the panel keeps.
pub struct ObjectiveMemory {
    over_seconds: bool,
    logarithmic: bool,
}

impl Default for ObjectiveMemory {
    fn default() -> Self {
        ObjectiveMemory { over_seconds: false, logarithmic: true }
    }
}

/// A term: its name, its value in a row, what it is.
type Term = (&'static str, fn(&ObjectiveRow) -> f64, &'static str);

const TERMS: [Term; 4] = [
    ("Objective", ObjectiveRow::total, "The sum of the terms"),
    ("Data term", |row| row.data, "Mean loss on the logarithm of re-render over photo"),
    ("Light", |row| row.light_prior, "Light prior"),
    ("Material prior", |row| row.code_prior, "Prior on the latent codes"),
];

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut ObjectiveMemory) {
    let rows: Vec<ObjectiveRow> = model.object.rows.iter().filter(|row| row.kind != StepKind::Start).copied().collect();
    let tried = model.object.rows.len() - rows.len();
    let Some(last) = rows.last().copied() else {
        let hint = match tried {
            0 => "The terms of the objective appear here during an estimation".to_owned(),
            count => format!("{count} initializations were optimized at low resolution; the first round is running"),
        };
        return empty(ui, "No data", &hint);
    };
    ui.horizontal_wrapped(|ui| {
        ui.selectable_value(&mut memory.over_seconds, false, "X axis: Rounds");
        ui.selectable_value(&mut memory.over_seconds, true, "X axis: Time");
        ui.separator();
        ui.checkbox(&mut memory.logarithmic, "Log axis");
        ui.separator();
        let colours = theme::palette(ui.visuals()).curves;
        for ((name, value, help), colour) in TERMS.iter().zip(colours) {
            let (rect, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
            ui.painter().circle_filled(rect.center(), 4.0, colour);
            ui.label(format!("{name} {:.4}", value(&last))).on_hover_text(*help);
        }
        ui.label(RichText::new(format!("{tried} initializations")).weak());
    });
    plot(ui, &rows, memory);
}

fn plot(ui: &mut Ui, rows: &[ObjectiveRow], memory: &ObjectiveMemory) {
    let colours = theme::palette(ui.visuals()).curves;
    let (logarithmic, over_seconds) = (memory.logarithmic, memory.over_seconds);
    let value = move |y: f64| if logarithmic { 10f64.powf(y) } else { y };
    // Light and reflectance of a round stand half a round apart.
    let place = |row: &ObjectiveRow| match (over_seconds, row.kind) {
        (true, _) => row.seconds,
        (false, StepKind::Reflectance) => row.round as f64 + 0.5,
        (false, _) => row.round as f64,
    };
    Plot::new("objective")
        .set_margin_fraction(vec2(0.03, 0.1))
        .x_axis_label(if over_seconds { "seconds" } else { "rounds" })
        .y_axis_label("loss")
        .y_axis_formatter(move |mark: GridMark, _: &_| number(value(mark.value)))
        .label_formatter(move |hover: &HoverPosition<'_>| {
            let HoverPosition::NearDataPoint { plot_name, position, .. } = hover else { return None };
            Some(format!("{plot_name}: {}", number(value(position.y))))
        })
        .allow_scroll(false)
        .show(ui, |plot| {
            for ((name, term, _), colour) in TERMS.iter().zip(colours) {
                let points: Vec<[f64; 2]> = rows
                    .iter()
                    .filter(|row| !logarithmic || term(row) > 1e-12)
                    .map(|row| [place(row), if logarithmic { term(row).log10() } else { term(row) }])
                    .collect();
                let width = if *name == "Objective" { 2.0 } else { 1.5 };
                plot.line(Line::new(*name, PlotPoints::from(points.clone())).color(colour).width(width));
                plot.points(Points::new(*name, PlotPoints::from(points)).color(colour).radius(2.5));
            }
        });
}

/// A number with three digits, however small.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e4).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.1e}") }
}
