//! Everything a person can do, in one list.
//!
//! Menus, the command palette, keys and the help page all read [`LIST`] and [`Act::info`]; an act that is not in the
//! list cannot be done, and one that is in it can be found in all four places. What an act does is
//! [`crate::studio::perform`]; whether it can be done now, and why not, is [`availability`].

pub mod availability;
pub mod keys;
pub mod turns;

use egui::{Key, KeyboardShortcut, Modifiers};

/// Something a person can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)] // Each act's name and help stand in the list below.
pub enum Act {
    OpenFolder,
    OpenDemo,
    CloseProject,
    SavePicture,
    SaveTurntable,
    SaveLightStrip,
    OpenReport,
    Quit,
    Undo,
    Redo,
    Start,
    PauseOrGoOn,
    Stop,
    StepOnce,
    Checkpoint,
    FitView,
    LookThrough,
    NextView,
    PreviousView,
    LeaveOut,
    ShowPhoto,
    WipePhoto,
    ErrorOverlay,
    Traced,
    Frustums,
    Thumbnails,
    ChartBorders,
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
    LightBackground,
    LightStrip,
    SurfaceLayers,
    Palette,
    Help,
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

/// The menu an act stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Opening, saving, leaving.
    File,
    /// Undo and redo.
    Edit,
    /// The fit.
    Fit,
    /// What the stage shows.
    View,
    /// Exposure, curve, marks.
    Display,
    /// Light to look at the materials in.
    Light,
    /// Object mode.
    Object,
    /// Panels, themes, help.
    Window,
}

impl Group {
    /// All menus in order, with their titles.
    pub const ALL: [(Group, &str); 8] = [
        (Group::File, "File"),
        (Group::Edit, "Edit"),
        (Group::Fit, "Fit"),
        (Group::View, "View"),
        (Group::Display, "Display"),
        (Group::Light, "Light"),
        (Group::Object, "Object"),
        (Group::Window, "Window"),
    ];
}

/// What is known of an act.
#[derive(Clone, Copy, Debug)]
pub struct ActInfo {
    /// The act.
    pub act: Act,
    /// The menu it stands in.
    pub group: Group,
    /// Label, sentence case without a full stop; `…` when it asks for more.
    pub name: &'static str,
    /// One sentence on what it does.
    pub help: &'static str,
    /// Its key, if it has one.
    pub shortcut: Option<KeyboardShortcut>,
}

const fn key(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::NONE, key))
}

const fn with(modifiers: Modifiers, key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(modifiers, key))
}

const CTRL: Modifiers = Modifiers::COMMAND;
const SHIFT: Modifiers = Modifiers::SHIFT;
const CTRL_SHIFT: Modifiers = Modifiers::COMMAND.plus(Modifiers::SHIFT);

const fn info(
    act: Act,
    group: Group,
    name: &'static str,
    help: &'static str,
    shortcut: Option<KeyboardShortcut>,
) -> ActInfo {
    ActInfo { act, group, name, help, shortcut }
}

/// The list.
#[rustfmt::skip]
pub const LIST: &[ActInfo] = &[
    info(Act::OpenFolder, Group::File, "Open…", "Opens a scene folder or a run folder.", with(CTRL, Key::O)),
    info(Act::OpenDemo, Group::File, "Open the built-in demo", "Photographs a small built-in scene whose materials are known, and opens it.", with(CTRL, Key::D)),
    info(Act::CloseProject, Group::File, "Close the scene", "Goes back to the first page. A fit that runs is stopped with a checkpoint.", with(CTRL, Key::W)),
    info(Act::SavePicture, Group::File, "Save picture…", "Path-traces the stage's view in the chosen light and saves it as PNG or EXR.", with(CTRL, Key::S)),
    info(Act::SaveTurntable, Group::File, "Save turntable…", "Saves pictures of a round about the scene in the chosen light.", None),
    info(Act::SaveLightStrip, Group::File, "Save strip of lights…", "Saves the stage's view under every light of the shelf.", None),
    info(Act::OpenReport, Group::File, "Show report", "Opens the run's report in the browser.", None),
    info(Act::Quit, Group::File, "Quit", "Ends the program. A fit that runs is stopped with a checkpoint.", with(CTRL, Key::Q)),

    info(Act::Undo, Group::Edit, "Undo", "Takes back the last change of a setting, a light or the display.", with(CTRL, Key::Z)),
    info(Act::Redo, Group::Edit, "Redo", "Does again what was taken back.", with(CTRL_SHIFT, Key::Z)),

    info(Act::Start, Group::Fit, "Start fit", "Fits the maps and the light to the photos.", with(CTRL, Key::Enter)),
    info(Act::PauseOrGoOn, Group::Fit, "Pause or go on", "Holds the fit after the step in progress, or lets it go on.", key(Key::Space)),
    info(Act::Stop, Group::Fit, "Stop fit", "Ends the fit at once; a checkpoint keeps what was done.", with(CTRL, Key::Period)),
    info(Act::StepOnce, Group::Fit, "Step once", "Does one step of a fit that is paused.", key(Key::Period)),
    info(Act::Checkpoint, Group::Fit, "Write checkpoint", "Saves the state of the fit now.", with(CTRL_SHIFT, Key::S)),

    info(Act::FitView, Group::View, "Frame the scene", "Moves the eye so that the whole scene is seen.", key(Key::F)),
    info(Act::LookThrough, Group::View, "Look through the photo's camera", "Puts the eye where the chosen photo was taken, or back.", key(Key::C)),
    info(Act::NextView, Group::View, "Next photo", "Chooses the next photo.", key(Key::CloseBracket)),
    info(Act::PreviousView, Group::View, "Previous photo", "Chooses the photo before.", key(Key::OpenBracket)),
    info(Act::LeaveOut, Group::View, "Leave the photo out", "Keeps the chosen photo out of the fit, or takes it in again.", key(Key::X)),
    info(Act::ShowPhoto, Group::View, "Photo over the stage", "Shows the photo over the stage, from its own camera. Holding Shift shows it for a moment.", key(Key::G)),
    info(Act::WipePhoto, Group::View, "Wipe photo against stage", "Photo on the left, stage on the right; drag the line.", key(Key::W)),
    info(Act::ErrorOverlay, Group::View, "Error of the photos", "Colours the surface by the error of the photos, or goes back.", key(Key::O)),
    info(Act::Traced, Group::View, "Path-traced preview", "Refines the stage by path tracing, with shadows and interreflection, while nothing moves.", key(Key::T)),
    info(Act::Frustums, Group::View, "Cameras", "Shows where the photos were taken.", key(Key::V)),
    info(Act::Thumbnails, Group::View, "Photos on the cameras", "Shows small photos on the cameras.", with(SHIFT, Key::V)),
    info(Act::ChartBorders, Group::View, "Chart borders", "Draws the borders of the charts on the maps.", key(Key::B)),
    info(Act::LayerLit, Group::View, "Lit", "Shows the surface in the chosen light.", key(Key::Num1)),
    info(Act::LayerDiffuse, Group::View, "Diffuse", "Shows the diffuse reflectance.", key(Key::Num2)),
    info(Act::LayerSpecular, Group::View, "Specular", "Shows the specular reflectance F0.", key(Key::Num3)),
    info(Act::LayerRoughness, Group::View, "Roughness", "Shows the roughness, the square of the microfacet width.", key(Key::Num4)),
    info(Act::LayerNormal, Group::View, "Normal", "Shows the direction of the surface.", key(Key::Num5)),
    info(Act::LayerPhotoError, Group::View, "Photo error", "Shows the root mean square error over the photos that see each texel.", key(Key::Num6)),
    info(Act::LayerTimesSeen, Group::View, "Times seen", "Shows how many photos see each texel.", key(Key::Num7)),
    info(Act::LayerCoverage, Group::View, "Coverage", "Shows the share of the photos that see each texel.", key(Key::Num9)),
    info(Act::LayerDisagreement, Group::View, "Disagreement of the photos", "Shows where the gradients of different photos pull apart.", key(Key::Num8)),
    info(Act::LayerDiffuseDeviation, Group::View, "Uncertainty of diffuse", "Shows the standard deviation of each texel's diffuse reflectance, as the solver tells it.", None),
    info(Act::LayerSpecularDeviation, Group::View, "Uncertainty of specular", "Shows the standard deviation of each texel's specular reflectance, as the solver tells it.", None),
    info(Act::LayerRoughnessDeviation, Group::View, "Uncertainty of roughness", "Shows the standard deviation of each texel's roughness, as the solver tells it.", None),
    info(Act::LayerLobeSharing, Group::View, "Texels that share a lobe", "Shows how many texels the solver gave the same specular lobe.", None),
    info(Act::LayerChoice, Group::View, "Lobes that are needed", "Shows what views that took no part in the solver's maps chose: no lobe, one a region, or lobes of their own.", None),
    info(Act::SurfaceLayers, Group::View, "Measure photo error", "Renders every photo again and spreads its error over the surface.", None),

    info(Act::ExposureUp, Group::Display, "Brighter", "Raises the exposure by a quarter of a stop.", key(Key::E)),
    info(Act::ExposureDown, Group::Display, "Darker", "Lowers the exposure by a quarter of a stop.", with(SHIFT, Key::E)),
    info(Act::ExposureAuto, Group::Display, "Measure exposure", "Brings the bright end of the chosen photo into range.", key(Key::N)),
    info(Act::ResetDisplay, Group::Display, "Reset display", "Exposure 0, sRGB, no marks.", key(Key::R)),
    info(Act::NextCurve, Group::Display, "Next tone curve", "Goes through sRGB, filmic and linear.", key(Key::K)),
    info(Act::FalseColour, Group::Display, "False colour", "Shows luminance by a colour scale.", key(Key::L)),
    info(Act::Stripes, Group::Display, "Clipping stripes", "Marks what is too bright or black.", key(Key::Z)),

    info(Act::NextLight, Group::Light, "Next light", "Lights the stage by the next light of the shelf.", key(Key::ArrowRight)),
    info(Act::PreviousLight, Group::Light, "Previous light", "Lights the stage by the light before.", key(Key::ArrowLeft)),
    info(Act::FittedLight, Group::Light, "Fitted light", "Lights the stage by the light that was fitted.", key(Key::Home)),
    info(Act::SecondLight, Group::Light, "Two lights side by side", "Shows a second light beside a line that can be dragged.", key(Key::M)),
    info(Act::TurnLightLeft, Group::Light, "Turn light left", "Turns the light by 15 degrees. Shift and drag on the stage turns it freely.", with(SHIFT, Key::ArrowLeft)),
    info(Act::TurnLightRight, Group::Light, "Turn light right", "Turns the light by 15 degrees the other way.", with(SHIFT, Key::ArrowRight)),
    info(Act::AddLight, Group::Light, "Add light…", "Puts an HDR map on the shelf.", with(CTRL, Key::L)),
    info(Act::LightStrip, Group::Light, "Strip of lights", "Shows the stage's view, path traced, under every light of the shelf.", key(Key::Y)),
    info(Act::LightBackground, Group::Light, "Light as background", "Shows the light behind the surface.", key(Key::H)),

    info(Act::ObjectWorkspace, Group::Object, "Object mode", "Light and measured reflectance from photos of one object.", key(Key::F3)),
    info(Act::SceneWorkspace, Group::Object, "Scene mode", "Maps and light from photos of a place.", key(Key::F2)),
    info(Act::OpenPhoto, Group::Object, "Add photo of an object…", "Adds a photo of one object to those that light and reflectance are estimated from.", with(CTRL_SHIFT, Key::O)),
    info(Act::ObjectStart, Group::Object, "Estimate light and reflectance", "Estimates what lit the object and what it is made of.", with(CTRL, Key::E)),
    info(Act::ObjectStop, Group::Object, "Stop estimation", "Ends the estimation within a step; what was reached is written.", with(CTRL_SHIFT, Key::E)),
    info(Act::ObjectRelight, Group::Object, "Relight the object", "Shows object and sphere under every light of the shelf.", None),
    info(Act::ObjectSave, Group::Object, "Save result to…", "Writes the result once more, to another folder.", None),
    info(Act::ObjectReport, Group::Object, "Show the object's report", "Opens the report of the estimation in the browser.", None),
    info(Act::OpenMaterial, Group::Object, "Open measured material…", "Shows lobes and sphere of a table in MERL's format, or of an estimated reflectance.", with(CTRL_SHIFT, Key::M)),
    info(Act::NextMaterial, Group::Object, "Next material", "Shows the next material of the library.", with(CTRL, Key::ArrowRight)),
    info(Act::PreviousMaterial, Group::Object, "Previous material", "Shows the material before.", with(CTRL, Key::ArrowLeft)),
    info(Act::PanelObject, Group::Object, "Panel: object", "Shows what is estimated, and from what.", None),
    info(Act::PanelObjectPicture, Group::Object, "Panel: re-render", "Shows the photo of the object beside its re-render.", None),
    info(Act::PanelReflectance, Group::Object, "Panel: reflectance", "Shows lobes and sphere of the estimated reflectance.", None),
    info(Act::PanelObjectLight, Group::Object, "Panel: estimated light", "Shows the light that was estimated from the object.", None),
    info(Act::PanelRelit, Group::Object, "Panel: relit", "Shows the object under the lights of the shelf.", None),
    info(Act::PanelObjective, Group::Object, "Panel: objective", "Shows the terms of the objective over the steps.", None),
    info(Act::PanelStarts, Group::Object, "Panel: starts", "Shows which starts explain the photo as well, and what the photo leaves open.", None),
    info(Act::PanelMaterials, Group::Object, "Panel: materials", "Shows a sphere of every material of the library.", key(Key::F4)),
    info(Act::PanelMaterialMap, Group::Object, "Panel: map of codes", "Shows the map of the materials' codes.", None),
    info(Act::PanelMaterial, Group::Object, "Panel: material", "Shows lobes and sphere of the chosen material.", None),

    info(Act::Palette, Group::Window, "All acts…", "Finds an act by its name.", with(CTRL, Key::K)),
    info(Act::Help, Group::Window, "Keys and help", "Lists every act and its key.", key(Key::F1)),
    info(Act::NextTheme, Group::Window, "Next theme", "Goes through dark, light, high contrast and as the system.", with(CTRL_SHIFT, Key::T)),
    info(Act::ZoomIn, Group::Window, "Larger interface", "Makes text and controls larger.", with(CTRL, Key::Plus)),
    info(Act::ZoomOut, Group::Window, "Smaller interface", "Makes text and controls smaller.", with(CTRL, Key::Minus)),
    info(Act::ZoomReset, Group::Window, "Interface at its own size", "Text and controls as the system says.", with(CTRL, Key::Num0)),
    info(Act::HideInterface, Group::Window, "Stage alone", "Hides everything but the stage, or brings it back.", with(SHIFT, Key::Tab)),
    info(Act::ResetLayout, Group::Window, "Reset layout", "Puts all panels back where they were at first.", None),
    info(Act::PanelFit, Group::Window, "Panel: fit", "Shows the controls of the fit.", with(CTRL, Key::Num1)),
    info(Act::PanelViews, Group::Window, "Panel: photos", "Shows the table of photos.", with(CTRL, Key::Num2)),
    info(Act::PanelStage, Group::Window, "Panel: stage", "Shows the stage.", with(CTRL, Key::Num3)),
    info(Act::PanelPhoto, Group::Window, "Panel: photo", "Shows the chosen photo beside its render.", with(CTRL, Key::Num4)),
    info(Act::PanelMaps, Group::Window, "Panel: maps", "Shows the maps on the atlas.", with(CTRL, Key::Num5)),
    info(Act::PanelLight, Group::Window, "Panel: light", "Shows the fitted environment.", with(CTRL, Key::Num6)),
    info(Act::PanelRelight, Group::Window, "Panel: relight", "Shows the shelf of lights.", with(CTRL, Key::Num7)),
    info(Act::PanelRecord, Group::Window, "Panel: texel", "Shows all that is known of the texel under the cursor.", with(CTRL, Key::Num8)),
    info(Act::PanelCurves, Group::Window, "Panel: curves", "Shows the loss curves.", with(CTRL, Key::Num9)),
    info(Act::PanelMessages, Group::Window, "Panel: messages", "Shows what was noticed.", None),
    info(Act::PanelScores, Group::Window, "Panel: scores", "Shows the errors of a finished run, also in light it was not fitted to.", None),
];

impl Act {
    /// What is known of the act.
    pub fn info(self) -> &'static ActInfo {
        // A test holds that every act is in the list; the first entry stands in for one that is not.
        LIST.iter().find(|info| info.act == self).unwrap_or(&LIST[0])
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_act_stands_in_the_list_once_and_no_key_twice() {
        // The last act of the enumeration tells how many there are.
        assert_eq!(LIST.len(), Act::PanelScores as usize + 1);
        let acts: HashSet<Act> = LIST.iter().map(|info| info.act).collect();
        assert_eq!(acts.len(), LIST.len());
        let names: HashSet<&str> = LIST.iter().map(|info| info.name).collect();
        assert_eq!(names.len(), LIST.len());
        let mut keys = HashSet::new();
        for info in LIST {
            if let Some(shortcut) = info.shortcut {
                assert!(keys.insert((format!("{:?}", shortcut.modifiers), shortcut.logical_key)), "{}", info.name);
            }
        }
    }

    #[test]
    fn labels_and_helps_are_written_alike() {
        for info in LIST {
            assert!(!info.name.ends_with('.') && !info.name.is_empty(), "{}", info.name);
            assert!(info.help.ends_with('.'), "{}", info.help);
            assert!(info.name.chars().next().is_some_and(char::is_uppercase), "{}", info.name);
        }
    }
}
