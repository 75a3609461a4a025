//! The hierarchy against every triangle tested in turn, and against what geometry demands.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::math::random::SequentialRandom;
use patina::trace::{Bvh, Hit, Ray, Walk};
use patina::{ErrorKind, Place};
use std::collections::HashMap;

type Triangles = (Vec<Vec3>, Vec<[u32; 3]>);

fn point(random: &mut SequentialRandom) -> Vec3 {
    let mut number = || 2.0 * random.next_number() - 1.0;
    Vec3::new(number(), number(), number())
}

fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin, direction, t_max: f32::INFINITY }
}

/// Moeller and Trumbore 1997 in f64, over all triangles: `(t, triangle)` of the nearest.
fn brute_force((positions, triangles): &Triangles, ray: &Ray) -> Option<(f64, u32)> {
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

/// How many rays the hierarchy and brute force disagree on by more than rounding; those pass close by an edge.
fn disagreements(scene: &Triangles, rays: &[Ray]) -> usize {
    let mut bvh = Bvh::build(&scene.0, &scene.1).unwrap();
    let mut agrees = |ray: &Ray| match (closest_hit(&mut bvh, ray), brute_force(scene, ray)) {
        (None, None) => true,
        (Some(hit), Some((t, triangle))) => {
            let [a, b, c] = scene.1[hit.triangle as usize].map(|vertex| scene.0[vertex as usize]);
            let interpolated = a + hit.u * (b - a) + hit.v * (c - a);
            let distance = interpolated.distance(ray.origin + hit.t * ray.direction);
            let size = ray.origin.length() + hit.t * ray.direction.length();
            hit.triangle == triangle && (f64::from(hit.t) - t).abs() <= 1e-4 * t && distance <= 1e-4 * size
        }
        _ => false,
    };
    rays.iter().filter(|ray| !agrees(ray)).count()
}

fn soup(count: usize, size: f32, random: &mut SequentialRandom) -> Triangles {
    let mut positions = Vec::new();
    for _ in 0..count {
        let middle = point(random);
        positions.extend([0; 3].map(|_| middle + size * point(random)));
    }
    let triangles = (0..count as u32).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
    (positions, triangles)
}

/// An icosahedron of radius one, each triangle cut in four so many times: closed and convex.
fn icosphere(cuts: usize) -> Triangles {
    let golden = 0.5 * (1.0 + 5.0f32.sqrt());
    let mut positions = Vec::new();
    for (short, long) in [(-1.0, -golden), (1.0, -golden), (-1.0, golden), (1.0, golden)] {
        positions.extend([Vec3::new(short, long, 0.0), Vec3::new(0.0, short, long), Vec3::new(long, 0.0, short)]);
    }
    for position in &mut positions {
        *position = position.normalize_or_zero();
    }
    // The faces are the triples of vertices one edge apart.
    let is_edge = |a: usize, b: usize| (positions[a].distance(positions[b]) - 1.0515).abs() < 0.01;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if is_edge(a, b) && is_edge(b, c) && is_edge(a, c) {
                    let is_outward = (positions[b] - positions[a]).cross(positions[c] - positions[a]).dot(positions[a]);
                    triangles.push(if is_outward > 0.0 { [a, b, c] } else { [a, c, b] }.map(|vertex| vertex as u32));
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..cuts {
        let mut middles = HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(one, other)| {
                *middles.entry((one.min(other), one.max(other))).or_insert_with(|| {
                    let sum: Vec3 = positions[one as usize] + positions[other as usize];
                    positions.push(sum.normalize_or_zero());
                    positions.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (positions, triangles)
}

#[test]
fn a_soup_of_triangles_gives_the_hits_of_brute_force() {
    let mut random = SequentialRandom::new(1);
    for (count, size) in [(1, 0.5), (5, 0.5), (40, 0.3), (200, 0.2)] {
        let scene = soup(count, size, &mut random);
        let rays: Vec<Ray> = (0..25_000)
            .map(|_| Ray {
                origin: 1.5 * point(&mut random),
                direction: point(&mut random),
                t_max: if random.next_number() < 0.5 { f32::INFINITY } else { 2.0 * random.next_number() },
            })
            .collect();
        let found = disagreements(&scene, &rays);
        assert!(found <= 3, "{found} of {} rays disagree on {count} triangles", rays.len());
    }
}

#[test]
fn small_and_large_scenes_give_the_hits_of_brute_force() {
    let sphere = icosphere(2);
    for scale in [1e-4, 1.0, 1e4] {
        for shift in [0.0, 10.0] {
            let mut random = SequentialRandom::new(2);
            let move_point = |point: Vec3| scale * (point + Vec3::splat(shift));
            let scene = (sphere.0.iter().copied().map(move_point).collect(), sphere.1.clone());
            let rays: Vec<Ray> = (0..5_000)
                .map(|_| ray(move_point(2.0 * point(&mut random)), scale.sqrt() * point(&mut random)))
                .collect();
            let found = disagreements(&scene, &rays);
            assert!(found <= 5, "{found} of {} rays disagree at scale {scale}, shift {shift}", rays.len());
        }
    }
}

#[test]
fn no_ray_leaves_a_closed_sphere_through_an_edge_or_a_vertex() {
    let (positions, triangles) = icosphere(5);
    let mut bvh = Bvh::build(&positions, &triangles).unwrap();
    let mut random = SequentialRandom::new(3);
    let (mut rays, mut misses) = (0, 0);
    for scale in [1.0, 0.37] {
        for (index, triangle) in triangles.iter().enumerate() {
            let corners = triangle.map(|vertex| positions[vertex as usize]);
            let origin = if index % 2 == 0 { Vec3::ZERO } else { 0.5 * point(&mut random) };
            for side in 0..3 {
                let (one, other) = (corners[side], corners[(side + 1) % 3]);
                for target in [one, 0.5 * (one + other), one.lerp(other, random.next_number())] {
                    rays += 1;
                    misses += usize::from(closest_hit(&mut bvh, &ray(origin, scale * (target - origin))).is_none());
                }
            }
        }
    }
    println!("{misses} of {rays} rays towards edges and vertices leave the closed sphere");
    assert_eq!(misses, 0);
}

#[test]
fn triangles_without_area_and_copies_are_left_out_and_indices_stay() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE, 2.0 * Vec3::X, -0.0 * Vec3::ONE];
    // Two points, three on a line, then a triangle, its copies turned, mirrored and by another vertex, then another.
    let triangles = [[0, 0, 1], [0, 1, 5], [0, 1, 2], [1, 2, 0], [0, 2, 1], [6, 1, 2], [4, 4, 4], [1, 2, 4], [0, 1, 2]];
    let mut bvh = Bvh::build(&positions, &triangles).unwrap();
    assert_eq!(bvh.triangle_count(), 2);
    let hit = closest_hit(&mut bvh, &ray(Vec3::new(0.2, 0.3, 1.0), -Vec3::Z)).unwrap();
    assert_eq!((hit.triangle, hit.t), (2, 1.0));
    assert!((hit.u - 0.2).abs() < 1e-6 && (hit.v - 0.3).abs() < 1e-6);
    assert_eq!(closest_hit(&mut bvh, &ray(Vec3::new(0.7, 0.6, 2.0), -Vec3::Z)).unwrap().triangle, 7);
    assert_eq!(bvh.bounds(), (Vec3::ZERO, Vec3::ONE));

    let copies = vec![[0, 1, 2]; 10_000];
    let bvh = Bvh::build(&positions, &copies).unwrap();
    assert_eq!(bvh.triangle_count(), 1);
    assert!(bvh.memory_bytes() < 1000);
}

#[test]
fn the_lowest_triangle_is_given_where_several_are_hit_at_once() {
    // Nested triangles in one plane, the largest last, in both orders.
    let mut positions = Vec::new();
    for index in 0..50 {
        let size = 1.0 + index as f32;
        positions.extend([Vec3::new(-size, 0.0, -size), Vec3::new(size, 0.0, -size), Vec3::new(0.0, 0.0, size)]);
    }
    let mut triangles: Vec<[u32; 3]> = (0..50).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
    let mut random = SequentialRandom::new(4);
    for _ in 0..20 {
        random.shuffle(&mut triangles);
        let mut bvh = Bvh::build(&positions, &triangles).unwrap();
        let hit = closest_hit(&mut bvh, &ray(Vec3::new(0.1, 1.0, -0.1), -Vec3::Y)).unwrap();
        assert_eq!(hit.triangle, 0);
    }
}

#[test]
fn rays_along_the_axes_meet_flat_planes() {
    // Two level squares of 8 x 8 cells; corners on whole numbers, so that rays run in the planes of boxes.
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for height in [0.0, 4.0] {
        for row in 0..9 {
            for column in 0..9 {
                positions.push(Vec3::new(column as f32, height, row as f32));
            }
        }
    }
    for layer in [0, 81] {
        for row in 0..8 {
            for column in 0..8 {
                let corner = layer + 9 * row + column;
                triangles.extend([[corner, corner + 1, corner + 10], [corner, corner + 10, corner + 9]]);
            }
        }
    }
    let mut bvh = Bvh::build(&positions, &triangles).unwrap();
    for step_x in 0..=32 {
        for step_z in 0..=32 {
            let (x, z) = (0.25 * step_x as f32, 0.25 * step_z as f32);
            for (zero, sign) in [(0.0, 1.0), (-0.0, 1.0), (0.0, -1.0), (-0.0, -1.0)] {
                let start = if sign > 0.0 { -1.0 } else { 5.0 };
                let down = ray(Vec3::new(x, start, z), Vec3::new(zero, sign, zero));
                let hit = closest_hit(&mut bvh, &down).unwrap();
                assert_eq!(hit.t, 1.0);
                let between = ray(Vec3::new(x, 2.0, z), Vec3::new(zero, sign, zero));
                assert_eq!(closest_hit(&mut bvh, &between).unwrap().t, 2.0);
                let beside = ray(Vec3::new(x, 2.0, z), Vec3::new(sign, zero, zero));
                assert_eq!(closest_hit(&mut bvh, &beside), None);
            }
        }
    }
    // Within a plane all triangles are seen from their edges: nothing to meet, and nothing to fail.
    for z in [0.0, 1.0, 2.5] {
        assert_eq!(closest_hit(&mut bvh, &ray(Vec3::new(-1.0, 0.0, z), Vec3::X)), None);
    }
}

#[test]
fn a_ray_ends_before_t_max_and_starts_after_zero() {
    let positions = [Vec3::new(-1.0, -1.0, 2.0), Vec3::new(1.0, -1.0, 2.0), Vec3::new(0.0, 1.0, 2.0)];
    let mut bvh = Bvh::build(&positions, &[[0, 1, 2]]).unwrap();
    let mut is_hit = |start: f32, length: f32, t_max: f32| {
        closest_hit(&mut bvh, &Ray { origin: start * Vec3::Z, direction: length * Vec3::Z, t_max }).is_some()
    };
    assert!(is_hit(0.0, 1.0, f32::INFINITY) && is_hit(0.0, 1.0, 2.000_001) && !is_hit(0.0, 1.0, 2.0));
    assert!(is_hit(0.0, 2.0, 1.000_001) && !is_hit(0.0, 2.0, 1.0));
    assert!(!is_hit(2.0, 1.0, f32::INFINITY) && !is_hit(2.0, -1.0, f32::INFINITY));
    assert!(!is_hit(3.0, 1.0, f32::INFINITY) && is_hit(3.0, -1.0, f32::INFINITY));
    assert!(is_hit(0.0, 1e-30, f32::INFINITY) && is_hit(0.0, 1e30, f32::INFINITY));
    for nothing in [0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
        assert!(!is_hit(0.0, 1.0, nothing));
    }
}

#[test]
fn what_is_no_ray_meets_nothing() {
    let (positions, triangles) = icosphere(1);
    let mut bvh = Bvh::build(&positions, &triangles).unwrap();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let mut one = ray(Vec3::ZERO, Vec3::ONE);
            one.origin[axis] = bad;
            let mut other = ray(Vec3::ZERO, Vec3::ONE);
            other.direction[axis] = bad;
            assert_eq!((closest_hit(&mut bvh, &one), closest_hit(&mut bvh, &other)), (None, None));
        }
    }
    assert_eq!(closest_hit(&mut bvh, &ray(Vec3::ZERO, Vec3::ZERO)), None);
    assert!(closest_hit(&mut bvh, &ray(Vec3::ZERO, Vec3::new(0.0, -0.0, 1e-38))).is_some());
}

#[test]
fn numbers_of_any_size_do_no_harm() {
    let mut random = SequentialRandom::new(6);
    // Any bits, small whole numbers and zeros, all finite.
    let mut number = move || match random.below(4) {
        0 => Some(f32::from_bits(random.next_bits() as u32)).filter(|number| number.is_finite()).unwrap_or(1.0),
        1 => f32::MAX * (2.0 * random.next_number() - 1.0),
        2 => random.below(5) as f32 - 2.0,
        _ => 2.0 * random.next_number() - 1.0,
    };
    let mut built = 0;
    for round in 0..600 {
        let positions: Vec<Vec3> = (0..30).map(|_| Vec3::new(number(), number(), number())).collect();
        let triangles: Vec<[u32; 3]> = (0..28).map(|vertex| [vertex, vertex + 1, vertex + 2]).collect();
        let Ok(mut bvh) = Bvh::build(&positions, &triangles[..1 + round % 28]) else { continue };
        built += 1;
        for _ in 0..50 {
            let ray = Ray {
                origin: Vec3::new(number(), number(), number()),
                direction: Vec3::new(number(), number(), number()),
                t_max: number(),
            };
            for walk in Walk::available() {
                bvh.set_walk(walk);
                let hit = bvh.closest_hit(&ray);
                assert!(
                    hit.is_none_or(|hit| hit.t > 0.0 && hit.t < ray.t_max && hit.triangle < 28),
                    "{hit:?}, {ray:?}"
                );
                bvh.is_occluded(&ray);
            }
        }
    }
    assert!(built > 500);
}

#[test]
fn a_mesh_that_cannot_be_traced_is_named() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.0, f32::NAN, 0.0), Vec3::splat(f32::INFINITY)];
    let error = |triangles: &[[u32; 3]]| Bvh::build(&positions, triangles).unwrap_err();
    assert_eq!(error(&[]).kind(), ErrorKind::InvalidScene);
    assert_eq!(error(&[[0, 0, 1]]).kind(), ErrorKind::InvalidScene);
    let outside = error(&[[0, 1, 2], [0, 1, 5]]);
    assert_eq!((outside.kind(), outside.place()), (ErrorKind::InvalidScene, &Place::Triangle(1)));
    for bad in [3, 4] {
        let not_finite = error(&[[0, 1, 2], [0, 1, 2], [0, 1, bad]]);
        assert_eq!((not_finite.kind(), not_finite.place()), (ErrorKind::NonFinite, &Place::Triangle(2)));
    }
    // A vertex that no triangle names may be anything.
    assert!(Bvh::build(&positions, &[[0, 1, 2]]).is_ok());
}

#[test]
fn a_ray_from_the_surface_does_not_meet_the_surface_it_leaves() {
    let sphere = icosphere(4);
    for scale in [1e-3, 0.1, 1.0, 100.0, 1e4] {
        for shift in [0.0, 3.0] {
            let mut random = SequentialRandom::new(7);
            let move_point = |point: Vec3| scale * (point + Vec3::splat(shift));
            let positions: Vec<Vec3> = sphere.0.iter().copied().map(move_point).collect();
            let mut bvh = Bvh::build(&positions, &sphere.1).unwrap();
            let (mut without_offset, mut rays) = (0, 0);
            for _ in 0..8_000 {
                // A camera ray that meets the outside, then a ray on from there, often close to the horizon.
                let camera = move_point(4.0 * point(&mut random).normalize_or(Vec3::X));
                let target = move_point(0.9 * point(&mut random).normalize_or(Vec3::X));
                let Some(hit) = closest_hit(&mut bvh, &ray(camera, (target - camera) / scale)) else { continue };
                let [a, b, c] = sphere.1[hit.triangle as usize].map(|vertex| positions[vertex as usize]);
                let normal = (b - a).cross(c - a).normalize_or_zero();
                let point_on_surface = a + hit.u * (b - a) + hit.v * (c - a);
                let along = point(&mut random).reject_from_normalized(normal).normalize_or_zero();
                let height = random.next_number().powi(3).max(1e-3);
                rays += 1;
                // The sphere is convex: a ray outwards meets nothing, a ray inwards meets the far side.
                let outwards = along + height * normal;
                let origin = bvh.offset_origin(point_on_surface, normal, outwards);
                assert_eq!(closest_hit(&mut bvh, &ray(origin, outwards)), None, "scale {scale}, shift {shift}");
                assert!((origin - point_on_surface).length() < 1e-5 * scale * (1.0 + shift));
                without_offset += usize::from(bvh.is_occluded(&ray(point_on_surface, outwards)));
                let inwards = along - height * normal;
                let origin = bvh.offset_origin(point_on_surface, -normal, inwards);
                let hit = closest_hit(&mut bvh, &ray(origin, inwards));
                assert!(hit.is_some(), "scale {scale}, shift {shift}");
            }
            assert!(rays > 5_000);
            assert!(without_offset > 0, "the test cannot fail: no ray needs the offset");
        }
    }
}
