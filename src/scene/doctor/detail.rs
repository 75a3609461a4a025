//! Is the surface patterned more finely than the photos resolve?
//!
//! Most of what a photo of plain things shows varies slowly: between neighbouring blocks of 2 x 2 pixels there is more
//! contrast than inside of them. Where it is the other way round, and strong, details are as small as a pixel: what is
//! smaller still is lost in its mean. Noise and reflections of small things look the same. Only smooth pieces of the
//! surface are asked, so that outlines of things do not count.

use super::Report;
use super::probe::{Probe, centre_of, hit_at, surface_at};
use crate::error::{Finding, Place, Severity};
use crate::math::statistics::quantile;
use crate::math::{luminance, parallel};
use crate::scene::{Mesh, Scene, View};
use crate::trace::Bvh;
use std::collections::BTreeSet;

/// Width and height of what is judged at once, in pixels.
const TILE: usize = 4;
/// Corners of a tile are of one smooth piece when their normals' cosine is at least this,
const LEAST_COSINE: f32 = 0.8;
/// and they lie within so many pixels of each other, as these are wide at their distance.
const WIDEST_PIXELS: f32 = 12.0;
/// Least contrast inside blocks of 2 x 2 pixels, relative to the tile's mean.
const LEAST_CONTRAST: f64 = 0.1;
/// Tiles darker than this share of the view's median are left out: relative contrast means little there.
const LEAST_BRIGHTNESS: f64 = 0.2;
/// Share of tiles beyond which fine detail is told. Of plain scenes 1 to 4 %, of a texture of cells as large as pixels 13 %.
const TOLD_SHARE: f64 = 0.1;

/// Measures which share of what training photos show has its contrast in single pixels, and tells it.
pub fn check(scene: &Scene, bvh: &Bvh, probes: &[Vec<Probe>], report: &mut Report) {
    let of_views: Vec<[usize; 2]> = parallel::map(scene.views.len(), |index| {
        let view = &scene.views[index];
        if view.held_out { [0; 2] } else { count(&scene.mesh, view, bvh, &probes[index]) }
    });
    let [judged, fine] = of_views.iter().fold([0; 2], |sum, own| [sum[0] + own[0], sum[1] + own[1]]);
    let share = fine as f64 / judged.max(1) as f64;
    report.surface.fine_share = share;
    let most = (0..of_views.len()).max_by_key(|&view| (of_views[view][1], std::cmp::Reverse(view)));
    if let Some(view) = most.filter(|_| share > TOLD_SHARE) {
        let message = format!(
            "{:.0} % of what the photos show varies more from pixel to pixel than over several: a texture finer than \
             the photos resolve, reflections of small objects, or noise",
            100.0 * share
        );
        report.findings.push(
            Finding::new(Severity::Note, "detail-too-fine", message)
                .at(Place::View(scene.views[view].name.clone()))
                .remedy(
                    "take photos from closer up, or use larger ones: maps hold the mean of what a pixel shows, and the \
                     highlights of its parts are taken for one rougher whole",
                ),
        );
    }
}

/// Tiles of a view that can be judged, and of these the ones whose contrast is in single pixels.
fn count(mesh: &Mesh, view: &View, bvh: &Bvh, probes: &[Probe]) -> [usize; 2] {
    let on_surface = probes.iter().filter(|probe| probe.hit.is_some());
    let tiles: BTreeSet<_> = on_surface.map(|probe| (probe.row / TILE * TILE, probe.column / TILE * TILE)).collect();
    let contrasts: Vec<[f64; 3]> = tiles
        .into_iter()
        .filter(|&(top, left)| top + TILE <= view.camera.height && left + TILE <= view.camera.width)
        .filter(|&tile| is_smooth(mesh, view, bvh, tile))
        .filter_map(|tile| contrasts_of(view, tile))
        .collect();
    let means: Vec<f64> = contrasts.iter().map(|own| own[2]).collect();
    let darkest = if means.is_empty() { 0.0 } else { LEAST_BRIGHTNESS * quantile(&means, 0.5) };
    let is_fine = |[inside, between, mean]: &[f64; 3]| inside > between && *inside > (LEAST_CONTRAST * mean).powi(2);
    let judged = contrasts.iter().filter(|own| own[2] > darkest);
    [judged.clone().count(), judged.filter(|own| is_fine(own)).count()]
}

/// Whether the corners of a tile lie on one smooth piece of the surface.
fn is_smooth(mesh: &Mesh, view: &View, bvh: &Bvh, (top, left): (usize, usize)) -> bool {
    let (bottom, right) = (top + TILE - 1, left + TILE - 1);
    let at = |row, column| {
        let hit = hit_at(&view.camera, bvh, centre_of(row, column))?;
        surface_at(mesh, &hit).map(|(place, _, normal)| (place, normal))
    };
    let Some((place, normal)) = at(top, left) else { return false };
    let pixel = place.distance(view.camera.position_in_world()) / view.camera.focal_pixels.x;
    [(top, right), (bottom, left), (bottom, right)].into_iter().all(|(row, column)| {
        at(row, column).is_some_and(|(other, turned)| {
            turned.dot(normal) >= LEAST_COSINE && other.distance(place) <= WIDEST_PIXELS * pixel
        })
    })
}

/// Of a tile's luminance: the mean variance inside blocks of 2 x 2 pixels, the variance of their means, and the mean.
/// `None` where some pixel does not count or is clipped.
fn contrasts_of(view: &View, (top, left): (usize, usize)) -> Option<[f64; 3]> {
    let mut blocks = [[0.0; 2]; 4];
    for (index, block) in blocks.iter_mut().enumerate() {
        let (row, column) = (top + 2 * (index / 2), left + 2 * (index % 2));
        let pixels = [(row, column), (row, column + 1), (row + 1, column), (row + 1, column + 1)];
        if !pixels.iter().all(|&pixel| view.states[pixel].is_surface() && !view.states[pixel].is_clipped()) {
            return None;
        }
        *block = mean_and_variance(pixels.map(|(row, column)| f64::from(luminance(view.photo.radiance(row, column)))));
    }
    let [mean, between] = mean_and_variance(blocks.map(|block| block[0]));
    let inside = blocks.iter().map(|block| block[1]).sum::<f64>() / 4.0;
    (inside + between + mean).is_finite().then_some([inside, between, mean])
}

fn mean_and_variance(values: [f64; 4]) -> [f64; 2] {
    let mean = values.iter().sum::<f64>() / 4.0;
    [mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 4.0]
}
