//! Neighbouring charts that lie flat together become one.
//!
//! Clusters of normals cut a cylinder in three and a house in its faces, although both unroll without distortion. Here
//! pairs of neighbours are mapped together on trial; the union stays when it is good, hardly distorted, and takes no
//! more room on the map, gutters counted, than the two apart. Rounds of disjoint pairs run side by side.

use super::chart::{ChartMesh, Surface};
use super::flatten::{FlatChart, Limits, try_flatten};
use super::shape::least_box;
use super::topology::NONE;
use crate::math::parallel;
use std::collections::{HashMap, HashSet};

/// Distortion allowed in a union: tighter than in a first chart, for nothing forces a merge.
const UNION_LIMITS: Limits = Limits { angle: 1.04, area: 1.15 };
/// Room that a union may take, as a multiple of the room of its halves: fewer seams are worth a little room.
const ROOM_FACTOR: f64 = 1.05;
/// Share of its box that a large union has to fill: small charts nest beside a crooked one, large ones leave it bare.
const FILL_LEAST: f64 = 0.66;
/// Share of the surface from which a union is large.
const LARGE: f64 = 0.03;
/// Share of the outline of the smaller chart that has to be common.
const SHARED_LEAST: f64 = 0.08;
const ROUNDS: usize = 60;
/// Triangles mapped on trial before no more pairs are tried: six times those of the mesh, less often for large meshes.
fn trial_budget(triangles: usize) -> usize {
    (6 * triangles).min((triangles * 5 / 4).max(500_000))
}

struct Candidate {
    flat: FlatChart,
    outline: f64,
    room: f64,
    area: f64,
    /// Share of its box.
    fill: f64,
    /// Grows with every union, so that a pair that failed is not tried again until one of the two has changed.
    name: u32,
}

impl Candidate {
    fn new(flat: FlatChart, gutter: f64, name: u32) -> Self {
        let size = least_box(&flat.points).size;
        let corners = |corners: &[u32; 3]| corners.map(|vertex| flat.points[vertex as usize]);
        let area: f64 = flat.chart.corners.iter().map(corners).map(|[a, b, c]| (b - a).perp_dot(c - a) / 2.0).sum();
        let outline = outline_length(&flat);
        // Half way between the room of the chart and that of its box, for charts nest, with half a gutter around it.
        let around = outline * gutter / 2.0 + gutter * gutter;
        let room = 0.5 * (area + around + (size.x + gutter) * (size.y + gutter));
        Candidate { flat, outline, room, area, fill: area / (size.x * size.y), name }
    }
}

/// Merges charts. `texels_per_unit` is the expected scale of the map, `gutter` the empty texels around each chart.
pub(crate) fn merge(
    surface: &Surface,
    charts: Vec<FlatChart>,
    texels_per_unit: f64,
    gutter: usize,
    progress: &(dyn Fn(f32) + Sync),
) -> Vec<FlatChart> {
    let gutter = gutter as f64 / texels_per_unit;
    let large = LARGE * surface.areas.iter().sum::<f64>();
    let mut charts: Vec<Option<Candidate>> =
        charts.into_iter().enumerate().map(|(name, flat)| Some(Candidate::new(flat, gutter, name as u32))).collect();
    let mut label = vec![0u32; surface.areas.len()];
    for (index, chart) in charts.iter().enumerate() {
        for &triangle in chart.iter().flat_map(|chart| &chart.flat.chart.triangles) {
            label[triangle as usize] = index as u32;
        }
    }
    let mut names = charts.len() as u32;
    let mut failed: HashSet<(u32, u32)> = HashSet::new();
    let mut budget = trial_budget(surface.areas.len());
    for round in 0..ROUNDS {
        let pairs = disjoint_pairs(surface, &label, &charts, &failed, &mut budget);
        if pairs.is_empty() {
            break;
        }
        let unions = parallel::map_items(&pairs, |&(a, b)| {
            let (a, b) = (charts[a as usize].as_ref()?, charts[b as usize].as_ref()?);
            let mut triangles = a.flat.chart.triangles.clone();
            triangles.extend(&b.flat.chart.triangles);
            triangles.sort_unstable();
            let flat = try_flatten(surface, &ChartMesh::new(surface, triangles), UNION_LIMITS)?;
            let union = Candidate::new(flat, gutter, 0);
            let halves_fill = (a.area * a.fill + b.area * b.fill) / (a.area + b.area);
            let crooked = union.area > large && union.fill < FILL_LEAST.min(halves_fill);
            (!crooked && union.room <= ROOM_FACTOR * (a.room + b.room)).then_some(union)
        });
        for (&(a, b), union) in pairs.iter().zip(unions) {
            let Some(mut union) = union else {
                if let (Some(a), Some(b)) = (&charts[a as usize], &charts[b as usize]) {
                    failed.insert((a.name, b.name));
                }
                continue;
            };
            for &triangle in &union.flat.chart.triangles {
                label[triangle as usize] = a;
            }
            union.name = names;
            names += 1;
            charts[a as usize] = Some(union);
            charts[b as usize] = None;
        }
        progress((round + 1) as f32 / ROUNDS as f32);
    }
    charts.into_iter().flatten().map(|candidate| candidate.flat).collect()
}

/// Pairs of neighbours, each chart in one pair at most; those that share most of their outline first.
fn disjoint_pairs(
    surface: &Surface,
    label: &[u32],
    charts: &[Option<Candidate>],
    failed: &HashSet<(u32, u32)>,
    budget: &mut usize,
) -> Vec<(u32, u32)> {
    let mut shared: HashMap<(u32, u32), f64> = HashMap::new();
    for (half_edge, &other) in surface.topology.across.iter().enumerate() {
        if other == NONE || other < half_edge as u32 {
            continue;
        }
        let (a, b) = (label[half_edge / 3], label[other as usize / 3]);
        if a != b {
            let corners = surface.corners(half_edge as u32 / 3);
            let length = corners[half_edge % 3].distance(corners[(half_edge + 1) % 3]);
            *shared.entry((a.min(b), a.max(b))).or_insert(0.0) += length;
        }
    }
    let mut ranked: Vec<(f64, u32, u32)> = shared
        .into_iter()
        .filter_map(|((a, b), length)| {
            let (first, second) = (charts[a as usize].as_ref()?, charts[b as usize].as_ref()?);
            let share = length / first.outline.min(second.outline);
            (share >= SHARED_LEAST && !failed.contains(&(first.name, second.name))).then_some((share, a, b))
        })
        .collect();
    ranked.sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut taken = vec![false; charts.len()];
    let mut pairs = Vec::new();
    for (_, a, b) in ranked {
        if taken[a as usize] || taken[b as usize] {
            continue;
        }
        let triangles =
            |index: u32| charts[index as usize].as_ref().map_or(0, |chart| chart.flat.chart.triangles.len());
        let cost = triangles(a) + triangles(b);
        if cost > *budget {
            continue;
        }
        *budget -= cost;
        (taken[a as usize], taken[b as usize]) = (true, true);
        pairs.push((a, b));
    }
    pairs
}

fn outline_length(flat: &FlatChart) -> f64 {
    let length = |vertices: &Vec<u32>| -> f64 {
        let at = |index: usize| flat.points[vertices[index % vertices.len()] as usize];
        (0..vertices.len()).map(|index| at(index).distance(at(index + 1))).sum()
    };
    flat.chart.loops.iter().map(length).sum()
}
