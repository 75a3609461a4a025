//! How good an atlas is: distortion of angles and areas, packing, and the counts that must be zero.

use super::chart::{ChartMesh, Surface};
use super::lscm::lay_flat;
use super::raster;
use crate::scene::Mesh;
use glam::{DMat2, DVec2, DVec3};

/// Measured quality of an atlas at the resolution it was packed for.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AtlasQuality {
    /// Number of charts.
    pub charts: usize,
    /// Number of triangles after cleaning.
    pub triangles: usize,
    /// Width and height in texels for which the charts were packed.
    pub resolution_texels: usize,
    /// Share of texels that a chart touches, in [0, 1].
    pub share_covered: f64,
    /// Area of all triangles in the unit square, in [0, 1]: the packing efficiency without border texels.
    pub share_of_area: f64,
    /// Quasi-conformal error, the ratio of singular values of the map, averaged by area; 1 is conformal.
    pub angle_distortion_mean: f64,
    /// The ratio below which 95 % of the area lies.
    pub angle_distortion_95: f64,
    /// The largest ratio, over triangles that are not slivers in space (height above 1/1000 of the longest edge).
    pub angle_distortion_max: f64,
    /// The larger of relative texture area and its inverse, averaged by area; 1 is even texel density.
    pub area_distortion_mean: f64,
    /// The area distortion below which 95 % of the area lies.
    pub area_distortion_95: f64,
    /// Texels whose centre lies in two triangles.
    pub overlapping_texels: usize,
    /// Triangles turned over against the others of their chart, beyond what rounding of coordinates explains.
    pub flipped_triangles: usize,
    /// Fewest empty texels between two charts; `None` for a single chart.
    pub narrowest_gutter_texels: Option<usize>,
    /// Longest side of a texel in world units at mean density.
    pub texel_size: f64,
}

/// Distortion of one chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Distortion {
    /// Ratio of singular values, mean by area.
    pub angle_mean: f64,
    /// The larger of relative area and its inverse, mean by area.
    pub area_mean: f64,
}

impl Default for Distortion {
    fn default() -> Self {
        Distortion { angle_mean: 1.0, area_mean: 1.0 }
    }
}

/// Ratio of singular values (at least 1) and signed area ratio of the map from space to texture; `None` when the
/// triangle has no area in space.
pub(crate) fn triangle_distortion(space: [DVec3; 3], texture: [DVec2; 3]) -> Option<(f64, f64)> {
    let flat = lay_flat(space)?;
    let from = DMat2::from_cols(flat[1] - flat[0], flat[2] - flat[0]);
    let to = DMat2::from_cols(texture[1] - texture[0], texture[2] - texture[0]);
    let map = to * from.inverse();
    let determinant = map.determinant();
    // Singular values from the squared Frobenius norm and the determinant: s1^2 + s2^2 and s1 s2.
    let norm = map.x_axis.length_squared() + map.y_axis.length_squared();
    let plus = (norm + 2.0 * determinant.abs()).max(0.0).sqrt();
    let minus = (norm - 2.0 * determinant.abs()).max(0.0).sqrt();
    let ratio = if plus > minus { (plus + minus) / (plus - minus) } else { f64::INFINITY };
    (!ratio.is_nan()).then_some((ratio, determinant))
}

/// Distortion of a chart whose total area is kept.
pub(crate) fn chart_distortion(surface: &Surface, chart: &ChartMesh, points: &[DVec2]) -> Distortion {
    let (mut area, mut angle, mut stretch) = (0.0, 0.0, 0.0);
    for (&triangle, corners) in chart.triangles.iter().zip(&chart.corners) {
        let texture = corners.map(|vertex| points[vertex as usize]);
        if let Some((ratio, scale)) = triangle_distortion(surface.corners(triangle), texture) {
            let weight = surface.areas[triangle as usize];
            area += weight;
            // A sliver of no weight may be distorted without bound.
            angle += weight * ratio.min(1e3);
            stretch += weight * scale.max(1.0 / scale).min(1e3);
        }
    }
    if area > 0.0 { Distortion { angle_mean: angle / area, area_mean: stretch / area } } else { Distortion::default() }
}

/// Measures a mesh with UVs. `chart_of_triangle` names the chart of each triangle.
pub(crate) fn measure(mesh: &Mesh, chart_of_triangle: &[u32], resolution: usize) -> AtlasQuality {
    let charts = chart_of_triangle.iter().max().map_or(0, |&last| last as usize + 1);
    let mut quality = AtlasQuality {
        charts,
        triangles: mesh.triangles.len(),
        resolution_texels: resolution,
        ..AtlasQuality::default()
    };
    let mut measured = Vec::with_capacity(mesh.triangles.len());
    let mut balance = vec![0i64; charts];
    let mut turned = Vec::new();
    let (mut space_area, mut texture_area) = (0.0, 0.0);
    for triangle in 0..mesh.triangles.len() {
        let space = mesh.corners(triangle).map(|corner| corner.as_dvec3());
        let texture = mesh.triangles[triangle].map(|vertex| mesh.uvs[vertex as usize].as_dvec2());
        let area = (space[1] - space[0]).cross(space[2] - space[0]).length() / 2.0;
        let signed = (texture[1] - texture[0]).perp_dot(texture[2] - texture[0]) / 2.0;
        space_area += area;
        texture_area += signed.abs();
        // Coordinates near 1 are rounded to 2^-24: an area below edge length times that has no sign.
        let longest = (0..3).map(|c| texture[c].distance(texture[(c + 1) % 3])).fold(0.0, f64::max);
        if signed.abs() > longest * f64::from(f32::EPSILON) {
            balance[chart_of_triangle[triangle] as usize] += if signed > 0.0 { 1 } else { -1 };
            turned.push((triangle, signed > 0.0));
        }
        if let Some((ratio, _)) = triangle_distortion(space, texture) {
            let longest = (0..3).map(|c| space[c].distance(space[(c + 1) % 3])).fold(0.0, f64::max);
            measured.push((ratio, area, signed.abs(), 2.0 * area > 1e-3 * longest * longest));
        }
    }
    quality.flipped_triangles = turned
        .iter()
        .filter(|&&(triangle, positive)| positive != (balance[chart_of_triangle[triangle] as usize] >= 0))
        .count();
    let density = if space_area > 0.0 { texture_area / space_area } else { 0.0 };
    quality.texel_size = if density > 0.0 { 1.0 / (density.sqrt() * resolution as f64) } else { 0.0 };
    let angle: Vec<(f64, f64)> = measured.iter().map(|m| (m.0.min(1e6), m.1)).collect();
    let stretch = |m: &(f64, f64, f64, bool)| {
        let ratio = m.2 / (m.1 * density);
        (ratio.max(1.0 / ratio).min(1e6), m.1)
    };
    let area: Vec<(f64, f64)> = measured.iter().map(stretch).collect();
    (quality.angle_distortion_mean, quality.angle_distortion_95) = mean_and_95(angle);
    (quality.area_distortion_mean, quality.area_distortion_95) = mean_and_95(area);
    quality.angle_distortion_max = measured.iter().filter(|m| m.3).map(|m| m.0.min(1e6)).fold(1.0, f64::max);
    quality.share_of_area = texture_area;
    let texels = raster::chart_texels(mesh, Some(chart_of_triangle), resolution, resolution);
    let covered = texels.pixels().iter().filter(|&&chart| chart != 0).count();
    quality.share_covered = covered as f64 / texels.pixels().len().max(1) as f64;
    quality.narrowest_gutter_texels = raster::narrowest_gutter(&texels);
    quality.overlapping_texels = raster::overlaps(mesh, resolution);
    quality
}

/// Weighted mean and 95 % quantile of (value, weight).
fn mean_and_95(mut values: Vec<(f64, f64)>) -> (f64, f64) {
    let total: f64 = values.iter().map(|v| v.1).sum();
    if total <= 0.0 {
        return (1.0, 1.0);
    }
    let mean = values.iter().map(|v| v.0 * v.1).sum::<f64>() / total;
    values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut below = 0.0;
    for (value, weight) in &values {
        below += weight;
        if below >= 0.95 * total {
            return (mean, *value);
        }
    }
    (mean, values.last().map_or(1.0, |v| v.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretched_triangle_has_the_ratio_of_its_stretch() {
        let space = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let turn = DVec2::from_angle(0.7);
        let texture = [DVec2::ZERO, DVec2::X * 3.0, DVec2::Y * 2.0].map(|p| turn.rotate(p));
        let (ratio, scale) = triangle_distortion(space, texture).unwrap();
        assert!((ratio - 1.5).abs() < 1e-12 && (scale - 6.0).abs() < 1e-12);
        let mirrored = [texture[0], texture[2], texture[1]];
        assert!(triangle_distortion(space, mirrored).unwrap().1 < 0.0);
    }
}
