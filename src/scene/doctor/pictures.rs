//! Encoding, clipping and darkness of the photos.

use super::probe::Probe;
use super::{Report, names_of, worst_first};
use crate::error::{Finding, Place, Severity};
use crate::math::{luminance, statistics::quantile};
use crate::scene::{PixelState, Scene, View};

/// A view with more clipped pixels than this loses highlights that tell roughness.
const HIGH_CLIPPED_SHARE: f64 = 0.05;
/// Where more of some photo is clipped, that is a warning.
const WARNED_CLIPPED_SHARE: f64 = 0.25;
/// A photo of which more than this is clipped is white.
const WHITE_SHARE: f64 = 0.995;
/// A photo whose brightest percent stays below this luminance is black.
const BLACK_LUMINANCE: f64 = 1e-4;

/// Checks each photo, and the encoding over all of them.
pub fn check(scene: &Scene, probes: &[Vec<Probe>], report: &mut Report) {
    let (mut clipped, mut white, mut black) = (Vec::new(), Vec::new(), Vec::new());
    let (mut linear_looking, mut srgb_looking) = (0usize, 0usize);
    for ((view, probes), line) in scene.views.iter().zip(probes).zip(&mut report.views) {
        let count = view.states.pixels().len().max(1) as f64;
        let share_of = |select: &dyn Fn(PixelState) -> bool| {
            view.states.pixels().iter().filter(|state| select(**state)).count() as f64 / count
        };
        line.clipped_share = share_of(&|state| state.is_clipped());
        line.ignored_share = share_of(&|state| state == PixelState::Ignored);
        let counted = 1.0 - line.ignored_share;
        if counted > 0.0 && line.clipped_share > WHITE_SHARE * counted {
            white.push(view.name.as_str());
            continue;
        }
        if line.clipped_share > HIGH_CLIPPED_SHARE {
            clipped.push((line.clipped_share, view.name.as_str()));
        }
        let all = luminances(view, probes, false);
        let on_mesh = luminances(view, probes, true);
        line.median_luminance = if on_mesh.is_empty() { 0.0 } else { quantile(&on_mesh, 0.5) };
        if !all.is_empty() && quantile(&all, 0.99) < BLACK_LUMINANCE {
            black.push(view.name.as_str());
            continue;
        }
        linear_looking += usize::from(looks_linear(view, &all));
        srgb_looking += usize::from(looks_encoded(view, &all));
    }
    let views = scene.views.len();
    if let Some((most, clipped)) = worst_first(clipped) {
        let severity = if most > WARNED_CLIPPED_SHARE { Severity::Warning } else { Severity::Note };
        let message = format!(
            "more than {:.0} % of the pixels are clipped in {} views, {:.0} % in the first: {}",
            100.0 * HIGH_CLIPPED_SHARE,
            clipped.len(),
            100.0 * most,
            names_of(&clipped)
        );
        report.findings.push(
            Finding::new(severity, "photo-clipped", message)
                .at(Place::View(clipped[0].into()))
                .remedy("clipped pixels count as a lower bound only; develop the photos darker or from raw"),
        );
    }
    if !black.is_empty() {
        let severity = if black.len() == views { Severity::Fatal } else { Severity::Warning };
        report.findings.push(
            Finding::new(severity, "photo-black", format!("{} views are black: {}", black.len(), names_of(&black)))
                .remedy("check the files, or exclude these views"),
        );
    }
    if !white.is_empty() {
        let severity = if white.len() == views { Severity::Fatal } else { Severity::Warning };
        report.findings.push(
            Finding::new(
                severity,
                "photo-white",
                format!("{} photos are clipped everywhere: {}", white.len(), names_of(&white)),
            )
            .remedy("they hold no radiance: check the files and their exposure, or exclude these views"),
        );
    }
    if linear_looking * 2 > views {
        report.findings.push(
            Finding::new(
                Severity::Warning,
                "encoding-looks-linear",
                "the 8-bit photos look as if they held linear values: dark, with highlights at full scale",
            )
            .remedy(
                "if they are linear, set encoding = \"linear\"; if they are sRGB photos of a dark scene, all is well",
            ),
        );
    }
    if srgb_looking * 2 > views {
        report.findings.push(
            Finding::new(
                Severity::Warning,
                "encoding-looks-srgb",
                "the float photos look as if they held sRGB values: bright middle tones, nothing above 1",
            )
            .remedy("if they were made from 8-bit photos, set encoding = \"srgb\""),
        );
    }
}

/// Luminances of the probed pixels that carry evidence; of the mesh alone when asked.
fn luminances(view: &View, probes: &[Probe], on_mesh: bool) -> Vec<f64> {
    probes
        .iter()
        .filter(|probe| {
            view.states[(probe.row, probe.column)] != PixelState::Ignored && (!on_mesh || probe.hit.is_some())
        })
        .map(|probe| f64::from(luminance(view.photo.radiance(probe.row, probe.column))))
        .collect()
}

/// An 8-bit photo whose bytes are distributed like linear radiance.
///
/// A photo exposed so that its brightest percent reaches full scale has its median near the middle of the scale when
/// it is encoded, and near 0.18² when linear values were stored and are decoded once more.
fn looks_linear(view: &View, luminances: &[f64]) -> bool {
    !view.photo.is_linear()
        && luminances.len() > 100
        && quantile(luminances, 0.995) > 0.5
        && quantile(luminances, 0.5) < 0.02
        && quantile(luminances, 0.8) < 0.06
}

/// A float photo whose values end at 1 and have their middle where encoded photos have it.
fn looks_encoded(view: &View, luminances: &[f64]) -> bool {
    if !view.photo.is_linear() || luminances.len() <= 100 {
        return false;
    }
    let lit: Vec<f64> = luminances.iter().copied().filter(|value| *value > 0.0).collect();
    let most = lit.iter().copied().fold(0.0, f64::max);
    !lit.is_empty() && most <= 1.0 && most > 0.9 && quantile(&lit, 0.5) > 0.45
}
