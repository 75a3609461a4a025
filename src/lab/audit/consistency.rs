//! The gradient of the views' disagreement `V` against central differences.
//!
//! `V` is made of the gradients `g_i` of the views, so its gradient takes second derivatives: `grad V = sum_i H_i v_i`
//! (see [`crate::fit::consistency`]). A fit gets it by dual numbers run through the reverse pass; here the same is done
//! in `f64` and in `f32` and compared with differences of `V`, whose `g_i` are computed anew by reverse mode at the moved
//! parameters. The range of the gradients, which carries no derivative, is frozen.

use super::bench::{Bench, PixelRecord};
use super::difference::central_difference;
use super::readers::{KINDS, Parameter, Readers};
use super::report::Difference;
use crate::fit::consistency::{Agreement, ViewGradient};
use crate::fit::loss::ViewLoss;
use crate::material::texels::TexelPyramid;
use crate::math::parallel;
use crate::math::real::{Dual, Real};
use crate::render::accumulate::{PixelLoss, sum_pixel};
use crate::render::sums::radiance_backward;
use crate::render::{ParameterGradient, Parameters};
use std::sync::atomic::{AtomicBool, Ordering};

/// Compares the gradient of `V` for some of the given parameters, evenly over their kinds.
pub fn differences(
    bench: &Bench<'_>,
    records: &[PixelRecord],
    readers: &Readers,
    parameters: &Parameters<f64>,
    among: &[Parameter],
    stop: &AtomicBool,
) -> Vec<Difference> {
    let raw: Vec<ParameterGradient<f64>> = (0..bench.view_count())
        .map(|view| {
            let mut gradient = bench.zeros();
            bench.reverse(view, parameters, &mut gradient, stop);
            gradient
        })
        .collect();
    let gradients: Vec<ViewGradient<f64>> = raw.iter().map(|raw| pulled(bench, raw)).collect();
    let texels = parameters.texels.levels[0].texels.len();
    let agreement = Agreement::of(&gradients, texels, None, |value| value);
    let range = agreement.range;
    let directions: Vec<_> = gradients.iter().map(|view| agreement.direction(view, |value| value)).collect();
    let precise = gradient_of_value(bench, parameters, &directions, f64::from_f64, stop);
    let single = gradient_of_value(bench, bench.parameters, &directions, |value| value as f32, stop).convert(f64::from);

    let chosen = evenly_over_kinds(among, bench.consistency_parameters());
    let work = |_, batch: &[Parameter]| {
        let mut moved = parameters.clone();
        let losses = bench.losses();
        let difference = |&parameter: &Parameter| {
            let own = readers.of(parameter, bench.weights);
            let difference = central_difference(parameter, &mut moved, bench.weights, |moved| {
                if stop.load(Ordering::Relaxed) {
                    return f64::NAN;
                }
                let mut views = gradients.clone();
                for (view, gradient) in views.iter_mut().enumerate() {
                    let of_view = || own.iter().map(|&record| &records[record as usize]).filter(|r| r.view == view);
                    if of_view().next().is_none() {
                        continue;
                    }
                    // Only the pixels that read the parameter change: take their old part away and add the new one.
                    let mut raw = raw[view].clone();
                    for record in of_view() {
                        add_gradient(bench, &losses, record, parameters, -1.0, &mut raw);
                        add_gradient(bench, &losses, record, moved, 1.0, &mut raw);
                    }
                    *gradient = pulled(bench, &raw);
                }
                Agreement::of(&views, texels, Some(range), |value| value).value
            });
            Difference {
                parameter,
                places: readers.places(parameter, &own, bench.weights),
                difference,
                precise: parameter.derivative(&precise),
                single: parameter.derivative(&single),
            }
        };
        batch.iter().map(difference).collect::<Vec<_>>()
    };
    parallel::map_chunks(&chosen, 16, work).into_iter().flatten().collect()
}

/// `sum_i H_i v_i` by dual numbers, on the base level.
fn gradient_of_value<R: Real>(
    bench: &Bench<'_>,
    parameters: &Parameters<R>,
    directions: &[Vec<(u32, [f64; 3])>],
    round: impl Fn(f64) -> R,
    stop: &AtomicBool,
) -> ParameterGradient<R> {
    let mut total: ParameterGradient<R> = bench.zeros();
    for (view, direction) in directions.iter().enumerate() {
        // A direction of unit size keeps the tangents of f32 in range, as in a fit.
        let size = direction.iter().flat_map(|(_, v)| v).fold(0.0f64, |size, value| size.max(value.abs()));
        if size == 0.0 {
            continue;
        }
        let lift = |value: R| Dual::new(value, R::zero());
        let mut base: Vec<_> = parameters.texels.levels[0].texels.iter().map(|texel| texel.map(lift)).collect();
        for (index, v) in direction {
            for channel in 0..3 {
                base[*index as usize].diffuse[channel].tangent = round(v[channel] / size);
            }
        }
        let dual = Parameters {
            texels: TexelPyramid::from_base(base, bench.weights),
            light: parameters.light.iter().map(|radiance| radiance.map(lift)).collect(),
            environment_size: parameters.environment_size,
        };
        let mut d_dual: ParameterGradient<Dual<R>> = bench.zeros();
        bench.reverse(view, &dual, &mut d_dual, stop);
        d_dual.texels.pull_down(bench.weights);
        let size = round(size);
        let texels = total.texels.levels[0].texels.iter_mut().zip(&d_dual.texels.levels[0].texels);
        for (total, d) in texels {
            total.d_material.add_scaled(&d.d_material.map(|d| d.tangent), size);
        }
        for (total, d) in total.light.iter_mut().zip(&d_dual.light).flat_map(|(total, d)| total.iter_mut().zip(d)) {
            *total += d.tangent * size;
        }
    }
    total
}

/// Adds `sign` times the gradient of one pixel's loss.
fn add_gradient(
    bench: &Bench<'_>,
    losses: &[ViewLoss<'_>],
    record: &PixelRecord,
    parameters: &Parameters<f64>,
    sign: f64,
    gradient: &mut ParameterGradient<f64>,
) {
    let estimate = sum_pixel(parameters, &record.arena, bench.lobe_strength());
    let Some(derivative) = losses[record.view].at(record.pixel, &estimate) else { return };
    let samples = record.arena.paths.len();
    let half = (samples / 2).max(1);
    for (sample, path) in record.arena.paths.iter().enumerate() {
        let (d_mean, count) = if samples == 1 {
            (std::array::from_fn(|c| derivative.d_first[c] + derivative.d_second[c]), 1)
        } else if sample < half {
            (derivative.d_first, half)
        } else {
            (derivative.d_second, samples - half)
        };
        let d_radiance = d_mean.map(|d: f64| d * sign * f64::from(1.0 / count as f32));
        radiance_backward(parameters, &record.arena, path, bench.lobe_strength(), d_radiance, gradient);
    }
}

fn pulled(bench: &Bench<'_>, raw: &ParameterGradient<f64>) -> ViewGradient<f64> {
    let mut texels = raw.texels.clone();
    texels.pull_down(bench.weights);
    ViewGradient::collect(&texels.levels[0].texels)
}

fn evenly_over_kinds(among: &[Parameter], count: usize) -> Vec<Parameter> {
    let each = count.div_ceil(KINDS.len());
    (0..KINDS.len())
        .flat_map(|kind| {
            // From the back of the list, where parameters are drawn from everywhere.
            among.iter().rev().filter(move |parameter| parameter.kind() == kind).take(each).copied()
        })
        .collect()
}
