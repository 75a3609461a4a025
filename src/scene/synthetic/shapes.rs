//! Shapes in code: closed surfaces cut into charts that are flat in their own parameters.
//!
//! A [`Chart`] is a grid over `[0,1]^2` bent by a function, so its texture coordinates cannot overlap. Charts that share
//! an edge compute its points from the same numbers: the shapes are closed to the last bit.

use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f64::consts::{FRAC_PI_4, TAU};

/// A piece of surface with places on its own unit square.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Vertex positions in world units.
    pub positions: Vec<Vec3>,
    /// Shading normals, unit length, one a vertex.
    pub normals: Vec<Vec3>,
    /// Place of each vertex on the chart, in `[0,1]^2`, v up; no two triangles overlap.
    pub places: Vec<Vec2>,
    /// Corners of each triangle, counter-clockwise from outside and on the chart.
    pub triangles: Vec<[u32; 3]>,
    /// Mean length of the chart's rows and columns, in world units.
    pub size_world: Vec2,
}

impl Chart {
    /// A grid of `columns x rows` cells over `[0,1]^2`. `surface(u, v)` must be smooth a little beyond the square, and
    /// its outside must be on the side of `d_u x d_v`. Cells without area (at a pole) are left out.
    pub fn from_function(columns: usize, rows: usize, surface: impl Fn(f64, f64) -> DVec3) -> Self {
        let mut chart = Chart::default();
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (column as f64 / columns as f64, row as f64 / rows as f64);
                // Adding zero turns -0 into +0, so that equal points have equal bits.
                chart.positions.push((surface(u, v) + DVec3::ZERO).as_vec3());
                chart.normals.push(normal_of(&surface, u, v));
                chart.places.push(Vec2::new(u as f32, v as f32));
            }
        }
        let vertex = |column: usize, row: usize| (row * (columns + 1) + column) as u32;
        for row in 0..rows {
            for column in 0..columns {
                let (a, b) = (vertex(column, row), vertex(column + 1, row));
                let (c, d) = (vertex(column + 1, row + 1), vertex(column, row + 1));
                chart.push_if_it_has_area([a, b, c]);
                chart.push_if_it_has_area([a, c, d]);
            }
        }
        let length = |a: u32, b: u32| chart.positions[a as usize].distance(chart.positions[b as usize]);
        let mut size = Vec2::ZERO;
        for row in 0..=rows {
            size.x += (0..columns).map(|column| length(vertex(column, row), vertex(column + 1, row))).sum::<f32>();
        }
        for column in 0..=columns {
            size.y += (0..rows).map(|row| length(vertex(column, row), vertex(column, row + 1))).sum::<f32>();
        }
        chart.size_world = size / Vec2::new((rows + 1) as f32, (columns + 1) as f32);
        chart
    }

    fn push_if_it_has_area(&mut self, triangle: [u32; 3]) {
        let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize]);
        if a != b && b != c && c != a {
            self.triangles.push(triangle);
        }
    }

    /// The chart under a rigid motion with scale: `p -> offset + scale * rotation * p`.
    pub fn placed(mut self, rotation: glam::Quat, scale: f32, offset: Vec3) -> Self {
        for position in &mut self.positions {
            *position = offset + scale * (rotation * *position);
        }
        for normal in &mut self.normals {
            *normal = (rotation * *normal).normalize_or(Vec3::Y);
        }
        self.size_world *= scale;
        self
    }
}

/// The unit normal `d_u x d_v` by central differences. Where it vanishes (a pole) it is taken a little further inside.
fn normal_of(surface: &impl Fn(f64, f64) -> DVec3, u: f64, v: f64) -> Vec3 {
    let step = 1e-5;
    for inset in [0.0, 1e-4, 1e-3, 1e-2] {
        let (u, v) = (u + inset * (0.5 - u), v + inset * (0.5 - v));
        let along_u = surface(u + step, v) - surface(u - step, v);
        let along_v = surface(u, v + step) - surface(u, v - step);
        let normal = along_u.cross(along_v);
        if normal.length() > 1e-3 * along_u.length_squared().max(along_v.length_squared()) {
            return normal.normalize_or(DVec3::Y).as_vec3();
        }
    }
    Vec3::Y
}

/// A flat disk facing +y around the origin. Its chart is the disk itself, without any stretch.
pub fn disk(radius: f64, rings: usize, sectors: usize) -> Vec<Chart> {
    let mut chart = Chart { size_world: Vec2::splat(2.0 * radius as f32), ..Chart::default() };
    let mut push = |x: f64, z: f64| {
        chart.positions.push(DVec3::new(x, 0.0, z).as_vec3());
        chart.normals.push(Vec3::Y);
        chart.places.push(DVec2::new(0.5 + 0.5 * x / radius, 0.5 - 0.5 * z / radius).as_vec2());
    };
    push(0.0, 0.0);
    for ring in 1..=rings {
        for sector in 0..sectors {
            let (sin, cos) = (TAU * sector as f64 / sectors as f64).sin_cos();
            let distance = radius * ring as f64 / rings as f64;
            push(distance * cos, -distance * sin);
        }
    }
    let vertex = |ring: usize, sector: usize| (1 + (ring - 1) * sectors + sector % sectors) as u32;
    for sector in 0..sectors {
        chart.triangles.push([0, vertex(1, sector), vertex(1, sector + 1)]);
        for ring in 1..rings {
            let (a, b) = (vertex(ring, sector), vertex(ring + 1, sector));
            let (c, d) = (vertex(ring + 1, sector + 1), vertex(ring, sector + 1));
            chart.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    vec![chart]
}

/// A torus around the y axis: `ring` is the radius of its core circle, `tube` that of its cross-section.
pub fn torus(ring: f64, tube: f64, columns: usize, rows: usize) -> Vec<Chart> {
    vec![Chart::from_function(columns, rows, |u, v| {
        let (sin_u, cos_u) = (TAU * u.rem_euclid(1.0)).sin_cos();
        let (sin_v, cos_v) = (TAU * v.rem_euclid(1.0)).sin_cos();
        let distance = ring + tube * cos_v;
        DVec3::new(distance * cos_u, tube * sin_v, -distance * sin_u)
    })]
}

/// A surface of revolution around the y axis. `profile` holds (radius, height) from the outer pole to the inner one,
/// joined by a uniform Catmull-Rom curve (Catmull and Rom 1974); its outside lies to the right of the profile.
pub fn lathe(profile: &[DVec2], columns: usize, rows: usize) -> Vec<Chart> {
    vec![Chart::from_function(columns, rows, |u, v| {
        let (sin, cos) = (TAU * u.rem_euclid(1.0)).sin_cos();
        let point = curve_through(profile, v);
        DVec3::new(point.x * cos, point.y, -point.x * sin)
    })]
}

/// A point of the Catmull-Rom curve through `points`, at `t` in `[0, 1]`; beyond it the curve is clamped.
fn curve_through(points: &[DVec2], t: f64) -> DVec2 {
    let last = points.len() - 1;
    let scaled = t.clamp(0.0, 1.0) * last as f64;
    let segment = (scaled as usize).min(last - 1);
    let x = scaled - segment as f64;
    let at = |index: isize| points[(segment as isize + index).clamp(0, last as isize) as usize];
    let (a, b, c, d) = (at(-1), at(0), at(1), at(2));
    let point = b + 0.5 * x * ((c - a) + x * ((2.0 * a - 5.0 * b + 4.0 * c - d) + x * (3.0 * (b - c) + d - a)));
    if scaled == segment as f64 { b } else { DVec2::new(point.x.max(0.0), point.y) }
}

/// A closed surface as six charts of a cube. `surface` gets a point of the cube `[-1,1]^3` (a little beyond near its
/// edges). `warp` spreads the grid evenly over a sphere; without it the grid is even on the cube.
pub fn cubed(cells: usize, warp: bool, surface: impl Fn(DVec3) -> DVec3) -> Vec<Chart> {
    let spread = |place: f64| {
        let place = 2.0 * place - 1.0;
        if warp && place.abs() != 1.0 { (place * FRAC_PI_4).tan() } else { place }
    };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    (0..6)
        .map(|face| {
            let (out, mut right, up) = (axes[face % 3], axes[(face + 1) % 3], axes[(face + 2) % 3]);
            let sign = if face < 3 { 1.0 } else { -1.0 };
            right *= sign;
            Chart::from_function(cells, cells, |u, v| surface(sign * out + spread(u) * right + spread(v) * up))
        })
        .collect()
}

/// A sphere around the origin.
pub fn sphere(radius: f64, cells: usize) -> Vec<Chart> {
    cubed(cells, true, |point| radius * point.normalize_or(DVec3::Y))
}

/// A cube with rounded edges around the origin: `half_edge` is half its width, `rounding` the radius of its edges.
pub fn rounded_cube(half_edge: f64, rounding: f64, cells: usize) -> Vec<Chart> {
    let inner = DVec3::splat(half_edge - rounding);
    cubed(cells, false, |point| {
        let outer = point * half_edge;
        let core = outer.clamp(-inner, inner);
        core + rounding * (outer - core).normalize_or(DVec3::Y)
    })
}

/// A sphere with smooth bumps: the radius varies by `amplitude` around 1.
pub fn blob(amplitude: f64, cells: usize) -> Vec<Chart> {
    cubed(cells, true, |point| {
        let d = point.normalize_or(DVec3::Y);
        let bumps = (3.1 * d.x + 0.4).sin() * (2.7 * d.y - 0.9).cos() + 0.6 * (4.3 * d.z + 2.0 * d.x + 1.1).sin();
        d * (1.0 + amplitude * bumps)
    })
}

/// A tube of radius `tube` along a (2, 3) torus knot that reaches about 3 from the origin, in `pieces` charts.
pub fn knot(tube: f64, columns: usize, rows: usize, pieces: usize) -> Vec<Chart> {
    // A knot on a torus of radii 2 and 1; the torus gives a frame that never degenerates.
    let core = |t: f64| {
        let ((sin_p, cos_p), (sin_q, cos_q)) = ((2.0 * TAU * t).sin_cos(), (3.0 * TAU * t).sin_cos());
        let distance = 2.0 + cos_q;
        (DVec3::new(distance * cos_p, sin_q, -distance * sin_p), DVec3::new(cos_q * cos_p, sin_q, -cos_q * sin_p))
    };
    (0..pieces)
        .map(|piece| {
            Chart::from_function(columns, rows, |u, v| {
                let t = ((piece as f64 + u) / pieces as f64).rem_euclid(1.0);
                let (point, outwards) = core(t);
                let tangent = (core(t + 1e-6).0 - core(t - 1e-6).0).normalize_or(DVec3::X);
                let side = (outwards - outwards.dot(tangent) * tangent).normalize_or(DVec3::Y);
                let (sin, cos) = (TAU * v.rem_euclid(1.0)).sin_cos();
                point + tube * (cos * side + sin * side.cross(tangent))
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// Signed volume, and how many directed edges lack their opposite once equal positions are joined.
    fn closedness(charts: &[Chart]) -> (f64, usize) {
        let mut names: HashMap<[u32; 3], usize> = HashMap::new();
        let mut edges: HashMap<(usize, usize), i32> = HashMap::new();
        let mut volume = 0.0;
        for chart in charts {
            for triangle in &chart.triangles {
                let corners = triangle.map(|vertex| chart.positions[vertex as usize]);
                let [a, b, c] = corners.map(Vec3::as_dvec3);
                volume += a.cross(b).dot(c) / 6.0;
                let ids = corners.map(|corner| {
                    let next = names.len();
                    *names.entry(corner.to_array().map(|x| (x + 0.0).to_bits())).or_insert(next)
                });
                for side in 0..3 {
                    let (from, to) = (ids[side], ids[(side + 1) % 3]);
                    *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
                }
            }
        }
        (volume, edges.values().filter(|&&balance| balance != 0).count())
    }

    #[test]
    fn solids_are_closed_outward_and_their_normals_agree_with_their_triangles() {
        let vase = [(0.0, 0.0), (0.5, 0.05), (0.7, 0.8), (0.5, 1.3), (0.3, 1.3), (0.4, 0.8), (0.3, 0.3), (0.0, 0.2)]
            .map(|(radius, height)| DVec2::new(radius, height));
        let pi = std::f64::consts::PI;
        let solids = [
            ("torus", torus(1.0, 0.3, 64, 32), Some(2.0 * pi * pi * 0.09)),
            ("sphere", sphere(1.0, 16), Some(4.0 / 3.0 * pi)),
            ("rounded cube", rounded_cube(0.5, 0.12, 16), None),
            ("blob", blob(0.15, 16), None),
            ("knot", knot(0.4, 64, 12, 3), None),
            ("vase", lathe(&vase, 32, 70), None),
        ];
        for (name, charts, expected) in solids {
            let (volume, open) = closedness(&charts);
            assert_eq!(open, 0, "{name} has open edges");
            assert!(volume > 0.0, "{name} is inside out");
            if let Some(expected) = expected {
                assert!((volume / expected - 1.0).abs() < 0.02, "{name}: volume {volume} against {expected}");
            }
            for chart in &charts {
                for triangle in &chart.triangles {
                    let [a, b, c] = triangle.map(|vertex| chart.positions[vertex as usize]);
                    let flat = (b - a).cross(c - a).normalize_or_zero();
                    for &vertex in triangle {
                        let normal = chart.normals[vertex as usize];
                        assert!(flat.dot(normal) > 0.3, "{name}: {flat} against {normal} at {a}");
                        assert!((normal.length() - 1.0).abs() < 1e-5);
                    }
                }
            }
        }
    }

    #[test]
    fn every_triangle_is_counter_clockwise_on_its_chart() {
        for charts in [disk(2.0, 4, 24), torus(1.0, 0.3, 12, 8), sphere(1.0, 4), knot(0.4, 20, 6, 3)] {
            for chart in charts {
                for triangle in &chart.triangles {
                    let [a, b, c] = triangle.map(|vertex| chart.places[vertex as usize]);
                    assert!((b - a).perp_dot(c - a) > 0.0);
                }
            }
        }
    }
}
