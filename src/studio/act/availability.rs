//! Whether an act can be done now, and why not.

use super::{Act, Group};
use crate::studio::model::opening::PREPARING_TITLE;
use crate::studio::model::starting::TITLE as STARTING_TITLE;
use crate::studio::model::{FitStatus, Model, Workspace};

/// `Ok` when the act can be done; otherwise why not, as a short sentence without a full stop.
pub fn availability(act: Act, model: &Model) -> Result<(), &'static str> {
    let need = |met: bool, why: &'static str| if met { Ok(()) } else { Err(why) };
    let project = model.project.as_ref();
    let has_views = project.is_some_and(|project| project.view_count() > 0);
    let has_maps = project.is_some_and(|project| project.maps.is_some());
    let status = &model.fit.status;
    if model.workspace == Workspace::Object && is_of_scenes(act) {
        return Err("this is for scenes: go to scene mode first");
    }
    match act {
        Act::OpenFolder
        | Act::OpenDemo
        | Act::Quit
        | Act::Palette
        | Act::Help
        | Act::NextTheme
        | Act::ZoomIn
        | Act::ZoomOut
        | Act::ZoomReset
        | Act::AddLight
        | Act::ExposureUp
        | Act::ExposureDown
        | Act::ResetDisplay
        | Act::NextCurve
        | Act::FalseColour
        | Act::Stripes
        | Act::OpenPhoto
        | Act::OpenMaterial
        | Act::PanelObject
        | Act::PanelObjectPicture
        | Act::PanelReflectance
        | Act::PanelObjectLight
        | Act::PanelRelit
        | Act::PanelObjective
        | Act::PanelStarts
        | Act::PanelMaterials
        | Act::PanelMaterialMap
        | Act::PanelMaterial => Ok(()),
        Act::SceneWorkspace => need(model.workspace == Workspace::Object, "this is scene mode"),
        Act::ObjectWorkspace => need(model.workspace == Workspace::Scene, "this is object mode"),
        Act::ObjectStart => {
            need(!model.object.status.is_live(), "an estimation is in progress")?;
            need(!model.edits.object.photos.is_empty(), "add a photo of an object first")?;
            let outcome = model.object.outcome.as_ref();
            need(outcome.is_none_or(|own| own.folder.is_some()), "the last result is not on disk yet: save it first")
        }
        Act::ObjectStop => need(model.object.status.is_live(), "no estimation is in progress"),
        Act::ObjectRelight | Act::ObjectSave => need(model.object.outcome.is_some(), "nothing was estimated yet"),
        Act::ObjectReport => {
            let folder = model.object.outcome.as_ref().and_then(|own| own.folder.as_ref());
            need(folder.is_some(), "the report is written when an estimation is done")
        }
        Act::NextMaterial | Act::PreviousMaterial => {
            need(model.materials.library.is_some(), "show the materials first")
        }
        Act::ExposureAuto if model.workspace == Workspace::Object => {
            need(!model.object.photos.is_empty(), "no photo was read yet")
        }
        Act::ResetLayout if model.workspace == Workspace::Object => Ok(()),
        Act::PanelMessages if model.workspace == Workspace::Object => Ok(()),
        Act::Undo => need(model.history.can_undo(&model.edits), "nothing was changed"),
        Act::Redo => need(model.history.can_redo(&model.edits), "nothing was taken back"),
        Act::Start => {
            need(project.is_some(), "open a scene first")?;
            need(has_views, "this run's scene is not here, so there are no photos to fit")?;
            let why = match model.tasks.is_running(PREPARING_TITLE) {
                true => "the scene is still being prepared",
                false => "the scene was not prepared to its end: open it again",
            };
            need(project.is_some_and(|project| project.surface.is_some()), why)?;
            need(!status.is_live(), "a fit is in progress")?;
            need(!model.tasks.is_running(STARTING_TITLE), "the fit is about to start")
        }
        Act::PauseOrGoOn => {
            need(matches!(status, FitStatus::Running | FitStatus::Pausing | FitStatus::Paused), "no fit is in progress")
        }
        Act::Stop => need(status.is_live() && *status != FitStatus::Stopping, "no fit is in progress"),
        Act::StepOnce => need(*status == FitStatus::Paused, "pause the fit first"),
        Act::Checkpoint => need(matches!(status, FitStatus::Running | FitStatus::Paused), "no fit is in progress"),
        Act::OpenReport => {
            let there = model.fit.folder.as_ref().is_some_and(|folder| folder.report_html_path().is_file());
            need(there, "the report is written when a fit is done")
        }
        Act::SavePicture | Act::SaveTurntable | Act::SaveLightStrip | Act::LightStrip => need(
            has_maps && project.is_some_and(|project| project.surface.is_some()),
            "there are no maps yet: start a fit",
        ),
        Act::LookThrough
        | Act::NextView
        | Act::PreviousView
        | Act::ShowPhoto
        | Act::WipePhoto
        | Act::ExposureAuto
        | Act::Frustums
        | Act::Thumbnails
        | Act::LeaveOut => need(has_views, "there are no photos"),
        Act::ErrorOverlay | Act::LayerPhotoError | Act::LayerCoverage | Act::LayerDisagreement | Act::SurfaceLayers => {
            need(has_views, "there are no photos")?;
            need(has_maps, "there are no maps yet: start a fit")
        }
        Act::LayerDiffuse
        | Act::LayerSpecular
        | Act::LayerRoughness
        | Act::LayerTimesSeen
        | Act::LayerDiffuseDeviation
        | Act::LayerSpecularDeviation
        | Act::LayerRoughnessDeviation
        | Act::LayerLobeSharing
        | Act::LayerChoice => need(has_maps, "there are no maps yet: start a fit"),
        Act::FittedLight => need(has_maps, "there is no fitted light yet"),
        Act::ChartBorders => {
            need(project.is_some_and(|project| project.surface.is_some()), "the atlas is not made yet")
        }
        _ => need(project.is_some(), "open a scene first"),
    }
}

/// Whether an act means nothing in object mode, so that its key there is not pressed in vain.
fn is_of_scenes(act: Act) -> bool {
    let group = act.info().group;
    let in_group = matches!(group, Group::Fit | Group::View) || group == Group::Light && act != Act::AddLight;
    let further = [Act::SavePicture, Act::SaveTurntable, Act::SaveLightStrip, Act::OpenReport, Act::HideInterface];
    in_group || further.contains(&act)
}
