//! The pre-flight check: can a fit work on this scene, and what would spoil it?
//!
//! [`check`] returns a [`Report`]: findings with code, place and remedy, and one line of figures per view. A fit must
//! not start when [`Report::is_fatal`]. [`overlay()`] draws the mesh's outline over a photo, [`contact_sheet()`] all
//! photos so on one picture, so that a person can judge in one glance what no figure tells.
//!
//! | file | what it asks |
//! |---|---|
//! | [`geometry`] | is the mesh a surface: degenerate, duplicated, unreferenced parts; winding |
//! | [`normals`] | do its normals belong to its triangles |
//! | [`cameras`] | do the cameras look at the mesh, upright, not mirrored |
//! | [`silhouette`] | do masks and mesh agree |
//! | [`pixel_centre`], [`edge_profile`], `mask_edges` | where do pixel centres lie in the intrinsics, to a hundredth of a pixel |
//! | [`pictures`] | encoding, clipping, darkness |
//! | [`agreement`], `outlying`, `copies`, `trial` | do photos belong to their cameras, by the photos alone |
//! | `ways` | do photos lie as stored, or as their EXIF orientation says |
//! | [`lights`], `shading` | is the light one, does it turn with the camera, does it fall into groups |
//! | [`exposure`] | do views agree on the radiance of what they share |
//! | [`resolution`] | how much detail of the surface do the photos resolve |
//! | [`facets`], [`closeness`], [`detail`] | is the mesh too coarse, are walls or gaps or patterns as fine as pixels |
//!
//! It refuses to repair: it measures and says what to do.

pub mod agreement;
pub mod cameras;
pub mod closeness;
pub mod contact_sheet;
mod copies;
pub mod detail;
pub mod edge_profile;
pub mod exposure;
pub mod facets;
pub mod geometry;
pub mod lights;
mod mask_edges;
mod neighbours;
pub mod normals;
mod outlying;
pub mod overlay;
pub mod pictures;
pub mod pixel_centre;
pub mod probe;
pub mod resolution;
mod shading;
mod shift;
pub mod silhouette;
mod trial;
pub(crate) mod ways;

pub use contact_sheet::contact_sheet;
pub use overlay::overlay;
pub use pixel_centre::CentreMeasurement;

use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::math::parallel;
use crate::scene::Scene;
use crate::scene::read::repeated::joined;
use crate::trace::Bvh;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the check found.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Report {
    /// Findings of the reader and of the check, the gravest first.
    #[serde(skip_deserializing)]
    pub findings: Vec<Finding>,
    /// Figures of each view, in the order of the scene.
    pub views: Vec<ViewCheck>,
    /// Where pixel centres lie, when silhouettes tell.
    pub pixel_centre: Option<CentreMeasurement>,
    /// Figures of the mesh.
    pub mesh: geometry::MeshCheck,
    /// How many texels of one size the whole surface takes so that each is as small as what a pixel covers where training
    /// photos look closely; `None` where none of them sees it.
    pub texels_resolved: Option<f64>,
    /// The same where photos show the surface most sharply; `None` where nothing is seen.
    pub texels_resolved_sharpest: Option<f64>,
    /// How photos agree where they show the same surface, the median over the views: [`agreement`]; `None` where they share
    /// too little.
    pub agreement: Option<f64>,
    /// How shading goes with the cameras: [`lights`]; `None` where the photos share too little.
    pub light: Option<lights::LightCheck>,
    /// Of what training photos show of the surface, how much is too fine for them, or too coarse in the mesh.
    pub surface: SurfaceCheck,
}

/// Shares in [0, 1] of what training photos show of the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SurfaceCheck {
    /// Triangles that are wide and turn much from one to the next: [`facets`].
    pub coarse_share: f64,
    /// Walls thinner than a pixel: [`closeness`].
    pub thin_share: f64,
    /// What lies within a pixel of another surface: [`closeness`].
    pub touching_share: f64,
    /// What has its contrast in single pixels: [`detail`].
    pub fine_share: f64,
}

/// Figures of a view. Shares are in [0, 1].
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ViewCheck {
    /// Name of the view.
    pub name: String,
    /// Whether it is held out.
    pub held_out: bool,
    /// Share of the picture that shows the mesh.
    pub mesh_share: f64,
    /// Of the mesh's pixels, the share that shows back faces.
    pub back_face_share: f64,
    /// Of the front-facing pixels, the share whose shading normal points away from the camera's side.
    pub opposed_normal_share: f64,
    /// Intersection over union of mask and mesh silhouette; `None` without a mask.
    pub mask_overlap: Option<f64>,
    /// Share of pixels with a clipped channel.
    pub clipped_share: f64,
    /// Share of pixels that say nothing.
    pub ignored_share: f64,
    /// Median luminance of the mesh's pixels, linear.
    pub median_luminance: f64,
    /// How the photo agrees with others where they show the same surface: the median correlation of the logarithms of
    /// radiance, in [-1, 1]; `None` when nothing is shared.
    pub agreement: Option<f64>,
    /// Whether its photo was found not to belong to its camera as it is: what asks for light and exposure leaves it out.
    #[serde(default)]
    pub is_misplaced: bool,
    /// Brightness against the other views by the surface they share, in stops; `None` when nothing is shared.
    pub exposure_stops: Option<f64>,
}

impl Report {
    /// Whether a fit cannot work.
    pub fn is_fatal(&self) -> bool {
        self.findings.iter().any(|finding| finding.severity == Severity::Fatal)
    }
}

/// Checks a scene; builds its ray structure for that.
pub fn check(scene: &Scene) -> Report {
    check_until(scene, &AtomicBool::new(false)).unwrap_or_default()
}

/// [`check`] that ends soon after a flag is raised, between two of its questions.
///
/// # Errors
/// `Stopped` when the flag is raised.
pub fn check_until(scene: &Scene, stop: &AtomicBool) -> Result<Report> {
    let bvh = scene.mesh.validate().and_then(|()| Bvh::build(&scene.mesh.positions, &scene.mesh.triangles));
    match bvh {
        Ok(bvh) => check_with_until(scene, &bvh, stop),
        Err(error) => {
            let mut report = Report { findings: scene.findings.clone(), ..Default::default() };
            report.findings.push(
                Finding::new(Severity::Fatal, "mesh-unusable", error.message()).at(error.place().clone()).remedy(
                    if error.remedy_text().is_empty() {
                        "give a mesh with triangles of some area"
                    } else {
                        error.remedy_text()
                    },
                ),
            );
            cameras::check(scene, &mut report);
            report.findings = joined(report.findings);
            sort(&mut report.findings);
            Ok(report)
        }
    }
}

/// Checks a scene whose ray structure is at hand. `bvh` must be of the scene's mesh.
pub fn check_with(scene: &Scene, bvh: &Bvh) -> Report {
    check_with_until(scene, bvh, &AtomicBool::new(false)).unwrap_or_default()
}

fn check_with_until(scene: &Scene, bvh: &Bvh, stop: &AtomicBool) -> Result<Report> {
    let stopped = || Error::new(ErrorKind::Stopped, "stopped while the scene was checked");
    let mut report = Report { findings: scene.findings.clone(), ..Default::default() };
    let usable = cameras::check(scene, &mut report);
    report.findings = joined(report.findings);
    let probe = |view: usize| {
        let is_wanted = usable[view] && !stop.load(Ordering::Relaxed);
        if is_wanted { probe::probe_view(&scene.views[view], bvh) } else { Vec::new() }
    };
    let probes: Vec<Vec<probe::Probe>> = parallel::map(scene.views.len(), probe);
    report.views = scene
        .views
        .iter()
        .map(|view| ViewCheck { name: view.name.clone(), held_out: view.held_out, ..Default::default() })
        .collect();
    let questions: [&dyn Fn(&mut Report); 13] = [
        &|report| geometry::check(scene, &probes, report),
        &|report| normals::check(scene, report),
        &|report| {
            cameras::check_sight(scene, &probes, report);
            report.findings = joined(std::mem::take(&mut report.findings));
        },
        &|report| silhouette::check(scene, &probes, report),
        &|report| pictures::check(scene, &probes, report),
        &|report| resolution::check(scene, &probes, report),
        &|report| facets::check(scene, &probes, report),
        &|report| closeness::check(scene, bvh, &probes, report),
        &|report| detail::check(scene, bvh, &probes, report),
        &|report| agreement::check(scene, bvh, &probes, report),
        &|report| lights::check(scene, bvh, &probes, report),
        &|report| exposure::check(scene, bvh, &probes, report),
        &|report| pixel_centre::check(scene, bvh, report),
    ];
    for question in questions {
        if stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        question(&mut report);
    }
    sort(&mut report.findings);
    Ok(report)
}

/// Gravest first; findings of one severity keep their order.
fn sort(findings: &mut [Finding]) {
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
}

/// Names by how bad they are, the worst first, those as bad in the order given; and how bad the worst is. `None` of none.
pub fn worst_first(mut bad: Vec<(f64, &str)>) -> Option<(f64, Vec<&str>)> {
    bad.sort_by(|a, b| b.0.total_cmp(&a.0));
    let worst = bad.first()?.0;
    Some((worst, bad.into_iter().map(|(_, name)| name).collect()))
}

/// A list of names for a message: the first few, then a count.
fn names_of(names: &[&str]) -> String {
    const SHOWN: usize = 6;
    let shown = names.iter().take(SHOWN).copied().collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}
