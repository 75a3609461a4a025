//! Scores of a finished run: photos, and light and maps against a truth where one is known.

use super::{act_button, empty, heading};
use crate::insight::report::data::ReportData;
use crate::insight::scores::AggregateScore;
use crate::job::entanglement::Entanglement;
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::model::tasks::TaskKind;
use egui::{Grid, RichText, ScrollArea, Ui};

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model) {
    let Some(report) = model.fit.report.clone() else {
        return empty(ui, "No scores yet", "Computed when the fit is finished");
    };
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.horizontal(|ui| {
            heading(ui, "Photos vs. render");
            act_button(ui, model, Act::OpenReport);
        });
        Grid::new("scores").striped(true).num_columns(5).spacing([18.0, 4.0]).show(ui, |ui| {
            header(ui, "Photos");
            for aggregate in &report.aggregates {
                row(ui, &aggregate.name, &aggregate.score);
            }
            if let Some(relit) = report.truth.as_ref().and_then(|truth| truth.relit.as_ref()) {
                row(ui, "novel lighting", relit);
            }
        });
        ui.label(RichText::new("In brackets: scale-aligned (per channel)").weak());
        plausible(ui, model);
        truth(ui, &report);
        other_lights(ui, model);
    });
}

/// Whether such a material exists, and the scale that would make it one.
fn plausible(ui: &mut Ui, model: &mut Model) {
    let Some(own) = model.plausibility() else { return };
    heading(ui, "Plausibility");
    Grid::new("plausible").num_columns(2).spacing([18.0, 4.0]).show(ui, |ui| {
        let mut line = |name: &str, [low, middle, high]: [f64; 3]| {
            ui.label(name);
            ui.label(format!("{middle:.3} ({low:.3} to {high:.3})"))
                .on_hover_text("Median of the seen texels, and the range of nine tenths of them");
            ui.end_row();
        };
        line("Diffuse reflectance", own.diffuse);
        line("Specular reflectance F0", own.specular);
    });
    for doubt in &own.doubts {
        let colours = crate::studio::theme::palette(ui.visuals());
        ui.label(RichText::new(crate::studio::model::words::capitalised(doubt)).color(colours.warning));
    }
    match own.factor {
        _ if own.doubts.is_empty() => {
            ui.label(RichText::new("Reflectances of materials that exist").weak());
        }
        Some(factor) => {
            let can = model.can_rescale();
            let button = ui.add_enabled(can, egui::Button::new(format!("Scale reflectance by {factor:.2}")));
            let help =
                "Write a copy of the run with this scale, and the environment scaled against it; photos leave it open";
            if button.on_hover_text(help).on_disabled_hover_text("Available when a fit is finished").clicked() {
                model.rescale_by_factor(factor as f32);
            }
        }
        None => {
            ui.label(RichText::new("No scale mends it: pin a patch whose reflectance is known").weak());
        }
    }
}

/// Scores under lights the fit never saw: the check of the paper.
fn other_lights(ui: &mut Ui, model: &mut Model) {
    heading(ui, "Novel lighting");
    let table = model.project.as_ref().and_then(|project| project.entanglement.clone());
    match table.as_deref() {
        None => {
            let busy = model.tasks.is_running(&TaskKind::NovelLighting);
            let there = model.project.as_ref().is_some_and(|project| project.scene.is_some() && project.maps.is_some());
            if ui.add_enabled(there && !busy, egui::Button::new("Compare under novel lighting")).clicked() {
                model.measure_entanglement();
            }
        }
        Some(Entanglement::Unknown(why)) => {
            ui.label(*why);
        }
        Some(Entanglement::Known(rows)) => {
            Grid::new("other lights").striped(true).num_columns(5).spacing([18.0, 4.0]).show(ui, |ui| {
                header(ui, "Environment");
                for line in rows {
                    row(ui, &line.light, &line.score);
                }
            });
            ui.label(RichText::new("An error that grows under novel lighting is lighting baked into the maps").weak());
        }
    }
}

fn header(ui: &mut Ui, first: &str) {
    for (title, help) in [
        (first, "Which images"),
        ("Images", "Number of images"),
        ("PSNR, dB", "10 log10 of 1 over the mean squared error of sRGB values"),
        ("SSIM", "Structural similarity of sRGB values (Wang et al. 2004)"),
        ("RMSE", "Root mean squared error of linear radiance"),
    ] {
        ui.label(RichText::new(title).weak()).on_hover_text(help);
    }
    ui.end_row();
}

fn row(ui: &mut Ui, name: &str, score: &AggregateScore) {
    ui.label(name);
    ui.label(score.views.to_string());
    let pair = |raw: f64, aligned: f64, digits: usize| format!("{raw:.digits$} ({aligned:.digits$})");
    ui.label(pair(score.raw.psnr_srgb_db, score.aligned.psnr_srgb_db, 2));
    ui.label(pair(score.raw.ssim_srgb, score.aligned.ssim_srgb, 3));
    ui.label(pair(score.raw.rmse_linear, score.aligned.rmse_linear, 4));
    ui.end_row();
}

fn truth(ui: &mut Ui, report: &ReportData) {
    heading(ui, "Disentanglement");
    let Some(truth) = &report.truth else {
        ui.label(
            "No ground truth here. Compare by eye: in the Relight panel, a surface that keeps the shadows or \
             highlights of the photos under another environment has lighting baked into it.",
        );
        return;
    };
    Grid::new("truth").striped(true).num_columns(3).spacing([18.0, 4.0]).show(ui, |ui| {
        for title in ["Against ground truth", "As estimated", "Scale-aligned"] {
            ui.label(RichText::new(title).weak());
        }
        ui.end_row();
        let mut line = |name: &str, raw: f64, aligned: f64| {
            ui.label(name);
            ui.label(format!("{raw:.4}"));
            ui.label(format!("{aligned:.4}"));
            ui.end_row();
        };
        if let Some(maps) = &truth.maps {
            line("Diffuse, RMSE", maps.diffuse.raw, maps.diffuse.aligned);
            line("Specular, RMSE", maps.specular.raw, maps.specular.aligned);
            line("Roughness, RMSE", maps.roughness.raw, maps.roughness.aligned);
        }
        if let Some(light) = &truth.environment {
            line("Environment, relative L2", light.relative_l2.raw, light.relative_l2.aligned);
            line("Environment, log RMSE", light.log_rmse.raw, light.log_rmse.aligned);
        }
        if let Some(relit) = &truth.relit {
            line("Relit renders, RMSE", relit.raw.rmse_linear, relit.aligned.rmse_linear);
        }
    });
    if let Some(degrees) = truth.environment.as_ref().and_then(|light| light.brightest_angle_degrees) {
        ui.label(format!("Brightest direction off by {degrees:.1}°"));
    }
}
