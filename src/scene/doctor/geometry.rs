//! Is the mesh a surface one can see?

use super::Report;
use super::probe::{Probe, surface_at};
use crate::error::{Finding, Place, Severity};
use crate::scene::{Mesh, Scene};
use glam::Vec3;
use std::collections::HashMap;

/// Counts of the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct MeshCheck {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Triangles without area.
    pub degenerate_triangles: usize,
    /// Triangles that repeat the corner positions of an earlier one, in any order.
    pub duplicate_triangles: usize,
    /// Vertices that no triangle uses.
    pub unreferenced_vertices: usize,
    /// Edges that more than two triangles share.
    pub crowded_edges: usize,
}

/// Counts what is wrong with a mesh; the second part names the first degenerate and the first duplicate triangle.
pub fn count(mesh: &Mesh) -> (MeshCheck, [Option<usize>; 2]) {
    let mut check = MeshCheck { vertices: mesh.positions.len(), triangles: mesh.triangles.len(), ..Default::default() };
    let mut first = [None; 2];
    let mut used = vec![false; mesh.positions.len()];
    // Vertices at one place are one point: a seam in the texture is not a hole.
    let mut point_of_bits: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    let points: Vec<u32> = mesh
        .positions
        .iter()
        .map(|position| {
            let next = point_of_bits.len() as u32;
            *point_of_bits.entry((*position + 0.0).to_array().map(f32::to_bits)).or_insert(next)
        })
        .collect();
    let mut seen = HashMap::with_capacity(mesh.triangles.len());
    let mut edges: HashMap<(u32, u32), u32> = HashMap::with_capacity(mesh.triangles.len() * 3 / 2);
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        triangle.iter().for_each(|&vertex| used[vertex as usize] = true);
        let mut corners = triangle.map(|vertex| points[vertex as usize]);
        if mesh.area_vector(index).length_squared() <= 0.0 {
            check.degenerate_triangles += 1;
            first[0].get_or_insert(index);
            continue;
        }
        corners.sort_unstable();
        if seen.insert(corners, index).is_some() {
            check.duplicate_triangles += 1;
            first[1].get_or_insert(index);
            continue;
        }
        for (a, b) in [(corners[0], corners[1]), (corners[1], corners[2]), (corners[0], corners[2])] {
            *edges.entry((a, b)).or_insert(0) += 1;
        }
    }
    check.unreferenced_vertices = used.iter().filter(|used| !**used).count();
    check.crowded_edges = edges.values().filter(|count| **count > 2).count();
    (check, first)
}

/// Counts the mesh, and by the probes which side of it the cameras see.
pub fn check(scene: &Scene, probes: &[Vec<Probe>], report: &mut Report) {
    let (counts, [first_degenerate, first_duplicate]) = count(&scene.mesh);
    report.mesh = counts;
    let place = |first: Option<usize>| first.map_or(Place::Nowhere, Place::Triangle);
    let mut note = |count: usize, code, what: &str, first: Option<usize>, remedy: &str| {
        if count > 0 {
            let severity = if count * 20 > counts.triangles { Severity::Warning } else { Severity::Note };
            report
                .findings
                .push(Finding::new(severity, code, format!("{count} {what}")).at(place(first)).remedy(remedy));
        }
    };
    note(
        counts.degenerate_triangles,
        "mesh-degenerate",
        "triangles have no area, this is the first",
        first_degenerate,
        "rays miss them, and the atlas removes them",
    );
    note(
        counts.duplicate_triangles,
        "mesh-duplicate",
        "triangles repeat an earlier one, this is the first",
        first_duplicate,
        "only the first of each is seen: remove the copies",
    );
    note(
        counts.unreferenced_vertices,
        "mesh-unreferenced",
        "vertices belong to no triangle",
        None,
        "they are not used",
    );
    note(
        counts.crowded_edges,
        "mesh-non-manifold",
        "edges are shared by more than two triangles",
        None,
        "the atlas cuts there; a cleaner mesh gives larger UV islands",
    );
    check_sides(scene, probes, report);
}

fn check_sides(scene: &Scene, probes: &[Vec<Probe>], report: &mut Report) {
    let (mut hits, mut back, mut opposed) = (0usize, 0usize, 0usize);
    for ((view, probes), line) in scene.views.iter().zip(probes).zip(&mut report.views) {
        let mut of_view = [0usize; 3];
        let position = view.camera.position_in_world();
        for (point, normal, shading) in probes.iter().filter_map(|probe| surface_at(&scene.mesh, probe.hit.as_ref()?)) {
            let is_back = normal.dot(position - point) < 0.0;
            of_view[0] += 1;
            of_view[1] += usize::from(is_back);
            of_view[2] += usize::from(!is_back && shading.dot(normal) < 0.0);
        }
        let share = |part: usize, whole: usize| if whole == 0 { 0.0 } else { part as f64 / whole as f64 };
        line.mesh_share = share(of_view[0], probes.len());
        line.back_face_share = share(of_view[1], of_view[0]);
        line.opposed_normal_share = share(of_view[2], of_view[0] - of_view[1]);
        hits += of_view[0];
        back += of_view[1];
        opposed += of_view[2];
    }
    let back_share = back as f64 / hits.max(1) as f64;
    let opposed_share = opposed as f64 / (hits - back).max(1) as f64;
    if back_share > 0.5 {
        let inside =
            if are_inside(scene) { ", or larger than it should be, since all cameras stand within it" } else { "" };
        let flip = if scene.has_manifest() { "set flip_winding = true in scene.toml, or " } else { "" };
        report.findings.push(
            Finding::new(
                Severity::Fatal,
                "mesh-inside-out",
                format!(
                    "the cameras see {:.0} % back faces: the triangles are wound the wrong way{inside}",
                    100.0 * back_share
                ),
            )
            .remedy(format!("{flip}flip the faces in the mesh; a mirrored axis or other units do the same")),
        );
    } else if back_share > 0.02 {
        report.findings.push(
            Finding::new(
                Severity::Warning,
                "mesh-back-faces",
                format!("the cameras see {:.1} % back faces, which are black", 100.0 * back_share),
            )
            .remedy("close the holes of the mesh, or flip the parts that are wound the wrong way"),
        );
    }
    if opposed_share > 0.5 {
        report.findings.push(
            Finding::new(Severity::Fatal, "normals-inside-out", format!("{:.0} % of the normals point away from the side that is seen", 100.0 * opposed_share))
                .remedy("export the mesh without normals (they are then computed), or with normals that agree with its triangles"),
        );
    } else if opposed_share > 0.02 {
        report.findings.push(
            Finding::new(
                Severity::Warning,
                "normals-opposed",
                format!("{:.1} % of the normals point away from the side that is seen", 100.0 * opposed_share),
            )
            .remedy("export the mesh without normals: they are then computed"),
        );
    }
}

/// Whether all cameras stand within the box around the mesh.
fn are_inside(scene: &Scene) -> bool {
    let (low, high) = scene
        .mesh
        .triangles
        .iter()
        .flatten()
        .map(|&vertex| scene.mesh.positions[vertex as usize])
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)));
    let is_inside = |point: Vec3| point.cmpge(low).all() && point.cmple(high).all();
    scene.views.iter().all(|view| is_inside(view.camera.position_in_world()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_bad_triangle_is_counted_once() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X, Vec3::splat(9.0), 2.0 * Vec3::X],
            triangles: vec![[0, 1, 2], [2, 0, 3], [0, 1, 5], [0, 0, 1]],
            ..Default::default()
        };
        let (check, first) = count(&mesh);
        assert_eq!(check.degenerate_triangles, 2);
        assert_eq!(check.duplicate_triangles, 1, "a copy with another vertex at the same place");
        assert_eq!(check.unreferenced_vertices, 1);
        assert_eq!(first, [Some(2), Some(1)]);
    }
}
