//! The queue: scenes that are fitted one after the other.

use super::{act_button, heading};
use crate::fit::Preset;
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::model::queue::{QueueState, QueuedScene};
use crate::studio::theme;
use egui::{ComboBox, RichText, Ui};

/// Draws the section.
pub fn show(ui: &mut Ui, model: &mut Model) {
    heading(ui, "Queue");
    act_button(ui, model, Act::QueueScene);
    if model.queue.scenes().is_empty() {
        ui.label(RichText::new("Scenes are fitted one after the other; several dropped at once go here.").weak());
        return;
    }
    for scene in model.queue.scenes().to_vec() {
        line(ui, model, &scene);
    }
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Fitted by");
        let preset = &mut model.queue.preset;
        ComboBox::from_id_salt("queue preset")
            .selected_text(preset.label())
            .show_ui(ui, |ui| {
                for own in Preset::ALL {
                    ui.selectable_value(preset, own, own.label());
                }
            })
            .response
            .labelled_by(label.id);
        let (name, help) = match model.queue.is_held {
            true => ("Resume queue", "Go on with the scenes that wait"),
            false => ("Pause queue", "Begin no further scene; the fit in progress goes on"),
        };
        if ui.button(name).on_hover_text(help).clicked() {
            model.queue.is_held = !model.queue.is_held;
        }
        if ui.button("Clear finished").on_hover_text("Take out what has ended; run folders stay").clicked() {
            model.queue.clear_ended();
        }
    });
}

fn line(ui: &mut Ui, model: &mut Model, scene: &QueuedScene) {
    let name = scene.path.file_name().unwrap_or(scene.path.as_os_str()).to_string_lossy().into_owned();
    ui.horizontal_wrapped(|ui| {
        ui.label(&name).on_hover_text(scene.path.display().to_string());
        match &scene.state {
            QueueState::Waiting => {
                ui.label(RichText::new("waiting").weak());
                let remove = ui.small_button("Remove").on_hover_text(format!("Take {name} out of the queue"));
                if remove.clicked() {
                    model.queue.remove(&scene.path);
                }
            }
            QueueState::AtWork => {
                ui.label(RichText::new("at work").strong());
            }
            QueueState::Done(run) => {
                if ui.link("finished").on_hover_text(format!("Open {}", run.display())).clicked() {
                    model.open(run.clone());
                }
            }
            QueueState::NotDone(why) => {
                ui.label(RichText::new(format!("not fitted: {why}")).color(theme::palette(ui.visuals()).error));
            }
        }
    });
}
