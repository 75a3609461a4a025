//! One chart as a small mesh of its own: vertices split where the surface is cut, boundary loops, genus, halving.

use super::topology::{NONE, Topology, next};
use crate::scene::Mesh;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What every step about charts reads: the cleaned mesh, who neighbours whom, and per-triangle geometry.
pub(crate) struct Surface<'a> {
    pub mesh: &'a Mesh,
    pub topology: &'a Topology,
    /// Unit normal of each triangle.
    pub normals: Vec<DVec3>,
    /// Area of each triangle.
    pub areas: Vec<f64>,
}

impl<'a> Surface<'a> {
    pub fn new(mesh: &'a Mesh, topology: &'a Topology) -> Self {
        let cross = |triangle: usize| {
            let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
            (b - a).cross(c - a)
        };
        let normals = (0..mesh.triangles.len()).map(|t| cross(t).normalize_or_zero()).collect();
        let areas = (0..mesh.triangles.len()).map(|t| cross(t).length() / 2.0).collect();
        Surface { mesh, topology, normals, areas }
    }

    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.mesh.corners(triangle as usize).map(|corner| corner.as_dvec3())
    }
}

/// An edge-connected set of triangles with vertices of its own.
#[derive(Clone, Debug)]
pub(crate) struct ChartMesh {
    /// Triangles of the surface, ascending.
    pub triangles: Vec<u32>,
    /// Chart vertices of each triangle, in the order of `triangles`.
    pub corners: Vec<[u32; 3]>,
    /// Position of each chart vertex.
    pub positions: Vec<DVec3>,
    /// Half-edge across each half-edge inside the chart, or [`NONE`]; `3 i + e` for triangle `triangles[i]`.
    pub across: Vec<u32>,
    /// Boundary loops as chart vertices, each in the direction of its half-edges: the surface lies to the left.
    pub loops: Vec<Vec<u32>>,
    /// Handles: 0 for a disk, with or without holes.
    pub genus: usize,
}

impl ChartMesh {
    /// The chart of `triangles`, which must be ascending.
    pub fn new(surface: &Surface, triangles: Vec<u32>) -> Self {
        let count = triangles.len();
        let mut across = vec![NONE; count * 3];
        for (local, &triangle) in triangles.iter().enumerate() {
            for edge in 0..3 {
                let other = surface.topology.across[triangle as usize * 3 + edge];
                if other != NONE
                    && let Ok(neighbour) = triangles.binary_search(&(other / 3))
                {
                    across[local * 3 + edge] = neighbour as u32 * 3 + other % 3;
                }
            }
        }
        let (corners, positions) = Self::vertices(surface, &triangles, &across);
        let mut chart = ChartMesh { triangles, corners, positions, across, loops: Vec::new(), genus: 0 };
        chart.trace_loops();
        // Euler and Poincare: V - E + F = 2 - 2 genus - loops.
        let boundary = chart.loops.iter().map(Vec::len).sum::<usize>();
        let edges = (count * 3 + boundary) / 2;
        let euler = chart.positions.len() as i64 - edges as i64 + count as i64;
        chart.genus = ((2 - chart.loops.len() as i64 - euler) / 2).max(0) as usize;
        chart
    }

    /// Corners that meet through joined edges are one vertex: a fan, so that a chart which touches itself at a point
    /// or along a slit may part there.
    fn vertices(surface: &Surface, triangles: &[u32], across: &[u32]) -> (Vec<[u32; 3]>, Vec<DVec3>) {
        let mut parent: Vec<u32> = (0..across.len() as u32).collect();
        fn root(parent: &mut [u32], mut node: u32) -> u32 {
            while parent[node as usize] != node {
                parent[node as usize] = parent[parent[node as usize] as usize];
                node = parent[node as usize];
            }
            node
        }
        for (half_edge, &other) in across.iter().enumerate() {
            if other != NONE && (half_edge as u32) < other {
                for (a, b) in [(half_edge as u32, next(other)), (next(half_edge as u32), other)] {
                    let (a, b) = (root(&mut parent, a), root(&mut parent, b));
                    parent[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let mut name = vec![NONE; across.len()];
        let mut positions = Vec::new();
        let mut corners = Vec::with_capacity(triangles.len());
        for (local, &triangle) in triangles.iter().enumerate() {
            let points = surface.corners(triangle);
            corners.push([0, 1, 2].map(|corner| {
                let class = root(&mut parent, (local * 3 + corner) as u32) as usize;
                if name[class] == NONE {
                    name[class] = positions.len() as u32;
                    positions.push(points[corner]);
                }
                name[class]
            }));
        }
        (corners, positions)
    }

    fn trace_loops(&mut self) {
        let mut seen = vec![false; self.across.len()];
        for start in 0..self.across.len() {
            if self.across[start] != NONE || seen[start] {
                continue;
            }
            let mut vertices = Vec::new();
            let mut at = start as u32;
            while !seen[at as usize] {
                seen[at as usize] = true;
                vertices.push(self.corners[at as usize / 3][at as usize % 3]);
                at = next(at);
                while self.across[at as usize] != NONE {
                    at = next(self.across[at as usize]);
                }
            }
            self.loops.push(vertices);
        }
    }

    /// Parts a chart of two triangles or more in two halves of surface triangles, neither empty: seeds far apart, each
    /// triangle to the nearer. Halves are edge-connected unless all centres lie in one place.
    pub fn halves(&self, surface: &Surface) -> [Vec<u32>; 2] {
        let centres: Vec<DVec3> =
            self.triangles.iter().map(|&triangle| surface.corners(triangle).into_iter().sum::<DVec3>() / 3.0).collect();
        let farthest = |distances: &[f64]| {
            (0..distances.len()).max_by(|&a, &b| distances[a].total_cmp(&distances[b]).then(b.cmp(&a))).unwrap_or(0)
        };
        let first = farthest(&self.distances(0, &centres));
        let from_first = self.distances(first, &centres);
        let second = farthest(&from_first);
        let from_second = self.distances(second, &centres);
        let mut halves = [Vec::new(), Vec::new()];
        for (local, &triangle) in self.triangles.iter().enumerate() {
            halves[usize::from(from_second[local] < from_first[local])].push(triangle);
        }
        // All centres in one place, as of a triangle and its back: then any parting serves, but none may be empty.
        if halves[1].is_empty() {
            let moved = halves[0].pop();
            halves[1].extend(moved);
        }
        halves
    }

    /// Distances over triangle centres from one triangle (Dijkstra).
    fn distances(&self, start: usize, centres: &[DVec3]) -> Vec<f64> {
        let mut distances = vec![f64::INFINITY; centres.len()];
        distances[start] = 0.0;
        let mut queue = BinaryHeap::from([Reverse((OrderedLength(0.0), start as u32))]);
        while let Some(Reverse((OrderedLength(distance), triangle))) = queue.pop() {
            if distance > distances[triangle as usize] {
                continue;
            }
            for edge in 0..3 {
                let other = self.across[triangle as usize * 3 + edge];
                if other == NONE {
                    continue;
                }
                let neighbour = other as usize / 3;
                let length = distance + centres[triangle as usize].distance(centres[neighbour]);
                if length < distances[neighbour] {
                    distances[neighbour] = length;
                    queue.push(Reverse((OrderedLength(length), neighbour as u32)));
                }
            }
        }
        distances
    }
}

/// A length that can stand in a queue.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct OrderedLength(pub f64);

impl Eq for OrderedLength {}

impl PartialOrd for OrderedLength {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for OrderedLength {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}
