//! What the report says beside its scores.

use super::outcome::loss_rows;
use super::prepare::{Prepared, RunSettings};
use crate::atlas::AtlasQuality;
use crate::error::{Finding, Severity};
use crate::export::RunResult;
use crate::fit::settings::BackgroundEvidence;
use crate::fit::solver::TransportError;
use crate::fit::{Fitter, ViewUse};
use crate::image::Image;
use crate::insight::report::data::{Fact, NonFiniteCount, ReportData, SettingLine, TexelCounts};
use crate::math::sphere::solid_angle_of_texel;
use crate::scene::{Background, Scene};
use glam::DVec3;
use std::f64::consts::PI;

pub(super) fn describe(
    fitter: &Fitter,
    prepared: &Prepared,
    settings: &RunSettings,
    result: &RunResult,
    covered: &Image<bool>,
) -> ReportData {
    let scene = fitter.scene();
    let count = |kind| fitter.view_uses().iter().filter(|own| **own == kind).count();
    let left_out = match count(ViewUse::LeftOut) {
        0 => String::new(),
        count => format!(", {count} left out"),
    };
    let fact = |name: &str, value: String| Fact { name: name.into(), value };
    let mut scene_facts = vec![
        fact("triangles", surface_size(fitter)),
        fact("views", format!("{} to fit, {} held out{left_out}", count(ViewUse::Training), count(ViewUse::HeldOut))),
    ];
    if let Some(view) = scene.views.first() {
        scene_facts.push(fact("photographs", format!("{} x {} pixels", view.camera.width, view.camera.height)));
    }
    scene_facts.push(fact("maps", format!("{0} x {0} texels", settings.fit.map_size)));
    if let Some(quality) = &prepared.quality {
        scene_facts.extend(atlas_facts(quality));
    }
    let mut findings: Vec<Finding> = prepared.findings.clone();
    findings.extend(fitter.findings());
    if !settings.fit.has_lobe() {
        findings.push(Finding::new(Severity::Note, "no-lobe", "the specular lobe was left out: no step frees it"));
    }
    let seen = |times: f32, covered: bool| covered && times > 0.0;
    let pixels = || result.times_seen.pixels().iter().zip(covered.pixels());
    let seen_count = pixels().filter(|(times, covered)| seen(**times, **covered)).count() as u64;
    let covered_count = covered.pixels().iter().filter(|&&covered| covered).count() as u64;
    ReportData {
        title: scene.name.clone(),
        program: format!("Patina {}", env!("CARGO_PKG_VERSION")),
        scene_facts,
        settings: settings
            .fit
            .listed()
            .into_iter()
            .map(|(name, value, is_default)| SettingLine { name, value, is_default })
            .collect(),
        findings: findings.iter().map(Into::into).collect(),
        loss_history: loss_rows(fitter.state()),
        gauge_statement: fitter.gauge().sentence().into(),
        evidence_statement: evidence(scene, settings),
        non_finite: fitter
            .state()
            .non_finite
            .iter()
            .map(|(name, count)| NonFiniteCount { name: name.clone(), count: *count })
            .collect(),
        texels: TexelCounts { seen: seen_count, unseen: covered_count - seen_count },
        ..Default::default()
    }
}

fn surface_size(fitter: &Fitter) -> String {
    fitter.surface().mesh().triangles.len().to_string()
}

fn atlas_facts(quality: &AtlasQuality) -> Vec<Fact> {
    let fact = |name: &str, value: String| Fact { name: name.into(), value };
    vec![
        fact("charts", quality.charts.to_string()),
        fact("atlas filled", format!("{:.1} %", 100.0 * quality.share_covered)),
        fact(
            "angle distortion",
            format!("mean {:.3}, worst {:.2}", quality.angle_distortion_mean, quality.angle_distortion_max),
        ),
        fact("area distortion", format!("mean {:.3}", quality.area_distortion_mean)),
        fact("overlapping texels", quality.overlapping_texels.to_string()),
        fact("flipped triangles", quality.flipped_triangles.to_string()),
    ]
}

/// What the solver tells beside its maps: its error of transport, how lobes are shared, how sure it is. Empty under Adam.
pub(super) fn solver_facts(fitter: &Fitter, transport: Option<TransportError>) -> Vec<Fact> {
    let fact = |name: &str, value: String| Fact { name: name.into(), value };
    let mut facts = Vec::new();
    if let Some(error) = transport {
        facts.push(fact(
            "cached transport against the path tracer",
            format!(
                "{:.2} % relative RMSE, bias {:+.2} %, over {} pixels of {} paths",
                100.0 * error.relative_rmse,
                100.0 * error.bias,
                error.pixels,
                error.samples
            ),
        ));
    }
    if let Some(shares) = fitter.light_evidence() {
        let (height, width) = (shares.height(), shares.width());
        let mut mean = DVec3::ZERO;
        for (texel, share) in shares.pixels().iter().enumerate() {
            mean += share.as_dvec3() * solid_angle_of_texel(texel / width, width, height) / (4.0 * PI);
        }
        facts.push(fact(
            "what the light is known by",
            format!(
                "highlights {:.0} %, background {:.0} %, diffuse light and shadows {:.0} %, belief that skies are smooth \
                 {:.0} % (means over the sphere; environment_evidence.exr has each texel)",
                100.0 * mean.x,
                100.0 * mean.y,
                100.0 * mean.z,
                100.0 * (1.0 - mean.element_sum())
            ),
        ));
    }
    let (Some(sharing), Some(deviations)) = (fitter.lobe_sharing(), fitter.deviations()) else { return facts };
    let solved: Vec<usize> = (0..sharing.pixels().len()).filter(|&texel| sharing.pixels()[texel] > 0.0).collect();
    if solved.is_empty() {
        return facts;
    }
    let share = |of: &dyn Fn(f32) -> bool| {
        let count = solved.iter().filter(|&&texel| of(sharing.pixels()[texel])).count();
        100.0 * count as f64 / solved.len() as f64
    };
    facts.push(fact(
        "specular lobes",
        format!(
            "{:.0} % of the texels share one with at least 63 others, {:.0} % with fewer, {:.0} % have one of their own",
            share(&|count| count >= 64.0),
            share(&|count| (2.0..64.0).contains(&count)),
            share(&|count| count < 2.0)
        ),
    ));
    let median = |of: &dyn Fn(usize) -> f32| {
        let mut values: Vec<f32> = solved.iter().map(|&texel| of(texel)).collect();
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    facts.push(fact(
        "median standard deviation given the light",
        format!(
            "diffuse {:.3}, specular {:.3}, roughness {:.3}",
            median(&|texel| deviations.diffuse.pixels()[texel].element_sum() / 3.0),
            median(&|texel| deviations.specular.pixels()[texel].element_sum() / 3.0),
            median(&|texel| deviations.roughness.pixels()[texel])
        ),
    ));
    facts
}

fn evidence(scene: &Scene, settings: &RunSettings) -> String {
    let background = match (scene.background, settings.fit.background) {
        (Background::Black, _) => "The background is black: pixels without surface say nothing of the light.",
        (Background::Environment, BackgroundEvidence::Use) => {
            "Pixels without surface were used: they show the light itself."
        }
        (Background::Environment, BackgroundEvidence::Ignore) => "Pixels without surface were left out.",
    };
    format!(
        "{background} Clipped channels only push the fit up to the clip, never down; masked and mixed pixels were left \
         out. Scores count unclipped surface pixels; PSNR and SSIM are of sRGB-encoded values."
    )
}
