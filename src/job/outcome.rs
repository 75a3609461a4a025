//! What a finished fit leaves behind: maps, scores, pictures, report.

use super::against_truth::truth_errors;
use super::explained;
use super::export::page_of_report;
use super::facts::{describe, loss_rows};
use super::pictures::parameters_of;
use super::prepare::{Prepared, RunSettings, covered, timed};
use super::shown::{ScoredView, exposure_of, go_on, relit_strips, score_views};
use super::solver_told::SolverTold;
use super::{Event, FinishingStage};
use crate::atlas::{dilate, nearest_covered};
use crate::error::Result;
use crate::export::{RunFolder, RunResult};
use crate::fit::views::views_of;
use crate::fit::{Fitter, ViewUse};
use crate::image::{GreyImage, Image};
use crate::insight::report::choice_table::ChoiceTable;
use crate::insight::report::data::{NamedAggregate, ReportData, StageTime, ViewLine};
use crate::insight::report::{ReportImages, write_report};
use crate::insight::scores::{ViewScores, aggregate};
use crate::insight::{capture, coverage, memory};
use crate::material::MaterialMaps;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What a picture without a light is worth on a view.
type Baseline = fn(&ScoredView) -> Option<&ViewScores>;

/// Renders, scores and writes everything into the run folder; returns what the report says. What is wrong with the capture
/// is told on the way, as events.
pub fn write(
    fitter: &Fitter,
    mut prepared: Prepared,
    settings: &RunSettings,
    folder: &RunFolder,
    began: Instant,
    stop: &AtomicBool,
    tell: &dyn Fn(Event),
) -> Result<ReportData> {
    let finishing = |stage: FinishingStage| tell(Event::Finishing(stage));
    let scene = fitter.scene().as_ref();
    let surface = fitter.surface().as_ref();
    let mut timings = std::mem::take(&mut prepared.timings);
    // The clock of the job began after these, and after earlier sessions of a resumed fit.
    let before_job: f64 = timings.iter().filter(|time| time.stage != "fit").map(|time| time.seconds).sum();
    finishing(FinishingStage::Maps);
    let training = views_of(fitter.view_uses(), ViewUse::Training);
    let times_seen =
        timed(&mut timings, "coverage", || coverage::times_seen_by(scene, surface, &training, settings.fit.map_size));
    let covered = covered(surface, settings.fit.map_size);
    let (maps, times_seen) = match fitter.known_maps() {
        // Those that are kept are handed on as they are, with what their own photos have seen of them.
        Some(known) => (known.maps.clone(), known.times_seen.clone()),
        None => (fill_outside(&fitter.maps(), &times_seen, &covered), times_seen),
    };
    let environment = fitter.environment();
    let (mesh, lobe) = (surface.mesh().clone(), fitter.settings().lobe);
    let result = RunResult { maps, environment, mesh, times_seen, lobe };
    timed(&mut timings, "write maps", || folder.write_result(&result))?;
    let told = SolverTold::of(fitter);
    told.write(folder)?;
    folder.write_loss(&loss_rows(fitter.state()))?;

    finishing(FinishingStage::Views);
    let own = parameters_of(&result);
    let views = timed(&mut timings, "score views", || score_views(fitter, surface, &own, settings, stop))?;
    if let Some(finding) = explained::finding(&views) {
        tell(Event::Finding(finding.clone()));
        prepared.findings.push(finding);
    }
    finishing(FinishingStage::Capture);
    let capture = timed(&mut timings, "capture", || capture::check(fitter, stop));
    crate::files::write_bytes(&folder.file(capture::table::FILE), capture::table::to_csv(&capture.views).as_bytes())?;
    for finding in &capture.findings {
        tell(Event::Finding(finding.clone()));
    }
    prepared.findings.extend(capture.findings);
    finishing(FinishingStage::Relighting);
    let (relit, relit_errors) =
        timed(&mut timings, "relight", || relit_strips(fitter, surface, &own, &result, settings, stop))?;
    go_on(stop)?;

    let mut data = describe(fitter, &prepared, settings, &result, &covered);
    let transport = timed(&mut timings, "check of transport", || fitter.transport_error(stop));
    data.scene_facts.extend(told.facts(transport));
    data.capture = capture.views;
    data.objective = fitter.descent().to_vec();
    data.choices = fitter.choices().map(|choices| ChoiceTable::of(choices));
    data.views = views
        .iter()
        .map(|view| {
            let gain = f64::from(fitter.state().log_gains[view.index].exp());
            let line = ViewLine::new(&view.pictures.name, view.pictures.held_out, &view.scores, gain);
            ViewLine { left_out: view.kind == ViewUse::LeftOut, ..line }
        })
        .collect();
    for (name, kind) in [("held-out views", ViewUse::HeldOut), ("training views", ViewUse::Training)] {
        let of_kind: Vec<_> = views.iter().filter(|view| view.kind == kind).collect();
        if !of_kind.is_empty() {
            let score = aggregate(of_kind.iter().map(|view| &view.scores));
            data.aggregates.push(NamedAggregate { name: name.into(), score });
        }
    }
    let baselines: [(&str, Baseline); 2] = [
        ("held-out views, a texture without a light", |view| view.of_texture.as_ref()),
        ("held-out views, the nearest photo", |view| view.of_nearest.as_ref()),
    ];
    for (name, scores) in baselines {
        let scores: Vec<_> = views.iter().filter_map(scores).collect();
        if !scores.is_empty() {
            data.aggregates.push(NamedAggregate { name: name.into(), score: aggregate(scores) });
        }
    }
    data.truth = truth_errors(scene, surface, &result.maps, told.deviations.as_deref(), &result.environment)?;
    if let Some(truth) = data.truth.as_mut().filter(|_| !relit_errors.is_empty()) {
        truth.relit = Some(aggregate(&relit_errors));
    }
    let named: f64 = timings.iter().map(|time| time.seconds).sum();
    let rest = (began.elapsed().as_secs_f64() + before_job - named).max(0.0);
    timings.push(StageTime { stage: "other".into(), seconds: rest });
    data.timings = timings;
    data.peak_memory_bytes = memory::peak_bytes();

    finishing(FinishingStage::Report);
    let viewer = page_of_report(&result, scene, settings.fit.has_lobe(), &data.title)?;
    let truth = scene.truth.as_ref();
    let images = ReportImages {
        // What was left out is no evidence of how good the fit is: its scores are listed, its pictures are not shown.
        views: views.into_iter().filter(|view| view.kind != ViewUse::LeftOut).map(|view| view.pictures).collect(),
        exposure_stops: exposure_of(scene),
        maps: Some(&result.maps),
        truth_maps: truth.map(|truth| &truth.maps).filter(|maps| !maps.diffuse.pixels().is_empty()),
        times_seen: Some(&result.times_seen),
        environment: Some(&result.environment),
        truth_environment: truth.map(|truth| &truth.environment),
        relit,
        choices: told.choice_map.as_deref(),
        viewer,
    };
    write_report(folder, &data, &images)?;
    Ok(data)
}

/// Texels outside every chart, and those inside that no photograph saw, take the value of the nearest texel that one
/// saw, so that no filter reads junk; `seen.exr` tells which they are.
fn fill_outside(maps: &MaterialMaps, times_seen: &GreyImage, covered: &Image<bool>) -> MaterialMaps {
    let seen = Image::from_fn(covered.width(), covered.height(), |row, column| {
        covered[(row, column)] && times_seen[(row, column)] > 0.0
    });
    if !seen.pixels().iter().any(|&seen| seen) {
        return maps.clone();
    }
    let nearest = nearest_covered(&seen);
    let filled = |index: usize| seen.pixels()[index];
    fn join<T: Clone>(own: &Image<T>, grown: Image<T>, keep: impl Fn(usize) -> bool) -> Image<T> {
        let pixels = own.pixels().iter().zip(grown.pixels()).enumerate();
        let pixels = pixels.map(|(index, (own, grown))| if keep(index) { own.clone() } else { grown.clone() });
        Image::from_pixels(own.width(), own.height(), pixels.collect())
    }
    MaterialMaps {
        diffuse: join(&maps.diffuse, dilate(&maps.diffuse, &nearest), filled),
        specular: join(&maps.specular, dilate(&maps.specular, &nearest), filled),
        roughness: join(&maps.roughness, dilate(&maps.roughness, &nearest), filled),
    }
}
