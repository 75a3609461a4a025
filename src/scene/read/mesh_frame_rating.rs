//! How well a mesh goes with the photos when it stands in one frame or another.
//!
//! Three measures, from the weakest to the strongest: how many cameras look at it, how masks and outlines overlap, and how
//! photos agree where they show the same point of it. One ray structure serves all frames: the cameras are moved, not the mesh.

use super::source::{MeshFrame, SourceCamera};
use super::source_mesh::SourceMesh;
use crate::math::statistics::quantile;
use crate::math::{evenly_spread, parallel};
use crate::scene::doctor::probe::{Probe, probe_about, surface_at};
use crate::scene::doctor::ways::{self, Way};
use crate::scene::doctor::{agreement, silhouette};
use crate::scene::{Background, Camera, Mesh, Scene, View, WorldFromSource};
use crate::trace::Bvh;
use glam::{DMat3, DMat4, DVec3};
use std::fmt;

/// Points of the mesh that are looked at.
const POINTS: usize = 400;
/// Views that rays are shot for, and about how many for each.
const TRACED_VIEWS: usize = 24;
const PROBES_PER_VIEW: usize = 4000;

/// How the photos see the mesh in a frame. Shares are in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rating {
    /// Share of the views that have some of it in their picture.
    pub views: f64,
    /// Share of its points that some view has in its picture.
    pub points: f64,
    /// How photos agree through it, in [-1, 1]; `None` where they share too little.
    pub agreement: Option<f64>,
    /// Intersection over union of masks and outline, the median over the masked views; `None` without masks.
    pub overlap: Option<f64>,
    /// Share of what cameras see of it that is back faces.
    pub back_faces: f64,
}

impl fmt::Display for Rating {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:.0} % of the views look at it", 100.0 * self.views)?;
        if let Some(agreement) = self.agreement {
            write!(formatter, ", photos agree by {agreement:.2}")?;
        }
        if let Some(overlap) = self.overlap {
            write!(formatter, ", masks overlap by {:.0} %", 100.0 * overlap)?;
        }
        Ok(())
    }
}

/// How a camera of the source becomes one in pixels and `f32`, for the view of an index.
pub type InPixels<'a> = dyn Fn(&SourceCamera, usize) -> Camera + Sync + 'a;

/// What rates frames: the mesh beside the photos.
pub struct Rater<'a> {
    cameras: &'a [SourceCamera],
    in_pixels: &'a InPixels<'a>,
    /// The mesh about `middle`, and the photos.
    scene: Scene,
    /// `None` for a mesh that rays cannot be shot at.
    bvh: Option<Bvh>,
    middle: DVec3,
    points: Vec<DVec3>,
    traced: Vec<usize>,
    masked: Vec<usize>,
}

impl<'a> Rater<'a> {
    /// Takes the photos; [`Rater::into_views`] gives them back. `mesh` must have a triangle.
    pub fn new(mesh: &SourceMesh, cameras: &'a [SourceCamera], views: Vec<View>, in_pixels: &'a InPixels<'a>) -> Self {
        let corners = mesh.triangles.len() * 3;
        let step = (corners / POINTS).max(1);
        let at = |corner: &u32| mesh.positions[*corner as usize];
        let points = mesh.triangles.iter().flatten().step_by(step).map(at).collect();
        let (low, high) = mesh.bounds_of_most().unwrap_or_default();
        let middle = 0.5 * (low + high);
        let positions = mesh.positions.iter().map(|point| (*point - middle).as_vec3()).collect();
        let mesh = Mesh { positions, triangles: mesh.triangles.clone(), ..Default::default() };
        let bvh = Bvh::build(&mesh.positions, &mesh.triangles).ok();
        let traced = evenly_spread(&(0..views.len()).collect::<Vec<_>>(), TRACED_VIEWS);
        let masked = traced.iter().copied().filter(|&view| views[view].has_mask()).collect();
        let scene = Scene {
            name: String::new(),
            folder: None,
            mesh,
            views,
            world_from_source: WorldFromSource::default(),
            background: Background::Environment,
            truth: None,
            findings: Vec::new(),
        };
        Rater { cameras, in_pixels, scene, bvh, middle, points, traced, masked }
    }

    /// The photos, with cameras that mean nothing.
    pub fn into_views(self) -> Vec<View> {
        self.scene.views
    }

    /// By the cameras alone.
    pub fn by_sight(&self, frame: &DMat4) -> Rating {
        let mut is_seen = vec![false; self.points.len()];
        let mut looking = 0usize;
        for (index, camera) in self.cameras.iter().enumerate() {
            let (width, height) = (self.scene.views[index].camera.width, self.scene.views[index].camera.height);
            let pinhole = (self.in_pixels)(camera, index);
            let mut any = false;
            for (point, is_seen) in self.points.iter().zip(&mut is_seen) {
                let point = camera.rotation * frame.transform_point3(*point) + camera.translation;
                let place =
                    (point.truncate() / point.z) * pinhole.focal_pixels.as_dvec2() + pinhole.centre_pixels.as_dvec2();
                let is_inside = place.x >= 0.0 && place.y >= 0.0 && place.x < width as f64 && place.y < height as f64;
                if point.z > 0.0 && is_inside {
                    *is_seen = true;
                    any = true;
                }
            }
            looking += usize::from(any);
        }
        let share = |count: usize, whole: usize| count as f64 / whole.max(1) as f64;
        let points = share(is_seen.iter().filter(|seen| **seen).count(), is_seen.len());
        Rating { views: share(looking, self.cameras.len()), points, ..Default::default() }
    }

    /// By the cameras and by what the photos show.
    pub fn rate(&mut self, frame: &DMat4) -> Rating {
        let seen = self.by_sight(frame);
        let probes = self.probed(frame, &self.traced.clone());
        let Some(bvh) = &self.bvh else { return seen };
        let overlaps: Vec<f64> =
            self.masked.iter().map(|&view| silhouette::overlap(&self.scene.views[view], &probes[view])).collect();
        let overlap = (!overlaps.is_empty()).then(|| quantile(&overlaps, 0.5));
        let back_faces = self.back_faces(&probes);
        Rating { agreement: agreement::measure(&self.scene, bvh, &probes), overlap, back_faces, ..seen }
    }

    fn back_faces(&self, probes: &[Vec<Probe>]) -> f64 {
        let (mut hits, mut back) = (0usize, 0usize);
        for (view, probes) in self.scene.views.iter().zip(probes) {
            let eye = view.camera.position_in_world();
            for hit in probes.iter().filter_map(|probe| probe.hit.as_ref()) {
                let Some((point, normal, _)) = surface_at(&self.scene.mesh, hit) else { continue };
                hits += 1;
                back += usize::from(normal.dot(eye - point) < 0.0);
            }
        }
        back as f64 / hits.max(1) as f64
    }

    /// Which way the photos lie that may be turned by these `orientations`, by the mesh as it is.
    pub fn ways(&mut self, orientations: &[Option<u8>]) -> Vec<Option<Way>> {
        let all: Vec<usize> = (0..self.scene.views.len()).collect();
        let probes = self.probed(&DMat4::IDENTITY, &all);
        match &self.bvh {
            Some(bvh) => ways::choose(&self.scene, bvh, &probes, orientations),
            None => vec![None; all.len()],
        }
    }

    /// Moves cameras to where they see the mesh in a frame, and shoots rays from them.
    fn probed(&mut self, frame: &DMat4, views: &[usize]) -> Vec<Vec<Probe>> {
        let mut probes: Vec<Vec<Probe>> = vec![Vec::new(); self.scene.views.len()];
        let Some(bvh) = &self.bvh else { return probes };
        for &view in views {
            let camera = moved(&self.cameras[view], frame, self.middle);
            self.scene.views[view].camera = (self.in_pixels)(&camera, view);
        }
        let shoot = |place: usize| probe_about(&self.scene.views[views[place]], bvh, PROBES_PER_VIEW);
        for (place, of_view) in parallel::map(views.len(), shoot).into_iter().enumerate() {
            probes[views[place]] = of_view;
        }
        probes
    }
}

/// The camera that sees the mesh about `middle` as `camera` sees it in the frame, but for the unit of length.
fn moved(camera: &SourceCamera, frame: &DMat4, middle: DVec3) -> SourceCamera {
    let linear = DMat3::from_mat4(*frame);
    let scale = linear.determinant().abs().cbrt();
    SourceCamera {
        intrinsics: camera.intrinsics,
        rotation: camera.rotation * linear * (1.0 / scale),
        translation: (camera.rotation * frame.transform_point3(middle) + camera.translation) / scale,
    }
}

/// A frame that is tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// What takes it to the frame of the cameras, in words after "after".
    pub name: String,
    /// `source_from_mesh`, a similarity.
    pub source_from_mesh: DMat4,
    /// Whether it takes lengths for those of another unit: small enough, any mesh is in the sight of all cameras.
    pub changes_units: bool,
}

impl Trial {
    fn new(name: impl Into<String>, source_from_mesh: DMat4) -> Self {
        Trial { name: name.into(), source_from_mesh, changes_units: false }
    }
}

/// Transforms that tools leave between a mesh and its cameras: axes exchanged, lengths in other units, what the source knows,
/// and an exchange of axes before any of these. What the source knows comes first.
pub fn known(own: &[MeshFrame]) -> Vec<Trial> {
    let turn = |name: &str, x, y, z| Trial::new(name, DMat4::from_mat3(DMat3::from_cols(x, y, z)));
    let turns = [
        turn("a turn from y up to z up", DVec3::X, DVec3::Z, DVec3::NEG_Y),
        turn("a turn from z up to y up", DVec3::X, DVec3::NEG_Z, DVec3::Y),
        turn("a turn from OpenGL's to OpenCV's axes", DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z),
    ];
    let units = [0.001, 0.01, 100.0, 1000.0].map(|scale| {
        let frame = DMat4::from_scale(DVec3::splat(scale));
        Trial { changes_units: true, ..Trial::new(format!("a change of units by {scale}"), frame) }
    });
    let own = own.iter().filter(|frame| frame.source_from_mesh.determinant().abs() > 0.0);
    let own = own.map(|frame| Trial::new(frame.name, frame.source_from_mesh));
    let single: Vec<Trial> = own.chain(units).collect();
    let both = single.iter().flat_map(|second| {
        turns.iter().map(move |first| {
            let name = format!("{} and {}", first.name, second.name);
            Trial { name, source_from_mesh: second.source_from_mesh * first.source_from_mesh, ..second.clone() }
        })
    });
    single.iter().chain(&turns).cloned().chain(both).collect()
}
