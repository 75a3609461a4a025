//! A run to look at, finished or not.

use super::budget::ENDED_BY_BUDGET;
use super::kept::Kept;
use super::opened_scene::open_scene_of;
use super::prepare::{RunSettings, surface_of};
use super::solver_told::SolverTold;
use super::stages::{OpenStage, Tell, told};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::export::RunFolder;
use crate::fit::{LossRow, Method, checkpoint};
use crate::image::{GreyImage, Image};
use crate::insight::report::data::ReportData;
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::material::texels::maps_from_texels;
use crate::render::Surface;
use crate::scene::Scene;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A run to look at.
pub struct OpenedRun {
    /// Everything it was started with, as last changed.
    pub settings: RunSettings,
    /// The scene; `None` when it cannot be read any more, which a finding then says.
    pub scene: Option<Arc<Scene>>,
    /// The surface with the atlas.
    pub surface: Arc<Surface>,
    /// The maps; of a run that has not ended those of its checkpoint, of the size of its stage.
    pub maps: MaterialMaps,
    /// The light.
    pub environment: Environment,
    /// The loss of every step.
    pub losses: Vec<LossRow>,
    /// The numbers of the report; `None` for a run that has not ended.
    pub report: Option<ReportData>,
    /// In how many photographs each texel was seen; `None` for a run that has not ended.
    pub times_seen: Option<GreyImage>,
    /// What the solver tells beside maps and light; empty for a run that has not ended, and under Adam.
    pub told: SolverTold,
    /// What could not be opened beside that.
    pub findings: Vec<Finding>,
    /// Whether the fit has ended and these are its results; otherwise `resume` goes on.
    pub is_finished: bool,
    /// Whether there is a checkpoint to go on from.
    pub can_resume: bool,
}

/// Opens a run to look at it, finished or not. `moved_scene` is where the scene is now, when it moved.
///
/// # Errors
/// When its settings, its mesh or its maps cannot be read; `Stopped` when the flag is raised.
pub fn view_run(folder: &RunFolder, moved_scene: Option<&Path>, stop: &AtomicBool, tell: Tell) -> Result<OpenedRun> {
    view_run_with(folder, moved_scene, &Kept::nowhere(), stop, tell)
}

/// [`view_run`] with what was kept of the scene's opening.
///
/// # Errors
/// As of [`view_run`].
pub fn view_run_with(
    folder: &RunFolder,
    moved_scene: Option<&Path>,
    kept: &Kept,
    stop: &AtomicBool,
    tell: Tell,
) -> Result<OpenedRun> {
    let mut settings: RunSettings = folder.read_settings()?;
    if let Some(path) = moved_scene {
        settings.scene = std::path::absolute(path).unwrap_or_else(|_| path.into());
    }
    let mut findings = Vec::new();
    let checkpoint_path = folder.checkpoint_path();
    let summary = checkpoint_path.is_file().then(|| checkpoint::summary(&checkpoint_path));
    let summary = match summary.transpose() {
        Ok(summary) => summary,
        // Without results there is nothing else to show.
        Err(error) if !folder.has_result() => return Err(error),
        Err(error) => {
            findings.push(finding_of("checkpoint-unreadable", &error));
            None
        }
    };
    // Results of an earlier run in the same folder are older than a checkpoint that has steps to go, but for those of a fit
    // that its budget ended where the checkpoint is.
    let is_under_way = summary.as_ref().is_some_and(|summary| {
        summary.step < summary.steps_total && !(folder.has_result() && ended_by_budget(folder, summary.step))
    });
    let is_finished = folder.has_result() && !is_under_way;
    let can_resume = summary.is_some();
    let losses = match summary {
        Some(summary) => summary.losses,
        None => losses_of(folder, &mut findings),
    };
    let (maps, environment, times_seen, surface) = if is_finished || !can_resume {
        let result = told(OpenStage::Maps, stop, tell, || folder.read_result())?;
        let surface = told(OpenStage::Tracer, stop, tell, || Surface::new(result.mesh))?;
        (result.maps, result.environment, Some(result.times_seen), surface)
    } else {
        let state = told(OpenStage::Maps, stop, tell, || checkpoint::read(&checkpoint_path))?;
        let maps = maps_from_texels(&state.texels, state.map_size, state.map_size);
        let environment = light_of(&state.light, &checkpoint_path)?;
        let surface = told(OpenStage::Tracer, stop, tell, || surface_of(folder))?;
        (maps, environment, None, surface)
    };
    // Files of the solver in the folder of another method are those of an earlier run.
    let told = if is_finished && settings.fit.method == Method::Solver {
        let told =
            SolverTold::read(folder).map_err(|error| findings.push(finding_of("uncertainty-unreadable", &error)));
        told.unwrap_or_default()
    } else {
        SolverTold::default()
    };
    let report = if is_finished {
        folder.read_report_json().map_err(|error| findings.push(finding_of("report-unreadable", &error))).ok()
    } else {
        None
    };
    let scene = match open_scene_to_view(&settings, kept, stop, tell) {
        Ok(scene) => Some(Arc::new(scene)),
        Err(error) if error.kind() == ErrorKind::Stopped => return Err(error),
        Err(error) => {
            findings.push(
                finding_of("scene-not-opened", &error)
                    .remedy("give the new path of the scene; maps and environment can be viewed without it"),
            );
            None
        }
    };
    Ok(OpenedRun {
        settings,
        scene,
        surface: Arc::new(surface),
        maps,
        environment,
        losses,
        report,
        times_seen,
        told,
        findings,
        is_finished,
        can_resume,
    })
}

/// Whether the report is of a fit that its budget ended after so many steps.
fn ended_by_budget(folder: &RunFolder, steps: usize) -> bool {
    let is_cut = |report: ReportData| {
        report.loss_history.len() == steps && report.findings.iter().any(|finding| finding.code == ENDED_BY_BUDGET)
    };
    folder.read_report_json().is_ok_and(is_cut)
}

/// A scene that is only looked at needs no check.
fn open_scene_to_view(settings: &RunSettings, kept: &Kept, stop: &AtomicBool, tell: Tell) -> Result<Scene> {
    if settings.scene.as_os_str().is_empty() {
        return Ok(open_scene_of(settings, kept, stop, tell)?.scene);
    }
    told(OpenStage::Read, stop, tell, || crate::scene::read(&settings.scene, &settings.read))
}

fn light_of(light: &[[f32; 3]], path: &Path) -> Result<Environment> {
    let height = (light.len() / 2).isqrt();
    if height == 0 || 2 * height * height != light.len() {
        return Err(Error::new(ErrorKind::Malformed, "the environment in the checkpoint is not twice as wide as high")
            .at(Place::File(path.into()))
            .remedy("the file is damaged: start the run again, or copy the checkpoint anew"));
    }
    let pixels = light.iter().map(|&radiance| glam::Vec3::from_array(radiance)).collect();
    Ok(Environment { radiance: Image::from_pixels(2 * height, height, pixels) })
}

fn losses_of(folder: &RunFolder, findings: &mut Vec<Finding>) -> Vec<LossRow> {
    let rows = match folder.read_loss() {
        Ok(rows) => rows,
        Err(error) => {
            findings.push(finding_of("loss-unreadable", &error));
            return Vec::new();
        }
    };
    let row = |row: crate::export::LossRow| LossRow {
        step: row.step as usize,
        stage: row.stage,
        seconds: row.seconds,
        loss: row.loss,
        image_loss: row.image_loss,
        consistency: row.mvcl,
        surface_rmse: row.surface_rmse,
        held_out_rmse: row.held_out_rmse,
    };
    rows.into_iter().map(row).collect()
}

fn finding_of(code: &'static str, error: &Error) -> Finding {
    Finding::new(Severity::Warning, code, error.message()).at(error.place().clone()).remedy(error.remedy_text())
}
