//! Polygons to triangles: the same surface whatever corner a face begins with.
//!
//! Convex polygons become a fan from a corner that is chosen by its place, quadrilaterals are cut along the shorter
//! diagonal that lies inside, all others are cut by ear clipping (Meisters 1975, "Polygons have ears"), seen along the
//! polygon's mean normal (Newell's).

use glam::{DVec2, DVec3};

/// Triangles of a polygon by the numbers of its corners, wound as it is; `count - 2` of them, none below three corners.
pub fn triangulate(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let count = corners.len();
    if count <= 3 {
        return if count == 3 { vec![[0, 1, 2]] } else { Vec::new() };
    }
    let order = canonical_order(corners);
    let normal = (0..count).map(|i| corners[i].cross(corners[(i + 1) % count])).sum::<DVec3>();
    // Relative to the first corner: far from the origin the sum above is all rounding.
    let origin = corners[order[0]];
    let near = |i: usize| corners[i] - origin;
    let normal_near = (0..count).map(|i| near(i).cross(near((i + 1) % count))).sum::<DVec3>();
    let normal = normal_near.try_normalize().or(normal.try_normalize());
    let Some(normal) = normal else { return fan(&order) };
    let across = normal.any_orthonormal_vector();
    let up = normal.cross(across);
    let flat: Vec<DVec2> = order.iter().map(|&i| DVec2::new(near(i).dot(across), near(i).dot(up))).collect();
    let local = if count == 4 { cut_quadrilateral(&flat, &order, corners) } else { clip_ears(&flat) };
    local.into_iter().map(|triangle| triangle.map(|corner| order[corner])).collect()
}

/// Numbers of the corners from the one of the least place on; where places repeat, what follows them decides.
fn canonical_order(corners: &[DVec3]) -> Vec<usize> {
    let count = corners.len();
    let key = |i: usize| (corners[i % count] + 0.0).to_array().map(f64::to_bits);
    let from = |start: usize| (0..count).map(move |step| key(start + step));
    let least = key(0);
    let least = (0..count).map(key).fold(least, std::cmp::min);
    let first = (0..count).filter(|&i| key(i) == least).min_by(|&a, &b| from(a).cmp(from(b))).unwrap_or(0);
    (0..count).map(|step| (first + step) % count).collect()
}

fn fan(order: &[usize]) -> Vec<[usize; 3]> {
    order[1..].windows(2).map(|pair| [order[0], pair[0], pair[1]]).collect()
}

fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

fn cut_quadrilateral(flat: &[DVec2], order: &[usize], corners: &[DVec3]) -> Vec<[usize; 3]> {
    let corner_turn = |i: usize| turn(flat[(i + 3) % 4], flat[i], flat[(i + 1) % 4]);
    let length = |a: usize, b: usize| corners[order[a]].distance_squared(corners[order[b]]);
    // A diagonal from a corner that turns inwards is the only one inside.
    let from_first = match (0..4).find(|&i| corner_turn(i) < 0.0) {
        Some(reflex) => reflex % 2 == 0,
        None => length(0, 2) <= length(1, 3),
    };
    if from_first { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[1, 2, 3], [1, 3, 0]] }
}

fn clip_ears(flat: &[DVec2]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..flat.len()).collect();
    if (0..flat.len()).all(|i| turn(flat[i], flat[(i + 1) % flat.len()], flat[(i + 2) % flat.len()]) >= 0.0) {
        return fan(&left);
    }
    let mut triangles = Vec::with_capacity(flat.len() - 2);
    let mut place = 0;
    let mut refused = 0;
    while left.len() > 3 {
        let count = left.len();
        let ear = [left[(place + count - 1) % count], left[place % count], left[(place + 1) % count]];
        // A polygon that crosses itself has no ear at times: then the next corner goes, so that the loop ends.
        if is_ear(flat, &left, ear) || refused >= count {
            triangles.push(ear);
            left.remove(place % count);
            refused = 0;
            place %= left.len();
        } else {
            refused += 1;
            place = (place + 1) % count;
        }
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

fn is_ear(flat: &[DVec2], left: &[usize], ear: [usize; 3]) -> bool {
    let [a, b, c] = ear.map(|corner| flat[corner]);
    if turn(a, b, c) <= 0.0 {
        return false;
    }
    left.iter().filter(|corner| !ear.contains(corner)).all(|&corner| {
        let point = flat[corner];
        // A corner at the place of one of the ear's own, as where a hole is tied to the outline, blocks nothing.
        let is_own = point == a || point == b || point == c;
        is_own || turn(a, b, point) < 0.0 || turn(b, c, point) < 0.0 || turn(c, a, point) < 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[DVec3], triangles: &[[usize; 3]]) -> f64 {
        let of = |t: &[usize; 3]| 0.5 * (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).length();
        triangles.iter().map(of).sum()
    }

    /// Triangles as places, in an order that depends on them alone.
    fn surface(corners: &[DVec3], triangles: &[[usize; 3]]) -> Vec<[[u64; 3]; 3]> {
        let mut surface: Vec<_> = triangles
            .iter()
            .map(|triangle| {
                let mut places = triangle.map(|corner| corners[corner].to_array().map(f64::to_bits));
                let least = (0..3).min_by_key(|&i| places[i]).unwrap();
                places.rotate_left(least);
                places
            })
            .collect();
        surface.sort_unstable();
        surface
    }

    #[test]
    fn concave_polygons_keep_their_area_whatever_the_first_corner() {
        let ell = [(0., 0.), (4., 0.), (4., 1.), (1., 1.), (1., 3.), (0., 3.)];
        let star: Vec<(f64, f64)> = (0..10)
            .map(|i| {
                let (angle, radius) = (i as f64 * 0.2 * std::f64::consts::PI, if i % 2 == 0 { 2.0 } else { 0.7 });
                (radius * f64::cos(angle), radius * f64::sin(angle))
            })
            .collect();
        let dart = [(0., 0.), (2., 2.), (0., 1.), (-2., 2.)];
        for outline in [&ell[..], &star, &dart] {
            let plane = |&(x, y): &(f64, f64)| DVec3::new(x, 2.0 * x + y, y) + DVec3::new(4e5, 5e6, 30.0);
            let corners: Vec<DVec3> = outline.iter().map(plane).collect();
            let double: DVec3 = (0..corners.len())
                .map(|i| (corners[i] - corners[0]).cross(corners[(i + 1) % corners.len()] - corners[0]))
                .sum();
            let whole = surface(&corners, &triangulate(&corners));
            for start in 0..corners.len() {
                let mut turned = corners.clone();
                turned.rotate_left(start);
                let triangles = triangulate(&turned);
                assert_eq!(triangles.len(), corners.len() - 2);
                assert!((area(&turned, &triangles) - 0.5 * double.length()).abs() < 1e-6, "start {start}");
                assert_eq!(surface(&turned, &triangles), whole, "start {start}");
            }
        }
    }

    #[test]
    fn a_hole_tied_to_the_outline_stays_a_hole() {
        let outline =
            [(0., 0.), (3., 0.), (3., 3.), (0., 3.), (0., 0.), (1., 1.), (1., 2.), (2., 2.), (2., 1.), (1., 1.)];
        let corners: Vec<DVec3> = outline.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect();
        assert!((area(&corners, &triangulate(&corners)) - 8.0).abs() < 1e-12);
    }

    #[test]
    fn a_polygon_without_area_or_that_crosses_itself_still_ends() {
        let line: Vec<DVec3> = (0..6).map(|i| DVec3::X * f64::from(i)).collect();
        assert_eq!(triangulate(&line).len(), 4);
        let pentagram: Vec<DVec3> = (0..5)
            .map(|i| f64::from(i) * 0.8 * std::f64::consts::PI)
            .map(|a| DVec3::new(a.cos(), a.sin(), 0.0))
            .collect();
        assert_eq!(triangulate(&pentagram).len(), 3);
        assert!(triangulate(&line[..2]).is_empty());
    }
}
