//! What the report says beside its scores.

use super::prepare::{Prepared, RunSettings};
use crate::atlas::AtlasQuality;
use crate::error::{Finding, Severity};
use crate::export::{LossRow, RunResult};
use crate::fit::settings::BackgroundEvidence;
use crate::fit::state::FitState;
use crate::fit::{Fitter, ViewUse};
use crate::image::Image;
use crate::insight::report::data::{Fact, NonFiniteCount, ReportData, SettingLine, TexelCounts};
use crate::scene::{Background, Scene};

/// The loss history as the run folder keeps it.
pub fn loss_rows(state: &FitState) -> Vec<LossRow> {
    rows_of(&state.losses)
}

/// Lines of a loss history as files have them.
pub fn rows_of(losses: &[crate::fit::LossRow]) -> Vec<LossRow> {
    let row = |row: &crate::fit::LossRow| LossRow {
        step: row.step as u64,
        stage: row.stage.clone(),
        seconds: row.seconds,
        loss: row.loss,
        image_loss: row.image_loss,
        mvcl: row.consistency,
        surface_rmse: row.surface_rmse,
        held_out_rmse: row.held_out_rmse,
    };
    losses.iter().map(row).collect()
}

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
    if fitter.known_maps().is_some() {
        scene_facts.push(fact("maps kept from", settings.known_maps.display().to_string()));
    }
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

fn evidence(scene: &Scene, settings: &RunSettings) -> String {
    let background = match (scene.background, settings.fit.background) {
        (Background::Black, _) => {
            "The background is black: pixels without surface are no evidence for the environment."
        }
        (Background::Environment, BackgroundEvidence::Use) => {
            "Background pixels were used: they show the environment itself."
        }
        (Background::Environment, BackgroundEvidence::Ignore) => "Background pixels were ignored.",
    };
    format!(
        "{background} Clipped channels only push the fit up to the clip, never down; masked and mixed \
         pixels were ignored. Scores count unclipped surface pixels; PSNR and SSIM are of sRGB-encoded values."
    )
}
