//! Scenes of one object for studies: what the fit can and cannot tell for a diffuse, a specular and a mixed surface.
//!
//! The shapes of the vase and the sphere are made here; the cow and the teddy take any mesh with texture coordinates.

use crate::error::{Error, ErrorKind, Result};
use crate::image::Image;
use crate::material::LobeModel;
use crate::scene::demo::{evening, morning, views_of};
use crate::scene::synthetic::bake::{Reflectance, SurfacePoint, bake};
use crate::scene::synthetic::layout::{PartChart, lay_out};
use crate::scene::synthetic::orbit::Orbit;
use crate::scene::synthetic::{finish, seen, shapes};
use crate::scene::{Background, Camera, Mesh, Scene, Truth, TruthRelight, WorldFromSource};
use glam::{DVec2, Vec3};

/// What is studied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StudyKind {
    /// Diffuse only: no specular lobe at all.
    Cow,
    /// Highly specular: coloured, sharp reflections over a dark body.
    Vase,
    /// Diffuse fur with specular patches.
    Teddy,
    /// Bare polished copper.
    CopperSphere,
}

impl StudyKind {
    /// Every kind.
    pub const ALL: [StudyKind; 4] = [StudyKind::Cow, StudyKind::Vase, StudyKind::Teddy, StudyKind::CopperSphere];

    /// Its name, as files and the command line have it.
    pub fn name(self) -> &'static str {
        match self {
            StudyKind::Cow => "cow",
            StudyKind::Vase => "vase",
            StudyKind::Teddy => "teddy",
            StudyKind::CopperSphere => "copper-sphere",
        }
    }

    /// What the surface is made of, at a point of the object in about `[-1, 1]^3`.
    fn reflectance(self, point: Vec3) -> Reflectance {
        match self {
            StudyKind::Cow => finish::cow_hide(point),
            StudyKind::Vase => finish::lustre(point),
            StudyKind::Teddy => finish::teddy(point),
            StudyKind::CopperSphere => finish::copper(point, 0.0),
        }
    }

    /// Strength of the specular lobe: 0 where the surface has none (F0 = 0 alone would leave Schlick's grazing part).
    pub fn lobe_strength(self) -> f32 {
        if self == StudyKind::Cow { 0.0 } else { 1.0 }
    }

    /// The mesh, laid out for a map of this size; `None` for the kinds whose mesh comes from a file.
    ///
    /// # Errors
    /// `InvalidSetting` when the map is too small.
    pub fn mesh_in_code(self, map_size: usize) -> Result<Option<Mesh>> {
        let charts = match self {
            StudyKind::Cow | StudyKind::Teddy => return Ok(None),
            StudyKind::CopperSphere => shapes::sphere(1.0, 20),
            StudyKind::Vase => {
                let profile = [
                    (0.0, 0.0),
                    (0.42, 0.0),
                    (0.45, 0.06),
                    (0.3, 0.2),
                    (0.5, 0.5),
                    (0.8, 1.0),
                    (0.74, 1.4),
                    (0.36, 1.72),
                    (0.34, 1.86),
                    (0.5, 2.0),
                    (0.47, 2.01),
                    (0.28, 1.8),
                    (0.62, 1.35),
                    (0.66, 1.0),
                    (0.3, 0.4),
                    (0.0, 0.3),
                ];
                shapes::lathe(&profile.map(|(radius, height)| DVec2::new(radius, height)), 64, 72)
            }
        };
        let charts = charts.into_iter().map(|chart| PartChart { chart, part: 0, density: 1.0 }).collect();
        Ok(Some(lay_out(charts, map_size, map_size)?.mesh))
    }
}

/// How a study scene is made.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct StudySettings {
    /// Number of views for the fit.
    pub views: usize,
    /// Number of further views that judge it.
    pub held_out: usize,
    /// Width and height of a photo in pixels.
    pub size: usize,
    /// Width and height of the truth maps in texels.
    pub map_size: usize,
    /// Where the cameras stand.
    pub seed: u64,
    /// What background pixels show.
    pub background: Background,
}

impl Default for StudySettings {
    fn default() -> Self {
        StudySettings { views: 48, held_out: 6, size: 160, map_size: 256, seed: 1, background: Background::Environment }
    }
}

/// Longest path of the pictures of a study.
const MAX_BOUNCES: usize = 3;

/// Builds a study scene around a mesh with texture coordinates, which is moved and scaled to fill `[-1, 1]^3`. Normals
/// are computed when it has none. The lights are a morning and, for relighting, an evening: put others into the truth
/// before rendering where another light is wanted. Photos are black until [`Scene::set_photo`].
///
/// # Errors
/// `InvalidScene` for a mesh without triangles or texture coordinates; otherwise as [`crate::scene::demo::build`].
pub fn build(kind: StudyKind, mut mesh: Mesh, settings: &StudySettings) -> Result<Scene> {
    mesh.validate()?;
    let Some((low, high)) = mesh.bounds().filter(|(low, high)| (*high - *low).max_element() > 0.0) else {
        return Err(Error::new(ErrorKind::InvalidScene, "the mesh has no extent").remedy("check the mesh file"));
    };
    if mesh.uvs.is_empty() {
        return Err(Error::new(ErrorKind::InvalidScene, "the mesh has no texture coordinates")
            .remedy("unwrap it first: the truth maps of a study lie on them"));
    }
    let (centre, half) = (0.5 * (low + high), 0.5 * (high - low).max_element());
    for position in &mut mesh.positions {
        *position = (*position - centre) / half;
    }
    if mesh.normals.is_empty() {
        mesh.compute_normals();
    }
    let size = settings.map_size;
    let baked = bake(&mesh, size, size, |_| 0, |point: &SurfacePoint| kind.reflectance(point.position));
    let radius = mesh.positions.iter().map(|position| position.length()).fold(0.0, f32::max);
    let field_of_view: f32 = 38f32.to_radians();
    let orbit = Orbit {
        target: Vec3::ZERO,
        // The sphere around the object just fits into the picture.
        distance: 1.02 * radius / (0.5 * field_of_view).sin(),
        elevation_radians: (-30f32.to_radians(), 70f32.to_radians()),
        width: settings.size,
        height: settings.size,
        field_of_view_x_radians: field_of_view,
        jitter: 0.02,
    };
    let views = views_of(&orbit, settings.views, settings.held_out, settings.seed)?;
    let cameras: Vec<Camera> = views.iter().filter(|view| !view.held_out).map(|view| view.camera).collect();
    let texels_seen: Image<bool> = seen::texels_seen(&mesh, &cameras, size, size, 4)?;
    Ok(Scene {
        name: kind.name().into(),
        folder: None,
        mesh,
        views,
        world_from_source: WorldFromSource::default(),
        background: settings.background,
        truth: Some(Truth {
            maps: baked.maps,
            texels_seen,
            environment: morning(),
            relight: Some(TruthRelight { environment: evening(), pictures: Vec::new() }),
            max_bounces: MAX_BOUNCES,
            lobe: LobeModel::BlinnPhong,
        }),
        findings: Vec::new(),
    })
}
