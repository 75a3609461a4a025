//! Of each act its menu, its name, what it does and its key.

use super::Act;
use egui::{Key, KeyboardShortcut, Modifiers};

/// The menu an act stands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Opening, saving, leaving.
    File,
    /// Undo and redo.
    Edit,
    /// The fit.
    Fit,
    /// What the viewport shows.
    View,
    /// Exposure, curve, marks.
    Display,
    /// Environments to look at the materials in.
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
        (Group::Light, "Environment"),
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
    info(Act::OpenFolder, Group::File, "Open…", "Open a scene folder or a run folder.", with(CTRL, Key::O)),
    info(Act::Import, Group::File, "Import capture…", "Turn a folder of photos, mesh and cameras into a scene; what is missing is told.", with(CTRL, Key::I)),
    info(Act::OpenDemo, Group::File, "Open the built-in demo", "Render photos of a small built-in scene with known materials, and open it.", with(CTRL, Key::D)),
    info(Act::CloseProject, Group::File, "Close project", "Return to the start page. A running fit is stopped with a checkpoint.", with(CTRL, Key::W)),
    info(Act::Export, Group::File, "Export…", "Write maps, mesh and environment for other programs: GLB, USD, Mitsuba, Blender, MaterialX, textures, a web page.", with(CTRL_SHIFT, Key::X)),
    info(Act::SavePicture, Group::File, "Render image…", "Path-trace the viewport under the chosen environment and save it as PNG or EXR.", with(CTRL, Key::S)),
    info(Act::SaveTurntable, Group::File, "Render turntable…", "Render images around the scene under the chosen environment.", None),
    info(Act::SaveFitFilm, Group::File, "Save film of the fit…", "Film the viewport as the fit went on: the kept states of the timeline, relit under the chosen environment.", None),
    info(Act::SaveLightStrip, Group::File, "Export contact sheet…", "Render the viewport under every environment of the library.", None),
    info(Act::OpenReport, Group::File, "Open report", "Open the run's report in the browser.", None),
    info(Act::OpenRunFolder, Group::File, "Open run folder", "Open the folder with the results of the run.", None),
    info(Act::Quit, Group::File, "Quit", "Quit Patina. A running fit is stopped with a checkpoint.", with(CTRL, Key::Q)),

    info(Act::Undo, Group::Edit, "Undo", "Undo the last change of a setting, an environment or the display.", with(CTRL, Key::Z)),
    info(Act::Redo, Group::Edit, "Redo", "Redo the change that was undone.", with(CTRL_SHIFT, Key::Z)),

    info(Act::Start, Group::Fit, "Start fit", "Fit the maps and the environment to the photos.", with(CTRL, Key::Enter)),
    info(Act::PauseOrGoOn, Group::Fit, "Pause / Resume", "Pause the fit after the current step, or resume it.", key(Key::Space)),
    info(Act::Stop, Group::Fit, "Stop fit", "Stop the fit at once; a checkpoint keeps the progress.", with(CTRL, Key::Period)),
    info(Act::StepOnce, Group::Fit, "Single step", "Run one step of a paused fit.", key(Key::Period)),
    info(Act::Checkpoint, Group::Fit, "Save checkpoint", "Save the state of the fit now.", with(CTRL_SHIFT, Key::S)),
    info(Act::QueueScene, Group::Fit, "Add to queue…", "Fit a scene after those that are queued before it.", None),

    info(Act::FitView, Group::View, "Frame all", "Frame the object that the photos show.", key(Key::F)),
    info(Act::NavigatePatina, Group::View, "Navigate as in Patina", "Drag or middle-drag to orbit, right-drag to pan, wheel to zoom.", None),
    info(Act::NavigateBlender, Group::View, "Navigate as in Blender", "Middle-drag to orbit, with Shift to pan, with Ctrl to zoom.", None),
    info(Act::NavigateMaya, Group::View, "Navigate as in Maya", "Alt and drag to orbit, Alt and middle-drag to pan, Alt and right-drag to zoom.", None),
    info(Act::LookThrough, Group::View, "Camera view", "View through the camera of the chosen photo, or return.", key(Key::C)),
    info(Act::NextView, Group::View, "Next photo", "Choose the next photo.", key(Key::CloseBracket)),
    info(Act::PreviousView, Group::View, "Previous photo", "Choose the previous photo.", key(Key::OpenBracket)),
    info(Act::LeaveOut, Group::View, "Exclude photo from fit", "Exclude the chosen photo from the fit, or include it again.", key(Key::X)),
    info(Act::ShowPhoto, Group::View, "Overlay photo", "Overlay the photo in its camera view. Hold Shift to peek.", key(Key::G)),
    info(Act::WipePhoto, Group::View, "Photo / render wipe", "Photo on the left, render on the right; drag the divider.", key(Key::W)),
    info(Act::CompareRun, Group::View, "Compare with another run…", "Hold the render against that of another run of the scene, in the Photo panel.", None),
    info(Act::ErrorOverlay, Group::View, "Show residuals", "Colour the surface by the residual of the photos, or return.", key(Key::O)),
    info(Act::Traced, Group::View, "Path-traced preview", "Refine the viewport by path tracing, with shadows and interreflection, while nothing moves.", key(Key::T)),
    info(Act::Frustums, Group::View, "Show cameras", "Show where the photos were taken.", key(Key::V)),
    info(Act::Thumbnails, Group::View, "Show camera thumbnails", "Show small photos on the cameras.", with(SHIFT, Key::V)),
    info(Act::ChartBorders, Group::View, "Show UV islands", "Draw the UV seams on the maps.", key(Key::B)),
    info(Act::LayerPhotos, Group::View, "Projected photos", "Show the photos projected onto the surface: the mean of those that see it.", key(Key::Num0)),
    info(Act::LayerCrossfade, Group::View, "Photo – albedo – relit", "Fade from the projected photos to the diffuse reflectance and on to the relit surface, by a slider.", with(SHIFT, Key::Num0)),
    info(Act::LayerLit, Group::View, "Shaded", "Show the surface under the chosen environment.", key(Key::Num1)),
    info(Act::LayerDiffuse, Group::View, "Diffuse", "Show the diffuse reflectance.", key(Key::Num2)),
    info(Act::LayerSpecular, Group::View, "Specular", "Show the specular reflectance F0.", key(Key::Num3)),
    info(Act::LayerRoughness, Group::View, "Roughness", "Show the perceptual roughness, the square root of the microfacet width.", key(Key::Num4)),
    info(Act::LayerNormal, Group::View, "Surface normal", "Show the surface normal.", key(Key::Num5)),
    info(Act::LayerPhotoError, Group::View, "Residual", "Show the root mean square residual over the photos that see each texel.", key(Key::Num6)),
    info(Act::LayerTimesSeen, Group::View, "View count", "Show how many photos see each texel.", key(Key::Num7)),
    info(Act::LayerCoverage, Group::View, "Coverage", "Show the share of the photos that see each texel.", key(Key::Num9)),
    info(Act::LayerDisagreement, Group::View, "Multi-view inconsistency", "Show where the gradients of different photos disagree.", key(Key::Num8)),
    info(Act::LayerDiffuseDeviation, Group::View, "Std. dev. (diffuse)", "Show the posterior standard deviation of the diffuse reflectance, as the solver reports it.", None),
    info(Act::LayerSpecularDeviation, Group::View, "Std. dev. (specular)", "Show the posterior standard deviation of the specular reflectance, as the solver reports it.", None),
    info(Act::LayerRoughnessDeviation, Group::View, "Std. dev. (roughness)", "Show the posterior standard deviation of the roughness, as the solver reports it.", None),
    info(Act::LayerLobeSharing, Group::View, "Lobe cluster size", "Show how many texels share the same specular lobe.", None),
    info(Act::LayerChoice, Group::View, "Lobe model", "Show which model the held-out views selected: no lobe, a shared lobe, or lobes of their own.", None),
    info(Act::SurfaceLayers, Group::View, "Compute residuals", "Render every photo again and project its residual onto the surface.", None),

    info(Act::ExposureUp, Group::Display, "Increase exposure", "Increase the exposure by 0.25 EV.", key(Key::E)),
    info(Act::ExposureDown, Group::Display, "Decrease exposure", "Decrease the exposure by 0.25 EV.", with(SHIFT, Key::E)),
    info(Act::ExposureAuto, Group::Display, "Auto exposure", "Bring the highlights of the chosen photo into range.", key(Key::N)),
    info(Act::ResetDisplay, Group::Display, "Reset display", "Exposure 0 EV, sRGB, no overlays.", key(Key::R)),
    info(Act::NextCurve, Group::Display, "Cycle tone mapping", "Cycle through sRGB, filmic and linear.", key(Key::K)),
    info(Act::FalseColour, Group::Display, "False colour", "Show luminance by a colour scale.", key(Key::L)),
    info(Act::Stripes, Group::Display, "Clipping warning (zebra)", "Mark pixels that are clipped or black.", key(Key::Z)),

    info(Act::NextLight, Group::Light, "Next environment", "Light the viewport by the next environment of the library.", key(Key::ArrowRight)),
    info(Act::PreviousLight, Group::Light, "Previous environment", "Light the viewport by the previous environment.", key(Key::ArrowLeft)),
    info(Act::FittedLight, Group::Light, "Estimated environment", "Light the viewport by the estimated environment.", key(Key::Home)),
    info(Act::SecondLight, Group::Light, "Compare environments (split)", "Show a second environment beside a divider.", key(Key::M)),
    info(Act::TurnLightLeft, Group::Light, "Rotate environment +15°", "Rotate the environment about the up axis. Shift-drag in the viewport rotates it freely.", with(SHIFT, Key::ArrowLeft)),
    info(Act::TurnLightRight, Group::Light, "Rotate environment −15°", "Rotate the environment about the up axis, the other way.", with(SHIFT, Key::ArrowRight)),
    info(Act::AddLight, Group::Light, "Import HDRI…", "Add an HDRI to the library of environments.", with(CTRL, Key::L)),
    info(Act::AddLightFolder, Group::Light, "Import folder of HDRIs…", "Add every HDRI of a folder to the library of environments.", None),
    info(Act::LightStrip, Group::Light, "Lighting contact sheet", "Path-trace the viewport under every environment of the library.", key(Key::Y)),
    info(Act::LightBackground, Group::Light, "Show environment as background", "Show the environment behind the surface.", key(Key::H)),

    info(Act::ObjectWorkspace, Group::Object, "Single object", "Estimate environment and measured reflectance from photos of a single object.", key(Key::F3)),
    info(Act::SceneWorkspace, Group::Object, "Scene", "Estimate maps and environment from photos of a scene.", key(Key::F2)),
    info(Act::OpenPhoto, Group::Object, "Add photo of an object…", "Add a photo of the object to those used for the estimation.", with(CTRL_SHIFT, Key::O)),
    info(Act::ObjectStart, Group::Object, "Estimate", "Estimate the environment and the reflectance of the object.", with(CTRL, Key::E)),
    info(Act::ObjectStop, Group::Object, "Stop estimation", "Stop the estimation within a step; the result so far is written.", with(CTRL_SHIFT, Key::E)),
    info(Act::ObjectRelight, Group::Object, "Relight the object", "Show object and sphere under every environment of the library.", None),
    info(Act::ObjectSave, Group::Object, "Save result as…", "Write the result to another folder.", None),
    info(Act::ObjectReport, Group::Object, "Open the object's report", "Open the report of the estimation in the browser.", None),
    info(Act::OpenMaterial, Group::Object, "Open measured material…", "Show BRDF lobes and preview sphere of a MERL table, or of an estimated reflectance.", with(CTRL_SHIFT, Key::M)),
    info(Act::NextMaterial, Group::Object, "Next material", "Show the next material of the library.", with(CTRL, Key::ArrowRight)),
    info(Act::PreviousMaterial, Group::Object, "Previous material", "Show the previous material of the library.", with(CTRL, Key::ArrowLeft)),
    info(Act::PanelObject, Group::Object, "Object panel", "Show the inputs of the estimation.", None),
    info(Act::PanelObjectPicture, Group::Object, "Re-render panel", "Show the photo of the object beside its re-render.", None),
    info(Act::PanelReflectance, Group::Object, "Reflectance panel", "Show BRDF lobes and preview sphere of the estimated reflectance.", None),
    info(Act::PanelObjectLight, Group::Object, "Object environment panel", "Show the environment estimated from the object.", None),
    info(Act::PanelRelit, Group::Object, "Relit panel", "Show the object under the environments of the library.", None),
    info(Act::PanelObjective, Group::Object, "Objective panel", "Show the terms of the objective over the steps.", None),
    info(Act::PanelStarts, Group::Object, "Initializations panel", "Show which initializations explain the photo, and what the photo leaves open.", None),
    info(Act::PanelMaterials, Group::Object, "Materials panel", "Show a sphere of every material of the library.", key(Key::F4)),
    info(Act::PanelMaterialMap, Group::Object, "Latent map panel", "Show the latent map of the materials.", None),
    info(Act::PanelMaterial, Group::Object, "Material panel", "Show BRDF lobes and preview sphere of the chosen material.", None),

    info(Act::Palette, Group::Window, "Command palette…", "Find a command by its name.", with(CTRL, Key::K)),
    info(Act::Help, Group::Window, "Keyboard shortcuts", "List every command and its key.", key(Key::F1)),
    info(Act::Guide, Group::Window, "User guide", "Open the guide: capture, file formats, the window, the objective, limits.", with(SHIFT, Key::F1)),
    info(Act::NextTheme, Group::Window, "Cycle theme", "Cycle through dark, light, high contrast and system.", with(CTRL_SHIFT, Key::T)),
    info(Act::ZoomIn, Group::Window, "Zoom in", "Enlarge text and controls.", with(CTRL, Key::Plus)),
    info(Act::ZoomOut, Group::Window, "Zoom out", "Shrink text and controls.", with(CTRL, Key::Minus)),
    info(Act::ZoomReset, Group::Window, "Reset UI scale", "Scale text and controls as the system does.", with(CTRL, Key::Num0)),
    info(Act::HideInterface, Group::Window, "Maximize viewport", "Hide everything but the viewport, or bring it back.", with(SHIFT, Key::Tab)),
    info(Act::ResetLayout, Group::Window, "Reset layout", "Restore the default arrangement of the panels.", None),
    info(Act::PanelFit, Group::Window, "Fit panel", "Show the controls and settings of the fit.", with(CTRL, Key::Num1)),
    info(Act::PanelViews, Group::Window, "Photos panel", "Show the table of photos.", with(CTRL, Key::Num2)),
    info(Act::PanelStage, Group::Window, "Viewport panel", "Show the viewport.", with(CTRL, Key::Num3)),
    info(Act::PanelPhoto, Group::Window, "Photo panel", "Show the chosen photo beside its render.", with(CTRL, Key::Num4)),
    info(Act::PanelMaps, Group::Window, "Maps panel", "Show the maps on the UV atlas.", with(CTRL, Key::Num5)),
    info(Act::PanelLight, Group::Window, "Environment panel", "Show the estimated environment.", with(CTRL, Key::Num6)),
    info(Act::PanelRelight, Group::Window, "Relight panel", "Show the library of environments.", with(CTRL, Key::Num7)),
    info(Act::PanelRecord, Group::Window, "Texel panel", "Show everything known about the texel under the cursor.", with(CTRL, Key::Num8)),
    info(Act::PanelCurves, Group::Window, "Curves panel", "Show the error curves.", with(CTRL, Key::Num9)),
    info(Act::PanelMessages, Group::Window, "Messages panel", "Show findings, warnings and errors.", None),
    info(Act::PanelScores, Group::Window, "Scores panel", "Show the errors of a finished run, also under novel lighting.", None),
];

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
