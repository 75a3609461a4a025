//! From how many sides the surface was seen.

use super::pictures::{Compared, Comparison};
use super::points::pixel_of;
use crate::math::parallel;
use crate::math::random::SequentialRandom;
use crate::render::Surface;
use glam::Vec3;

/// Points of the mesh, evenly by area, that are looked for in the views.
const POINTS: usize = 2000;

/// Where cameras stand around what they see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides {
    /// Widest part of the circle around the middle of the mesh in which no camera stands, in degrees of azimuth.
    pub gap_degrees: f64,
    /// Share of the mesh's area that no view sees, in [0, 1].
    pub unseen_share: f64,
}

/// Measures it. `None` for fewer than three views, and for cameras that look outwards or stand above: there is no circle.
pub fn sides_of(comparison: &Comparison, surface: &Surface) -> Option<Sides> {
    let points = points_by_area(surface);
    let seen = parallel::map_items(&points, |&(position, normal)| {
        comparison.views.iter().any(|own| sees(own, surface, position, normal))
    });
    let unseen = seen.into_iter().filter(|seen| !seen).count();
    let middle = points.iter().map(|(position, _)| *position).sum::<Vec3>() / points.len().max(1) as f32;
    let mut azimuths = Vec::new();
    for own in &comparison.views {
        let away = own.camera.position_in_world() - middle;
        let stands_above = away.x.hypot(away.z) < 0.2 * away.length();
        if stands_above || away.dot(own.camera.forward_in_world()) > 0.0 {
            return None;
        }
        azimuths.push(f64::from(away.z.atan2(away.x)).to_degrees().rem_euclid(360.0));
    }
    if azimuths.len() < 3 || points.is_empty() {
        return None;
    }
    Some(Sides { gap_degrees: widest_gap(&mut azimuths), unseen_share: unseen as f64 / points.len() as f64 })
}

/// Widest gap between azimuths in degrees, all in [0, 360).
fn widest_gap(azimuths: &mut [f64]) -> f64 {
    azimuths.sort_by(f64::total_cmp);
    let across = azimuths.first().zip(azimuths.last()).map_or(360.0, |(first, last)| first + 360.0 - last);
    azimuths.windows(2).map(|pair| pair[1] - pair[0]).fold(across, f64::max)
}

/// Points of the mesh with the normals of their triangles, evenly by area.
fn points_by_area(surface: &Surface) -> Vec<(Vec3, Vec3)> {
    let mesh = surface.mesh();
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(|index| f64::from(mesh.area_vector(index).length())).collect();
    let total: f64 = areas.iter().sum();
    let mut random = SequentialRandom::new(0x51de);
    let mut points = Vec::with_capacity(POINTS);
    let mut before = 0.0;
    for (index, area) in areas.iter().enumerate() {
        let [a, b, c] = mesh.corners(index);
        let normal = mesh.area_vector(index).normalize_or_zero();
        while points.len() < POINTS && (points.len() as f64 + 0.5) / POINTS as f64 * total < before + area {
            let root = random.next_number().sqrt();
            let v = random.next_number();
            points.push((a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v), normal));
        }
        before += area;
    }
    points
}

fn sees(own: &Compared, surface: &Surface, position: Vec3, normal: Vec3) -> bool {
    let eye = own.camera.position_in_world();
    (eye - position).dot(normal) > 0.0
        && pixel_of(own, position).is_some()
        && !surface.bvh().is_hidden_from(position, normal, eye)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_widest_gap_may_lie_across_zero() {
        assert_eq!(widest_gap(&mut [350.0, 10.0, 60.0, 100.0]), 250.0);
        assert_eq!(widest_gap(&mut [0.0, 90.0, 180.0, 270.0]), 90.0);
        assert_eq!(widest_gap(&mut [200.0, 160.0, 180.0]), 320.0);
    }
}
