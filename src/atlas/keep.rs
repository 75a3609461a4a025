//! When the coordinates a mesh came with may stay.

use super::raster::overlaps;
use super::topology::Topology;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::scene::Mesh;
use glam::Vec2;

/// Texels in which triangles may overlap by rounding, as a share of the map, before coordinates count as overlapping.
const OVERLAP_SHARE: f64 = 1e-4;

/// Why the coordinates of a mesh cannot serve as an atlas; `None` when they can.
pub(crate) fn objection(mesh: &Mesh, resolution: usize) -> Option<String> {
    if mesh.uvs.is_empty() {
        return Some("the mesh has no texture coordinates".into());
    }
    let referenced = || mesh.triangles.iter().flatten().map(|&vertex| mesh.uvs[vertex as usize]);
    if let Some(uv) =
        referenced().find(|uv| !(uv.cmpge(Vec2::splat(-1e-4)).all() && uv.cmple(Vec2::splat(1.0001)).all()))
    {
        return Some(format!("a texture coordinate, {uv}, lies outside [0, 1]"));
    }
    let area = |triangle: usize| {
        let [a, b, c] = mesh.triangles[triangle].map(|vertex| mesh.uvs[vertex as usize].as_dvec2());
        (b - a).perp_dot(c - a).abs() / 2.0
    };
    let space = |triangle: usize| f64::from(mesh.area_vector(triangle).length()) / 2.0;
    let total: f64 = (0..mesh.triangles.len()).map(space).sum();
    let lost: f64 = (0..mesh.triangles.len()).filter(|&triangle| area(triangle) < 1e-12).map(space).sum();
    if lost > 1e-3 * total {
        return Some(format!("{:.1} % of the surface has no area in the texture", 100.0 * lost / total));
    }
    let overlapping = overlaps(mesh, resolution);
    if overlapping as f64 > OVERLAP_SHARE * (resolution * resolution) as f64 {
        return Some(format!("charts overlap in {overlapping} of {resolution} x {resolution} texels"));
    }
    None
}

/// The error for coordinates that were to be kept and cannot be.
pub(crate) fn refusal(reason: String) -> Error {
    Error::new(ErrorKind::InvalidSetting, format!("the texture coordinates cannot be kept: {reason}"))
        .at(Place::Setting("uv".into()))
        .remedy("use --uv auto or --uv rebuild")
}

/// Charts of a mesh with coordinates: triangles joined across edges whose ends have the same coordinates.
pub(crate) fn charts(mesh: &Mesh, topology: &Topology) -> Result<Vec<u32>> {
    let uv = |half_edge: u32, end: usize| {
        let corner = (half_edge as usize % 3 + end) % 3;
        mesh.uvs[mesh.triangles[half_edge as usize / 3][corner] as usize]
    };
    let mut chart = vec![u32::MAX; mesh.triangles.len()];
    let mut count = 0;
    for start in 0..chart.len() {
        if chart[start] != u32::MAX {
            continue;
        }
        chart[start] = count;
        let mut stack = vec![start as u32];
        while let Some(triangle) = stack.pop() {
            for half_edge in triangle * 3..triangle * 3 + 3 {
                let other = topology.across[half_edge as usize];
                if other == super::topology::NONE || chart[other as usize / 3] != u32::MAX {
                    continue;
                }
                if uv(half_edge, 0) == uv(other, 1) && uv(half_edge, 1) == uv(other, 0) {
                    chart[other as usize / 3] = count;
                    stack.push(other / 3);
                }
            }
        }
        count += 1;
    }
    Ok(chart)
}
