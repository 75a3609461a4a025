//! The line at the bottom: what goes on, how far it is, what is under the cursor.

use crate::insight::report::number;
use crate::studio::act::Act;
use crate::studio::model::{FitStatus, Model, Workspace};
use crate::studio::theme;
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
    let colours = theme::palette(ui.visuals());
    if let Some((title, what, share)) = model.tasks.progress().into_iter().find(|(title, ..)| title != "Choosing") {
        let text = if what.is_empty() { title.clone() } else { format!("{title}: {what}") };
        ui.label(text);
        // A bar that moves by itself would be drawn anew all the time, and take from the work it tells of.
        ui.add(ProgressBar::new(share).desired_width(140.0).show_percentage());
        if ui.button("Cancel").on_hover_text("Ends this work; what was there before stays").clicked() {
            model.tasks.stop(&title);
            model.log.note(format!("Stopped: {title}"));
        }
        return;
    }
    if model.workspace == Workspace::Object {
        return super::object::toolbar::status(ui, model);
    }
    if model.project.is_none() {
        return;
    }
    match &model.fit.status {
        FitStatus::Failed(why) => {
            ui.label(RichText::new(format!("Failed: {why}")).color(colours.error));
        }
        status => {
            let live = status.is_live();
            let words = RichText::new(status.words());
            ui.label(if live { words.color(colours.accent).strong() } else { words });
        }
    }
    if let (Some(row), true) = (model.fit.losses.last(), model.fit.status.is_live()) {
        let total = model.fit.steps_total.max(1);
        ui.add(ProgressBar::new(row.step as f32 / total as f32).desired_width(160.0))
            .on_hover_text("Share of the steps that are done");
        ui.label(format!("step {} of {total}, {}", row.step, row.stage));
        if let (Some(progress), FitStatus::Running) = (&model.fit.progress, &model.fit.status) {
            ui.label(format!(
                "{:.1} steps/s, {} left",
                progress.steps_per_second,
                number::duration(progress.seconds_left)
            ));
        }
        let (rmse, over) = match row.surface_rmse {
            Some(surface) => (surface, "the unclipped surface of the last step's photos"),
            None => (row.image_loss.max(0.0).sqrt(), "every pixel of the last step's photos that is evidence"),
        };
        ui.label(format!("RMSE {rmse:.4}"))
            .on_hover_text(format!("Root mean squared error of linear radiance over {over}"));
    }
}

fn right(ui: &mut Ui, model: &mut Model) {
    let warnings = model.log.unread;
    if ui.button("Help").on_hover_text("Every act and its key\nKey: F1").clicked() {
        model.act(Act::Help);
    }
    if warnings > 0 {
        let colours = theme::palette(ui.visuals());
        let text = RichText::new(format!("{warnings} to look at")).color(colours.warning);
        if ui.button(text).on_hover_text("Warnings and errors since you last looked").clicked() {
            model.act(Act::PanelMessages);
        }
    }
    if model.software_adapter {
        ui.label(RichText::new("software drawing").weak()).on_hover_text(format!(
            "No graphics card is used: {}. Everything works; turning the scene is slower",
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
