//! Everything a person can do, in one list.
//!
//! Menus, the command palette, keys and the help page all read [`LIST`] and [`Act::info`]; an act that is not in the
//! list cannot be done, and one that is in it can be found in all four places. What an act does is
//! [`crate::studio::perform`]; whether it can be done now, and why not, is [`availability`].

pub mod availability;
pub mod keys;
pub mod list;
pub mod turns;

pub use list::{ActInfo, Group, LIST};

use crate::studio::stage::Navigation;

/// Something a person can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)] // Each act's name and help stand in the list.
pub enum Act {
    OpenFolder,
    Import,
    OpenDemo,
    CloseProject,
    Export,
    SavePicture,
    SaveTurntable,
    SaveFitFilm,
    SaveLightStrip,
    OpenReport,
    OpenRunFolder,
    Quit,
    Undo,
    Redo,
    Start,
    PauseOrGoOn,
    Stop,
    StepOnce,
    Checkpoint,
    QueueScene,
    FitView,
    NavigatePatina,
    NavigateBlender,
    NavigateMaya,
    LookThrough,
    NextView,
    PreviousView,
    LeaveOut,
    ShowPhoto,
    WipePhoto,
    CompareRun,
    ErrorOverlay,
    Traced,
    Frustums,
    Thumbnails,
    ChartBorders,
    LayerPhotos,
    LayerCrossfade,
    LayerLit,
    LayerDiffuse,
    LayerSpecular,
    LayerRoughness,
    LayerNormal,
    LayerPhotoError,
    LayerTimesSeen,
    LayerCoverage,
    LayerDisagreement,
    LayerDiffuseDeviation,
    LayerSpecularDeviation,
    LayerRoughnessDeviation,
    LayerLobeSharing,
    LayerChoice,
    ExposureUp,
    ExposureDown,
    ExposureAuto,
    ResetDisplay,
    NextCurve,
    FalseColour,
    Stripes,
    NextLight,
    PreviousLight,
    SecondLight,
    TurnLightLeft,
    TurnLightRight,
    FittedLight,
    AddLight,
    AddLightFolder,
    LightBackground,
    LightStrip,
    SurfaceLayers,
    Palette,
    Help,
    Guide,
    NextTheme,
    ZoomIn,
    ZoomOut,
    ZoomReset,
    HideInterface,
    ResetLayout,
    SceneWorkspace,
    ObjectWorkspace,
    OpenPhoto,
    ObjectStart,
    ObjectStop,
    ObjectRelight,
    ObjectSave,
    ObjectReport,
    OpenMaterial,
    NextMaterial,
    PreviousMaterial,
    PanelObject,
    PanelObjectPicture,
    PanelReflectance,
    PanelObjectLight,
    PanelRelit,
    PanelObjective,
    PanelStarts,
    PanelMaterials,
    PanelMaterialMap,
    PanelMaterial,
    PanelFit,
    PanelViews,
    PanelStage,
    PanelPhoto,
    PanelMaps,
    PanelLight,
    PanelRelight,
    PanelRecord,
    PanelCurves,
    PanelMessages,
    PanelScores,
}

impl Act {
    /// What is known of the act.
    pub fn info(self) -> &'static ActInfo {
        // A test holds that every act is in the list; the first entry stands in for one that is not.
        LIST.iter().find(|info| info.act == self).unwrap_or(&LIST[0])
    }

    /// The hand movements it chooses, if it does.
    pub fn navigation(self) -> Option<Navigation> {
        match self {
            Act::NavigatePatina => Some(Navigation::Patina),
            Act::NavigateBlender => Some(Navigation::Blender),
            Act::NavigateMaya => Some(Navigation::Maya),
            _ => None,
        }
    }

    /// Its label.
    pub fn name(self) -> &'static str {
        self.info().name
    }

    /// The label without the ellipsis, for sentences.
    pub fn bare_name(self) -> &'static str {
        self.name().trim_end_matches('…')
    }
}
