//! The gradient of the picture loss against central differences.

use super::AuditSettings;
use super::bench::{Bench, PixelRecord};
use super::consistency;
use super::difference::central_difference;
use super::readers::{Parameter, Readers};
use super::report::{AuditReport, Difference};
use crate::error::{Error, ErrorKind, Result};
use crate::material::texels::PyramidWeights;
use crate::math::parallel;
use crate::math::random::SequentialRandom;
use crate::math::real::Real;
use crate::render::{ParameterGradient, Parameters, Surface};
use crate::scene::Scene;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Parameters that one thread works on at a time.
const BATCH: usize = 64;
/// Share of the parameters that seams, and that silhouettes, take at most before the others are drawn.
const PLACE_SHARE: usize = 4;

/// Compares reverse mode with central differences over views of a scene.
///
/// `parameters` is where the gradient is looked at; its mip chain has the weights `weights`. Photographs that the
/// parameters explain exactly leave nothing to compare: [`built_in`](fn@super::built_in) makes a scene with residuals.
///
/// # Errors
/// `InvalidScene` when there is no view, or when no path reads a parameter; `Stopped` when `stop` is raised.
pub fn gradients(
    scene: &Scene,
    surface: &Surface,
    parameters: &Parameters<f32>,
    weights: &PyramidWeights,
    settings: &AuditSettings,
    stop: &AtomicBool,
) -> Result<AuditReport> {
    let began = Instant::now();
    let bench = Bench::new(scene, surface, parameters, weights, settings)?;
    let precise = parameters.convert(f64::from);
    let records = bench.records(&precise);
    let readers = Readers::new(&records, parameters, weights);
    let chosen = choose(&readers, parameters, weights, settings);
    if chosen.is_empty() {
        return Err(Error::new(ErrorKind::InvalidScene, "no path reads a texel or the light")
            .remedy("check that the views see the mesh: patina check"));
    }
    let (reverse_f64, reverse_f32) = (reverse_of_all(&bench, &precise, stop), reverse_of_all(&bench, parameters, stop));
    let differences = central_differences(&bench, &records, &readers, &precise, &chosen, stop);
    let rows = chosen
        .iter()
        .zip(differences)
        .map(|(&parameter, difference)| Difference {
            parameter,
            places: readers.places(parameter, &readers.of(parameter, weights), weights),
            difference,
            precise: parameter.derivative(&reverse_f64),
            single: parameter.derivative(&reverse_f32.convert(f64::from)),
        })
        .collect();
    let mut report = AuditReport {
        settings: *settings,
        views: bench.view_count(),
        pixels: records.len(),
        silhouette_pixels: records.iter().filter(|record| record.escaped > 0.0 && record.escaped < 1.0).count(),
        paths_by_hits: paths_by_hits(&records),
        reads_per_level: readers.reads_per_level(),
        unread_with_derivative: unread_with_derivative(&readers, &reverse_f64, weights),
        ..AuditReport::default()
    };
    report.add_gradient(rows, parameters);
    if settings.consistency_parameters > 0 {
        let rows = consistency::differences(&bench, &records, &readers, &precise, &chosen, stop);
        report.add_consistency(rows, parameters);
    }
    if stop.load(Ordering::Relaxed) {
        return Err(Error::new(ErrorKind::Stopped, "the audit was stopped"));
    }
    report.seconds = began.elapsed().as_secs_f64();
    Ok(report)
}

/// The gradient of the summed loss of all views, on the base level, as a fit computes it.
fn reverse_of_all<R: Real>(bench: &Bench<'_>, parameters: &Parameters<R>, stop: &AtomicBool) -> ParameterGradient<R> {
    let mut gradient = bench.zeros();
    for view in 0..bench.view_count() {
        bench.reverse(view, parameters, &mut gradient, stop);
    }
    gradient.texels.pull_down(bench.weights);
    gradient
}

/// Every parameter there is.
fn all_parameters(texels: usize, light: usize) -> impl Iterator<Item = Parameter> {
    let maps = (0..texels).flat_map(|index| (0..7).map(move |number| Parameter::Texel { index, number }));
    maps.chain((0..light).flat_map(|index| (0..3).map(move |channel| Parameter::Light { index, channel })))
}

/// Draws parameters that are read: poles and wrap of the light first, then a share of seams and silhouettes, then any.
fn choose(
    readers: &Readers,
    parameters: &Parameters<f32>,
    weights: &PyramidWeights,
    settings: &AuditSettings,
) -> Vec<Parameter> {
    let mut pool: Vec<Parameter> =
        all_parameters(parameters.texels.levels[0].texels.len(), parameters.light.len()).collect();
    SequentialRandom::new(settings.seed ^ 0xa0d1).shuffle(&mut pool);
    let quota = settings.parameters / PLACE_SHARE;
    let mut taken = [0usize; 6];
    let (mut first, mut rest) = (Vec::new(), Vec::new());
    for parameter in pool {
        let own = readers.of(parameter, weights);
        if own.is_empty() {
            continue;
        }
        let places = readers.places(parameter, &own, weights);
        let wanted = places[4] || places[5] || (0..2).any(|place| places[place] && taken[place] < quota);
        if wanted {
            (0..6).for_each(|place| taken[place] += usize::from(places[place]));
            first.push(parameter);
        } else {
            rest.push(parameter);
        }
    }
    first.extend(rest);
    first.truncate(settings.parameters);
    first
}

fn central_differences(
    bench: &Bench<'_>,
    records: &[PixelRecord],
    readers: &Readers,
    parameters: &Parameters<f64>,
    chosen: &[Parameter],
    stop: &AtomicBool,
) -> Vec<f64> {
    let work = |_, batch: &[Parameter]| {
        let mut moved = parameters.clone();
        let losses = bench.losses();
        let difference = |&parameter: &Parameter| {
            if stop.load(Ordering::Relaxed) {
                return f64::NAN;
            }
            let own = readers.of(parameter, bench.weights);
            central_difference(parameter, &mut moved, bench.weights, |parameters| {
                own.iter().map(|&record| bench.pixel_loss(&losses, &records[record as usize], parameters)).sum()
            })
        };
        batch.iter().map(difference).collect::<Vec<_>>()
    };
    parallel::map_chunks(chosen, BATCH, work).concat()
}

/// Number of paths that meet the surface 0, 1, 2, ... times.
fn paths_by_hits(records: &[PixelRecord]) -> Vec<usize> {
    let mut counts = Vec::new();
    for path in records.iter().flat_map(|record| &record.arena.paths) {
        let hits = path.count as usize;
        counts.resize(counts.len().max(hits + 1), 0);
        counts[hits] += 1;
    }
    counts
}

/// Parameters that no path reads and whose derivative is not exactly zero: must be none.
fn unread_with_derivative(readers: &Readers, gradient: &ParameterGradient<f64>, weights: &PyramidWeights) -> usize {
    all_parameters(gradient.texels.levels[0].texels.len(), gradient.light.len())
        .filter(|&parameter| parameter.derivative(gradient) != 0.0 && readers.of(parameter, weights).is_empty())
        .count()
}
