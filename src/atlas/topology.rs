//! Who is whose neighbour: vertices welded by position, triangles joined across edges.
//!
//! An edge joins two triangles when exactly two of them share it and walk it in opposite directions. Every other edge
//! is cut open: charts end there. Edges are matched by vertex index first and by position second, so that two objects
//! which touch along an edge stay apart when their files keep them apart.

use crate::error::{Finding, Severity};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// "No neighbour across this edge".
pub(crate) const NONE: u32 = u32::MAX;

/// Neighbours of triangles. Half-edge `3 t + e` runs from corner `e` of triangle `t` to corner `(e + 1) % 3`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Topology {
    /// Half-edge on the other side of each half-edge, or [`NONE`].
    pub across: Vec<u32>,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges whose two triangles walk it in the same direction.
    pub winding_conflicts: usize,
}

/// Index of the first vertex at the same position, for each vertex. Both zeros are one position.
pub(crate) fn weld(positions: &[Vec3]) -> Vec<u32> {
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
    let key = |point: &Vec3| (*point + Vec3::ZERO).to_array().map(f32::to_bits);
    positions.iter().enumerate().map(|(index, point)| *first.entry(key(point)).or_insert(index as u32)).collect()
}

/// The half-edge after this one in its triangle.
pub(crate) fn next(half_edge: u32) -> u32 {
    if half_edge % 3 == 2 { half_edge - 2 } else { half_edge + 1 }
}

impl Topology {
    /// The neighbours of `triangles`, whose vertex `v` lies at point `points[v]`.
    pub fn new(triangles: &[[u32; 3]], points: &[u32]) -> Self {
        let mut topology = Topology { across: vec![NONE; triangles.len() * 3], ..Topology::default() };
        let mut open: Vec<u32> = (0..topology.across.len() as u32).collect();
        let ends = |half_edge: u32| {
            let corners = triangles[half_edge as usize / 3];
            (corners[half_edge as usize % 3], corners[(half_edge as usize + 1) % 3])
        };
        let identity = |vertex: u32| vertex;
        topology.join(&mut open, &ends, &identity, false);
        topology.join(&mut open, &ends, &|vertex| points[vertex as usize], true);
        topology
    }

    /// What was cut, for the user.
    pub fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        if self.non_manifold_edges > 0 {
            let message = format!("{} edges have more than two faces and were cut open", self.non_manifold_edges);
            findings.push(Finding::new(Severity::Note, "mesh-non-manifold", message));
        }
        if self.winding_conflicts > 0 {
            let message =
                format!("faces turn against each other at {} edges, which were cut open", self.winding_conflicts);
            findings.push(
                Finding::new(Severity::Warning, "mesh-winding", message)
                    .remedy("make the faces consistent, or check that normals point outwards"),
            );
        }
        findings
    }

    /// Joins the half-edges of `open` which lie alone with one opposite partner under `name`; what stays single
    /// remains in `open`, except half-edges of non-manifold edges, which stay cut.
    fn join(
        &mut self,
        open: &mut Vec<u32>,
        ends: &(impl Fn(u32) -> (u32, u32) + Sync),
        name: &(impl Fn(u32) -> u32 + Sync),
        last: bool,
    ) {
        let mut edges: Vec<(u64, u32, bool)> = open
            .par_iter()
            .map(|&half_edge| {
                let (from, to) = ends(half_edge);
                let (from, to) = (name(from), name(to));
                let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                (key, half_edge, from < to)
            })
            .collect();
        edges.par_sort_unstable();
        open.clear();
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            match group {
                [single] => open.push(single.1),
                [a, b] if a.2 != b.2 => {
                    self.across[a.1 as usize] = b.1;
                    self.across[b.1 as usize] = a.1;
                }
                [a, b] => {
                    if last {
                        self.winding_conflicts += 1;
                    } else {
                        open.extend([a.1, b.1]);
                    }
                }
                _ => self.non_manifold_edges += 1,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_objects_with_their_own_vertices_stay_apart() {
        // Two quads of two triangles each, which share the edge from (0,0,0) to (0,1,0) only by position.
        let positions: Vec<Vec3> =
            [(0, 0), (1, 0), (1, 1), (0, 1)].iter().map(|&(x, y)| Vec3::new(x as f32, y as f32, 0.0)).collect();
        let mut all = positions.clone();
        all.extend(positions.iter().map(|p| Vec3::new(-p.x, p.y, 1.0 - 1.0)));
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]];
        let topology = Topology::new(&triangles, &weld(&all));
        assert_eq!(topology.non_manifold_edges, 0);
        assert_eq!(topology.across[2], 3, "the diagonal of the first quad");
        assert_eq!(topology.across[5], 9, "the two quads meet at one edge and are joined by position");
    }

    #[test]
    fn an_edge_of_three_triangles_is_cut() {
        let positions = [Vec3::ZERO, Vec3::Y, Vec3::X, Vec3::Z, Vec3::NEG_X];
        let topology = Topology::new(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]], &weld(&positions));
        assert_eq!(topology.non_manifold_edges, 1);
        assert!(topology.across.iter().all(|&other| other == NONE));
    }
}
