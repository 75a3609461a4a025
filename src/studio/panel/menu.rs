//! The menu bar, drawn from the list of acts; at its right, which half of the studio is shown.

use super::act_line;
use crate::studio::act::{Act, ActInfo, Group, LIST};
use crate::studio::model::Model;
use crate::studio::workspace::{Panel, Workspace};
use egui::{Align, Button, Layout, Ui};

/// Room that the switch of workspaces takes, in points.
const ROOM: f32 = 220.0;

impl Act {
    /// The list within its menu in which it stands, if it does: menus are no longer than a small window.
    pub fn list(self) -> Option<&'static str> {
        match self {
            own if Panel::of(own).is_some() => Some("Panels"),
            own if own.navigation().is_some() => Some("Navigation as in"),
            Act::LayerPhotos
            | Act::LayerCrossfade
            | Act::LayerLit
            | Act::LayerDiffuse
            | Act::LayerSpecular
            | Act::LayerRoughness
            | Act::LayerNormal
            | Act::LayerPhotoError
            | Act::LayerCoverage
            | Act::LayerDisagreement
            | Act::LayerTimesSeen
            | Act::LayerDiffuseDeviation
            | Act::LayerSpecularDeviation
            | Act::LayerRoughnessDeviation
            | Act::LayerLobeSharing
            | Act::LayerChoice => Some("Layers of the surface"),
            _ => None,
        }
    }
}

/// Draws the menu bar.
pub fn show(ui: &mut Ui, model: &mut Model) {
    egui::Panel::top("menu").show(ui, |ui| {
        egui::MenuBar::new().ui(ui, |ui| {
            for (group, title) in Group::ALL {
                ui.menu_button(title, |ui| {
                    ui.set_min_width(230.0);
                    let (mut listed, own): (Vec<&ActInfo>, Vec<&ActInfo>) =
                        LIST.iter().filter(|info| info.group == group).partition(|info| info.act.list().is_some());
                    own.into_iter().for_each(|info| line(ui, model, info));
                    listed.sort_by_key(|info| info.act.list());
                    for part in listed.chunk_by(|a, b| a.act.list() == b.act.list()) {
                        let name = part[0].act.list().unwrap_or_default();
                        let list = ui.menu_button(name, |ui| part.iter().for_each(|info| line(ui, model, info)));
                        list.response.accessible_name(name);
                    }
                });
            }
            // In a narrow window the menus come first; the switch is in the menu of object mode too.
            if ui.available_width() < ROOM {
                return;
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                for (act, workspace) in
                    [(Act::ObjectWorkspace, Workspace::Object), (Act::SceneWorkspace, Workspace::Scene)]
                {
                    let is_on = model.workspace == workspace;
                    let button = ui.add(Button::selectable(is_on, act.name())).on_hover_text(act.info().help);
                    if button.clicked() && !is_on {
                        model.act(act);
                    }
                }
            });
        });
    });
}

/// A line of a menu, marked where it shows a panel that is in front, or the hand movements in force.
fn line(ui: &mut Ui, model: &mut Model, info: &ActInfo) {
    let is_on = Panel::of(info.act).is_some_and(|own| model.visible_panels.contains(&own))
        || info.act.navigation() == Some(model.preferences.navigation);
    if act_line(ui, model, info, |button| button.selected(is_on)).clicked() {
        model.act(info.act);
        ui.close();
    }
}
