//! The line at the bottom: what goes on, how far it is, what is under the cursor.

use crate::insight::report::number;
use crate::studio::act::Act;
use crate::studio::model::tasks::TaskKind;
use crate::studio::model::{Model, Phase};
use crate::studio::theme;
use crate::studio::workspace::Workspace;
use egui::{Align, Layout, ProgressBar, RichText, Ui};

/// Draws the line.
pub fn show(ui: &mut Ui, model: &mut Model) {
    egui::Panel::bottom("status").show(ui, |ui| {
        ui.horizontal(|ui| {
            left(ui, model);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| right(ui, model));
        });
    });
}

fn left(ui: &mut Ui, model: &mut Model) {
    let phase = model.phase();
    if model.workspace == Workspace::Scene && phase.is_live() {
        return fit(ui, model, &phase);
    }
    let tasks = model.tasks.progress();
    if let Some((kind, what, share)) = tasks.into_iter().find(|(kind, ..)| *kind != TaskKind::Choosing) {
        // Work beside a scene that is ready does not hide what is to be said of it.
        if !matches!(phase, Phase::Closed | Phase::Opening | Phase::Preparing | Phase::Queued | Phase::Starting) {
            ui.label(phase.words());
        }
        let text = if what.is_empty() { kind.words() } else { format!("{}: {what}", kind.words()) };
        ui.label(text);
        // A bar that moves by itself would be drawn anew all the time, and take from the work it tells of.
        ui.add(ProgressBar::new(share).desired_width(140.0).show_percentage());
        if ui.button("Cancel").on_hover_text("Cancel this task; nothing that was open is lost").clicked() {
            model.tasks.stop(&kind);
            if kind.is_of_scene() {
                model.start_is_queued = false;
            }
            model.log.note(format!("Cancelled: {}", kind.words()));
        }
        if phase == Phase::Queued {
            ui.label("Fit starts automatically when ready");
        }
        return;
    }
    if model.workspace == Workspace::Object {
        return super::object::toolbar::status(ui, model);
    }
    match &phase {
        Phase::Closed => {}
        Phase::Failed(_) => {
            let colours = theme::palette(ui.visuals());
            ui.label(RichText::new(phase.words()).color(colours.error));
        }
        _ => {
            ui.label(phase.words());
        }
    }
}

/// One bar over the whole job, with the number that the window's title shows.
fn fit(ui: &mut Ui, model: &Model, phase: &Phase) {
    let colours = theme::palette(ui.visuals());
    ui.label(RichText::new(phase.words()).color(colours.accent).strong());
    let advance = &model.fit.advance;
    ui.add(ProgressBar::new(advance.share()).desired_width(160.0).text(format!("{} %", advance.percent())))
        .on_hover_text("Share of the whole job, report included");
    if let (Some(seconds), Phase::Fitting | Phase::Finishing(_)) = (advance.seconds_left(), phase) {
        ui.label(format!("{} left", number::duration(seconds)));
    }
    if let (Some(row), Phase::Fitting | Phase::Pausing | Phase::Paused) = (model.fit.losses.last(), phase) {
        let total = model.fit.steps_total.max(1);
        ui.label(RichText::new(super::curves::stage_words(&row.stage)).weak())
            .on_hover_text(format!("Step {} of {total}", row.step));
    }
    if let Some(rmse) = model.fit.losses.iter().rev().find_map(|row| row.held_out_rmse) {
        ui.label(format!("Held-out RMSE {rmse:.4}"))
            .on_hover_text("Root mean squared error of linear radiance over unclipped surface of held-out photos");
    }
}

fn right(ui: &mut Ui, model: &mut Model) {
    let warnings = model.log.unread;
    if ui.button("Help").on_hover_text("Every command and its key\nKey: F1").clicked() {
        model.act(Act::Help);
    }
    if warnings > 0 {
        let colours = theme::palette(ui.visuals());
        let text = RichText::new(format!("{warnings} {}", if warnings == 1 { "warning" } else { "warnings" }))
            .color(colours.warning);
        if ui.button(text).on_hover_text("Warnings since you last opened Messages").clicked() {
            model.act(Act::PanelMessages);
        }
    }
    if model.software_adapter {
        ui.label(RichText::new("CPU rendering").weak()).on_hover_text(format!(
            "No graphics card is used: {}. Everything works; orbiting is slower",
            model.adapter
        ));
    }
    if !model.hovered_value.is_empty() {
        ui.label(RichText::new(std::mem::take(&mut model.hovered_value)).monospace().small());
        return;
    }
    if let Some(message) = model.log.newest().filter(|message| message.at.elapsed().as_secs() < 12) {
        let mut text = message.sentence();
        if text.chars().count() > 90 {
            text = text.chars().take(88).collect::<String>() + "…";
        }
        ui.label(RichText::new(text).weak());
    }
}
