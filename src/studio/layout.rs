//! How the panels are arranged; a person may drag them anywhere, and the arrangement is remembered.

use super::model::Model;
use super::panel::{self, Memory};
use super::theme;
use super::workspace::{Panel, Workspace};
use egui::{Color32, Stroke, Ui, Visuals, WidgetText};
use egui_tiles::{
    Behavior, Container, Linear, LinearDir, SimplificationOptions, TabState, Tile, TileId, Tiles, Tree, UiResponse,
};

/// The arrangement.
pub struct Layout {
    tree: Tree<Panel>,
}

/// Groups of tabs, each a list of panels: left, upper and lower centre, upper and lower right.
const SCENE_TABS: [&[Panel]; 5] = [
    &[Panel::Fit, Panel::Views],
    &[Panel::Stage, Panel::Photo],
    &[Panel::Curves, Panel::Messages, Panel::Scores],
    &[Panel::Maps, Panel::Light],
    &[Panel::Relight, Panel::Record],
];
const OBJECT_TABS: [&[Panel]; 5] = [
    &[Panel::Object],
    &[Panel::ObjectPicture, Panel::Materials, Panel::MaterialMap],
    &[Panel::Objective, Panel::Starts, Panel::Messages],
    &[Panel::Reflectance, Panel::Material],
    &[Panel::ObjectLight, Panel::Relit],
];

impl Default for Layout {
    fn default() -> Self {
        Layout::of(Workspace::Scene)
    }
}

impl Layout {
    /// The first arrangement of a workspace.
    pub fn of(workspace: Workspace) -> Self {
        let (groups, name, heights) = match workspace {
            Workspace::Scene => (SCENE_TABS, "layout", [0.7, 0.5]),
            Workspace::Object => (OBJECT_TABS, "object layout", [0.64, 0.56]),
        };
        let mut tiles = Tiles::default();
        let mut tabs = |panels: &[Panel]| {
            let panes = panels.iter().map(|&panel| tiles.insert_pane(panel)).collect();
            tiles.insert_tab_tile(panes)
        };
        let [left, stage, below, upper_right, lower_right] = groups.map(&mut tabs);
        let mut split = |direction: LinearDir, children: &[(TileId, f32)]| {
            let mut linear = Linear::new(direction, children.iter().map(|(child, _)| *child).collect());
            for (child, share) in children {
                linear.shares.set_share(*child, *share);
            }
            tiles.insert_new(Tile::Container(Container::Linear(linear)))
        };
        let centre = split(LinearDir::Vertical, &[(stage, heights[0]), (below, 1.0 - heights[0])]);
        let right = split(LinearDir::Vertical, &[(upper_right, heights[1]), (lower_right, 1.0 - heights[1])]);
        let root = split(LinearDir::Horizontal, &[(left, 0.21), (centre, 0.53), (right, 0.26)]);
        let mut layout = Layout { tree: Tree::new(egui::Id::unique(name), root, tiles) };
        for first in groups.iter().filter_map(|group| group.first()) {
            layout.activate(*first);
        }
        layout
    }

    /// The arrangement that was remembered; the first one where nothing was, or where it lacks a panel.
    pub fn from_text(text: &str, workspace: Workspace) -> Self {
        let Ok(tree) = serde_json::from_str::<Tree<Panel>>(text) else { return Layout::of(workspace) };
        let has = |panel: Panel| tree.tiles.tiles().any(|tile| matches!(tile, Tile::Pane(own) if *own == panel));
        let is_whole = Panel::of_workspace(workspace).iter().all(|(panel, ..)| has(*panel));
        if is_whole { Layout { tree } } else { Layout::of(workspace) }
    }

    /// The arrangement as text.
    pub fn to_text(&self) -> String {
        serde_json::to_string(&self.tree).unwrap_or_default()
    }

    /// Brings a panel to the front of its tabs.
    pub fn activate(&mut self, panel: Panel) {
        self.tree.make_active(|_, tile| matches!(tile, Tile::Pane(own) if *own == panel));
    }

    /// Panels that are in front.
    pub fn visible(&self) -> Vec<Panel> {
        let active = self.tree.active_tiles();
        let pane = |id: &TileId| match self.tree.tiles.get(*id) {
            Some(Tile::Pane(panel)) => Some(*panel),
            _ => None,
        };
        active.iter().filter_map(pane).collect()
    }

    /// Shows all panels.
    pub fn show(&mut self, ui: &mut Ui, model: &mut Model, memory: &mut Memory) {
        self.tree.ui(&mut Frames { model, memory }, ui);
    }
}

/// Draws the frames around panels.
struct Frames<'a> {
    model: &'a mut Model,
    memory: &'a mut Memory,
}

impl Behavior<Panel> for Frames<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, panel: &mut Panel) -> UiResponse {
        panel::show(*panel, ui, self.model, self.memory);
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, panel: &Panel) -> WidgetText {
        match panel {
            Panel::Messages if self.model.log.unread > 0 => {
                format!("{} ({})", panel.title(), self.model.log.unread).into()
            }
            _ => panel.title().into(),
        }
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: true, ..Default::default() }
    }

    fn tab_bar_height(&self, _style: &egui::Style) -> f32 {
        26.0
    }

    fn gap_width(&self, _style: &egui::Style) -> f32 {
        3.0
    }

    fn tab_bar_color(&self, visuals: &Visuals) -> Color32 {
        visuals.extreme_bg_color
    }

    fn tab_bg_color(&self, visuals: &Visuals, _tiles: &Tiles<Panel>, _tile: TileId, state: &TabState) -> Color32 {
        match (state.active, visuals.override_text_color) {
            // With all text of one colour, as in high contrast, the ground tells the tab that is open.
            (true, Some(_)) => visuals.selection.bg_fill,
            (true, None) => visuals.panel_fill,
            (false, _) => visuals.extreme_bg_color,
        }
    }

    fn tab_outline_stroke(&self, _: &Visuals, _: &Tiles<Panel>, _: TileId, _: &TabState) -> Stroke {
        Stroke::NONE
    }

    fn tab_text_color(&self, visuals: &Visuals, _: &Tiles<Panel>, _: TileId, state: &TabState) -> Color32 {
        if state.active { theme::palette(visuals).accent } else { visuals.weak_text_color() }
    }
}
