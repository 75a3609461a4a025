//! A form made of the one settings structure: names, helps and choices are those of the command line.

use crate::fit::describe::{SettingDescription, ValueKind};
use crate::fit::{FitSettings, Method};
use crate::studio::model::words;
use crate::studio::theme;
use egui::{Checkbox, ComboBox, DragValue, Grid, RichText, Ui};
use std::collections::HashMap;

/// What the form keeps: the descriptions, and text that is being typed.
#[derive(Default)]
pub struct FormMemory {
    described: Vec<SettingDescription>,
    typing: HashMap<String, String>,
    filter: String,
    /// The setting that should be scrolled to.
    pub sought: Option<String>,
    /// Whether all settings are shown.
    pub all: bool,
}

/// Settings that most people change, whatever the method; the others stand below a heading.
const FIRST: [&str; 5] = ["method", "map-size", "bounces", "background", "exposure"];
/// The same of Adam alone,
const FIRST_OF_ADAM: [&str; 4] = ["steps-diffuse", "steps-all", "samples", "consistency"];
/// and of the solver.
const FIRST_OF_SOLVER: [&str; 2] = ["solver-rounds", "solver-refine"];

/// Draws the form. `live` while a fit runs: what cannot change then is grey.
pub fn show(ui: &mut Ui, settings: &mut FitSettings, live: bool, memory: &mut FormMemory) {
    if memory.described.is_empty() {
        memory.described = FitSettings::described();
    }
    if memory.sought.is_some() {
        memory.all = true;
        memory.filter.clear();
    }
    let described = std::mem::take(&mut memory.described);
    let of_method: &[&str] = match settings.method {
        Method::Solver | Method::Automatic => &FIRST_OF_SOLVER,
        Method::Adam => &FIRST_OF_ADAM,
    };
    let is_first = |setting: &SettingDescription| FIRST.iter().chain(of_method).any(|name| *name == setting.name);
    grid(ui, "first settings", described.iter().filter(|setting| is_first(setting)), settings, live, memory);
    ui.add_space(4.0);
    ui.checkbox(&mut memory.all, "All settings");
    if memory.all {
        let label = ui.label("Find a setting");
        ui.text_edit_singleline(&mut memory.filter).labelled_by(label.id);
        let wanted = memory.filter.trim().to_lowercase();
        let matches = |setting: &&SettingDescription| {
            !is_first(setting)
                && is_read(&setting.name, settings)
                && setting.value_kind != ValueKind::Names
                && (wanted.is_empty()
                    || setting.name.contains(&wanted)
                    || setting.help.to_lowercase().contains(&wanted))
        };
        let rest: Vec<&SettingDescription> = described.iter().filter(matches).collect();
        if rest.is_empty() {
            ui.label(RichText::new("No matching setting").weak());
        }
        grid(ui, "all settings", rest.into_iter(), settings, live, memory);
    }
    memory.described = described;
}

fn grid<'a>(
    ui: &mut Ui,
    id: &str,
    described: impl Iterator<Item = &'a SettingDescription>,
    settings: &mut FitSettings,
    live: bool,
    memory: &mut FormMemory,
) {
    let default = FitSettings::default();
    Grid::new(id).num_columns(2).spacing([10.0, 4.0]).show(ui, |ui| {
        for setting in described {
            let changed = settings.get(&setting.name).ok() != default.get(&setting.name).ok();
            let text = RichText::new(words::of_setting(&setting.name));
            let text = if changed { text.color(theme::palette(ui.visuals()).accent) } else { text };
            let label = ui.label(text).on_hover_text(help(setting, &default));
            if memory.sought.as_deref() == Some(setting.name.as_str()) {
                label.scroll_to_me(Some(egui::Align::Center));
                memory.sought = None;
            }
            let enabled = !live || setting.changes_mid_run;
            let why = "Cannot be changed during a fit";
            ui.add_enabled_ui(enabled, |ui| field(ui, setting, settings, label.id, memory))
                .response
                .on_disabled_hover_text(why);
            ui.end_row();
        }
    });
}

/// Whether a fit with these settings reads the one of this name.
fn is_read(name: &str, settings: &FitSettings) -> bool {
    match settings.method {
        Method::Adam => !name.starts_with("solver-"),
        Method::Solver | Method::Automatic => !Method::means_adam(&[name.to_owned()]),
    }
}

fn help(setting: &SettingDescription, default: &FitSettings) -> String {
    let mut text = format!("{}\n--{}", setting.help, setting.name);
    for (value, meaning) in setting.possible_values.iter().zip(&setting.possible_value_help) {
        text += &format!("\n{value}: {meaning}");
    }
    if let Ok(usual) = default.get_text(&setting.name) {
        text += &format!("\nDefault: {}", if usual.is_empty() { "none" } else { &usual });
    }
    text
}

fn field(
    ui: &mut Ui,
    setting: &SettingDescription,
    settings: &mut FitSettings,
    label: egui::Id,
    memory: &mut FormMemory,
) {
    let name = setting.name.as_str();
    let Ok(before) = settings.get_text(name) else { return };
    let after = match setting.value_kind {
        ValueKind::Switch => {
            let mut on = before == "true";
            ui.add(Checkbox::without_text(&mut on)).labelled_by(label);
            on.to_string()
        }
        ValueKind::Choice => {
            let mut chosen = before.clone();
            let response = ComboBox::from_id_salt(name).selected_text(words::of_setting(&chosen)).show_ui(ui, |ui| {
                for (value, meaning) in setting.possible_values.iter().zip(&setting.possible_value_help) {
                    ui.selectable_value(&mut chosen, value.clone(), words::of_setting(value)).on_hover_text(meaning);
                }
            });
            response.response.labelled_by(label);
            chosen
        }
        ValueKind::Whole if name == "map-size" => {
            let mut chosen = before.clone();
            let response =
                ComboBox::from_id_salt(name).selected_text(format!("{chosen} x {chosen}")).show_ui(ui, |ui| {
                    for power in 6..=12 {
                        let size = 1usize << power;
                        ui.selectable_value(&mut chosen, size.to_string(), format!("{size} x {size}"));
                    }
                });
            response.response.labelled_by(label);
            chosen
        }
        ValueKind::Whole => {
            let mut number: u64 = before.parse().unwrap_or(0);
            let speed = (number as f64 * 0.01).max(0.05);
            ui.add(DragValue::new(&mut number).speed(speed)).labelled_by(label);
            number.to_string()
        }
        ValueKind::Number => {
            let mut number: f32 = before.parse().unwrap_or(0.0);
            let speed = (f64::from(number) * 0.01).max(1e-4);
            ui.add(DragValue::new(&mut number).speed(speed).max_decimals(5)).labelled_by(label);
            number.to_string()
        }
        ValueKind::Names => {
            let text = memory.typing.entry(name.into()).or_insert_with(|| before.clone());
            let response = ui.text_edit_singleline(text).labelled_by(label);
            if response.lost_focus() { memory.typing.remove(name).unwrap_or_default() } else { before.clone() }
        }
    };
    if after != before {
        // A value out of its range is not taken: the field goes back to what it was.
        let mut tried = settings.clone();
        if tried.set(name, &after).is_ok() && tried.validate().is_ok() {
            *settings = tried;
        }
    }
}
