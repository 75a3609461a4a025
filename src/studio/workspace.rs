//! The two halves of the window, which panels each has, and the acts that show them.

use super::act::Act;
use serde::{Deserialize, Serialize};

/// Which half of the studio the window shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Workspace {
    /// Maps and light from photos of a place.
    #[default]
    Scene,
    /// Light and measured reflectance from photos of one object.
    Object,
}

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
