//! Speed of rays on one thread: `cargo run --release --no-default-features --example ray_speed [triangles...]`.
//!
//! The scene is a closed sphere of radius one with bumps (a tenth of the radius, some 20 around) and a ground square
//! of 2 triangles and side 20 below it. Four kinds of rays: a million camera rays in tiles of 16 x 16 pixels, a
//! cosine-distributed bounce from each of their hits, a million uniform rays from within a box of side 3, and as many
//! occlusion rays as bounces, over the hemisphere and 10 long. Printed are millions of rays a second, the best of
//! some rounds, for each walk this machine has and for the walk that comes with obvhs.

use glam::{Vec3, Vec3A};
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::RayHit;
use obvhs::triangle::Triangle;
use patina::math::random::SequentialRandom;
use patina::trace::{Bvh, Hit, Ray, Walk};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Rounds of which the best counts.
const ROUNDS: usize = 5;

/// Positions and corner indices.
pub struct SpeedScene {
    /// Positions.
    pub positions: Vec<Vec3>,
    /// Corners.
    pub triangles: Vec<[u32; 3]>,
}

/// The bumpy sphere over its ground, of about so many triangles.
pub fn speed_scene(triangle_count: usize) -> SpeedScene {
    let rows = ((triangle_count as f32 / 4.0).sqrt().round() as u32).max(2);
    let columns = 2 * rows;
    let mut positions = Vec::new();
    for row in 0..=rows {
        let theta = std::f32::consts::PI * row as f32 / rows as f32;
        for column in 0..columns {
            let phi = std::f32::consts::TAU * column as f32 / columns as f32;
            let radius = 1.0 + 0.1 * (9.0 * theta).sin() * (20.0 * phi).cos() * theta.sin();
            positions.push(radius * Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()));
        }
    }
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let next = (column + 1) % columns;
            let [a, b] = [row * columns + column, row * columns + next];
            let [c, d] = [a + columns, b + columns];
            triangles.push([a, b, d]);
            triangles.push([a, d, c]);
        }
    }
    let first = positions.len() as u32;
    positions
        .extend([(-1, -1), (1, -1), (1, 1), (-1, 1)].map(|(x, z)| Vec3::new(10.0 * x as f32, -1.2, 10.0 * z as f32)));
    triangles.extend([[first, first + 2, first + 1], [first, first + 3, first + 2]]);
    SpeedScene { positions, triangles }
}

/// Rays by kind; the last kind asks for occlusion only.
pub fn speed_rays(scene: &SpeedScene, bvh: &Bvh) -> [(&'static str, Vec<Ray>); 4] {
    let mut random = SequentialRandom::new(5);
    let camera = Vec3::new(1.5, 1.2, 3.0);
    let (size, tile) = (1024, 16);
    let forward = (Vec3::new(0.0, -0.3, 0.0) - camera).normalize_or_zero();
    let right = forward.cross(Vec3::Y).normalize_or_zero();
    let up = right.cross(forward);
    let mut primary = Vec::new();
    for index in 0..size * size {
        let (in_tile, tile_index) = (index % (tile * tile), index / (tile * tile));
        let x = (tile_index % (size / tile)) * tile + in_tile % tile;
        let y = (tile_index / (size / tile)) * tile + in_tile / tile;
        let plane = |pixel: usize| (pixel as f32 + 0.5) / size as f32 * 2.0 - 1.0;
        let direction = forward + 0.6 * plane(x) * right - 0.6 * plane(y) * up;
        primary.push(Ray { origin: camera, direction: direction.normalize_or_zero(), t_max: f32::INFINITY });
    }
    let mut unit = move || loop {
        let mut number = || 2.0 * random.next_number() - 1.0;
        let point = Vec3::new(number(), number(), number());
        if point.length_squared() <= 1.0 && point.length_squared() > 1e-4 {
            return point.normalize_or_zero();
        }
    };
    let mut bounce = Vec::new();
    let mut occlusion = Vec::new();
    for ray in &primary {
        let Some(hit) = bvh.closest_hit(ray) else { continue };
        let [a, b, c] = scene.triangles[hit.triangle as usize].map(|vertex| scene.positions[vertex as usize]);
        let mut normal = (b - a).cross(c - a).normalize_or_zero();
        if normal.dot(ray.direction) > 0.0 {
            normal = -normal;
        }
        let point = a + hit.u * (b - a) + hit.v * (c - a);
        let cosine = (normal + unit()).normalize_or(normal);
        let uniform = unit();
        let uniform = if uniform.dot(normal) < 0.0 { -uniform } else { uniform };
        bounce.push(Ray { origin: bvh.offset_origin(point, normal, cosine), direction: cosine, t_max: f32::INFINITY });
        occlusion.push(Ray { origin: bvh.offset_origin(point, normal, uniform), direction: uniform, t_max: 10.0 });
    }
    let mut random_rays = Vec::new();
    let mut place = SequentialRandom::new(6);
    for _ in 0..1_000_000 {
        let mut number = || 3.0 * (place.next_number() - 0.5);
        random_rays.push(Ray {
            origin: Vec3::new(number(), number(), number()),
            direction: unit(),
            t_max: f32::INFINITY,
        });
    }
    [("primary", primary), ("bounce", bounce), ("random", random_rays), ("occlusion", occlusion)]
}

/// Time on a processor of this thread where the system tells it (Linux), otherwise time on the clock.
pub fn thread_time(start: Instant) -> Duration {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.as_deref().and_then(|text| text.split(' ').next()).and_then(|word| word.parse().ok());
    nanoseconds.map_or_else(|| start.elapsed(), Duration::from_nanos)
}

/// Millions of rays a second.
pub fn speed(rays: &[Ray], mut trace: impl FnMut(&Ray) -> bool) -> (f64, usize) {
    let clock = Instant::now();
    let start = thread_time(clock);
    let hits = rays.iter().filter(|ray| trace(ray)).count();
    let seconds = (thread_time(clock) - start).as_secs_f64();
    (rays.len() as f64 / seconds * 1e-6, black_box(hits))
}

/// The walk of obvhs with the triangle test of obvhs.
pub struct ObvhsWalk {
    tree: CwBvh,
    triangles: Vec<Triangle>,
}

impl ObvhsWalk {
    /// Builds with the medium preset.
    pub fn build(scene: &SpeedScene) -> Self {
        let corner = |vertex: u32| Vec3A::from(scene.positions[vertex as usize]);
        let triangles: Vec<Triangle> =
            scene.triangles.iter().map(|&[a, b, c]| Triangle { v0: corner(a), v1: corner(b), v2: corner(c) }).collect();
        let tree = build_cwbvh_from_tris(&triangles, obvhs::BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&index| triangles[index as usize]).collect();
        ObvhsWalk { tree, triangles }
    }

    fn ray(ray: &Ray) -> obvhs::ray::Ray {
        obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), 0.0, ray.t_max)
    }

    /// Whether anything is hit, looking for the nearest hit.
    pub fn closest(&self, ray: &Ray) -> bool {
        let mut hit = RayHit::none();
        let ray = Self::ray(ray);
        self.tree.ray_traverse(ray, &mut hit, |ray, index| self.triangles[index].intersect(ray))
    }

    /// Whether anything is hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        !self.tree.ray_traverse_miss(Self::ray(ray), |ray, index| self.triangles[index].intersect(ray))
    }
}

fn main() {
    let counts: Vec<usize> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let counts = if counts.is_empty() { vec![100_000, 500_000] } else { counts };
    for count in counts {
        let scene = speed_scene(count);
        let clock = Instant::now();
        let start = thread_time(clock);
        let built = Bvh::build(&scene.positions, &scene.triangles);
        let seconds = (thread_time(clock) - start).as_secs_f64();
        let Ok(mut bvh) = built else { continue };
        println!(
            "{} triangles: built in {:.0} ms, {:.1} bytes a triangle",
            scene.triangles.len(),
            seconds * 1e3,
            bvh.memory_bytes() as f64 / scene.triangles.len() as f64
        );
        let obvhs = ObvhsWalk::build(&scene);
        println!("{:<10}{:>12}{:>12}{:>12}{:>12}", "Mrays/s", "primary", "bounce", "random", "occlusion");
        let kinds = speed_rays(&scene, &bvh);
        let walks = Walk::available();
        let mut best = vec![[0.0f64; 4]; walks.len() + 1];
        for _ in 0..ROUNDS {
            for (kind, (_, rays)) in kinds.iter().enumerate() {
                for (row, &walk) in walks.iter().enumerate() {
                    bvh.set_walk(walk);
                    let figure = if kind == 3 {
                        speed(rays, |ray| bvh.is_occluded(ray))
                    } else {
                        speed(rays, |ray| bvh.closest_hit(ray).is_some_and(|hit: Hit| hit.t > 0.0))
                    };
                    best[row][kind] = best[row][kind].max(figure.0);
                }
                let figure = if kind == 3 {
                    speed(rays, |ray| obvhs.occluded(ray))
                } else {
                    speed(rays, |ray| obvhs.closest(ray))
                };
                best[walks.len()][kind] = best[walks.len()][kind].max(figure.0);
            }
        }
        for (row, figures) in best.iter().enumerate() {
            let name = walks.get(row).map_or("obvhs".to_owned(), |walk| format!("{walk:?}"));
            println!("{name:<10}{:>12.2}{:>12.2}{:>12.2}{:>12.2}", figures[0], figures[1], figures[2], figures[3]);
        }
    }
}
