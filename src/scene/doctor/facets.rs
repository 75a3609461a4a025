//! Has the mesh enough triangles for the shapes it stands for?
//!
//! A curved surface turns a little from triangle to triangle. Where it turns by many degrees although the triangles are
//! several pixels wide, photos show a shape that the mesh has not: normals, outlines and shadows are off.

use super::Report;
use super::probe::{Probe, area_in_pixel};
use crate::error::{Finding, Severity};
use crate::scene::{Mesh, Scene};
use glam::Vec3;
use std::collections::HashMap;

/// Two triangles that turn by less than this are one flat piece, in degrees.
const FLAT_DEGREES: f32 = 1.0;
/// Two triangles that turn by more meet at an edge of the thing itself, in degrees.
const CREASE_DEGREES: f32 = 60.0;
/// A triangle is coarse when it turns by more than this against its neighbours, in degrees,
const COARSE_DEGREES: f32 = 12.0;
/// and is wider than so many pixels.
const COARSE_PIXELS: f32 = 2.0;
/// Share of what is seen beyond which coarse triangles are told.
const TOLD_SHARE: f64 = 0.1;
/// Where there is so much of it, that is a warning.
const WARNED_SHARE: f64 = 0.5;

/// Mean angle in degrees between each triangle and its neighbours across edges, those left out that go on flat or end at
/// a crease; 0 where none remains. Vertices at one place are one.
pub fn turns_degrees(mesh: &Mesh) -> Vec<f32> {
    let mut point_of_bits: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    let points: Vec<u32> = mesh
        .positions
        .iter()
        .map(|position| {
            let next = point_of_bits.len() as u32;
            *point_of_bits.entry((*position + 0.0).to_array().map(f32::to_bits)).or_insert(next)
        })
        .collect();
    let normals: Vec<Option<Vec3>> =
        (0..mesh.triangles.len()).map(|triangle| mesh.area_vector(triangle).try_normalize()).collect();
    // An edge waits for the triangle on its other side.
    let mut waiting: HashMap<(u32, u32), usize> = HashMap::with_capacity(mesh.triangles.len() * 2);
    let mut sums = vec![(0f32, 0f32); mesh.triangles.len()];
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let Some(normal) = normals[triangle] else { continue };
        let corners = corners.map(|vertex| points[vertex as usize]);
        for (from, to) in [(corners[0], corners[1]), (corners[1], corners[2]), (corners[2], corners[0])] {
            let Some(other) = waiting.remove(&(from.min(to), from.max(to))) else {
                waiting.insert((from.min(to), from.max(to)), triangle);
                continue;
            };
            let Some(across) = normals[other] else { continue };
            let degrees = normal.angle_between(across).to_degrees();
            if (FLAT_DEGREES..CREASE_DEGREES).contains(&degrees) {
                for index in [triangle, other] {
                    sums[index].0 += degrees;
                    sums[index].1 += 1.0;
                }
            }
        }
    }
    sums.into_iter().map(|(sum, count)| sum / count.max(1.0)).collect()
}

/// Measures how much of what training photos show are coarse triangles, and tells it.
pub fn check(scene: &Scene, probes: &[Vec<Probe>], report: &mut Report) {
    let turns = turns_degrees(&scene.mesh);
    let (mut asked, mut coarse) = (0usize, 0usize);
    let (mut degrees, mut pixels) = (0f64, 0f64);
    for (view, probes) in scene.views.iter().zip(probes).filter(|(view, _)| !view.held_out) {
        let eye = view.camera.position_in_world();
        for probe in probes.iter().filter(|probe| view.states[(probe.row, probe.column)].is_surface()) {
            let Some(triangle) = probe.hit.map(|hit| hit.triangle as usize) else { continue };
            let [a, b, c] = scene.mesh.corners(triangle);
            let place = (a + b + c) / 3.0;
            let pixel = area_in_pixel(&view.camera, place, (eye - place).normalize_or_zero());
            let width = (0.5 * scene.mesh.area_vector(triangle).length() / pixel).sqrt();
            asked += 1;
            if turns[triangle] > COARSE_DEGREES && width > COARSE_PIXELS {
                coarse += 1;
                degrees += f64::from(turns[triangle]);
                pixels += f64::from(width);
            }
        }
    }
    let share = coarse as f64 / asked.max(1) as f64;
    report.surface.coarse_share = share;
    if share > TOLD_SHARE {
        let message = format!(
            "{:.0} % of what the photos show are triangles some {:.0} pixels wide that turn by some {:.0} degrees from \
             one to the next: the mesh is coarser than the object",
            100.0 * share,
            pixels / coarse as f64,
            degrees / coarse as f64
        );
        let severity = if share > WARNED_SHARE { Severity::Warning } else { Severity::Note };
        report.findings.push(Finding::new(severity, "mesh-coarse", message).remedy(
            "give the mesh before it was decimated; normals, outlines and shadows are off, and maps take up the \
             difference",
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The wall of a prism of so many sides, of two triangles each; with `cut`, no two sides share vertices.
    fn prism(sides: u32, cut: bool) -> Mesh {
        let corner = |index: u32, y: f32| {
            let angle = (index % sides) as f32 * std::f32::consts::TAU / sides as f32;
            Vec3::new(angle.cos(), y, angle.sin())
        };
        let mut mesh = Mesh::default();
        for side in 0..sides {
            let first = if cut { mesh.positions.len() as u32 } else { 2 * side };
            mesh.positions.extend([corner(side, 0.0), corner(side, 1.0)]);
            let next = if cut { first + 2 } else { 2 * ((side + 1) % sides) };
            if cut {
                mesh.positions.extend([corner(side + 1, 0.0), corner(side + 1, 1.0)]);
            }
            mesh.triangles.extend([[first, first + 1, next], [next, first + 1, next + 1]]);
        }
        mesh
    }

    #[test]
    fn a_prism_turns_by_its_angle_unless_that_is_a_crease() {
        for cut in [false, true] {
            let turns = turns_degrees(&prism(18, cut));
            assert!(turns.len() == 36 && turns.iter().all(|turn| (turn - 20.0).abs() < 0.01), "{turns:?}");
            assert!(turns_degrees(&prism(4, cut)).iter().all(|turn| *turn == 0.0), "a box has edges of its own");
        }
        assert!(turns_degrees(&Mesh::default()).is_empty());
    }
}
