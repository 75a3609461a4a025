//! From a reflectance that is a function of the place on a surface to texture maps.

use crate::image::Image;
use crate::material::MaterialMaps;
use crate::math::parallel;
use crate::scene::mesh::Mesh;
use glam::{DVec2, Vec3};

/// A place on the surface that a texel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position in world units.
    pub position: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    /// Part of the scene it belongs to.
    pub part: u32,
}

/// What the surface does with light there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reflectance {
    /// Diffuse reflectance, linear RGB in [0, 1].
    pub diffuse: Vec3,
    /// Reflectance at normal incidence, linear RGB in [0, 1].
    pub specular: Vec3,
    /// Roughness `r = a^2` in (0, 1].
    pub roughness: f32,
}

/// Maps and where they mean something.
#[derive(Clone, Debug)]
pub struct Baked {
    /// The maps; texels outside every chart repeat the nearest texel inside one.
    pub maps: MaterialMaps,
    /// Texels inside a chart.
    pub covered: Image<bool>,
}

/// Samples a side of a texel.
const SAMPLES: usize = 2;
const NOBODY: u32 = u32::MAX;

/// Evaluates `reflectance` over the mesh as its texture coordinates lay it out, on `width x height` texels.
///
/// A texel is the mean over those of its 2 x 2 samples that lie in a triangle. Triangles without corners in range or
/// without texture coordinates cover nothing. `part_of` names the part of a triangle.
pub fn bake(
    mesh: &Mesh,
    width: usize,
    height: usize,
    part_of: impl Fn(usize) -> u32 + Sync,
    reflectance: impl Fn(&SurfacePoint) -> Reflectance + Sync,
) -> Baked {
    let owners = owners_of_samples(mesh, width, height);
    // Average the reflectance over the covered samples of each texel.
    let texel = |row: usize, column: usize| {
        let mut sum = Reflectance::default();
        let mut count = 0.0;
        for sample in 0..SAMPLES * SAMPLES {
            let place = (row * SAMPLES + sample / SAMPLES, column * SAMPLES + sample % SAMPLES);
            let triangle = owners[place];
            if triangle != NOBODY {
                let point = point_of(mesh, triangle as usize, place, width, height, part_of(triangle as usize));
                let value = reflectance(&point);
                sum.diffuse += value.diffuse;
                sum.specular += value.specular;
                sum.roughness += value.roughness;
                count += 1.0;
            }
        }
        (count > 0.0).then(|| Reflectance {
            diffuse: sum.diffuse / count,
            specular: sum.specular / count,
            roughness: sum.roughness / count,
        })
    };
    let texels = parallel::map_small(width * height, |index| texel(index / width, index % width));
    let covered = Image::from_pixels(width, height, texels.iter().map(Option::is_some).collect());
    let nearest = nearest_covered(&covered);
    let fallback = Reflectance { roughness: 1.0, ..Reflectance::default() };
    let filled: Vec<Reflectance> = nearest
        .pixels()
        .iter()
        .map(|&texel| texels.get(texel as usize).copied().flatten().unwrap_or(fallback))
        .collect();
    Baked {
        maps: MaterialMaps {
            diffuse: Image::from_pixels(width, height, filled.iter().map(|value| value.diffuse).collect()),
            specular: Image::from_pixels(width, height, filled.iter().map(|value| value.specular).collect()),
            roughness: Image::from_pixels(width, height, filled.iter().map(|value| value.roughness).collect()),
        },
        covered,
    }
}

/// The triangle at the centre of each sample, at `SAMPLES` times the resolution; the lowest index wins.
fn owners_of_samples(mesh: &Mesh, width: usize, height: usize) -> Image<u32> {
    let (width, height) = (width * SAMPLES, height * SAMPLES);
    let mut owners = Image::filled(width, height, NOBODY);
    if mesh.uvs.len() != mesh.positions.len() {
        return owners;
    }
    for triangle in (0..mesh.triangles.len()).rev() {
        let corners = mesh.triangles[triangle].map(|vertex| pixels_of(mesh, vertex, width, height));
        let low = corners[0].min(corners[1]).min(corners[2]);
        let high = corners[0].max(corners[1]).max(corners[2]);
        if !(low.is_finite() && high.is_finite()) {
            continue;
        }
        // Pixel k has its centre at k + 0.5.
        let first = |x: f64| (x - 0.5).ceil().max(0.0) as usize;
        let end = |x: f64, size: usize| ((x - 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize;
        for row in first(low.y)..end(high.y, height) {
            for column in first(low.x)..end(high.x, width) {
                let weights = barycentric(corners, DVec2::new(column as f64 + 0.5, row as f64 + 0.5));
                if weights.is_some_and(|weights| weights.iter().all(|&weight| weight >= -1e-9)) {
                    owners[(row, column)] = triangle as u32;
                }
            }
        }
    }
    owners
}

/// Texture coordinates of a vertex in pixels from the upper left corner of a `width x height` map.
fn pixels_of(mesh: &Mesh, vertex: u32, width: usize, height: usize) -> DVec2 {
    let uv = mesh.uvs[vertex as usize].as_dvec2();
    DVec2::new(uv.x * width as f64, (1.0 - uv.y) * height as f64)
}

/// Barycentric weights of a point; `None` for a triangle without area.
fn barycentric([a, b, c]: [DVec2; 3], point: DVec2) -> Option<[f64; 3]> {
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 || !area.is_finite() {
        return None;
    }
    let (second, third) = ((point - a).perp_dot(c - a) / area, (b - a).perp_dot(point - a) / area);
    Some([1.0 - second - third, second, third])
}

fn point_of(
    mesh: &Mesh,
    triangle: usize,
    (row, column): (usize, usize),
    width: usize,
    height: usize,
    part: u32,
) -> SurfacePoint {
    let vertices = mesh.triangles[triangle];
    let corners = vertices.map(|vertex| pixels_of(mesh, vertex, width * SAMPLES, height * SAMPLES));
    let centre = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
    let weights = barycentric(corners, centre).unwrap_or([1.0, 0.0, 0.0]);
    let blend =
        |values: &[Vec3]| (0..3).map(|corner| weights[corner] as f32 * values[vertices[corner] as usize]).sum::<Vec3>();
    let flat = || mesh.area_vector(triangle).normalize_or(Vec3::Y);
    let normal =
        if mesh.normals.is_empty() { flat() } else { blend(&mesh.normals).try_normalize().unwrap_or_else(flat) };
    SurfacePoint { position: blend(&mesh.positions), normal, part }
}

/// For each texel the index of a nearest covered one; of nobody where nothing is covered.
///
/// The covered area grows by one ring of eight neighbours at a time; a new texel takes the nearest of what its
/// neighbours of earlier rings have found.
fn nearest_covered(covered: &Image<bool>) -> Image<u32> {
    let (width, height) = (covered.width(), covered.height());
    let mut nearest =
        Image::from_fn(
            width,
            height,
            |row, column| {
                if covered[(row, column)] { (row * width + column) as u32 } else { NOBODY }
            },
        );
    let around = |row: usize, column: usize| {
        let columns = column.saturating_sub(1)..=(column + 1).min(width - 1);
        (row.saturating_sub(1)..=(row + 1).min(height - 1))
            .flat_map(move |row| columns.clone().map(move |column| (row, column)))
    };
    let mut front: Vec<(usize, usize)> =
        (0..width * height).map(|texel| (texel / width, texel % width)).filter(|&place| covered[place]).collect();
    let mut reached = covered.clone();
    while !front.is_empty() {
        let mut ring = Vec::new();
        for &(row, column) in &front {
            for place in around(row, column) {
                if !std::mem::replace(&mut reached[place], true) {
                    ring.push(place);
                }
            }
        }
        let found: Vec<u32> = ring
            .iter()
            .map(|&(row, column)| {
                let squared_distance = |texel: u32| {
                    let texel = texel as usize;
                    (texel / width).abs_diff(row).pow(2) + (texel % width).abs_diff(column).pow(2)
                };
                let known = around(row, column).map(|place| nearest[place]).filter(|&texel| texel != NOBODY);
                known.min_by_key(|&texel| (squared_distance(texel), texel)).unwrap_or(NOBODY)
            })
            .collect();
        for (&place, texel) in ring.iter().zip(found) {
            nearest[place] = texel;
        }
        front = ring;
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    fn square() -> Mesh {
        Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::X - Vec3::Z, -Vec3::Z],
            normals: vec![Vec3::Y; 4],
            uvs: vec![Vec2::new(0.25, 0.25), Vec2::new(0.75, 0.25), Vec2::new(0.75, 0.75), Vec2::new(0.25, 0.75)],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn texels_show_the_place_that_bilinear_lookup_would_find_there() {
        let baked = bake(
            &square(),
            16,
            16,
            |triangle| triangle as u32,
            |point| Reflectance {
                diffuse: Vec3::new(point.position.x, -point.position.z, 0.5),
                specular: Vec3::splat(point.part as f32),
                roughness: 0.3,
            },
        );
        assert_eq!(baked.covered.pixels().iter().filter(|&&covered| covered).count(), 64);
        for row in 4..12 {
            for column in 4..12 {
                let (u, v) = ((column as f32 + 0.5) / 16.0, 1.0 - (row as f32 + 0.5) / 16.0);
                let expected = Vec3::new((u - 0.25) * 2.0, (v - 0.25) * 2.0, 0.5);
                assert!(baked.maps.diffuse[(row, column)].abs_diff_eq(expected, 1e-5), "row {row} column {column}");
            }
        }
        // Above the diagonal of the square lies the second triangle.
        assert_eq!(baked.maps.specular[(5, 5)].x, 1.0);
        assert_eq!(baked.maps.specular[(10, 11)].x, 0.0);
        // Outside, the nearest texel inside is repeated.
        assert_eq!(baked.maps.diffuse[(0, 0)], baked.maps.diffuse[(4, 4)]);
        assert_eq!(baked.maps.diffuse[(7, 15)], baked.maps.diffuse[(7, 11)]);
    }

    #[test]
    fn a_mesh_that_covers_nothing_gives_finite_maps() {
        let mut mesh = square();
        mesh.uvs = vec![Vec2::NAN; 4];
        let baked = bake(&mesh, 4, 4, |_| 0, |_| Reflectance::default());
        assert!(baked.covered.pixels().iter().all(|covered| !covered));
        assert!(baked.maps.roughness.pixels().iter().all(|&roughness| roughness == 1.0));
    }
}
