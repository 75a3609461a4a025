//! What the viewport frames: the part of the surface that the photos show, not the ground that runs on around it.

use crate::math::statistics::quantile;
use crate::scene::{Mesh, Scene};
use glam::Vec3;

/// Triangles that are looked at, at most.
const MOST_TRIANGLES: usize = 20_000;
/// Cameras that are asked, at most.
const MOST_CAMERAS: usize = 24;
/// Share of an image's width and height about its middle in which lies what it was taken of.
const MIDDLE: f32 = 0.7;
/// Share of what was found that is cut off at each end of an axis.
const CUT: f64 = 0.02;

/// Lower and upper corner of what the photos were taken of; of the whole mesh without cameras.
pub fn subject(mesh: &Mesh, scene: Option<&Scene>) -> (Vec3, Vec3) {
    let whole = bounds(mesh);
    let Some(scene) = scene.filter(|scene| !scene.views.is_empty()) else { return whole };
    let every_camera = scene.views.len().div_ceil(MOST_CAMERAS);
    let every_triangle = mesh.triangles.len().div_ceil(MOST_TRIANGLES).max(1);
    let centres: Vec<Vec3> = (0..mesh.triangles.len())
        .step_by(every_triangle)
        .map(|triangle| mesh.corners(triangle).into_iter().sum::<Vec3>() / 3.0)
        .collect();
    let counts: Vec<usize> = centres
        .iter()
        .map(|centre| {
            let views = scene.views.iter().step_by(every_camera);
            views.filter(|view| is_in_the_middle(&view.camera, *centre)).count()
        })
        .collect();
    let most = counts.iter().copied().max().unwrap_or(0);
    if most == 0 {
        return whole;
    }
    // What at least half as many photos have in their middle as the best of all.
    let seen: Vec<Vec3> =
        centres.iter().zip(&counts).filter(|(_, count)| 2 * **count >= most).map(|(centre, _)| *centre).collect();
    let end = |axis: usize, share: f64| {
        let values: Vec<f64> = seen.iter().map(|centre| f64::from(centre[axis])).collect();
        quantile(&values, share) as f32
    };
    let corner = |share: f64| Vec3::new(end(0, share), end(1, share), end(2, share));
    let (low, high) = (corner(CUT), corner(1.0 - CUT));
    if (high - low).length() > 1e-4 * (whole.1 - whole.0).length() { (low, high) } else { whole }
}

/// Lower and upper corner of a mesh; a box about the origin for one without vertices.
pub(super) fn bounds(mesh: &Mesh) -> (Vec3, Vec3) {
    mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE))
}

fn is_in_the_middle(camera: &crate::scene::Camera, point_in_world: Vec3) -> bool {
    let Some((pixel, _)) = camera.project(point_in_world) else { return false };
    let (width, height) = (camera.width as f32, camera.height as f32);
    (pixel.x / width - 0.5).abs() < 0.5 * MIDDLE && (pixel.y / height - 0.5).abs() < 0.5 * MIDDLE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::demo::{DemoSettings, build};

    #[test]
    fn ground_far_away_is_not_framed() {
        let small =
            DemoSettings { views: 6, held_out: 0, width: 48, height: 36, map_size: 64, seed: 1, ..Default::default() };
        let scene = build(&small).unwrap().scene;
        let near = subject(&scene.mesh, Some(&scene));
        let mut mesh = scene.mesh.clone();
        // The same mesh, with a triangle a hundred times as far out as all else.
        let far = 100.0 * mesh.bounds().unwrap().1.length();
        let first = mesh.positions.len() as u32;
        for corner in [Vec3::new(far, 0.0, 0.0), Vec3::new(far, 0.0, 1.0), Vec3::new(far, 1.0, 0.0)] {
            mesh.positions.push(corner);
        }
        mesh.triangles.push([first, first + 1, first + 2]);
        let (low, high) = subject(&mesh, Some(&scene));
        assert!((high - low).length() < 2.0 * (near.1 - near.0).length(), "{low} {high}");
        assert_eq!(subject(&mesh, None), mesh.bounds().unwrap());
    }
}
