//! Studies: the same fit many times over, with one thing changed, judged against a known truth.
//!
//! [`mvcl`] asks what consistency between views changes (Joy and Poullis 2023). [`Case`] names what is compared,
//! `measure` scores one fit, `tables` puts scores side by side with the figures of the paper.
//!
//! A study keeps no run folders: it fits in memory and writes tables, anew after each seed, so that a study that is
//! stopped leaves what it has. It judges nothing itself: it prints figures and what each setting does by construction.

mod case;
mod measure;
mod tables;

pub use case::Case;

use crate::atlas::{AtlasSettings, KeepUv};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::fit::{FitSettings, Fitter, Method};
use crate::job::demo::photograph;
use crate::job::open::read_scene;
use crate::job::prepare::{Prepared, RunSettings, prepare};
use crate::lab::scenes::study::{StudyKind, StudySettings, build};
use crate::lab::study_table::StudyTable;
use crate::scene::{ReadSettings, Scene};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Paths a pixel in photographs of the built-in scene.
const PHOTO_SAMPLES: usize = 64;

/// What a study runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StudyOptions {
    /// Exchange folders with their truth; when empty, the vase of [`crate::lab::scenes::study`], photographed here.
    pub scenes: Vec<PathBuf>,
    /// What is compared, in this order; all when empty. [`Case::None`] is always run, first.
    pub cases: Vec<Case>,
    /// Seeds 1 to this number; at least 1.
    pub seeds: usize,
    /// Halved photographs, few steps and few paths.
    pub quick: bool,
    /// Optimiser steps of the first step; `None` takes 60 when quick, else the default of a fit.
    pub steps_diffuse: Option<usize>,
    /// Optimiser steps of the second step; `None` takes 90 when quick, else the default of a fit.
    pub steps_all: Option<usize>,
    /// Folder of the tables and plots.
    pub output: PathBuf,
}

impl StudyOptions {
    /// The cases to run.
    fn cases(&self) -> Vec<Case> {
        let chosen = if self.cases.is_empty() { Case::ALL.to_vec() } else { self.cases.clone() };
        let mut cases = vec![Case::None];
        for case in chosen {
            if !cases.contains(&case) {
                cases.push(case);
            }
        }
        cases
    }

    /// Settings shared by every fit, for maps of the truth's size. Every case takes every pixel of its views, so that
    /// cases of one seed see the same pixels and paths. First hits are drawn anew in each step: kept ones let the two
    /// halves of a pixel's estimate drift apart on texels smaller than a pixel, since their product then falls.
    fn fit_settings(&self, map_size: usize) -> FitSettings {
        let base = if self.quick {
            FitSettings { steps_diffuse: 60, steps_all: 90, samples: 2, levels: 2, ..Default::default() }
        } else {
            FitSettings::default()
        };
        FitSettings {
            method: Method::Adam,
            map_size,
            pixels_per_step: 0,
            held_out_interval: 0,
            first_hits_mib: 0,
            steps_diffuse: self.steps_diffuse.unwrap_or(base.steps_diffuse),
            steps_all: self.steps_all.unwrap_or(base.steps_all),
            ..base
        }
    }

    /// What was run, in a sentence.
    fn described(&self, prepared: &Prepared, fit: &FitSettings) -> String {
        let views = &prepared.scene.views;
        let held_out = views.iter().filter(|view| view.held_out).count();
        let size = views.first().map_or((0, 0), |view| (view.camera.width, view.camera.height));
        format!(
            "{} views of {} x {} pixels to fit, {held_out} held out; maps of {} x {}; {} + {} optimiser steps (one-step: {}), \
             {} views a step with every pixel, {} paths a pixel, {} surface hits.",
            views.len() - held_out,
            size.0,
            size.1,
            fit.map_size,
            fit.map_size,
            fit.steps_diffuse,
            fit.steps_all,
            fit.steps_diffuse + fit.steps_all,
            fit.views_per_step,
            fit.samples,
            fit.bounces
        )
    }
}

/// Fits each scene with each case and seed, and writes tables and plots into the output folder: `mvcl-SCENE`, with
/// errors, `mvcl-change`, with changes against no consistency, and `mvcl.md`, which holds them all. Returns the tables
/// in that order. `tell` gets a line for each fit.
///
/// # Errors
/// `InvalidSetting` for no seeds or steps out of range, `InvalidScene` for a scene without truth, `Stopped` when `stop`
/// is raised; tables of what was done are then written already.
pub fn mvcl(options: &StudyOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<Vec<StudyTable>> {
    if options.seeds == 0 {
        return Err(Error::new(ErrorKind::InvalidSetting, "must be at least 1").at(Place::Setting("seeds".into())));
    }
    let cases = options.cases();
    let sources: Vec<Option<&Path>> = match options.scenes.is_empty() {
        true => vec![None],
        false => options.scenes.iter().map(|path| Some(path.as_path())).collect(),
    };
    let mut scenes: Vec<tables::SceneTable> = Vec::new();
    for source in sources {
        let (prepared, fit) = prepared(options, source, stop, tell)?;
        let mut name = prepared.scene.name.clone();
        if scenes.iter().any(|other| other.name == name) {
            name = format!("{name}-{}", scenes.len() + 1);
        }
        scenes.push(tables::SceneTable::new(name, options.described(&prepared, &fit), &prepared.scene));
        for seed in 1..=options.seeds as u64 {
            for &case in &cases {
                let values = run(&prepared, case.settings(&fit, seed), stop)?;
                if let Some(scene) = scenes.last_mut() {
                    scene.add(case, &values);
                    tell(&format!("{}, seed {seed}, {}: {}", scene.name, case.name(), measure::line(&values)));
                }
            }
            tables::write(&scenes, &cases, &options.output)?;
        }
    }
    tables::write(&scenes, &cases, &options.output)
}

/// One fit and its scores, one a column of [`measure::COLUMNS`].
fn run(prepared: &Prepared, fit: FitSettings, stop: &AtomicBool) -> Result<Vec<f64>> {
    let mut fitter = Fitter::new(Arc::clone(&prepared.scene), Arc::clone(&prepared.surface), fit, None)?;
    if !fitter.finish(stop)? {
        return Err(stopped());
    }
    let values = measure::measure(&fitter, stop)?;
    if stop.load(Ordering::Relaxed) { Err(stopped()) } else { Ok(values) }
}

fn stopped() -> Error {
    Error::new(ErrorKind::Stopped, "the study was stopped").remedy("tables of the seeds that were done are written")
}

/// A scene on the texture coordinates of its truth, and the settings of its fits.
fn prepared(
    options: &StudyOptions,
    source: Option<&Path>,
    stop: &AtomicBool,
    tell: &dyn Fn(&str),
) -> Result<(Prepared, FitSettings)> {
    let shrink = if options.quick { 2 } else { 1 };
    let (scene, findings) = match source {
        Some(path) => {
            tell(&format!("reading {}", path.display()));
            read_scene(path, &ReadSettings { shrink, ..Default::default() }, &mut Vec::new())?
        }
        None => {
            tell("photographing the built-in vase");
            (built_in(shrink, stop)?, Vec::new())
        }
    };
    let Some(truth) = &scene.truth else {
        let place = source.map_or(Place::Nowhere, |path| Place::File(path.into()));
        return Err(Error::new(ErrorKind::InvalidScene, "the scene has no truth to compare with")
            .at(place)
            .remedy("give an exchange folder with diffuse.exr, specular.exr, roughness.exr and env.exr"));
    };
    let fit = options.fit_settings(truth.maps.diffuse.width());
    fit.validate()?;
    let settings = RunSettings {
        atlas: AtlasSettings { keep_uv: KeepUv::Keep, ..Default::default() },
        fit: fit.clone(),
        ..Default::default()
    };
    Ok((prepare(scene, findings, &settings, Vec::new(), &|_| {})?, fit))
}

/// The vase of [`crate::lab::scenes::study`] with its photographs.
fn built_in(shrink: usize, stop: &AtomicBool) -> Result<Scene> {
    let default = StudySettings::default();
    let settings = StudySettings { size: default.size / shrink, ..default };
    let kind = StudyKind::Vase;
    let mesh = kind.mesh_in_code(settings.map_size)?.unwrap_or_default();
    let mut scene = build(kind, mesh, &settings)?;
    photograph(&mut scene, PHOTO_SAMPLES, settings.seed, kind.lobe_strength(), stop, &|_| {})?;
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_baseline_always_runs_first_and_once() {
        let options = StudyOptions { cases: vec![Case::Exact, Case::None, Case::Exact], ..Default::default() };
        assert_eq!(options.cases(), [Case::None, Case::Exact]);
        assert_eq!(StudyOptions::default().cases(), Case::ALL);
    }

    #[test]
    fn no_seed_and_no_truth_are_errors() {
        let stop = AtomicBool::new(false);
        let error = mvcl(&StudyOptions::default(), &stop, &|_| {}).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidSetting);
        let options = StudyOptions { seeds: 1, scenes: vec!["no such folder".into()], ..Default::default() };
        assert!(mvcl(&options, &stop, &|_| {}).is_err());
    }
}
