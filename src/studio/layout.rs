//! Which panels there are and how they are arranged; a person may drag them anywhere, and the arrangement is remembered.

use super::act::Act;
use super::model::{Model, Workspace};
use super::panel::{self, Memory};
use super::theme;
use egui::{Color32, Stroke, Ui, Visuals, WidgetText};
use egui_tiles::{
    Behavior, Container, Linear, LinearDir, SimplificationOptions, TabState, Tile, TileId, Tiles, Tree, UiResponse,
};
use serde::{Deserialize, Serialize};

/// A panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Panel {
    /// Controls and settings of the fit.
    Fit,
    /// The table of photos.
    Views,
    /// The mesh in 3-D.
    Stage,
    /// A photo beside its render.
    Photo,
    /// The maps on the atlas.
    Maps,
    /// The fitted environment.
    Light,
    /// The shelf of lights.
    Relight,
    /// The texel under the cursor.
    Record,
    /// Loss curves.
    Curves,
    /// What was noticed.
    Messages,
    /// Scores of a finished run.
    Scores,
    /// Object mode: what is estimated, from what.
    Object,
    /// Object mode: photo and re-render.
    ObjectPicture,
    /// Object mode: the estimated reflectance.
    Reflectance,
    /// Object mode: the estimated light.
    ObjectLight,
    /// Object mode: the object under other lights.
    Relit,
    /// Object mode: the objective, term by term.
    Objective,
    /// Object mode: which starts explain the photo.
    Starts,
    /// The library of materials.
    Materials,
    /// The map of their codes.
    MaterialMap,
    /// The chosen material.
    Material,
}

impl Panel {
    /// The panels of object mode with their titles and the acts that show them.
    pub const OBJECT: [(Panel, &str, Act); 11] = [
        (Panel::Object, "Object", Act::PanelObject),
        (Panel::ObjectPicture, "Re-render", Act::PanelObjectPicture),
        (Panel::Materials, "Materials", Act::PanelMaterials),
        (Panel::MaterialMap, "Latent map", Act::PanelMaterialMap),
        (Panel::Objective, "Objective", Act::PanelObjective),
        (Panel::Starts, "Initializations", Act::PanelStarts),
        (Panel::Messages, "Messages", Act::PanelMessages),
        (Panel::Reflectance, "Reflectance", Act::PanelReflectance),
        (Panel::Material, "Material", Act::PanelMaterial),
        (Panel::ObjectLight, "Estimated environment", Act::PanelObjectLight),
        (Panel::Relit, "Relit", Act::PanelRelit),
    ];

    /// The panels of a workspace.
    pub fn of_workspace(workspace: Workspace) -> &'static [(Panel, &'static str, Act)] {
        match workspace {
            Workspace::Scene => &Panel::ALL,
            Workspace::Object => &Panel::OBJECT,
        }
    }

    /// The workspace a panel is shown in: this one, if it has it.
    pub fn workspace(self, now: Workspace) -> Workspace {
        let has = |workspace| Panel::of_workspace(workspace).iter().any(|(panel, ..)| *panel == self);
        match (has(now), has(Workspace::Scene)) {
            (true, _) => now,
            (false, true) => Workspace::Scene,
            (false, false) => Workspace::Object,
        }
    }

    /// All panels of scene mode with their titles and the acts that show them.
    pub const ALL: [(Panel, &str, Act); 11] = [
        (Panel::Fit, "Fit", Act::PanelFit),
        (Panel::Views, "Photos", Act::PanelViews),
        (Panel::Stage, "Viewport", Act::PanelStage),
        (Panel::Photo, "Photo", Act::PanelPhoto),
        (Panel::Maps, "Maps", Act::PanelMaps),
        (Panel::Light, "Environment", Act::PanelLight),
        (Panel::Relight, "Relight", Act::PanelRelight),
        (Panel::Record, "Texel", Act::PanelRecord),
        (Panel::Curves, "Curves", Act::PanelCurves),
        (Panel::Messages, "Messages", Act::PanelMessages),
        (Panel::Scores, "Scores", Act::PanelScores),
    ];

    /// Its title.
    pub fn title(self) -> &'static str {
        let mut all = Panel::ALL.iter().chain(&Panel::OBJECT);
        all.find(|(panel, ..)| *panel == self).map_or("", |(_, title, _)| title)
    }

    /// The panel that an act shows.
    pub fn of(act: Act) -> Option<Panel> {
        Panel::ALL.iter().chain(&Panel::OBJECT).find(|(_, _, shows)| *shows == act).map(|(panel, ..)| *panel)
    }
}

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
