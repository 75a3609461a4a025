//! Fewer triangles for a mesh that is turned around: vertices of one cell of a grid become one (Rossignac and Borrel
//! 1993). Only indices are made anew; they name corners of the full mesh.

use crate::scene::Mesh;
use glam::{IVec3, Vec2, Vec3};
use std::collections::HashMap;

/// Cells along the longest side of the box.
const CELLS: f32 = 112.0;
/// Cells along each side of the atlas: vertices on either side of a chart's border stay two.
const ATLAS_CELLS: f32 = 16.0;

/// The triangles that are left, each with three different corners; in the order of the mesh.
pub(super) fn triangles(mesh: &Mesh, (low, high): (Vec3, Vec3)) -> Vec<[u32; 3]> {
    let per_unit = CELLS / (high - low).max_element().max(f32::MIN_POSITIVE);
    let mut first_of_cell: HashMap<(IVec3, [i32; 2], [bool; 3]), u32> = HashMap::new();
    let representative: Vec<u32> = (0..mesh.positions.len())
        .map(|vertex| {
            let cell = ((mesh.positions[vertex] - low) * per_unit).as_ivec3();
            let uv = (mesh.uvs.get(vertex).copied().unwrap_or(Vec2::ZERO) * ATLAS_CELLS).floor().as_ivec2();
            // The two sides of a thin sheet stay two as well.
            let side = mesh.normals.get(vertex).map_or([false; 3], |normal| normal.to_array().map(|value| value < 0.0));
            *first_of_cell.entry((cell, uv.to_array(), side)).or_insert(vertex as u32)
        })
        .collect();
    let moved = mesh.triangles.iter().map(|triangle| triangle.map(|vertex| representative[vertex as usize]));
    moved.filter(|[a, b, c]| a != b && b != c && c != a).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fine_grid_loses_most_triangles_and_none_of_its_extent() {
        let side = 700u32;
        let mut mesh = Mesh::default();
        for row in 0..side {
            for column in 0..side {
                mesh.positions.push(Vec3::new(column as f32, 0.0, row as f32) / (side - 1) as f32);
            }
        }
        for row in 0..side - 1 {
            for column in 0..side - 1 {
                let corner = row * side + column;
                mesh.triangles.push([corner, corner + side, corner + 1]);
                mesh.triangles.push([corner + 1, corner + side, corner + side + 1]);
            }
        }
        let few = triangles(&mesh, (Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0)));
        assert!(few.len() * 10 < mesh.triangles.len(), "{} of {}", few.len(), mesh.triangles.len());
        // The area that is covered stays, but for the border cells.
        let area: f32 = few
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
                0.5 * (b - a).cross(c - a).y
            })
            .sum();
        assert!((area - 1.0).abs() < 0.02, "{area}");
    }
}
