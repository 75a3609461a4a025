//! The menu bar, drawn from the list of acts.

use crate::studio::act::availability::availability;
use crate::studio::act::{Group, LIST};
use crate::studio::model::Model;
use egui::{Button, Ui};

/// Draws the menu bar.
pub fn show(ui: &mut Ui, model: &mut Model) {
    egui::Panel::top("menu").show(ui, |ui| {
        egui::MenuBar::new().ui(ui, |ui| {
            for (group, title) in Group::ALL {
                ui.menu_button(title, |ui| {
                    ui.set_min_width(230.0);
                    for info in LIST.iter().filter(|info| info.group == group) {
                        let mut button = Button::new(info.name);
                        if let Some(shortcut) = info.shortcut {
                            button = button.shortcut_text(ui.ctx().format_shortcut(&shortcut));
                        }
                        let available = availability(info.act, model);
                        let response = ui.add_enabled(available.is_ok(), button).on_hover_text(info.help);
                        let response = match available {
                            Ok(()) => response,
                            Err(why) => response.on_disabled_hover_text(format!("Not now: {why}")),
                        };
                        if response.clicked() {
                            model.act(info.act);
                            ui.close();
                        }
                    }
                });
            }
        });
    });
}
