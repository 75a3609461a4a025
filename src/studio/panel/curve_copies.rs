//! What other programs take of the error curves: figures as CSV, a drawing as SVG, by the clipboard.

use crate::export::loss_log;
use crate::fit::LossRow;
use crate::insight::plot::{LinePlot, Scale, Series, standalone};
use crate::job::rows_of;
use egui::Ui;

/// The curves for other programs: figures and a drawing, by the clipboard.
pub fn show(ui: &mut Ui, rows: &[LossRow]) {
    if ui.button("Copy CSV").on_hover_text("Copy every step with its errors as comma-separated values").clicked() {
        ui.ctx().copy_text(loss_log::text(&rows_of(rows)));
    }
    let svg = ui.button("Copy SVG").on_hover_text("Copy the curve of the error over seconds as a drawing");
    if let Some(drawing) = svg.clicked().then(|| drawing(rows)).flatten() {
        ui.ctx().copy_text(drawing);
    }
}

/// The error over seconds as an SVG file: of held-out photos, of the training photos where none is held out.
fn drawing(rows: &[LossRow]) -> Option<String> {
    let of = |name: &str, value: fn(&LossRow) -> Option<f64>, marked: bool| {
        let points: Vec<(f64, f64)> = rows.iter().filter_map(|row| Some((row.seconds, value(row)?))).collect();
        (!points.is_empty()).then(|| Series { name: name.into(), points, marked })
    };
    let held_out = of("Held-out photos", |row| row.held_out_rmse, true);
    let series = held_out.or_else(|| of("Training photos", |row| row.surface_rmse, false))?;
    // A single line is named by its axis.
    let y_label = format!("RMSE of {}, linear radiance", series.name.to_lowercase());
    let plot = LinePlot {
        x_label: "time (s)".into(),
        y_label,
        x_scale: Scale::Linear,
        y_scale: Scale::Logarithmic,
        series: vec![series],
        marks: Vec::new(),
    };
    plot.svg().map(|svg| standalone(&[svg]))
}
