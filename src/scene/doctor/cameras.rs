//! Do the cameras look at the mesh, upright and not mirrored?

use super::probe::Probe;
use super::{Report, names_of};
use crate::error::{Finding, Place, Severity};
use crate::scene::{Camera, Scene};
use glam::{DMat3, DVec3, Mat3, Vec3};

/// How far a rotation may be off in `f32` after it was made orthonormal in `f64`.
const TOLERANCE: f32 = 1e-4;
/// Vertices used to see where the mesh lies on the pictures.
const SAMPLED_VERTICES: usize = 2000;

/// Checks the numbers of all cameras. Says for each view whether its camera can be used for rays.
pub fn check(scene: &Scene, report: &mut Report) -> Vec<bool> {
    let mut usable = Vec::with_capacity(scene.views.len());
    for view in &scene.views {
        let mirrored = view.camera.rotation_camera_from_world.determinant() < 0.0;
        let valid = view.camera.validate(TOLERANCE);
        usable.push(valid.is_ok() || mirrored && view.camera.rotation_camera_from_world.is_finite());
        if let Err(error) = &valid {
            let code = if mirrored { "camera-mirrored" } else { "camera-invalid" };
            report.findings.push(
                Finding::new(Severity::Fatal, code, error.message())
                    .at(Place::View(view.name.clone()))
                    .remedy(error.remedy_text()),
            );
        }
        let camera = &view.camera;
        let off = (camera.centre_pixels.x / camera.width as f32 - 0.5)
            .abs()
            .max((camera.centre_pixels.y / camera.height as f32 - 0.5).abs());
        if valid.is_ok() && off > 0.25 {
            report.findings.push(
                Finding::new(
                    Severity::Warning,
                    "camera-off-centre",
                    format!(
                        "the principal point ({:.0}, {:.0}) is far from the centre of a {} x {} photo",
                        camera.centre_pixels.x, camera.centre_pixels.y, camera.width, camera.height
                    ),
                )
                .at(Place::View(view.name.clone()))
                .remedy(
                    "the intrinsics may belong to photos of another size: scale them, or use the photos they were \
                     calibrated on",
                )
                .extent(off.into()),
            );
        }
    }
    check_count(scene, report);
    check_upright(scene, &usable, report);
    usable
}

/// Of fewer training views that is told, and of still fewer it is a warning.
const FEW_VIEWS: usize = 6;
const VERY_FEW_VIEWS: usize = 4;

fn check_count(scene: &Scene, report: &mut Report) {
    let training = scene.views.iter().filter(|view| !view.held_out).count();
    if training == 0 {
        report
            .findings
            .push(Finding::new(Severity::Fatal, "no-views", "there is no view to fit").remedy("hold out fewer views"));
    } else if training < FEW_VIEWS {
        let severity = if training < VERY_FEW_VIEWS { Severity::Warning } else { Severity::Note };
        report.findings.push(
            Finding::new(
                severity,
                "few-views",
                format!("only {training} training views: highlights are seen from few directions"),
            )
            .remedy(
                "where no view shows a highlight, roughness and specular stay near their start values: see the view count map",
            ),
        );
    }
    let mut places: Vec<(Vec3, &str)> =
        scene.views.iter().map(|view| (view.camera.position_in_world(), view.name.as_str())).collect();
    places.sort_by(|a, b| {
        a.0.to_array().map(|x| x.to_bits()).cmp(&b.0.to_array().map(|x| x.to_bits())).then(a.1.cmp(b.1))
    });
    let twins: Vec<&str> = places.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1).collect();
    if !twins.is_empty() && twins.len() + 1 == scene.views.len() {
        report.findings.push(
            Finding::new(Severity::Warning, "cameras-at-one-place", "all cameras are at the same position")
                .remedy("highlights only move when the camera does: take photos from several positions"),
        );
    } else if !twins.is_empty() {
        report.findings.push(
            Finding::new(
                Severity::Note,
                "cameras-repeated",
                format!("{} views have the same camera position as another: {}", twins.len(), names_of(&twins)),
            )
            .remedy("check that their camera files are not copies"),
        );
    }
}

fn check_upright(scene: &Scene, usable: &[bool], report: &mut Report) {
    let turned: Vec<&str> = scene
        .views
        .iter()
        .zip(usable)
        .filter(|(view, usable)| **usable && -view.camera.rotation_camera_from_world.row(1).y < -0.2)
        .map(|(view, _)| view.name.as_str())
        .collect();
    if turned.is_empty() {
        return;
    }
    let most = turned.len() * 2 > scene.views.len();
    report.findings.push(
        Finding::new(
            Severity::Warning,
            if most { "up-inverted" } else { "cameras-upside-down" },
            format!("{} of {} photos are upside down: {}", turned.len(), scene.views.len(), names_of(&turned)),
        )
        .remedy(if most {
            "the up axis is wrong: set it with --up, or leave it on auto"
        } else {
            "check the orientation of these photos and cameras"
        }),
    );
}

/// Checks by the probes which views see the mesh, and looks for the convention that would explain it when few do.
pub fn check_sight(scene: &Scene, probes: &[Vec<Probe>], report: &mut Report) {
    let blind: Vec<&str> = scene
        .views
        .iter()
        .zip(probes)
        .filter(|(_, probes)| probes.iter().all(|probe| probe.hit.is_none()))
        .map(|(view, _)| view.name.as_str())
        .collect();
    let all_blind = blind.len() == scene.views.len() && !blind.is_empty();
    if all_blind {
        report.findings.push(Finding::new(Severity::Fatal, "views-see-nothing", "no view sees the mesh").remedy(
            "mesh and cameras are in different coordinate systems: check axes, units and the direction of the camera matrix",
        ));
    } else {
        for name in &blind {
            report.findings.push(
                Finding::new(
                    Severity::Warning,
                    "view-sees-nothing",
                    "the view does not see the mesh, so it contributes nothing",
                )
                .at(Place::View((*name).into()))
                .remedy("check its camera, or exclude the view"),
            );
        }
    }
    let asked = share_in_sight(scene, |camera| *camera);
    if asked < 0.3 {
        explain(scene, asked, report);
    }
}

/// Mean share over the views of sampled vertices that project into the picture.
fn share_in_sight(scene: &Scene, change: impl Fn(&Camera) -> Camera) -> f64 {
    let step = (scene.mesh.positions.len() / SAMPLED_VERTICES).max(1);
    let mut shares = 0.0;
    for view in &scene.views {
        let camera = change(&view.camera);
        let (mut inside, mut count) = (0usize, 0usize);
        for point in scene.mesh.positions.iter().step_by(step) {
            count += 1;
            inside += usize::from(camera.place_in_picture(*point).is_some());
        }
        shares += inside as f64 / count.max(1) as f64;
    }
    shares / scene.views.len().max(1) as f64
}

/// A mistaken convention: what it is called, what to do, and the camera as it would be without the mistake.
type Mistake<'a> = (&'a str, &'a str, Box<dyn Fn(&Camera) -> Camera + 'a>);

fn explain(scene: &Scene, asked: f64, report: &mut Report) {
    let with_rows = |camera: &Camera, signs: Vec3| {
        let turn = Mat3::from_diagonal(signs);
        Camera {
            rotation_camera_from_world: turn * camera.rotation_camera_from_world,
            translation_camera_from_world: turn * camera.translation_camera_from_world,
            ..*camera
        }
    };
    let world = &scene.world_from_source;
    let mistakes: [Mistake; 3] = [
        (
            "the cameras are OpenGL cameras (y up, z back)",
            "set camera_axes = \"opengl\" in scene.toml",
            Box::new(move |camera| with_rows(camera, Vec3::new(1.0, -1.0, -1.0))),
        ),
        (
            "the matrices go from camera to world",
            "set camera_matrix = \"world_from_camera\" in scene.toml",
            Box::new(|camera| inverted_in_source(camera, world.rotation, world.origin_in_source)),
        ),
        (
            "the matrices go from camera to world and the cameras are OpenGL cameras",
            "set camera_matrix = \"world_from_camera\" and camera_axes = \"opengl\" in scene.toml",
            Box::new(move |camera| {
                with_rows(
                    &inverted_in_source(camera, world.rotation, world.origin_in_source),
                    Vec3::new(1.0, -1.0, -1.0),
                )
            }),
        ),
    ];
    let best = mistakes
        .iter()
        .map(|(name, remedy, change)| (share_in_sight(scene, change), name, remedy))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((share, name, remedy)) = best
        && share > 0.6
        && share > 2.0 * asked
    {
        report.findings.push(
            Finding::new(
                Severity::Warning,
                "camera-convention",
                format!(
                    "{:.0} % of the mesh is inside the photos; if {name}, it would be {:.0} %",
                    100.0 * asked,
                    100.0 * share
                ),
            )
            .remedy(if scene.has_manifest() {
                *remedy
            } else {
                "export the cameras again as OpenCV cameras (x right, y down, z forward), each matrix from world to camera"
            }),
        );
    }
}

/// The camera whose source matrix is the inverse of this one's.
fn inverted_in_source(camera: &Camera, rotation: DMat3, origin: DVec3) -> Camera {
    let from_source = camera.rotation_camera_from_world.as_dmat3() * rotation;
    let translation = camera.translation_camera_from_world.as_dvec3() - from_source * origin;
    let inverse = from_source.transpose();
    let inverse_translation = -(inverse * translation);
    Camera {
        rotation_camera_from_world: (inverse * rotation.transpose()).as_mat3(),
        translation_camera_from_world: (inverse_translation + inverse * origin).as_vec3(),
        ..*camera
    }
}
