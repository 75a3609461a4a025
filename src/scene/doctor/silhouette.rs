//! Do the masks agree with the mesh's silhouette?

use super::probe::Probe;
use super::trial::Lie;
use super::{Report, names_of, worst_first};
use crate::error::{Finding, Place, Severity};
use crate::image::file::place_in_stored;
use crate::math::statistics::quantile;
use crate::scene::{PixelState, Scene, View};

/// Below this overlap a mask is suspicious.
const LOW_OVERLAP: f64 = 0.9;
/// Below this median overlap the cameras are not those of the mesh.
const FATAL_OVERLAP: f64 = 0.2;

/// Intersection over union of a view's mask and the mesh's silhouette, on the probed pixels that say something.
pub(crate) fn overlap(view: &View, probes: &[Probe]) -> f64 {
    overlap_of(view, probes, Lie::AS_IT_IS)
}

/// The same of a mask that lies another way.
pub(super) fn overlap_of(view: &View, probes: &[Probe], lie: Lie) -> f64 {
    let (mut both, mut either) = (0usize, 0usize);
    let size = (view.states.width(), view.states.height());
    for probe in probes {
        let state = view.states[place_in_stored(lie.0, size, (probe.row, probe.column))];
        if state == PixelState::Ignored {
            continue;
        }
        both += usize::from(state.is_surface() && probe.hit.is_some());
        either += usize::from(state.is_surface() || probe.hit.is_some());
    }
    both as f64 / either.max(1) as f64
}

/// Intersection over union of mask and silhouette in each masked view, on the probed pixels.
pub fn check(scene: &Scene, probes: &[Vec<Probe>], report: &mut Report) {
    let mut overlaps = Vec::new();
    let mut low = Vec::new();
    for ((view, probes), line) in scene.views.iter().zip(probes).zip(&mut report.views) {
        if !view.has_mask() || probes.is_empty() {
            continue;
        }
        let overlap = overlap(view, probes);
        line.mask_overlap = Some(overlap);
        overlaps.push(overlap);
        if overlap < LOW_OVERLAP {
            low.push((-overlap, view.name.as_str()));
        }
    }
    // One triangle is the object of no mask: a mesh so small stands for something else.
    if overlaps.is_empty() || scene.mesh.triangles.len() < 2 {
        return;
    }
    let median = quantile(&overlaps, 0.5);
    if median < FATAL_OVERLAP {
        report.findings.push(
            Finding::new(
                Severity::Fatal,
                "masks-and-mesh-disagree",
                format!("masks and mesh overlap by only {:.0} % (median over the views)", 100.0 * median),
            )
            .remedy(
                "check the overlays: masks may be inverted (255 is object), or the cameras may belong to another mesh",
            ),
        );
    } else if let Some((least, low)) = worst_first(low) {
        let message = format!(
            "masks and mesh overlap by less than {:.0} % in {} views, by {:.0} % in the first: {}",
            100.0 * LOW_OVERLAP,
            low.len(),
            -100.0 * least,
            names_of(&low)
        );
        report.findings.push(
            Finding::new(Severity::Warning, "mask-overlap-low", message).at(Place::View(low[0].into())).remedy(
                "check the overlays of these views: the mask may cover more than the mesh, or the camera may be off",
            ),
        );
    }
}
