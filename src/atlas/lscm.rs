//! Least-squares conformal map of one chart.
//!
//! Source: Levy, Petitjean, Ray and Maillot 2002, "Least Squares Conformal Maps for Automatic Texture Atlas
//! Generation", section 2: the sum over triangles of `|d U/dx + i d U/dy|^2 * area` is minimised over the complex map
//! `U = u + i v` with two vertices pinned. The real normal equations are assembled triangle by triangle and solved by
//! sparse Cholesky. A flat chart maps to itself: its energy is zero there.

use super::chart::ChartMesh;
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use glam::{DVec2, DVec3};

/// The conformal map of a chart with at least one boundary loop: a point for each chart vertex, in world units, pins at
/// their distance in space. `None` when the system has no finite solution.
pub(crate) fn conformal_map(chart: &ChartMesh) -> Option<Vec<DVec2>> {
    let [first_pin, second_pin] = pins(chart)?;
    let length = chart.positions[first_pin as usize].distance(chart.positions[second_pin as usize]);
    if length == 0.0 {
        return None;
    }
    // Unknowns: u of every free vertex, then v beside it.
    const PINNED: usize = usize::MAX;
    let mut unknown = vec![0; chart.positions.len()];
    let mut free = 0;
    for (vertex, slot) in unknown.iter_mut().enumerate() {
        let pinned = vertex as u32 == first_pin || vertex as u32 == second_pin;
        *slot = if pinned { PINNED } else { free };
        free += usize::from(!pinned);
    }
    let pin_value = |vertex: u32| if vertex == second_pin { length } else { 0.0 };

    let mut triplets = Vec::with_capacity(chart.corners.len() * 21);
    let mut right = vec![0.0; free * 2];
    for corners in &chart.corners {
        let weights = cauchy_riemann_weights(corners.map(|vertex| chart.positions[vertex as usize]))?;
        for j in 0..3 {
            let row = unknown[corners[j] as usize];
            if row == PINNED {
                continue;
            }
            for k in 0..3 {
                // conj(W_j) W_k, the complex entry of the normal matrix, acts on (u, v) as a scaled rotation.
                let real = weights[j].dot(weights[k]);
                let imaginary = weights[j].perp_dot(weights[k]);
                let column = unknown[corners[k] as usize];
                if column == PINNED {
                    let value = pin_value(corners[k]);
                    right[2 * row] -= real * value;
                    right[2 * row + 1] -= imaginary * value;
                } else {
                    let block = [
                        (2 * row, 2 * column, real),
                        (2 * row, 2 * column + 1, -imaginary),
                        (2 * row + 1, 2 * column, imaginary),
                        (2 * row + 1, 2 * column + 1, real),
                    ];
                    // The Cholesky solver reads the lower triangle.
                    triplets.extend(block.iter().filter(|(r, c, _)| r >= c).map(|&(r, c, x)| Triplet::new(r, c, x)));
                }
            }
        }
    }
    if free > 0 {
        let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(free * 2, free * 2, &triplets).ok()?;
        let factor = matrix.sp_cholesky(faer::Side::Lower).ok()?;
        factor.solve_in_place(faer::MatMut::from_column_major_slice_mut(&mut right, free * 2, 1));
    }
    let map: Vec<DVec2> = (0..chart.positions.len())
        .map(|vertex| match unknown[vertex] {
            PINNED => DVec2::new(pin_value(vertex as u32), 0.0),
            slot => DVec2::new(right[2 * slot], right[2 * slot + 1]),
        })
        .collect();
    map.iter().all(|point| point.is_finite()).then_some(map)
}

/// `W_j / sqrt(2 area)` of the three corners as (real, imaginary): the opposite edge in the plane of the triangle
/// (Levy et al. 2002, equation 2). `None` for a triangle without area.
fn cauchy_riemann_weights(corners: [DVec3; 3]) -> Option<[DVec2; 3]> {
    let points = lay_flat(corners)?;
    let double_area = (points[1] - points[0]).perp_dot(points[2] - points[0]);
    let scale = 1.0 / double_area.sqrt();
    Some([0, 1, 2].map(|corner| (points[(corner + 2) % 3] - points[(corner + 1) % 3]) * scale))
}

/// A triangle in its own plane, counter-clockwise; `None` when it has no area.
pub(crate) fn lay_flat(corners: [DVec3; 3]) -> Option<[DVec2; 3]> {
    let (along, to_third) = (corners[1] - corners[0], corners[2] - corners[0]);
    let x = along.try_normalize()?;
    let height = along.cross(to_third).length() / along.length();
    (height > 0.0).then_some([DVec2::ZERO, DVec2::new(along.length(), 0.0), DVec2::new(to_third.dot(x), height)])
}

/// Two boundary vertices far apart: the ends of a double sweep. `None` without a boundary.
fn pins(chart: &ChartMesh) -> Option<[u32; 2]> {
    let boundary: Vec<u32> = chart.loops.iter().flatten().copied().collect();
    let farthest = |from: u32| {
        let origin = chart.positions[from as usize];
        let distance = |vertex: u32| chart.positions[vertex as usize].distance_squared(origin);
        boundary.iter().copied().max_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(b.cmp(&a)))
    };
    let first = farthest(*boundary.first()?)?;
    let second = farthest(first)?;
    (first != second).then_some([first, second])
}

/// Orthogonal projection on the plane with this unit normal, counter-clockwise seen from where the normal points.
pub(crate) fn project(chart: &ChartMesh, normal: DVec3) -> Vec<DVec2> {
    let (x, y) = normal.any_orthonormal_pair();
    // `any_orthonormal_pair` may hand out either orientation: the pair must turn with the normal.
    let y = if x.cross(y).dot(normal) < 0.0 { -y } else { y };
    let origin = chart.positions.first().copied().unwrap_or_default();
    chart.positions.iter().map(|&point| DVec2::new((point - origin).dot(x), (point - origin).dot(y))).collect()
}
