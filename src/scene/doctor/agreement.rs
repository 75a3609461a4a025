//! Do photos and cameras belong together? By the photos alone: no mask is needed.
//!
//! Two cameras that see the same points of the surface should find the same bright and dark places there. How far they do
//! is the correlation of the logarithms of radiance over the shared points; exposures, gains and a common reflectance drop
//! out of it. A photo that was given the camera of another one correlates with nobody. What explains it is looked for by
//! trying: photos moved on by one or two ([`shift`]), all of them turned or mirrored; of single ones
//! [`outlying`] speaks.
//!
//! It refuses to judge surfaces that look everywhere alike, and mirrors, whose pictures move with the camera.

use super::probe::Probe;
use super::shift::{self, Shift};
use super::trial::{Given, JUDGED_ABOVE, Lie, Trial, is_clearly_better};
use super::{Report, outlying};
use crate::error::{Finding, Place, Severity};
use crate::math::statistics::quantile;
use crate::scene::Scene;
use crate::trace::Bvh;

/// Of fewer views nothing is said.
const FEWEST_VIEWS: usize = 3;
/// Where most views correlate by less than this, photos belong to other cameras or another mesh; where they do by less than
/// [`JUDGED_ABOVE`], something of them is off.
const HARDLY: f64 = 0.2;
/// What captures have whose cameras and mesh fit.
const USUAL: f64 = 0.7;
/// Photos that are turned or mirrored agree by more than this after that: facades are alike upside down.
const LEAST_TURNED: f64 = 0.6;

/// How the photos of a scene agree, the median over the views, in [-1, 1]; `None` where they share too little.
pub(crate) fn measure(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>]) -> Option<f64> {
    Trial::new(scene, bvh, probes).of_all(&Given::own(scene.views.len()), FEWEST_VIEWS)
}

/// Measures how the photos agree, and names those that do not belong to their cameras.
pub fn check(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], report: &mut Report) {
    let trial = Trial::new(scene, bvh, probes);
    if trial.pair_count() < 2 {
        return;
    }
    let found = trial.of_pairs(&Given::own(scene.views.len()));
    let agreement = trial.of_views(&found, &vec![false; scene.views.len()]);
    for (line, agreement) in report.views.iter_mut().zip(&agreement) {
        line.agreement = *agreement;
    }
    let known: Vec<f64> = agreement.iter().copied().flatten().collect();
    if known.len() < FEWEST_VIEWS {
        return;
    }
    let middle = quantile(&known, 0.5);
    report.agreement = Some(middle);
    // Gloss from far apart has photos agree as poorly from some photo on as a shift does; outlines of masks tell.
    let shift = shift::best(&trial, scene.views.len(), &found).filter(|shift| shift.from == 0 || !masks_prove(report));
    if let Some(Shift { by, from, own, shifted, .. }) = shift {
        let first = &scene.views[from].name;
        let which = if from == 0 { String::new() } else { format!(" from {first} on") };
        let message = format!(
            "photos and cameras are out of step{which}: where photos show the same surface their correlation is {own:.2}, and \
             {shifted:.2} when each camera is given the photo {} in the order of names",
            match by {
                1 => "after its own".into(),
                -1 => "before its own".into(),
                by if by > 0 => format!("{by} places after its own"),
                by => format!("{} places before its own", -by),
            }
        );
        let told = Finding::new(Severity::Warning, "photos-shifted", message).remedy(
            "rename photos and cameras to match: one was added or removed on one side, or numbering starts at 1 there",
        );
        report.findings.push(if from == 0 { told } else { told.at(Place::View(first.clone())) });
        report.views[from..].iter_mut().for_each(|line| line.is_misplaced = true);
        return;
    }
    if middle >= JUDGED_ABOVE {
        outlying::check(scene, &trial, found, report);
        let is_named = report.views.iter().any(|line| line.is_misplaced);
        if middle < USUAL && !is_named && scene.mesh.triangles.len() > 1 {
            report.findings.push(disagree(Severity::Note, "less than usual", middle));
        }
    } else if let Some((lie, turned)) = best_lie(&trial, scene, middle) {
        let message = format!(
            "the photos match each other only when all of them are {}: where they show the same surface their correlation is \
             {turned:.2} then, and {middle:.2} as they are",
            lie.in_words()
        );
        report.findings.push(
            Finding::new(Severity::Warning, "photo-turned", message)
                .remedy("rotate or flip the photo files, to lie as they did when the cameras were calibrated"),
        );
    } else if scene.mesh.triangles.len() > 1 && (middle < HARDLY || !masks_tell(report)) {
        let (severity, how) = match middle < HARDLY {
            true => (Severity::Warning, "barely"),
            false if masks_prove(report) => (Severity::Note, "poorly"),
            false => (Severity::Warning, "poorly"),
        };
        report.findings.push(disagree(severity, how, middle));
    }
}

/// Photos agree so, without a single one to blame.
fn disagree(severity: Severity, how: &str, agreement: f64) -> Finding {
    let message = format!(
        "photos correlate {how} where the cameras say they show the same surface ({agreement:.2}; 1 is a perfect match, \
         captures that fit have {USUAL:.1} and more)"
    );
    Finding::new(severity, "photos-disagree", message).remedy(
        "look at the outlines over the photos (check -o FOLDER): the mesh may be larger, smaller or turned, photos may have been \
         cropped, resized, turned or given another's camera; mirrors, glass, gloss seen from far apart and moving light have \
         the same effect",
    )
}

/// The median overlap of masks and outlines of the mesh, where there are masks.
fn usual_overlap(report: &Report) -> Option<f64> {
    let overlaps: Vec<f64> = report.views.iter().filter_map(|view| view.mask_overlap).collect();
    (!overlaps.is_empty()).then(|| quantile(&overlaps, 0.5))
}

/// Whether masks say that cameras and mesh belong together: then photos that agree poorly show gloss from far apart.
fn masks_prove(report: &Report) -> bool {
    /// Above this median overlap of masks and outline.
    const SAME: f64 = 0.985;
    usual_overlap(report).is_some_and(|overlap| overlap > SAME)
}

/// Whether masks say already that the mesh is not the object: then photos cannot agree through it.
fn masks_tell(report: &Report) -> bool {
    /// Below this median overlap of masks and outline.
    const ANOTHER: f64 = 0.5;
    usual_overlap(report).is_some_and(|overlap| overlap < ANOTHER)
}

/// How all photos are to be turned or mirrored to agree well, and how they agree then.
fn best_lie(trial: &Trial, scene: &Scene, own: f64) -> Option<(Lie, f64)> {
    let is_square = scene.views.iter().all(|view| view.states.width() == view.states.height());
    let size = if is_square { (1, 1) } else { (1, 2) };
    let (lie, agreement) = Lie::others(size)
        .filter_map(|lie| {
            let given: Vec<Given> = (0..scene.views.len()).map(|photo| Given { photo, lie }).collect();
            Some((lie, trial.of_all(&given, FEWEST_VIEWS)?))
        })
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    (is_clearly_better(agreement, own) && agreement > LEAST_TURNED).then_some((lie, agreement))
}
