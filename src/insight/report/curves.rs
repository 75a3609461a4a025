//! The curves of the page: loss, held-out error and consistency, over steps and over seconds.

use super::tables;
use crate::export::LossRow;
use crate::insight::plot::{LinePlot, Scale, Series};

/// The section on the loss.
pub fn loss(rows: &[LossRow]) -> String {
    if rows.is_empty() {
        return tables::empty("No step was taken, so there is no loss.");
    }
    type Along = fn(&LossRow) -> f64;
    let axes: [(&str, Along); 2] = [("steps", |row| row.step as f64), ("seconds", |row| row.seconds)];
    let mut html = String::from("<div class=row2>");
    let mut reasons = Vec::new();
    let line = |name: &str, along: Along, value: fn(&LossRow) -> Option<f64>, marked: bool| {
        let points = rows.iter().filter_map(|row| Some((along(row), value(row)?))).collect();
        Series { name: name.into(), points, marked }
    };
    let has_consistency = rows.iter().any(|row| row.mvcl != 0.0);
    for (quantity, y_scale) in
        [("loss", Scale::Logarithmic), ("held-out RMSE", Scale::Logarithmic), ("consistency (MVCL)", Scale::Linear)]
    {
        for (x_label, along) in axes {
            let series = match quantity {
                "loss" => vec![
                    line("whole loss", along, |row| Some(row.loss), false),
                    line("image part", along, |row| Some(row.image_loss), false),
                ],
                "held-out RMSE" => vec![line("held-out RMSE", along, |row| row.held_out_rmse, true)],
                _ if has_consistency => vec![line("consistency", along, |row| Some(row.mvcl), false)],
                _ => continue,
            };
            let plot = LinePlot {
                x_label: x_label.into(),
                y_label: if quantity == "held-out RMSE" { "held-out RMSE, linear".into() } else { quantity.into() },
                x_scale: Scale::Linear,
                y_scale,
                series,
                marks: stage_starts(rows, along),
            };
            match plot.svg() {
                Some(svg) => html += &svg,
                None if x_label == "steps" => reasons.push(format!(
                    "There is no curve of the {quantity}: it was never measured, or never finite and above zero."
                )),
                None => {}
            }
        }
    }
    html += "</div>";
    for reason in reasons {
        html += &tables::empty(&reason);
    }
    html
}

/// Where a new stage begins, but for the first.
fn stage_starts(rows: &[LossRow], along: fn(&LossRow) -> f64) -> Vec<(f64, String)> {
    rows.windows(2)
        .filter(|pair| pair[0].stage != pair[1].stage)
        .map(|pair| (along(&pair[1]), pair[1].stage.clone()))
        .collect()
}
