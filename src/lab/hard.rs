//! Hard cases for every method: what breaks a fit, by how much, and whether it was told. `patina bench hard`.
//!
//! Each case of [`crate::lab::scenes::hard`] is photographed as it is, spoiled, checked as a user's scene is, fitted, and judged
//! against the truth: its own photos before they were spoiled, its maps, its light, another light. Where the mesh is
//! wrong, the error of the diffuse map is also given near the defect and far from it.

use super::contest::Contestant;
use super::contest::judge::{COLUMNS, Judge};
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::fit::{FitSettings, Fitter, Method};
use crate::image::{GreyImage, Image, RgbImage};
use crate::insight::capture;
use crate::insight::intervals::{IntervalCoverage, WRONG, interval_coverage};
use crate::insight::report::number::{fixed, short};
use crate::insight::truth::map_errors;
use crate::job::against_truth::resampled;
use crate::job::demo::photograph;
use crate::lab::scenes::hard::{HardCase, HardScene, HardSettings, build};
use crate::material::MaterialMaps;
use crate::render::Surface;
use crate::scene::{Scene, Truth, doctor};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What is run.
#[derive(Clone, Debug)]
pub struct HardOptions {
    /// The methods; Mitsuba is none of them.
    pub methods: Vec<Contestant>,
    /// The cases.
    pub cases: Vec<HardCase>,
    /// Tiny photos and few steps.
    pub quick: bool,
    /// Seed of the cameras, the photos and the fits.
    pub seed: u64,
    /// Folder of the table.
    pub output: PathBuf,
}

/// Columns of the judge that the table shows.
const SHOWN: [usize; 9] = [0, 2, 5, 6, 8, 11, 14, 15, 16];

/// One case by one method.
#[derive(Clone, Debug, PartialEq)]
pub struct HardRow {
    /// Name of the case.
    pub case: String,
    /// Name of the method.
    pub method: &'static str,
    /// Scores of the judge, one a column of [`COLUMNS`]; empty when the fit ended with an error.
    pub scores: Vec<f64>,
    /// Aligned error of the diffuse map within one unit of the defect of the mesh, and beyond; `None` where the mesh is
    /// right.
    pub near_and_far: Option<[f64; 2]>,
    /// Whether stated uncertainties hold; `None` where the method states none.
    pub intervals: Option<IntervalCoverage>,
    /// Steps done.
    pub steps: usize,
    /// Seconds of the fit.
    pub seconds: f64,
    /// Numbers that were not finite and were left out, in the fit and in its pictures.
    pub non_finite: u64,
    /// Short names of warnings before and after the fit, or the error it ended with.
    pub told: Vec<String>,
}

/// The table.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct HardTable {
    /// Its rows: by case, then by method.
    pub rows: Vec<HardRow>,
    /// Sentences below it.
    pub notes: Vec<String>,
}

/// Runs the cases and writes `hard.md` and `hard.csv`, anew after each fit.
///
/// # Errors
/// An output folder that cannot be written; `Stopped` when `stop` is raised. A fit that ends with an error is a row.
pub fn run(options: &HardOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<HardTable> {
    std::fs::create_dir_all(&options.output).map_err(|source| Error::writing(&options.output, source))?;
    let mut table = HardTable::default();
    let settings = if options.quick {
        HardSettings { size: 20, views: 8, held_out: 2, map_size: 64, light_height: 8, seed: options.seed }
    } else {
        HardSettings { seed: options.seed, ..Default::default() }
    };
    for &case in &options.cases {
        tell(&format!("photographing {}", case.name()));
        let mut hard = build(case, &settings)?;
        photograph_with_widths(&mut hard, if options.quick { 16 } else { 256 }, options.seed, stop)?;
        let given = hard.spoil(&hard.scene)?;
        for &method in &options.methods {
            let base = fit_settings(&hard, options);
            let fit = if method == Contestant::Mitsuba { None } else { method.settings(&base) };
            let Some(fit) = fit else {
                let note = format!("`{}` was left out: this build has no such method.", method.name());
                if !table.notes.contains(&note) {
                    tell(&note);
                    table.notes.push(note);
                }
                continue;
            };
            let row = run_case(&hard, &given, method, fit, if options.quick { 8 } else { 64 }, stop)?;
            tell(&format!("{}, {}: {} steps, {:.1} s", row.case, row.method, row.steps, row.seconds));
            table.rows.push(row);
            table.write(&options.output)?;
        }
    }
    table.write(&options.output)?;
    Ok(table)
}

fn fit_settings(hard: &HardScene, options: &HardOptions) -> FitSettings {
    let truth = hard.scene.truth.as_ref();
    let own = FitSettings {
        method: Method::Adam,
        seed: options.seed,
        map_size: truth.map_or(64, |truth| truth.maps.diffuse.width()),
        environment_height: truth.map_or(16, |truth| truth.environment.height()),
        bounces: truth.map_or(2, |truth| truth.max_bounces),
        steps_diffuse: 80,
        steps_all: 160,
        levels: 2,
        views_per_step: 4,
        pixels_per_step: 0,
        held_out_interval: 0,
        exposure: hard.case == HardCase::Exposure,
        ..Default::default()
    };
    if options.quick { FitSettings { steps_diffuse: 8, steps_all: 8, samples: 2, lobe_ramp: 2, ..own } } else { own }
}

fn run_case(
    hard: &HardScene,
    given: &Scene,
    method: Contestant,
    settings: FitSettings,
    samples: usize,
    stop: &AtomicBool,
) -> Result<HardRow> {
    let mut row = HardRow {
        case: hard.case.name(),
        method: method.name(),
        scores: Vec::new(),
        near_and_far: None,
        intervals: None,
        steps: 0,
        seconds: 0.0,
        non_finite: 0,
        told: Vec::new(),
    };
    let mut findings = doctor::check(given).findings;
    let began = Instant::now();
    let fitted = fitted(given, settings, stop);
    row.seconds = began.elapsed().as_secs_f64();
    let fitter = match fitted {
        Ok(fitter) => fitter,
        Err(error) if error.kind() == ErrorKind::Stopped => return Err(error),
        Err(error) => {
            row.told.push(format!("error: {error}").replace('\n', " "));
            return Ok(row);
        }
    };
    findings.extend(fitter.findings());
    findings.extend(capture::check(&fitter, stop).findings);
    row.steps = fitter.state().step;
    let counted = fitter.state().non_finite.iter().map(|(_, count)| count).sum();
    let (maps, light) = (fitter.maps(), fitter.environment());
    let judge = Judge::new(hard.scene.clone(), samples, 6)?.with_surface(Surface::new(given.mesh.clone())?);
    row.scores = judge.scores(&maps, &light, counted, stop)?;
    row.non_finite = row.scores.last().copied().unwrap_or(f64::NAN) as u64;
    if let (Some(truth), Some(distance)) = (&hard.scene.truth, &hard.distance_to_defect) {
        row.near_and_far = Some(errors_by_distance(&maps, truth, distance)?);
    }
    if let (Some(truth), Some(deviations)) = (&hard.scene.truth, fitter.deviations()) {
        let errors = map_errors(&maps, &truth.maps, &truth.texels_seen)?;
        row.intervals = interval_coverage(&maps, &deviations, &truth.maps, &truth.texels_seen, &errors);
    }
    row.told = warnings(&findings);
    Ok(row)
}

/// Names of warnings, each once, in the order they came.
fn warnings(findings: &[Finding]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for finding in findings.iter().filter(|finding| finding.severity >= Severity::Warning) {
        if !names.iter().any(|name| name == finding.code) {
            names.push(finding.code.into());
        }
    }
    names
}

fn fitted(given: &Scene, settings: FitSettings, stop: &AtomicBool) -> Result<Fitter> {
    let surface = Arc::new(Surface::new(given.mesh.clone())?);
    let mut fitter = Fitter::new(Arc::new(given.clone()), surface, settings, None)?;
    if !fitter.finish(stop)? {
        return Err(
            Error::new(ErrorKind::Stopped, "the hard cases were stopped").remedy("the rows that were done are written")
        );
    }
    Ok(fitter)
}

/// Aligned errors of the diffuse map over seen texels within one unit of the defect, and beyond.
fn errors_by_distance(maps: &MaterialMaps, truth: &Truth, distance: &GreyImage) -> Result<[f64; 2]> {
    let maps = resampled(maps, (distance.width(), distance.height()));
    let error = |is_near: bool| {
        let counted = Image::from_fn(distance.width(), distance.height(), |row, column| {
            truth.texels_seen[(row, column)] && (distance[(row, column)] < 1.0) == is_near
        });
        Ok(map_errors(&maps, &truth.maps, &counted)?.diffuse.aligned)
    };
    Ok([error(true)?, error(false)?])
}

/// Photographs a scene as the mean of pictures with lobes of several widths.
fn photograph_with_widths(hard: &mut HardScene, samples: usize, seed: u64, stop: &AtomicBool) -> Result<()> {
    let count = hard.width_factors.len().max(1);
    let mut photos: Vec<RgbImage> = Vec::new();
    let mut relit: Vec<(usize, RgbImage)> = Vec::new();
    for (index, factor) in hard.width_factors.iter().enumerate() {
        let mut scene = hard.scene.clone();
        if let Some(truth) = scene.truth.as_mut() {
            // The maps hold the square of the width.
            truth.maps.roughness = truth.maps.roughness.map(|&r| (r * factor * factor).min(1.0));
        }
        photograph(&mut scene, samples.div_ceil(count), seed + 977 * index as u64, 1.0, stop, &|_| {})?;
        let share = 1.0 / count as f32;
        let add = |sum: &mut RgbImage, picture: &RgbImage| {
            sum.pixels_mut().iter_mut().zip(picture.pixels()).for_each(|(sum, pixel)| *sum += share * *pixel);
        };
        let black = |picture: &RgbImage| picture.map(|_| glam::Vec3::ZERO);
        for (view, own) in scene.views.iter().enumerate() {
            let picture = own.photo.to_linear();
            if photos.len() == view {
                photos.push(black(&picture));
            }
            add(&mut photos[view], &picture);
        }
        let pictures = scene.truth.and_then(|truth| truth.relight).map(|relight| relight.pictures).unwrap_or_default();
        for (number, (view, picture)) in pictures.iter().enumerate() {
            if relit.len() == number {
                relit.push((*view, black(picture)));
            }
            add(&mut relit[number].1, picture);
        }
    }
    for (view, photo) in photos.into_iter().enumerate() {
        hard.scene.set_photo(view, photo)?;
    }
    if let Some(relight) = hard.scene.truth.as_mut().and_then(|truth| truth.relight.as_mut()) {
        relight.pictures = relit;
    }
    Ok(())
}

impl HardTable {
    /// The table as Markdown.
    pub fn to_markdown(&self) -> String {
        let mut text = String::from("# Hard cases\n\n| case | method |");
        for column in SHOWN {
            text += &format!(" {} |", COLUMNS[column].0);
        }
        text += " diffuse near / far of the defect | 90 % intervals hold: diffuse / specular / roughness | wrong / warned of | steps | \
                 seconds | non-finite | told |\n| --- | --- |";
        text += &" ---: |".repeat(SHOWN.len() + 6);
        text += " --- |\n";
        for row in &self.rows {
            text += &format!("| {} | {} |", row.case, row.method);
            for column in SHOWN {
                text += &format!(" {} |", short(row.scores.get(column).copied().unwrap_or(f64::NAN)));
            }
            let near =
                row.near_and_far.map_or(String::new(), |[near, far]| format!("{} / {}", short(near), short(far)));
            let told = row.told.join(", ").replace('|', "/");
            let [held, warned] = row.intervals.map_or(Default::default(), |own| {
                let share = |value: f64| fixed(100.0 * value, 0);
                let held = [own.diffuse, own.specular, own.roughness].map(share).join(" / ");
                [held, format!("{} % / {} %", fixed(100.0 * own.wrong, 1), share(own.warned))]
            });
            text += &format!(
                " {near} | {held} | {warned} | {} | {} | {} | {told} |\n",
                row.steps,
                short(row.seconds),
                row.non_finite
            );
        }
        text += &format!(
            "\nErrors are root mean squared errors against the truth: pictures against the photos before they were \
             spoiled, maps over texels that a view sees, the light relative to its own. `aligned` is after the best \
             factor per channel. Intervals are those that the solver states, in percent of the texels. Wrong is what is \
             further than {WRONG} from the truth in diffuse reflectance; of so many of these the stated interval holds \
             the truth all the same: the uncertainty warned. `told` names warnings of the check before the fit, of the fit, and of the look at its capture after it.\n"
        );
        for note in &self.notes {
            text += &format!("\n{note}\n");
        }
        text
    }

    /// One line a row, every score with all digits.
    pub fn to_csv(&self) -> String {
        let mut text = String::from("case,method");
        for (name, _) in COLUMNS.iter().filter(|(name, _)| *name != "non-finite") {
            text += &format!(",{}", name.replace(' ', "_").replace('.', ""));
        }
        text += ",diffuse_near,diffuse_far,held_diffuse,held_specular,held_roughness,wrong,warned,steps,seconds,non_finite,told\n";
        for row in &self.rows {
            text += &format!("{},{}", row.case, row.method);
            for column in 0..COLUMNS.len() - 1 {
                text += &format!(",{}", row.scores.get(column).copied().unwrap_or(f64::NAN));
            }
            let [near, far] = row.near_and_far.unwrap_or([f64::NAN; 2]);
            let told = row.told.join(" ").replace('"', "'");
            let held = row
                .intervals
                .map_or([f64::NAN; 5], |own| [own.diffuse, own.specular, own.roughness, own.wrong, own.warned]);
            let held = held.map(|share| share.to_string()).join(",");
            text += &format!(",{near},{far},{held},{},{},{},\"{told}\"\n", row.steps, row.seconds, row.non_finite);
        }
        text
    }

    fn write(&self, folder: &Path) -> Result<()> {
        crate::files::write_bytes(&folder.join("hard.md"), self.to_markdown().as_bytes())?;
        crate::files::write_bytes(&folder.join("hard.csv"), self.to_csv().as_bytes())
    }
}
