//! Studies: the same fit many times over, with one thing changed, judged against a known truth.
//!
//! [`mvcl`] asks what consistency between views changes (Joy and Poullis 2023). [`Case`] names what is compared,
//! `measure` scores one fit, `tables` puts scores side by side with the figures of the paper.
//!
//! A case is one fit, a line of the results file ([`crate::lab::study`]); it keeps no run folder. A study judges nothing
//! itself: it prints figures and what each setting does by construction.

mod case;
mod measure;
pub mod tables;

pub use case::Case;

use crate::atlas::{AtlasSettings, KeepUv};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::fit::{FitSettings, Fitter, Method};
use crate::job::demo::photograph;
use crate::job::open::read_scene;
use crate::job::prepare::{Prepared, RunSettings, prepare};
use crate::lab::scenes::study::{StudyKind, StudySettings, build};
use crate::lab::study::{Results, Sitting, StudyCase, Tally};
use crate::scene::{ReadSettings, Scene};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Paths a pixel in photographs of the built-in scene.
const PHOTO_SAMPLES: usize = 64;

/// Version of the method: results of another one are void. Raise it with every change that moves them.
pub const VERSION: u32 = 1;

/// What a study runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StudyOptions {
    /// Exchange folders with their truth; when empty, the vase of [`crate::lab::scenes::study`], photographed here.
    pub scenes: Vec<PathBuf>,
    /// Seeds 1 to this number; at least 1.
    pub seeds: usize,
    /// Halved photographs, few steps and few paths.
    pub quick: bool,
    /// Optimiser steps of the first step; `None` takes 60 when quick, else the default of a fit.
    pub steps_diffuse: Option<usize>,
    /// Optimiser steps of the second step; `None` takes 90 when quick, else the default of a fit.
    pub steps_all: Option<usize>,
}

/// One fit of the study.
#[derive(Clone, Debug, PartialEq)]
struct FitCase {
    scene: usize,
    case: Case,
    seed: u64,
}

impl StudyOptions {
    /// Names of the scenes, each only once, with the folders they are read from.
    fn sources(&self) -> Vec<(String, Option<&Path>)> {
        if self.scenes.is_empty() {
            return vec![("vase".into(), None)];
        }
        let stem = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().replace('/', "-");
        let names = crate::files::unrepeated(&self.scenes.iter().map(stem).collect::<Vec<_>>());
        names.into_iter().zip(self.scenes.iter().map(|path| Some(path.as_path()))).collect()
    }

    /// All fits, and the cases they are.
    fn cases(&self) -> Vec<(FitCase, StudyCase)> {
        let fit = self.fit_settings(64);
        let steps = format!("{} + {}", fit.steps_diffuse, fit.steps_all);
        let size = if self.quick { " quick" } else { "" };
        let mut cases = Vec::new();
        for (scene, (name, _)) in self.sources().iter().enumerate() {
            for seed in 1..=self.seeds as u64 {
                for case in Case::ALL {
                    let key = format!("{name}{size}/{}/seed {seed}", case.name());
                    let mut study_case = StudyCase::new(key, format!("{name}/{seed}"), seed);
                    study_case.inputs.insert("steps".into(), steps.clone());
                    cases.push((FitCase { scene, case, seed }, study_case));
                }
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
}

/// Does the fits that `results` does not have yet, with every setting of consistency on every scene and seed.
///
/// # Errors
/// `InvalidSetting` for no seeds or steps out of range, `Stopped` when the sitting is stopped, a file that cannot be
/// written. A scene that cannot be read is a failure of its cases.
pub fn mvcl(options: &StudyOptions, results: &Path, sitting: &Sitting) -> Result<Tally> {
    if options.seeds == 0 {
        return Err(Error::new(ErrorKind::InvalidSetting, "must be at least 1")
            .at(Place::Setting("seeds".into()))
            .remedy("give a number of seeds, such as --seeds 5"));
    }
    options.fit_settings(64).validate()?;
    let mut results = Results::read(results)?;
    let sources = options.sources();
    let (fits, cases): (Vec<FitCase>, Vec<StudyCase>) = options.cases().into_iter().unzip();
    let mut at_hand: Option<(usize, Prepared, FitSettings)> = None;
    let mut work = |place: usize| {
        let FitCase { scene, case, seed } = fits[place];
        let (prepared, fit) = match at_hand.take() {
            Some((own, prepared, fit)) if own == scene => (prepared, fit),
            _ => prepared(options, sources[scene].1, sitting.stop, sitting.tell)?,
        };
        let outcome = run(&prepared, case.settings(&fit, seed), sitting.stop);
        at_hand = Some((scene, prepared, fit));
        let values = outcome?;
        Ok(measure::COLUMNS.iter().map(|(name, _)| *name).zip(values).collect())
    };
    sitting.run(&mut results, VERSION, &cases, &mut work)
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
    Error::new(ErrorKind::Stopped, "the study was stopped")
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
    fn every_setting_meets_every_seed_and_rivals_share_a_block() {
        let scenes: Vec<PathBuf> = vec!["a/cow".into(), "b/cow".into()];
        let options = StudyOptions { seeds: 2, scenes, quick: true, ..Default::default() };
        let cases = options.cases();
        assert_eq!(cases.len(), 2 * 2 * Case::ALL.len());
        let keys: std::collections::HashSet<&str> = cases.iter().map(|(_, case)| case.key.as_str()).collect();
        assert!(keys.len() == cases.len() && keys.contains("cow_2 quick/none/seed 2"), "{keys:?}");
        assert!(cases[..Case::ALL.len()].iter().all(|(_, case)| case.block == cases[0].1.block));
        let longer = StudyOptions { steps_all: Some(7), ..options.clone() };
        assert_ne!(longer.cases()[0].1.inputs, cases[0].1.inputs, "other steps are another case");
    }

    #[test]
    fn no_seed_is_an_error_and_a_scene_that_is_not_there_a_failure() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mvcl.jsonl");
        let stop = AtomicBool::new(false);
        let pattern = "/none/".parse().unwrap();
        let sitting = Sitting { budget: None, pattern, stop: &stop, tell: &|_| {} };
        let error = mvcl(&StudyOptions::default(), &path, &sitting).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidSetting);
        let options = StudyOptions { seeds: 1, scenes: vec!["no such folder".into()], ..Default::default() };
        let tally = mvcl(&options, &path, &sitting).unwrap();
        assert_eq!((tally.done_now, tally.failed), (1, 1));
    }
}
