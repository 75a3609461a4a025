//! First charts: triangles merged bottom-up into compact clusters of similar normals.
//!
//! Every triangle starts alone. The queue holds pairs of neighbours; the cheapest pair merges while the merged cluster
//! stays within the cone of normals. Disjoint parts never meet, so any number of them is fine. The idea is hierarchical
//! face clustering (Garland, Willmott and Heckbert 2001), with the spread of normals in place of the fit of a plane.

use super::chart::{OrderedLength, Surface};
use super::topology::NONE;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// How much a ragged outline costs against a spread of normals.
const COMPACTNESS_WEIGHT: f64 = 0.01;
/// Spread allowed when a cluster of few triangles is swallowed by a neighbour.
const TINY_SPREAD_FACTOR: f64 = 1.5;

struct Cluster {
    area: f64,
    /// Sum of area times normal.
    area_vector: DVec3,
    perimeter: f64,
    triangles: usize,
    version: u32,
    /// Length of the border shared with each neighbour. Never iterated in an order that matters.
    shared: HashMap<u32, f64>,
}

struct Clusters {
    clusters: Vec<Cluster>,
    parent: Vec<u32>,
}

type Entry = Reverse<(OrderedLength, u32, u32, u32, u32)>;

/// The cluster of each triangle, numbered from 0 without gaps in the order of their first triangle.
///
/// `spread_limit` bounds `1 - |sum of area vectors| / area` of a cluster: 0 is flat, 0.15 is a cap of 45 degrees,
/// 0.25 one of 60. Clusters of fewer than `tiny` triangles or with less than `tiny_area` are merged a little beyond it.
pub(crate) fn cluster(surface: &Surface, spread_limit: f64, tiny: usize, tiny_area: f64) -> Vec<u32> {
    let mut state = Clusters::singles(surface);
    state.merge(spread_limit, |_, _| true);
    state.merge(spread_limit * TINY_SPREAD_FACTOR, |a, b| {
        let small = |cluster: &Cluster| cluster.triangles < tiny || cluster.area < tiny_area;
        small(a) || small(b)
    });
    let mut name = HashMap::new();
    (0..surface.areas.len() as u32)
        .map(|triangle| {
            let root = state.root(triangle);
            let count = name.len() as u32;
            *name.entry(root).or_insert(count)
        })
        .collect()
}

impl Clusters {
    fn singles(surface: &Surface) -> Self {
        let count = surface.areas.len();
        let clusters = (0..count)
            .map(|triangle| {
                let corners = surface.corners(triangle as u32);
                let mut shared = HashMap::new();
                let mut perimeter = 0.0;
                for edge in 0..3 {
                    let length = corners[edge].distance(corners[(edge + 1) % 3]);
                    perimeter += length;
                    let other = surface.topology.across[triangle * 3 + edge];
                    if other != NONE && other as usize / 3 != triangle {
                        *shared.entry(other / 3).or_insert(0.0) += length;
                    }
                }
                Cluster {
                    area: surface.areas[triangle],
                    area_vector: surface.normals[triangle] * surface.areas[triangle],
                    perimeter,
                    triangles: 1,
                    version: 0,
                    shared,
                }
            })
            .collect();
        Clusters { clusters, parent: (0..count as u32).collect() }
    }

    fn root(&mut self, mut node: u32) -> u32 {
        while self.parent[node as usize] != node {
            self.parent[node as usize] = self.parent[self.parent[node as usize] as usize];
            node = self.parent[node as usize];
        }
        node
    }

    /// Spread of normals and cost of the union of two neighbours.
    fn union_cost(&self, a: u32, b: u32) -> (f64, f64) {
        let (first, second) = (&self.clusters[a as usize], &self.clusters[b as usize]);
        let area = first.area + second.area;
        let spread = (1.0 - (first.area_vector + second.area_vector).length() / area).max(0.0);
        let shared = first.shared.get(&b).copied().unwrap_or(0.0);
        let perimeter = (first.perimeter + second.perimeter - 2.0 * shared).max(0.0);
        let raggedness = perimeter * perimeter / (4.0 * std::f64::consts::PI * area);
        (spread, spread + COMPACTNESS_WEIGHT * raggedness)
    }

    fn entry(&self, a: u32, b: u32) -> (f64, Entry) {
        let (a, b) = (a.min(b), a.max(b));
        let (spread, cost) = self.union_cost(a, b);
        let versions = (self.clusters[a as usize].version, self.clusters[b as usize].version);
        (spread, Reverse((OrderedLength(cost), a, b, versions.0, versions.1)))
    }

    fn merge(&mut self, spread_limit: f64, wanted: impl Fn(&Cluster, &Cluster) -> bool) {
        let mut pairs = Vec::new();
        for a in 0..self.clusters.len() as u32 {
            if self.parent[a as usize] == a {
                pairs.extend(self.clusters[a as usize].shared.keys().filter(|&&b| a < b).map(|&b| (a, b)));
            }
        }
        let mut queue: BinaryHeap<Entry> = pairs.into_iter().map(|(a, b)| self.entry(a, b).1).collect();
        while let Some(Reverse((_, a, b, version_a, version_b))) = queue.pop() {
            let (root_a, root_b) = (self.root(a), self.root(b));
            if root_a == root_b {
                continue;
            }
            let (spread, entry) = self.entry(root_a, root_b);
            // A pair that has changed since it was queued takes its new place; the copy of a pair is harmless.
            if (entry.0.1, entry.0.2, entry.0.3, entry.0.4) != (a, b, version_a, version_b) {
                if spread <= spread_limit {
                    queue.push(entry);
                }
                continue;
            }
            if spread <= spread_limit && wanted(&self.clusters[a as usize], &self.clusters[b as usize]) {
                self.unite(a, b);
            }
        }
    }

    fn unite(&mut self, a: u32, b: u32) {
        // The one with fewer neighbours moves: every border is renamed a logarithmic number of times.
        let larger = self.clusters[a as usize].shared.len() >= self.clusters[b as usize].shared.len();
        let (keep, gone) = if larger { (a, b) } else { (b, a) };
        let moved = std::mem::take(&mut self.clusters[gone as usize].shared);
        let shared = moved.get(&keep).copied().unwrap_or(0.0);
        for (other, length) in moved {
            if other == keep {
                continue;
            }
            *self.clusters[keep as usize].shared.entry(other).or_insert(0.0) += length;
            let reverse = &mut self.clusters[other as usize].shared;
            reverse.remove(&gone);
            *reverse.entry(keep).or_insert(0.0) += length;
        }
        let (area, vector, perimeter, triangles) = {
            let gone = &self.clusters[gone as usize];
            (gone.area, gone.area_vector, gone.perimeter, gone.triangles)
        };
        let kept = &mut self.clusters[keep as usize];
        kept.shared.remove(&gone);
        kept.area += area;
        kept.area_vector += vector;
        kept.perimeter += perimeter - 2.0 * shared;
        kept.triangles += triangles;
        kept.version += 1;
        self.parent[gone as usize] = keep;
    }
}
