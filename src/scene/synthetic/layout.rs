//! Charts of parametric shapes, side by side in one texture.
//!
//! This is no unwrapper: the charts are rectangles already. They are put on shelves, tall ones first, at the largest
//! common texel density that fits (found by bisection).

use super::shapes::Chart;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::scene::mesh::Mesh;
use glam::Vec2;

/// Texels kept free around each chart, so that bilinear taps and one level of the mip chain stay inside it.
const GUTTER_TEXELS: f32 = 2.0;

/// A chart of a part, to be laid out.
#[derive(Clone, Debug)]
pub struct PartChart {
    /// The surface.
    pub chart: Chart,
    /// Number of the part it belongs to.
    pub part: u32,
    /// Texels a world unit, relative to the other charts.
    pub density: f32,
}

/// A mesh whose parts share one texture.
#[derive(Clone, Debug, Default)]
pub struct PartMesh {
    /// The mesh, with normals and texture coordinates.
    pub mesh: Mesh,
    /// Part of each triangle.
    pub triangle_part: Vec<u32>,
}

/// A rectangle of texels for a chart: gutters included, `turned` when the chart's v runs along the row.
#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    corner: Vec2,
    size: Vec2,
    turned: bool,
}

/// Joins charts into one mesh with texture coordinates for a map of `width x height` texels.
///
/// # Errors
/// `InvalidSetting` when the map is too small to hold the charts at all.
pub fn lay_out(charts: Vec<PartChart>, width: usize, height: usize) -> Result<PartMesh> {
    let map = Vec2::new(width as f32, height as f32);
    // Bisect the density: `low` fits, `high` does not.
    let area: f32 = charts.iter().map(|item| (item.chart.size_world * item.density).element_product()).sum();
    let mut high = 2.0 * (map.element_product() / area.max(f32::MIN_POSITIVE)).sqrt();
    let mut low = 0.0;
    let mut best = None;
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        match shelve(&charts, middle, map) {
            Some(slots) => {
                best = Some(slots);
                low = middle;
            }
            None => high = middle,
        }
    }
    let slots = best.ok_or_else(|| {
        Error::new(ErrorKind::InvalidSetting, format!("a map of {width} x {height} texels cannot hold the charts"))
            .at(Place::Setting("map-size".into()))
            .remedy("choose a larger map")
    })?;
    let mut joined = PartMesh::default();
    for (item, slot) in charts.into_iter().zip(slots) {
        let first = joined.mesh.positions.len() as u32;
        joined.mesh.positions.extend(&item.chart.positions);
        joined.mesh.normals.extend(&item.chart.normals);
        for place in item.chart.places {
            // A quarter turn keeps the orientation: (u, v) becomes (1 - v, u).
            let place = if slot.turned { Vec2::new(1.0 - place.y, place.x) } else { place };
            let texel = slot.corner + GUTTER_TEXELS + place * (slot.size - 2.0 * GUTTER_TEXELS);
            joined.mesh.uvs.push(texel / map);
        }
        joined.mesh.triangles.extend(item.chart.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
        joined.triangle_part.resize(joined.mesh.triangles.len(), item.part);
    }
    Ok(joined)
}

/// Puts all charts on shelves at this density; `None` when they do not fit.
fn shelve(charts: &[PartChart], texels_per_unit: f32, map: Vec2) -> Option<Vec<Slot>> {
    let mut slots: Vec<Slot> = charts
        .iter()
        .map(|item| {
            let texels = (item.chart.size_world * item.density * texels_per_unit).ceil().max(Vec2::splat(2.0));
            let turned = texels.y > texels.x;
            let size = if turned { Vec2::new(texels.y, texels.x) } else { texels };
            Slot { corner: Vec2::ZERO, size: size + 2.0 * GUTTER_TEXELS, turned }
        })
        .collect();
    // Tall first; the index breaks ties, so the order is always the same.
    let mut order: Vec<usize> = (0..slots.len()).collect();
    order.sort_by(|&a, &b| slots[b].size.y.total_cmp(&slots[a].size.y).then(a.cmp(&b)));
    let mut shelves: Vec<(f32, f32, f32)> = Vec::new(); // (used width, bottom, height)
    for index in order {
        let size = slots[index].size;
        let free = shelves.iter().position(|&(used, _, height)| used + size.x <= map.x && size.y <= height);
        let shelf = match free {
            Some(shelf) => shelf,
            None => {
                let bottom = shelves.last().map_or(0.0, |&(_, bottom, height)| bottom + height);
                if size.x > map.x || bottom + size.y > map.y {
                    return None;
                }
                shelves.push((0.0, bottom, size.y));
                shelves.len() - 1
            }
        };
        slots[index].corner = Vec2::new(shelves[shelf].0, shelves[shelf].1);
        shelves[shelf].0 += size.x;
    }
    Some(slots)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::shapes;

    #[test]
    fn a_map_too_small_is_refused_with_a_remedy() {
        let charts: Vec<_> =
            shapes::sphere(1.0, 2).into_iter().map(|chart| PartChart { chart, part: 0, density: 1.0 }).collect();
        assert!(lay_out(charts.clone(), 32, 32).is_ok());
        let error = lay_out(charts, 8, 8).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidSetting);
        assert!(!error.remedy_text().is_empty());
    }
}
