//! The hierarchy against every triangle tested in turn.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::math::random::SequentialRandom;
use patina::trace::{Bvh, Hit, Ray, Walk};

fn number(random: &mut SequentialRandom) -> f32 {
    2.0 * random.next_number() - 1.0
}

fn point(random: &mut SequentialRandom) -> Vec3 {
    Vec3::new(number(random), number(random), number(random))
}

/// Moeller and Trumbore 1997 in f64, over all triangles: `(t, triangle)` of the nearest.
fn brute_force(positions: &[Vec3], triangles: &[[u32; 3]], ray: &Ray) -> Option<(f64, u32)> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut best: Option<(f64, u32)> = None;
    for (index, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize].as_dvec3());
        let (side_u, side_v) = (b - a, c - a);
        let cross = direction.cross(side_v);
        let determinant = side_u.dot(cross);
        if determinant == 0.0 {
            continue;
        }
        let from_corner = origin - a;
        let u = from_corner.dot(cross) / determinant;
        let turned = from_corner.cross(side_u);
        let v = direction.dot(turned) / determinant;
        let t = side_v.dot(turned) / determinant;
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        if inside && t > 0.0 && t < f64::from(ray.t_max) && best.is_none_or(|(best_t, _)| t < best_t) {
            best = Some((t, index as u32));
        }
    }
    best
}

fn soup(count: usize, size: f32, random: &mut SequentialRandom) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    for _ in 0..count {
        let middle = point(random);
        positions.extend([0; 3].map(|_| middle + size * point(random)));
    }
    let triangles = (0..count as u32).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
    (positions, triangles)
}

/// Asks all walks this machine has, which must agree to the bit.
fn closest_hit(bvh: &mut Bvh, ray: &Ray) -> Option<Hit> {
    bvh.set_walk(Walk::Plain);
    let expected = bvh.closest_hit(ray);
    let bits = |hit: Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.triangle, hit.u.to_bits(), hit.v.to_bits()));
    for walk in Walk::available() {
        bvh.set_walk(walk);
        assert_eq!(bits(bvh.closest_hit(ray)), bits(expected), "{walk:?}, {ray:?}");
        assert_eq!(bvh.is_occluded(ray), expected.is_some(), "{walk:?}, {ray:?}");
    }
    expected
}

/// Counts the rays on which hierarchy and brute force disagree by more than rounding.
fn disagreements(positions: &[Vec3], triangles: &[[u32; 3]], rays: &[Ray]) -> usize {
    let mut bvh = Bvh::build(positions, triangles).unwrap();
    let mut agrees = |ray: &Ray| match (closest_hit(&mut bvh, ray), brute_force(positions, triangles, ray)) {
        (None, None) => true,
        (Some(hit), Some((t, triangle))) => hit.triangle == triangle && (f64::from(hit.t) - t).abs() <= 1e-4 * t,
        _ => false,
    };
    rays.iter().filter(|ray| !agrees(ray)).count()
}

#[test]
fn a_soup_of_triangles_gives_the_hits_of_brute_force() {
    let mut random = SequentialRandom::new(1);
    let (positions, triangles) = soup(300, 0.2, &mut random);
    let rays: Vec<Ray> = (0..50_000)
        .map(|_| Ray {
            origin: 1.5 * point(&mut random),
            direction: point(&mut random),
            t_max: if random.next_number() < 0.5 { f32::INFINITY } else { 2.0 * random.next_number() },
        })
        .collect();
    let count = disagreements(&positions, &triangles, &rays);
    assert!(count <= 5, "{count} of {} rays disagree", rays.len());
}
