//! How much detail of the surface do the photos resolve?
//!
//! A pixel covers a piece of the surface; what is smaller than that no photo tells apart. The pieces differ in size from
//! view to view and from place to place: what counts is how small they are where photos look closely, and how often such
//! a piece goes into the whole surface, since an atlas spreads its texels evenly.

use super::Report;
use super::probe::{Probe, area_in_pixel, surface_at};
use crate::math::parallel;
use crate::scene::{Mesh, Scene};

/// Share of the surface, each piece counted as often as it is seen, that is covered by larger pixels than the one that
/// counts: grazing and distant looks at a place go unheeded, and so do a few very close ones.
const COARSER_SHARE: f64 = 0.75;
/// The same where only the sharpest part counts.
const COARSER_THAN_SHARPEST: f64 = 0.95;

/// Sets [`Report::texels_resolved`] and [`Report::texels_resolved_sharpest`] from what the probes of the training views meet.
pub fn check(scene: &Scene, probes: &[Vec<Probe>], report: &mut Report) {
    let training: Vec<_> = scene.views.iter().zip(probes).filter(|(view, _)| !view.held_out).collect();
    let of_views = parallel::map_items(&training, |(view, probes)| {
        let seen = probes.iter().filter(|probe| view.states[(probe.row, probe.column)].is_surface());
        let pieces = seen.filter_map(|probe| {
            let (place, normal, _) = surface_at(&scene.mesh, probe.hit.as_ref()?)?;
            let area = f64::from(area_in_pixel(&view.camera, place, normal));
            (area.is_finite() && area > 0.0).then_some(area)
        });
        pieces.collect::<Vec<_>>()
    });
    let mut pieces: Vec<f64> = of_views.concat();
    pieces.sort_unstable_by(|one, other| other.total_cmp(one));
    let whole = surface_area(&scene.mesh);
    let resolved = |coarser_share: f64| {
        let coarser = coarser_share * pieces.iter().sum::<f64>();
        let mut so_far = 0.0;
        let chosen = pieces.iter().find(|&&area| {
            so_far += area;
            so_far >= coarser
        });
        chosen.map(|area| whole / area)
    };
    report.texels_resolved = resolved(COARSER_SHARE);
    report.texels_resolved_sharpest = resolved(COARSER_THAN_SHARPEST);
}

fn surface_area(mesh: &Mesh) -> f64 {
    (0..mesh.triangles.len()).map(|triangle| 0.5 * f64::from(mesh.area_vector(triangle).length())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::scene::demo::{DemoSettings, build};
    use crate::scene::doctor;
    use crate::scene::{Camera, Photo, PixelState, View};
    use glam::Vec3;
    use std::f32::consts::FRAC_PI_2;

    /// A square of 2 x 2 units in the plane z = 0, and cameras on its axis that see it whole or in part.
    fn square(heights: &[f32], side_pixels: usize) -> Scene {
        let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let mut mesh = Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
        mesh.compute_normals();
        let view = |&height: &f32| {
            let eye = Vec3::new(0.0, 0.0, height);
            let camera = Camera::looking_at(eye, Vec3::ZERO, side_pixels, side_pixels, FRAC_PI_2);
            View {
                name: format!("from {height}"),
                camera,
                photo: Photo::Srgb8(Image::filled(side_pixels, side_pixels, [150; 3])),
                states: Image::filled(side_pixels, side_pixels, PixelState::Surface),
                held_out: false,
                exposure_prior_stops: None,
            }
        };
        let small =
            DemoSettings { views: 1, held_out: 0, width: 8, height: 6, map_size: 64, seed: 1, ..Default::default() };
        Scene { mesh, views: heights.iter().map(view).collect(), truth: None, ..build(&small).unwrap().scene }
    }

    #[test]
    fn a_square_that_fills_the_picture_has_a_texel_a_pixel() {
        // Ninety degrees at distance 1: the picture is the square.
        let resolved = doctor::check(&square(&[1.0], 64)).texels_resolved.unwrap();
        assert!((resolved / 4096.0 - 1.0).abs() < 1e-3, "{resolved}");
        // At distance 2 it takes a quarter of the pixels.
        let resolved = doctor::check(&square(&[2.0], 64)).texels_resolved.unwrap();
        assert!((resolved / 1024.0 - 1.0).abs() < 1e-3, "{resolved}");
    }

    #[test]
    fn close_looks_count_unless_they_are_few() {
        // Half of what is seen is seen from near.
        let half = doctor::check(&square(&[2.0, 1.0], 64)).texels_resolved.unwrap();
        assert!((half / 4096.0 - 1.0).abs() < 1e-3, "{half}");
        // One of eight looks.
        let few = doctor::check(&square(&[2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.0], 64)).texels_resolved.unwrap();
        assert!((few / 1024.0 - 1.0).abs() < 1e-3, "{few}");
        // They are the sharpest part all the same.
        let sharpest = doctor::check(&square(&[2.0, 2.0, 1.0], 64)).texels_resolved_sharpest.unwrap();
        assert!((sharpest / 4096.0 - 1.0).abs() < 1e-3, "{sharpest}");
    }

    #[test]
    fn nothing_seen_resolves_nothing() {
        let mut scene = square(&[1.0, 0.5], 16);
        scene.views[0].held_out = true;
        scene.views[1].states = Image::filled(16, 16, PixelState::Ignored);
        assert_eq!(doctor::check(&scene).texels_resolved, None);
    }
}
