//! Whether an act can be done now, and why not.

use super::{Act, Group};
use crate::studio::model::tasks::TaskKind;
use crate::studio::model::{FitStatus, Model};
use crate::studio::workspace::Workspace;

/// `Ok` when the act can be done; otherwise why not, as a short sentence without a full stop.
pub fn availability(act: Act, model: &Model) -> Result<(), &'static str> {
    let need = |met: bool, why: &'static str| if met { Ok(()) } else { Err(why) };
    let project = model.project.as_ref();
    let has_views = project.is_some_and(|project| project.view_count() > 0);
    let has_maps = project.is_some_and(|project| project.maps.is_some());
    let status = &model.fit.status;
    if model.workspace == Workspace::Object && is_of_scenes(act) {
        return Err("this is for scenes: switch to the Scene workspace first");
    }
    match act {
        Act::OpenFolder
        | Act::QueueScene
        | Act::Import
        | Act::OpenDemo
        | Act::Quit
        | Act::Palette
        | Act::Help
        | Act::Guide
        | Act::NextTheme
        | Act::ZoomIn
        | Act::ZoomOut
        | Act::ZoomReset
        | Act::AddLight
        | Act::AddLightFolder
        | Act::ExposureUp
        | Act::ExposureDown
        | Act::ResetDisplay
        | Act::NextCurve
        | Act::FalseColour
        | Act::Stripes
        | Act::NavigatePatina
        | Act::NavigateBlender
        | Act::NavigateMaya
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
        Act::SceneWorkspace => need(model.workspace == Workspace::Object, "already in the Scene workspace"),
        Act::ObjectWorkspace => need(model.workspace == Workspace::Scene, "already in the Single object workspace"),
        Act::ObjectStart => {
            need(!model.object.status.is_live(), "an estimation is running")?;
            need(!model.edits.object.photos.is_empty(), "add a photo of the object first")?;
            let outcome = model.object.outcome.as_ref();
            need(outcome.is_none_or(|own| own.folder.is_some()), "the last result is not on disk yet: save it first")
        }
        Act::ObjectStop => need(model.object.status.is_live(), "no estimation is running"),
        Act::ObjectRelight | Act::ObjectSave => need(model.object.outcome.is_some(), "no result yet"),
        Act::ObjectReport => {
            let folder = model.object.outcome.as_ref().and_then(|own| own.folder.as_ref());
            need(folder.is_some(), "the report is written when the estimation is finished")
        }
        Act::NextMaterial | Act::PreviousMaterial => {
            need(model.materials.library.is_some(), "open the Materials panel first")
        }
        Act::ExposureAuto if model.workspace == Workspace::Object => {
            need(!model.object.photos.is_empty(), "no photo yet")
        }
        Act::ResetLayout if model.workspace == Workspace::Object => Ok(()),
        Act::PanelMessages if model.workspace == Workspace::Object => Ok(()),
        Act::Undo => need(model.history.can_undo(&model.edits), "nothing to undo"),
        Act::Redo => need(model.history.can_redo(&model.edits), "nothing to redo"),
        Act::Start => {
            need(project.is_some(), "open a scene first")?;
            need(has_views, "the scene of this run was not found, so there are no photos")?;
            need(!model.start_is_queued, "the fit starts automatically when the scene is ready")?;
            let is_prepared = project.is_some_and(|project| project.surface.is_some());
            need(is_prepared || model.is_preparing(), "preparing the scene was cancelled: open it again")?;
            need(!status.is_live(), "a fit is running")?;
            need(!model.tasks.is_running(&TaskKind::Starting), "the fit is starting")
        }
        Act::PauseOrGoOn => {
            need(matches!(status, FitStatus::Running | FitStatus::Pausing | FitStatus::Paused), "no fit is running")
        }
        Act::Stop if model.start_is_queued || model.tasks.is_running(&TaskKind::Starting) => Ok(()),
        Act::Stop => need(status.is_live() && *status != FitStatus::Stopping, "no fit is running"),
        Act::StepOnce => need(*status == FitStatus::Paused, "pause the fit first"),
        Act::Checkpoint => need(matches!(status, FitStatus::Running | FitStatus::Paused), "no fit is running"),
        Act::OpenReport => {
            let there = model.fit.folder.as_ref().is_some_and(|folder| folder.report_html_path().is_file());
            need(there, "the report is written when the fit is finished")
        }
        Act::OpenRunFolder => {
            let there = model.fit.folder.as_ref().is_some_and(|folder| folder.path().is_dir());
            need(there, "no run yet: start a fit")
        }
        Act::Export => {
            let has_result = model.fit.folder.as_ref().is_some_and(|folder| folder.has_result());
            need(has_result && !status.is_live(), "available when a fit is finished")?;
            need(!model.tasks.is_running(&TaskKind::Exporting), "an export is being written")
        }
        Act::SavePicture | Act::SaveTurntable | Act::SaveLightStrip | Act::LightStrip => {
            need(has_maps && project.is_some_and(|project| project.surface.is_some()), "no maps yet: start a fit")
        }
        Act::SaveFitFilm => {
            need(has_maps && project.is_some_and(|project| project.surface.is_some()), "no maps yet: start a fit")?;
            need(model.timeline.states().len() >= 2, "available once a fit of this window has shown two states")
        }
        Act::LookThrough
        | Act::NextView
        | Act::PreviousView
        | Act::ShowPhoto
        | Act::WipePhoto
        | Act::ExposureAuto
        | Act::Frustums
        | Act::Thumbnails
        | Act::LayerPhotos
        | Act::LeaveOut => need(has_views, "no photos"),
        Act::CompareRun => {
            need(has_views, "no photos")?;
            need(has_maps, "no maps yet: start a fit")
        }
        Act::LayerCrossfade
        | Act::ErrorOverlay
        | Act::LayerPhotoError
        | Act::LayerCoverage
        | Act::LayerDisagreement
        | Act::SurfaceLayers => {
            need(has_views, "no photos")?;
            need(has_maps, "no maps yet: start a fit")
        }
        Act::LayerDiffuse
        | Act::LayerSpecular
        | Act::LayerRoughness
        | Act::LayerTimesSeen
        | Act::LayerDiffuseDeviation
        | Act::LayerSpecularDeviation
        | Act::LayerRoughnessDeviation
        | Act::LayerLobeSharing
        | Act::LayerChoice => need(has_maps, "no maps yet: start a fit"),
        Act::FittedLight => need(has_maps, "no estimated environment yet"),
        Act::ChartBorders => {
            need(project.is_some_and(|project| project.surface.is_some()), "the UV atlas is not ready yet")
        }
        Act::CloseProject
        | Act::FitView
        | Act::Traced
        | Act::LayerLit
        | Act::LayerNormal
        | Act::NextLight
        | Act::PreviousLight
        | Act::SecondLight
        | Act::TurnLightLeft
        | Act::TurnLightRight
        | Act::LightBackground
        | Act::HideInterface
        | Act::ResetLayout
        | Act::PanelFit
        | Act::PanelViews
        | Act::PanelStage
        | Act::PanelPhoto
        | Act::PanelMaps
        | Act::PanelLight
        | Act::PanelRelight
        | Act::PanelRecord
        | Act::PanelCurves
        | Act::PanelMessages
        | Act::PanelScores => need(project.is_some(), "open a scene first"),
    }
}

/// Whether an act means nothing in object mode, so that its key there is not pressed in vain.
fn is_of_scenes(act: Act) -> bool {
    match act.info().group {
        Group::Fit | Group::View => true,
        Group::Light => !matches!(act, Act::AddLight | Act::AddLightFolder),
        Group::File | Group::Window => matches!(
            act,
            Act::Export
                | Act::SavePicture
                | Act::SaveTurntable
                | Act::SaveFitFilm
                | Act::SaveLightStrip
                | Act::OpenReport
                | Act::OpenRunFolder
                | Act::HideInterface
        ),
        Group::Edit | Group::Display | Group::Object => false,
    }
}
