//! What lies nearer together than photos resolve: walls thinner than a pixel, and surfaces that touch.
//!
//! From each place that a training photo shows a ray goes into the surface and one goes out of it, along its normal and as
//! far as the photo's pixel is wide there. One that leaves the surface again has crossed a wall; one that meets the front
//! of another surface has crossed a gap.

use super::Report;
use super::probe::{Probe, area_in_pixel, surface_at};
use crate::error::{Finding, Place, Severity};
use crate::math::parallel;
use crate::scene::{Scene, View};
use crate::trace::{Bvh, Ray};
use glam::Vec3;

/// Share of what is seen beyond which thin walls are told: sound meshes have less, thin shells a multiple.
const TOLD_THIN: f64 = 0.02;
/// Share beyond which gaps are told: things that stand on a floor have two or three thousandths where they meet it.
const TOLD_TOUCHING: f64 = 0.005;

/// Pixels of a photo that were asked.
#[derive(Clone, Copy, Default)]
struct Counts {
    asked: usize,
    thin: usize,
    touching: usize,
}

impl Counts {
    fn plus(self, other: Counts) -> Counts {
        Counts {
            asked: self.asked + other.asked,
            thin: self.thin + other.thin,
            touching: self.touching + other.touching,
        }
    }
}

/// Measures how much of what training photos show is thin or touches something, and tells it.
pub fn check(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], report: &mut Report) {
    let of_views: Vec<Counts> = parallel::map(scene.views.len(), |index| {
        let view = &scene.views[index];
        if view.held_out { Counts::default() } else { count(scene, bvh, view, &probes[index]) }
    });
    let all = of_views.iter().copied().fold(Counts::default(), Counts::plus);
    let share = |count: usize| count as f64 / all.asked.max(1) as f64;
    (report.surface.thin_share, report.surface.touching_share) = (share(all.thin), share(all.touching));
    let most = |pick: &dyn Fn(&Counts) -> usize| {
        let view = (0..of_views.len()).max_by_key(|&view| (pick(&of_views[view]), std::cmp::Reverse(view)));
        view.map_or(Place::Nowhere, |view| Place::View(scene.views[view].name.clone()))
    };
    if share(all.thin) > TOLD_THIN {
        let message =
            format!("{:.0} % of what the photos show are walls thinner than a pixel", 100.0 * share(all.thin));
        report
            .findings
            .push(Finding::new(Severity::Warning, "mesh-thin", message).at(most(&|counts| counts.thin)).remedy(
            "pixels and texels of both sides mix at their rims: give walls their true thickness, or take photos from \
                 closer up",
        ));
    }
    if share(all.touching) > TOLD_TOUCHING {
        let message = format!(
            "{:.1} % of what the photos show lies within a pixel of another surface",
            100.0 * share(all.touching)
        );
        report.findings.push(
            Finding::new(Severity::Warning, "mesh-touching", message).at(most(&|counts| counts.touching)).remedy(
                "maps are unreliable there, since little light gets in and pixels mix; photograph objects \
                 separately where their maps matter",
            ),
        );
    }
}

fn count(scene: &Scene, bvh: &Bvh, view: &View, probes: &[Probe]) -> Counts {
    let mut counts = Counts::default();
    let eye = view.camera.position_in_world();
    for probe in probes.iter().filter(|probe| view.states[(probe.row, probe.column)].is_surface()) {
        let Some((place, normal, _)) = probe.hit.as_ref().and_then(|hit| surface_at(&scene.mesh, hit)) else {
            continue;
        };
        let to_eye = (eye - place).normalize_or_zero();
        if normal.dot(to_eye) <= 0.0 {
            continue;
        }
        // As wide as the pixel would be on a surface that faces the camera.
        let width = area_in_pixel(&view.camera, place, to_eye).sqrt();
        // Whether a ray from the surface meets a triangle that looks along it (`1`) or against it (`-1`).
        let meets = |direction: Vec3, facing: f32| {
            let origin = bvh.offset_origin(place, normal, direction);
            let hit = bvh.closest_hit(&Ray { origin, direction, t_max: width });
            let other = hit.and_then(|hit| surface_at(&scene.mesh, &hit));
            other.is_some_and(|(_, other, _)| facing * other.dot(direction) > 0.0)
        };
        counts.asked += 1;
        counts.thin += usize::from(meets(-normal, 1.0));
        counts.touching += usize::from(meets(normal, -1.0));
    }
    counts
}
