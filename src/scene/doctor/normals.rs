//! Do the mesh's normals belong to its triangles?

use super::Report;
use crate::error::{Finding, Severity};
use crate::math::statistics::quantile;
use crate::scene::{Mesh, Scene};

/// Median angle beyond which normals are told, in degrees. Normals of smooth surfaces that were exported soundly are a
/// degree or two from the mean of the triangles around them, at edges of the surface more, but those are few.
pub(crate) const TOLD_DEGREES: f64 = 5.0;

/// Median angle in degrees between the normals a mesh came with and those of the triangles around each vertex; `None`
/// for a mesh without normals, or without a normal of some length.
pub fn median_departure_degrees(mesh: &Mesh) -> Option<f64> {
    let mut own = mesh.clone();
    own.compute_normals();
    let mut is_used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&vertex| is_used[vertex as usize] = true);
    let pairs = mesh.normals.iter().zip(&own.normals).zip(is_used).filter(|(_, is_used)| *is_used);
    let angles: Vec<f64> = pairs
        .filter_map(|((given, computed), _)| {
            let given = given.try_normalize()?;
            // A normal on the wrong side is told as that.
            Some(f64::from(given.dot(*computed).abs().min(1.0).acos().to_degrees()))
        })
        .collect();
    (!angles.is_empty()).then(|| quantile(&angles, 0.5))
}

/// Warns of normals that are off by more than smoothing explains: shading then shows bumps that are not there.
pub fn check(scene: &Scene, report: &mut Report) {
    if let Some(degrees) = median_departure_degrees(&scene.mesh).filter(|degrees| *degrees > TOLD_DEGREES) {
        report.findings.push(
            Finding::new(
                Severity::Warning,
                "normals-noisy",
                format!("half of the mesh's normals lie more than {degrees:.0} degrees off the triangles around them"),
            )
            .remedy("export the mesh without normals: they are then computed"),
        );
    }
}
