//! A mesh that stands in another frame than the cameras: noticed by what the cameras see of it, and put right by a transform
//! that is known from the tools.

use super::source::{MeshFrame, SourceView};
use super::source_mesh::SourceMesh;
use crate::error::{Finding, Severity};
use glam::{DMat3, DMat4, DVec3};

/// Points of the mesh that are looked at.
const POINTS: usize = 400;
/// A frame in which this share of the views looks at the mesh fits, one in which less than the other does fails.
const FITTING_SHARE: f64 = 0.8;
const FAILING_SHARE: f64 = 0.5;

/// How the cameras see the mesh in a frame.
#[derive(Clone, Copy, PartialEq)]
struct Seen {
    /// Share of the views that have some of it in their picture.
    views: f64,
    /// Share of its points that some view has in its picture.
    points: f64,
}

fn seen(points: &[DVec3], views: &[SourceView], frame: &DMat4) -> Seen {
    let mut is_seen = vec![false; points.len()];
    let mut looking = 0usize;
    for view in views {
        let intrinsics = &view.camera.intrinsics;
        let middle = (2.0 * intrinsics.z_axis.x, 2.0 * intrinsics.z_axis.y);
        let (width, height) = view.size.map_or(middle, |(width, height)| (width as f64, height as f64));
        let mut any = false;
        for (point, is_seen) in points.iter().zip(&mut is_seen) {
            let point = view.camera.rotation * frame.transform_point3(*point) + view.camera.translation;
            let place = *intrinsics * (point / point.z);
            if point.z > 0.0 && place.x >= 0.0 && place.y >= 0.0 && place.x < width && place.y < height {
                *is_seen = true;
                any = true;
            }
        }
        looking += usize::from(any);
    }
    let count = is_seen.iter().filter(|seen| **seen).count();
    Seen { views: looking as f64 / views.len().max(1) as f64, points: count as f64 / points.len().max(1) as f64 }
}

/// Transforms that tools leave between a mesh and its cameras.
fn known() -> Vec<MeshFrame> {
    let of = |name, x: DVec3, y: DVec3, z: DVec3| MeshFrame {
        name,
        source_from_mesh: DMat4::from_mat3(DMat3::from_cols(x, y, z)),
    };
    vec![
        of("a turn from y up to z up", DVec3::X, DVec3::Z, DVec3::NEG_Y),
        of("a turn from z up to y up", DVec3::X, DVec3::NEG_Z, DVec3::Y),
        of("a turn from OpenGL's to OpenCV's axes", DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z),
    ]
}

/// Looks at how much of the mesh the cameras see; where that is next to nothing and a known transform makes it much, the mesh
/// is turned and the user told.
pub fn put_right(mesh: &mut SourceMesh, views: &[SourceView], own: &[MeshFrame], findings: &mut Vec<Finding>) {
    let corners = mesh.triangles.len() * 3;
    if corners == 0 {
        return;
    }
    let step = (corners / POINTS).max(1);
    let points: Vec<DVec3> =
        mesh.triangles.iter().flatten().step_by(step).map(|&corner| mesh.positions[corner as usize]).collect();
    let as_it_is = seen(&points, views, &DMat4::IDENTITY);
    if as_it_is.views >= FAILING_SHARE {
        return;
    }
    let mut frames = own.to_vec();
    frames.extend(known());
    let rated = frames.into_iter().map(|frame| (seen(&points, views, &frame.source_from_mesh), frame));
    let mut rated: Vec<(Seen, MeshFrame)> = rated.filter(|(seen, _)| seen.views >= FITTING_SHARE).collect();
    // What the source knows comes first among equals: the sort is stable.
    rated.sort_by(|a, b| (b.0.views * b.0.points).total_cmp(&(a.0.views * a.0.points)));
    let percent = |share: f64| (100.0 * share).round();
    match rated.first() {
        Some((share, frame)) => {
            let doubt = rated.get(1).map_or(String::new(), |(other, frame)| {
                format!("; after {} it would be {} %: look at the outlines", frame.name, percent(other.views))
            });
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "mesh-frame-changed",
                    format!(
                        "{} % of the views look at the mesh as it is, {} % after {}: the mesh is turned so{doubt}",
                        percent(as_it_is.views),
                        percent(share.views),
                        frame.name
                    ),
                )
                .remedy("export the mesh in the frame of the cameras if the outlines of `patina check -o` do not fit"),
            );
            let turn = DMat3::from_mat4(frame.source_from_mesh);
            let normal_turn = turn.inverse().transpose();
            mesh.positions.iter_mut().for_each(|point| *point = frame.source_from_mesh.transform_point3(*point));
            for normal in &mut mesh.normals {
                *normal = (normal_turn * normal.as_dvec3()).normalize_or_zero().as_vec3();
            }
        }
        None => findings.push(
            Finding::new(
                Severity::Warning,
                "mesh-frame-unknown",
                format!(
                    "{} % of the views look at the mesh: it may be in another coordinate system than they are",
                    percent(as_it_is.views)
                ),
            )
            .remedy("export mesh and cameras from the same project in the same coordinate system"),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Place;
    use crate::scene::read::source::SourceCamera;

    fn ring() -> Vec<SourceView> {
        (0..8)
            .map(|index| {
                let azimuth = 0.7 * f64::from(index);
                let eye = DVec3::new(4.0 * azimuth.cos(), 4.0 * azimuth.sin(), 6.0);
                let forward = (DVec3::new(0.0, 0.0, 5.0) - eye).normalize();
                let right = forward.cross(DVec3::Z).normalize();
                let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
                let camera = SourceCamera {
                    intrinsics: super::super::colmap_lens::matrix([90.0; 2], [50.0, 50.0]),
                    rotation,
                    translation: -(rotation * eye),
                };
                let size = Some((100, 100));
                SourceView {
                    name: String::new(),
                    photo: "a".into(),
                    mask: None,
                    camera,
                    lens: None,
                    size,
                    place: Place::Nowhere,
                }
            })
            .collect()
    }

    fn mesh(centre: DVec3) -> SourceMesh {
        let positions =
            (0..300).map(|index| centre + DVec3::from_array([0.31, 0.77, 0.53].map(|x| (x * f64::from(index)).sin())));
        SourceMesh {
            positions: positions.collect(),
            triangles: (0..100).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect(),
            ..Default::default()
        }
    }

    #[test]
    fn a_mesh_with_y_up_is_turned_to_cameras_with_z_up() {
        let mut findings = Vec::new();
        let mut fitting = mesh(DVec3::new(0.0, 0.0, 5.0));
        let before = fitting.positions.clone();
        put_right(&mut fitting, &ring(), &[], &mut findings);
        assert!(findings.is_empty() && fitting.positions == before, "what fits is left alone");
        let mut turned = mesh(DVec3::new(0.0, 5.0, 0.0));
        put_right(&mut turned, &ring(), &[], &mut findings);
        assert_eq!(findings[0].code, "mesh-frame-changed");
        let (low, high) = turned.bounds().unwrap();
        assert!((0.5 * (low + high) - DVec3::new(0.0, 0.0, 5.0)).length() < 0.2);
        let mut lost = mesh(DVec3::new(900.0, 0.0, 0.0));
        put_right(&mut lost, &ring(), &[], &mut findings);
        assert_eq!(findings[1].code, "mesh-frame-unknown");
        let own = MeshFrame { name: "own", source_from_mesh: DMat4::from_translation(DVec3::new(-900.0, 0.0, 5.0)) };
        put_right(&mut lost, &ring(), &[own], &mut findings);
        assert_eq!(findings[2].code, "mesh-frame-changed");
    }
}
