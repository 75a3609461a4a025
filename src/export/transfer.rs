//! Maps carried over to another mesh of the same place, such as a retopology with an artist's texture coordinates.
//!
//! From every texel of the other mesh a ray goes out along its normal both ways, and the nearer hit within reach gives the
//! material. Where nothing is met, the texel is filled from its neighbours and counted as not covered.

use super::run_folder::RunResult;
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::image::{GreyImage, Image, RgbImage};
use crate::material::MaterialMaps;
use crate::material::texels::TextureTap;
use crate::math::parallel;
use crate::scene::Mesh;
use crate::trace::{Bvh, Ray};
use glam::{Mat3, Vec2, Vec3};

/// How far a ray looks, as a share of the diagonal of the result's bounding box.
pub const REACH: f32 = 0.02;
/// Overlap of bounding boxes below which two meshes are not of one place.
const LEAST_OVERLAP: f32 = 0.2;

/// A result on another mesh.
#[derive(Clone, Debug)]
pub struct Transferred {
    /// Maps and mesh; `times_seen` is carried over too, 0 where nothing was met.
    pub result: RunResult,
    /// Share of the texels of the other mesh that met the surface, in [0, 1].
    pub coverage: f64,
    /// What was noticed.
    pub findings: Vec<Finding>,
}

/// Carries a result over to a mesh with texture coordinates; the maps get `size x size` texels.
///
/// The other mesh may lie in the source's own axes: of the identity and the turns that bring another axis up, the one is
/// taken at which the bounding boxes agree best.
///
/// # Errors
/// `InvalidScene` for a mesh without texture coordinates, with coordinates that overlap wholly outside [0, 1], or of
/// another place.
pub fn transfer(result: &RunResult, onto: Mesh, size: usize) -> Result<Transferred> {
    if onto.uvs.len() != onto.positions.len() || onto.triangles.is_empty() {
        return Err(Error::new(ErrorKind::InvalidScene, "the mesh has no texture coordinates")
            .remedy("unwrap it first, or export without --onto"));
    }
    let mut findings = Vec::new();
    let onto = turned_to(&result.mesh, onto, &mut findings)?;
    let bvh = Bvh::build(&result.mesh.positions, &result.mesh.triangles)?;
    let (low, high) = result.mesh.bounds().unwrap_or_default();
    let reach = REACH * (high - low).length();
    let places = places_of_texels(&onto, size);
    let wanted = places.pixels().iter().filter(|place| place.is_some()).count();
    if wanted == 0 {
        return Err(Error::new(ErrorKind::InvalidScene, "no texture coordinate of the mesh lies in [0, 1]")
            .remedy("move its charts into the unit square: tiles beyond it are not written"));
    }
    let tap = |index: usize| {
        let (position, normal) = places.pixels()[index]?;
        let uv = nearest_along(&bvh, &result.mesh, position, normal, reach)?;
        Some(TextureTap::at(uv, 0, result.maps.diffuse.width(), result.maps.diffuse.height()))
    };
    let taps = parallel::map_small(places.pixels().len(), tap);
    let met = taps.iter().filter(|tap| tap.is_some()).count();
    let coverage = met as f64 / wanted as f64;
    let message = format!("{:.1} % of the texels of the other mesh met the fitted surface", 100.0 * coverage);
    let severity = if coverage < 0.95 { Severity::Warning } else { Severity::Note };
    let finding = Finding::new(severity, "export-transfer", message);
    findings.push(if coverage < 0.95 {
        finding.remedy("bring the meshes closer together; the rest is filled")
    } else {
        finding
    });
    // Texels that met nothing take the nearest that did.
    let covered = Image::from_pixels(size, size, taps.iter().map(Option::is_some).collect());
    let nearest = crate::atlas::nearest_covered(&covered);
    let rgb = |map: &RgbImage| -> RgbImage {
        let texel =
            |tap: &TextureTap| (0..4).map(|i| map.pixels()[tap.index[i] as usize] * tap.weight[i]).sum::<Vec3>();
        nearest.map(|&index| taps[index as usize].as_ref().map_or(Vec3::ZERO, texel))
    };
    let grey = |map: &GreyImage, filled: bool| -> GreyImage {
        let texel = |tap: &TextureTap| (0..4).map(|i| map.pixels()[tap.index[i] as usize] * tap.weight[i]).sum::<f32>();
        let mut own = 0u32..;
        nearest.map(|&index| {
            let index = if filled { index } else { own.next().unwrap_or(index) };
            taps[index as usize].as_ref().map_or(0.0, texel)
        })
    };
    let maps = MaterialMaps {
        diffuse: rgb(&result.maps.diffuse),
        specular: rgb(&result.maps.specular),
        roughness: grey(&result.maps.roughness, true),
    };
    let times_seen = grey(&result.times_seen, false);
    let environment = result.environment.clone();
    Ok(Transferred {
        result: RunResult { maps, environment, mesh: onto, times_seen, lobe: result.lobe },
        coverage,
        findings,
    })
}

/// Position and normal of the other mesh at the centre of each texel, or at the nearest point of the triangle that
/// touches it.
fn places_of_texels(mesh: &Mesh, size: usize) -> Image<Option<(Vec3, Vec3)>> {
    let mut places: Image<Option<(Vec3, Vec3)>> = Image::filled(size, size, None);
    let mut distance = vec![f32::INFINITY; size * size];
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let uvs = triangle.map(|vertex| mesh.uvs[vertex as usize]);
        if !uvs.iter().all(|uv| uv.is_finite()) {
            continue;
        }
        // Rows counted downwards.
        let corners = uvs.map(|uv| Vec2::new(uv.x, 1.0 - uv.y) * size as f32);
        let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        let flat = mesh.area_vector(index).normalize_or_zero();
        let first = low.floor().max(Vec2::ZERO);
        let last = high.ceil().min(Vec2::splat(size as f32));
        for row in first.y as usize..last.y.max(0.0) as usize {
            for column in first.x as usize..last.x.max(0.0) as usize {
                let centre = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let weights = nearest_weights(corners, centre);
                let nearest = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
                let gap = (nearest - centre).length();
                let texel = row * size + column;
                // Half the diagonal of a texel: it is touched.
                if gap > 0.71 || gap >= distance[texel] {
                    continue;
                }
                distance[texel] = gap;
                let mix = |of: &[Vec3]| {
                    let [a, b, c] = triangle.map(|vertex| of[vertex as usize]);
                    a * weights.x + b * weights.y + c * weights.z
                };
                let normal = if mesh.normals.is_empty() { flat } else { mix(&mesh.normals).normalize_or(flat) };
                places[(row, column)] = Some((mix(&mesh.positions), normal));
            }
        }
    }
    places
}

/// Barycentric weights of the point of a triangle that is nearest to another point of the plane.
fn nearest_weights(corners: [Vec2; 3], point: Vec2) -> Vec3 {
    let [a, b, c] = corners;
    let area = (b - a).perp_dot(c - a);
    if area.abs() > 1e-12 {
        let weights = Vec3::new((b - point).perp_dot(c - point), (c - point).perp_dot(a - point), 0.0) / area;
        let weights = Vec3::new(weights.x, weights.y, 1.0 - weights.x - weights.y);
        if weights.min_element() >= 0.0 {
            return weights;
        }
    }
    // On a side.
    let mut best = (f32::INFINITY, Vec3::X);
    for side in 0..3 {
        let (from, to) = (corners[side], corners[(side + 1) % 3]);
        let along = to - from;
        let share = ((point - from).dot(along) / along.length_squared().max(1e-20)).clamp(0.0, 1.0);
        let gap = (from + along * share - point).length_squared();
        if gap < best.0 {
            let mut weights = [0.0; 3];
            weights[side] = 1.0 - share;
            weights[(side + 1) % 3] = share;
            best = (gap, Vec3::from_array(weights));
        }
    }
    best.1
}

/// Texture coordinate of the result where a line through a point along a normal meets it nearest, within reach.
fn nearest_along(bvh: &Bvh, mesh: &Mesh, position: Vec3, normal: Vec3, reach: f32) -> Option<Vec2> {
    let hit = |direction: Vec3| {
        // From behind the point, so that a surface in its very place is met.
        let behind = 1e-3 * reach;
        bvh.closest_hit(&Ray { origin: position - direction * behind, direction, t_max: reach + behind })
    };
    let (outward, inward) = (hit(normal), hit(-normal));
    let hit = match (outward, inward) {
        (Some(a), Some(b)) => Some(if a.t <= b.t { a } else { b }),
        (a, b) => a.or(b),
    }?;
    let [a, b, c] = mesh.triangles[hit.triangle as usize].map(|vertex| mesh.uvs[vertex as usize]);
    Some(a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v)
}

/// The other mesh, turned so that its bounding box agrees best with that of the result.
fn turned_to(own: &Mesh, mut onto: Mesh, findings: &mut Vec<Finding>) -> Result<Mesh> {
    let columns = |x: Vec3, y: Vec3, z: Vec3| Mat3::from_cols(x, y, z);
    // As readers turn a source whose up is +y, +z, -z, -y, +x, -x.
    let turns = [
        ("+y", Mat3::IDENTITY),
        ("+z", columns(Vec3::X, Vec3::NEG_Z, Vec3::Y)),
        ("-z", columns(Vec3::X, Vec3::Z, Vec3::NEG_Y)),
        ("-y", columns(Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z)),
        ("+x", columns(Vec3::Y, Vec3::NEG_X, Vec3::Z)),
        ("-x", columns(Vec3::NEG_Y, Vec3::X, Vec3::Z)),
    ];
    let overlap = |turn: &Mat3| {
        let (Some((own_low, own_high)), Some((low, high))) = (own.bounds(), onto.bounds()) else { return 0.0 };
        let (a, b) = (*turn * low, *turn * high);
        let (low, high) = (a.min(b), a.max(b));
        // Flat things have boxes without a depth.
        let pad = 1e-2 * (own_high - own_low).length();
        let common = (own_high.min(high) - own_low.max(low) + pad).max(Vec3::ZERO);
        let union = own_high.max(high) - own_low.min(low) + pad;
        (common / union).element_product()
    };
    let scored = turns.map(|(up, turn)| (overlap(&turn), up, turn));
    // The first of equals: a mesh as it is before one that is turned.
    let best = scored
        .iter()
        .copied()
        .fold((0.0f32, "+y", Mat3::IDENTITY), |best, next| if next.0 > best.0 * 1.001 { next } else { best });
    if best.0 < LEAST_OVERLAP {
        let message = format!("its bounding box shares only {:.0} % with that of the run", 100.0 * best.0);
        return Err(Error::new(ErrorKind::InvalidScene, message)
            .remedy("give a mesh of the same place, in the axes and units of the scene or of the run's mesh.obj"));
    }
    if best.1 != "+y" {
        findings.push(Finding::new(
            Severity::Note,
            "export-mesh-turned",
            format!("the other mesh was turned so that its {} axis is up, as the scene was on reading", best.1),
        ));
        onto.positions.iter_mut().for_each(|p| *p = best.2 * *p);
        onto.normals.iter_mut().for_each(|n| *n = best.2 * *n);
    }
    if onto.normals.is_empty() {
        onto.compute_normals();
    }
    Ok(onto)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Environment;

    /// A square whose diffuse map is its own texture coordinate.
    fn square() -> RunResult {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
            normals: vec![Vec3::Z; 4],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let (u, v) = (|column: usize| (column as f32 + 0.5) / 64.0, |row: usize| 1.0 - (row as f32 + 0.5) / 64.0);
        let maps = MaterialMaps {
            diffuse: Image::from_fn(64, 64, |row, column| Vec3::new(u(column), v(row), 0.0)),
            specular: Image::filled(64, 64, Vec3::splat(0.04)),
            roughness: Image::from_fn(64, 64, |row, _| 0.1 + 0.5 * v(row)),
        };
        let environment = Environment::constant(2, 1, Vec3::ONE);
        RunResult { maps, environment, mesh, times_seen: Image::filled(64, 64, 3.0), lobe: Default::default() }
    }

    #[test]
    fn material_lands_where_the_place_is_whatever_the_coordinates() {
        // The same square, a little off, its coordinates turned by a quarter, its left third missing in the result.
        let own = square();
        let mut onto = own.mesh.clone();
        onto.positions.iter_mut().for_each(|p| p.z += 0.004);
        onto.uvs = vec![Vec2::X, Vec2::ONE, Vec2::Y, Vec2::ZERO];
        let moved = transfer(&own, onto.clone(), 32).unwrap();
        assert_eq!(moved.coverage, 1.0);
        for row in 2..30 {
            for column in 2..30 {
                // u = 1 - y, v = x.
                let (u, v) = ((column as f32 + 0.5) / 32.0, 1.0 - (row as f32 + 0.5) / 32.0);
                let expected = Vec3::new(v, 1.0 - u, 0.0);
                assert!((moved.result.maps.diffuse[(row, column)] - expected).length() < 2e-3);
            }
        }
        let mut wide = onto;
        wide.positions.iter_mut().for_each(|p| p.x = 1.5 * p.x - 0.5);
        let moved = transfer(&own, wide, 48).unwrap();
        assert!((moved.coverage - 2.0 / 3.0).abs() < 0.03, "{}", moved.coverage);
        assert!(moved.findings.iter().any(|f| f.severity == Severity::Warning && !f.remedy.is_empty()));
        assert!(moved.result.times_seen.pixels().contains(&0.0) && moved.result.times_seen.pixels().contains(&3.0));
        assert!(moved.result.maps.roughness.pixels().iter().all(|&r| r > 0.05), "holes are filled");
    }

    #[test]
    fn a_mesh_in_the_axes_of_its_source_is_turned_and_one_of_elsewhere_refused() {
        let mut own = square();
        own.mesh.positions.iter_mut().for_each(|p| *p += Vec3::new(0.0, 3.0, 0.0));
        // z up: (x, y, z) of the source is (x, z, -y) of the world.
        let mut onto = own.mesh.clone();
        onto.positions.iter_mut().for_each(|p| *p = Vec3::new(p.x, -p.z, p.y));
        onto.normals.clear();
        let moved = transfer(&own, onto, 16).unwrap();
        assert!(moved.findings.iter().any(|finding| finding.code == "export-mesh-turned"));
        assert_eq!(moved.coverage, 1.0);
        let mut elsewhere = own.mesh.clone();
        elsewhere.positions.iter_mut().for_each(|p| *p += 10.0);
        assert_eq!(transfer(&own, elsewhere, 16).unwrap_err().kind(), ErrorKind::InvalidScene);
        let bare = Mesh { uvs: Vec::new(), ..own.mesh.clone() };
        assert!(transfer(&own, bare, 16).unwrap_err().remedy_text().contains("--onto"));
    }
}
