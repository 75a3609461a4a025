//! The card of a finished fit: what was found, how well it shows photos that took no part, what is uncertain, and where one
//! goes from here.

use super::act_button_named;
use crate::error::Severity;
use crate::insight::report::ReportData;
use crate::insight::report::number;
use crate::studio::act::Act;
use crate::studio::model::known::Told;
use crate::studio::model::{FitStatus, Model};
use crate::studio::theme;
use crate::studio::workspace::Workspace;
use egui::{Align2, Area, Context, Frame, Grid, Id, Order, RichText, Stroke, Ui, vec2};

/// Draws the card, if a fit has just finished.
pub fn show(context: &Context, model: &mut Model) {
    let is_wanted = model.card && model.workspace == Workspace::Scene && model.fit.status == FitStatus::Finished;
    let (true, Some(report)) = (is_wanted, model.fit.report.clone()) else { return };
    let colours = theme::palette(&context.global_style().visuals);
    let area = Area::new(Id::unique("card of the finished fit")).order(Order::Middle);
    area.anchor(Align2::RIGHT_BOTTOM, vec2(-18.0, -40.0)).show(context, |ui| {
        Frame::popup(ui.style()).stroke(Stroke::new(1.5, colours.accent)).inner_margin(14.0).show(ui, |ui| {
            ui.set_max_width(380.0f32.min(ui.ctx().content_rect().width() - 60.0));
            ui.label(RichText::new("Fit finished").heading().color(colours.accent));
            figures(ui, model, &report);
            ui.add_space(6.0);
            ui.label(RichText::new("Next steps").strong());
            ui.horizontal_wrapped(|ui| {
                act_button_named(ui, model, Act::PanelRelight, "Relight result");
                act_button_named(ui, model, Act::Export, "Export result…");
                act_button_named(ui, model, Act::OpenReport, "View report");
                act_button_named(ui, model, Act::OpenRunFolder, "View folder");
                if ui.button("Hide card").on_hover_text("Hide this card; the Scores panel keeps the figures").clicked()
                {
                    model.card = false;
                }
            });
        });
    });
}

fn figures(ui: &mut Ui, model: &Model, report: &ReportData) {
    Grid::new("card").num_columns(2).spacing([12.0, 4.0]).show(ui, |ui| {
        let mut line = |name: &str, value: String, help: &str| {
            ui.label(RichText::new(name).weak()).on_hover_text(help);
            ui.label(value).on_hover_text(help);
            ui.end_row();
        };
        line("Found", found(model), "Maps on the UV atlas, and the environment that lights them");
        for (name, score) in scores(report) {
            line(
                name,
                score,
                "Root mean squared error of linear radiance over unclipped surface, and peak signal-to-noise ratio of sRGB",
            );
        }
        let seconds: f64 = report.timings.iter().map(|stage| stage.seconds).filter(|own| own.is_finite()).sum();
        line("Time", number::duration(seconds), "From reading the scene to the report");
        line("Uncertain", uncertain(model, report), "The standard deviations are layers under Diagnostics");
        if let Some(own) = model.plausibility() {
            let words = if own.doubts.is_empty() { "as of materials that exist".into() } else { own.doubts.join("; ") };
            line("Plausible", words, "Reflectances beside those of materials that exist; the Scores panel offers a scale");
        }
        line("Scale", "reflectance against light: see the report".into(), &report.gauge_statement);
    });
}

/// Which maps were found, of which size.
fn found(model: &Model) -> String {
    let maps = model.project.as_ref().and_then(|project| project.maps.as_ref());
    let environment = model.project.as_ref().and_then(|project| project.environment.as_ref());
    let (Some(maps), Some(environment)) = (maps, environment) else { return "see the report".into() };
    let what = if model.edits.fit.has_lobe() { "diffuse, specular, roughness" } else { "diffuse" };
    let (side, light) = (maps.diffuse.width(), (environment.width(), environment.height()));
    format!("{what} of {side}² texels, environment of {} x {}", light.0, light.1)
}

/// Scores of the views that tell most: those that took no part, beside the others.
fn scores(report: &ReportData) -> Vec<(&'static str, String)> {
    let named = [("Held-out photos", "held-out views"), ("Training photos", "training views")];
    let line = |(words, name): (&'static str, &str)| {
        let raw = &report.aggregates.iter().find(|own| own.name == name && own.score.views > 0)?.score.raw;
        let psnr = if raw.psnr_srgb_db.is_finite() { format!(", {:.1} dB", raw.psnr_srgb_db) } else { String::new() };
        Some((words, format!("RMSE {:.4}{psnr}", raw.rmse_linear)))
    };
    named.into_iter().filter_map(line).collect()
}

/// What the photos do not tell, in a few words.
fn uncertain(model: &Model, report: &ReportData) -> String {
    let mut said = Vec::new();
    let texels = report.texels.seen + report.texels.unseen;
    if report.texels.unseen > 0 && texels > 0 {
        let share = 100.0 * report.texels.unseen as f64 / texels as f64;
        said.push(format!("{share:.0} % of the texels are seen by no photo"));
    }
    if let Some(project) = &model.project {
        for (what, name) in [(Told::Diffuse, "diffuse"), (Told::Roughness, "roughness")] {
            let median = project.known.layer(what).map(|layer| median(layer.texels.pixels()));
            if let Some(median) = median.filter(|median| median.is_finite()) {
                said.push(format!("{name} ±{}", number::short(median)));
            }
        }
    }
    let warnings = report.findings.iter().filter(|finding| finding.severity > Severity::Note).count();
    if warnings > 0 {
        said.push(format!("{warnings} {}", if warnings == 1 { "warning" } else { "warnings" }));
    }
    if said.is_empty() { "nothing was noticed".into() } else { said.join(", ") }
}

/// The number that half of the texels stay below, of some thousand of them; NaN without any.
fn median(texels: &[f32]) -> f64 {
    let every = (texels.len() / 4096).max(1);
    let values: Vec<f64> =
        texels.iter().step_by(every).filter(|value| value.is_finite()).map(|&value| f64::from(value)).collect();
    if values.is_empty() { f64::NAN } else { crate::math::statistics::quantile(&values, 0.5) }
}
