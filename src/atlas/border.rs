//! Borders of charts, for drawing.

use crate::scene::Mesh;
use glam::Vec2;

/// Edges of the charts as pairs of texture coordinates, v up: edges that only one triangle has. An atlas gives the two
/// sides of a seam vertices of their own, so a seam appears once for each of its charts. Empty without texture
/// coordinates.
pub fn chart_borders(mesh: &Mesh) -> Vec<(Vec2, Vec2)> {
    if mesh.uvs.len() != mesh.positions.len() {
        return Vec::new();
    }
    let edges_of = |triangle: &[u32; 3]| {
        let [a, b, c] = *triangle;
        [(a, b), (b, c), (c, a)].map(|(start, end)| (start.min(end), start.max(end)))
    };
    let mut edges: Vec<(u32, u32)> = mesh.triangles.iter().flat_map(edges_of).collect();
    edges.sort_unstable();
    let alone = edges.chunk_by(|one, other| one == other).filter(|same| same.len() == 1);
    alone.map(|same| (mesh.uvs[same[0].0 as usize], mesh.uvs[same[0].1 as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn two_triangles_with_a_common_edge_have_four_borders() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X + Vec3::Y],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE],
            triangles: vec![[0, 1, 2], [2, 1, 3]],
            ..Mesh::default()
        };
        let borders = chart_borders(&mesh);
        assert_eq!(borders.len(), 4);
        assert!(!borders.contains(&(Vec2::X, Vec2::Y)) && !borders.contains(&(Vec2::Y, Vec2::X)));
    }
}
