//! The panels: each file draws one, from the model, and queues acts.
//!
//! [`show`] is the only way in. A panel keeps nothing that matters: [`Memory`] holds scroll places, zooms and the like.
//! Every panel has an empty state that says what would fill it.

pub mod banner;
pub mod card;
pub mod curve_copies;
pub mod curves;
pub mod dialog;
pub mod fit;
pub mod form;
pub mod guide;
pub mod light;
pub mod maps;
pub mod menu;
pub mod messages;
pub mod object;
pub mod photo;
pub mod queue;
pub mod reading;
mod record;
pub mod relight;
pub mod scores;
pub mod stage;
pub mod status;
pub mod toolbar;
pub mod views;
pub mod welcome;

use super::act::availability::availability;
use super::act::{Act, ActInfo};
use super::model::Model;
use super::theme::PANEL_MARGIN;
use super::workspace::Panel;
use egui::{Align, Button, Layout, Margin, Response, RichText, Ui};

/// What panels keep between frames.
#[derive(Default)]
pub struct Memory {
    /// Loss curves.
    pub curves: curves::CurvesMemory,
    /// The settings form.
    pub form: form::FormMemory,
    /// Maps.
    pub maps: maps::MapsMemory,
    /// The environment.
    pub light: light::LightMemory,
    /// The photo.
    pub photo: photo::PhotoMemory,
    /// The stage.
    pub stage: stage::StageMemory,
    /// The table of photos.
    pub views: views::ViewsMemory,
    /// How the scene is read.
    pub reading: reading::ReadingMemory,
    /// The texel's record.
    pub record: record::RecordMemory,
    /// The shelf.
    pub relight: relight::RelightMemory,
    /// The panels of object mode.
    pub object: object::ObjectMemory,
    /// The guide.
    pub guide: guide::GuideMemory,
    /// The first page.
    pub welcome: welcome::WelcomeMemory,
}

/// Draws a panel.
pub fn show(panel: Panel, ui: &mut Ui, model: &mut Model, memory: &mut Memory) {
    if panel == Panel::Stage {
        return stage::show(ui, model, &mut memory.stage);
    }
    egui::Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::same(PANEL_MARGIN)).show(ui, |ui| {
        ui.set_min_size(ui.available_size());
        // Figures and messages are copied by hand into mails and notebooks.
        ui.style_mut().interaction.selectable_labels = matches!(panel, Panel::Record | Panel::Scores | Panel::Messages);
        match panel {
            Panel::Fit => fit::show(ui, model, &mut memory.form, &mut memory.reading),
            Panel::Views => views::show(ui, model, &mut memory.views),
            Panel::Stage => {}
            Panel::Photo => photo::show(ui, model, &mut memory.photo),
            Panel::Maps => maps::show(ui, model, &mut memory.maps),
            Panel::Light => light::show(ui, model, &mut memory.light),
            Panel::Relight => relight::show(ui, model, &mut memory.relight),
            Panel::Record => record::show(ui, model, &mut memory.record),
            Panel::Curves => curves::show(ui, model, &mut memory.curves),
            Panel::Messages => messages::show(ui, model),
            Panel::Scores => scores::show(ui, model),
            _ => object::show(panel, ui, model, &mut memory.object),
        }
    });
}

/// A button that does an act; grey with the reason where it cannot be done now.
pub fn act_button(ui: &mut Ui, model: &mut Model, act: Act) -> Response {
    act_button_named(ui, model, act, act.name())
}

/// The same under another label.
pub fn act_button_named(ui: &mut Ui, model: &mut Model, act: Act, label: &str) -> Response {
    let available = availability(act, model);
    let response = ui.add_enabled(available.is_ok(), Button::new(label));
    let response = with_help(ui, response, act, available);
    if response.clicked() {
        model.act(act);
    }
    response
}

/// A switch that does an act and shows whether it is on.
pub fn act_switch(ui: &mut Ui, model: &mut Model, act: Act, label: &str, is_on: bool) -> Response {
    let available = availability(act, model);
    let button = Button::selectable(is_on, label);
    let response = ui.add_enabled(available.is_ok(), button);
    let response = with_help(ui, response, act, available);
    if response.clicked() {
        model.act(act);
    }
    response
}

/// A line of a menu or of the palette: the act's name with its key beside it; grey with the reason where it cannot be
/// done now. For readers of the screen its name is the act's alone, and the key is told as a key.
pub fn act_line(
    ui: &mut Ui,
    model: &Model,
    info: &ActInfo,
    dress: impl FnOnce(Button<'static>) -> Button<'static>,
) -> Response {
    let keys = info.shortcut.map(|shortcut| ui.ctx().format_shortcut(&shortcut));
    let mut button = dress(Button::new(info.name));
    if let Some(keys) = &keys {
        button = button.shortcut_text(keys.clone());
    }
    let available = availability(info.act, model);
    let response = ui.add_enabled(available.is_ok(), button).accessible_name(info.name).on_hover_text(info.help);
    ui.ctx().accesskit_node_builder(response.id, |node| {
        node.set_role(egui::accesskit::Role::MenuItem);
        if let Some(keys) = keys {
            node.set_keyboard_shortcut(keys);
        }
    });
    match available {
        Ok(()) => response,
        Err(why) => response.on_disabled_hover_text(format!("{}\nNot now: {why}", info.help)),
    }
}

fn with_help(ui: &Ui, response: Response, act: Act, available: Result<(), &'static str>) -> Response {
    let keys = act.info().shortcut.map(|shortcut| ui.ctx().format_shortcut(&shortcut));
    let text = match &keys {
        Some(keys) => format!("{}\nKey: {keys}", act.info().help),
        None => act.info().help.to_owned(),
    };
    let response = response.on_hover_text(text);
    match available {
        Ok(()) => response,
        Err(why) => response.on_disabled_hover_text(format!("{}\nNot now: {why}", act.info().help)),
    }
}

/// What an empty panel says: what it will show, and what to do for it.
pub fn empty(ui: &mut Ui, what: &str, hint: &str) {
    ui.with_layout(Layout::top_down(Align::Center), |ui| {
        ui.add_space((ui.available_height() * 0.35).min(120.0));
        ui.label(RichText::new(what).strong());
        ui.label(RichText::new(hint).weak());
    });
}

/// A heading within a panel.
pub fn heading(ui: &mut Ui, text: &str) {
    ui.add_space(4.0);
    ui.label(RichText::new(text).strong());
}
