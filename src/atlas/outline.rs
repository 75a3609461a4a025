//! Does the outline of a flat chart cross itself, does the chart wind around a vertex more than once?
//!
//! A flat chart without flipped triangles, whose boundary is simple and whose vertices are surrounded once, covers
//! every point of the plane at most once. These tests are exact up to rounding, where counting pixels would not be.

use super::chart::ChartMesh;
use glam::DVec2;
use std::collections::HashMap;

/// Whether the triangles around some inner vertex turn by more than one full turn.
pub(crate) fn wraps(chart: &ChartMesh, points: &[DVec2]) -> bool {
    let mut angles = vec![0.0; points.len()];
    for corners in &chart.corners {
        for corner in 0..3 {
            let at = points[corners[corner] as usize];
            let to_next = points[corners[(corner + 1) % 3] as usize] - at;
            let to_previous = points[corners[(corner + 2) % 3] as usize] - at;
            angles[corners[corner] as usize] += to_next.angle_to(to_previous).abs();
        }
    }
    angles.iter().any(|&angle| angle > std::f64::consts::TAU + 1e-3)
}

/// Whether two edges of the boundary loops cross, or touch other than at the vertex they share.
pub(crate) fn crosses_itself(loops: &[Vec<u32>], points: &[DVec2]) -> bool {
    let edges: Vec<[u32; 2]> =
        loops.iter().flat_map(|l| (0..l.len()).map(move |i| [l[i], l[(i + 1) % l.len()]])).collect();
    let ends = |edge: [u32; 2]| edge.map(|vertex| points[vertex as usize]);
    let (mut low, mut high, mut total) = (DVec2::INFINITY, DVec2::NEG_INFINITY, 0.0);
    for &edge in &edges {
        let [a, b] = ends(edge);
        (low, high, total) = (low.min(a).min(b), high.max(a).max(b), total + a.distance(b));
    }
    // Cells about as large as an edge, and never so many that long edges walk through thousands.
    let extent = (high - low).max_element();
    let cell = (total / edges.len() as f64).max(extent / 256.0);
    if !(cell > 0.0 && cell.is_finite()) {
        return true;
    }
    let mut cells: HashMap<(i32, i32), Vec<u32>> = HashMap::new();
    for (index, &edge) in edges.iter().enumerate() {
        let [a, b] = ends(edge);
        let corner = |point: DVec2| ((point - low) / cell).floor().as_ivec2();
        let (from, to) = (corner(a.min(b)), corner(a.max(b)));
        for y in from.y..=to.y {
            for x in from.x..=to.x {
                let others = cells.entry((x, y)).or_default();
                if others.iter().any(|&other| edges_meet(edges[other as usize], edge, points)) {
                    return true;
                }
                others.push(index as u32);
            }
        }
    }
    false
}

fn edges_meet(first: [u32; 2], second: [u32; 2], points: &[DVec2]) -> bool {
    let [a, b] = first.map(|vertex| points[vertex as usize]);
    let [c, d] = second.map(|vertex| points[vertex as usize]);
    let side = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p);
    let shared = first.iter().find(|vertex| second.contains(vertex));
    if let Some(&vertex) = shared {
        let other = |edge: [u32; 2]| points[if edge[0] == vertex { edge[1] } else { edge[0] } as usize];
        let (at, to, too) = (points[vertex as usize], other(first), other(second));
        // Edges with a common vertex cross only by lying on each other.
        return to != too && side(at, to, too) == 0.0 && (to - at).dot(too - at) > 0.0;
    }
    let (s1, s2, s3, s4) = (side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b));
    let boxes_apart = a.max(b).cmplt(c.min(d)).any() || c.max(d).cmplt(a.min(b)).any();
    !boxes_apart && s1 * s2 <= 0.0 && s3 * s4 <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bow_tie_crosses_itself_and_a_square_does_not() {
        let points = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        assert!(!crosses_itself(&[vec![0, 1, 2, 3]], &points));
        assert!(crosses_itself(&[vec![0, 2, 1, 3]], &points));
    }

    #[test]
    fn a_hole_inside_is_fine_and_a_hole_across_the_outline_is_not() {
        let mut points = vec![DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        points.extend([DVec2::new(0.2, 0.2), DVec2::new(0.2, 0.8), DVec2::new(0.8, 0.2)]);
        let loops = [vec![0, 1, 2, 3], vec![4, 5, 6]];
        assert!(!crosses_itself(&loops, &points));
        points[6].x = 1.2;
        assert!(crosses_itself(&loops, &points));
    }
}
