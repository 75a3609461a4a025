//! Which views are held against each other, and the points at which: what checks of agreement and of exposure have in common.

use super::probe::{Probe, surface_at};
use crate::math::parallel;
use crate::scene::{Scene, View};
use glam::Vec3;

/// What is found for each view, in the order of the views.
pub fn over_views<T: Send>(scene: &Scene, of_view: impl Fn(usize) -> Vec<T> + Send + Sync) -> Vec<T> {
    parallel::map(scene.views.len(), of_view).into_iter().flatten().collect()
}

/// The `most` views with probes that look from the most similar side as view `own`, the nearest first.
pub fn of(scene: &Scene, probes: &[Vec<Probe>], own: usize, most: usize) -> Vec<usize> {
    let forward = |view: &View| view.camera.forward_in_world();
    let mut others: Vec<(f32, usize)> = (0..scene.views.len())
        .filter(|&other| other != own && !probes[other].is_empty())
        .map(|other| (forward(&scene.views[own]).dot(forward(&scene.views[other])), other))
        .collect();
    others.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    others.truncate(most);
    others.into_iter().map(|(_, other)| other).collect()
}

/// About `most` of a view's probes that hit the surface and are `wanted`, evenly chosen: point and normal in the world, and
/// what `value` tells of the probe; without those of which it tells nothing.
pub fn points<T>(
    scene: &Scene,
    probes: &[Probe],
    most: usize,
    wanted: impl Fn(&Probe) -> bool,
    value: impl Fn(&Probe) -> Option<T>,
) -> Vec<(Vec3, Vec3, T)> {
    let hits: Vec<&Probe> = probes.iter().filter(|probe| probe.hit.is_some() && wanted(probe)).collect();
    let step = (hits.len() / most).max(1);
    let point = |probe: &&Probe| {
        let (point, normal, _) = surface_at(&scene.mesh, probe.hit.as_ref()?)?;
        Some((point, normal, value(probe)?))
    };
    hits.iter().step_by(step).filter_map(point).collect()
}
