//! What a fit is given: mesh, cameras, photographs; their readers and the pre-flight check.
//!
//! [`mesh`] and [`camera`] hold the geometry, [`photo`] the pixels, [`view`](View) joins them; [`lens`] undoes distortion.
//! [`read()`] makes a scene of a folder, [`doctor`] says whether a fit can work on it. [`demo`] is a scene made in code, out
//! of what
//! [`synthetic`] holds. Nothing here fits or renders.

pub mod camera;
pub mod demo;
pub mod doctor;
pub mod lens;
pub mod mesh;
pub mod photo;
pub mod read;
pub mod settings;
pub mod synthetic;

pub use camera::Camera;
pub use mesh::Mesh;
pub use photo::{Photo, PixelState};
pub use read::{read, read_mesh};
pub use settings::ReadSettings;

use crate::error::{Error, ErrorKind, Finding, Place, Result};
use crate::files::composed;
use crate::image::{Image, RgbImage};
use crate::light::Environment;
use crate::material::{LobeModel, MaterialMaps};
use glam::{DMat3, DVec3};
use std::path::PathBuf;

/// A calibrated photograph.
#[derive(Clone, Debug)]
pub struct View {
    /// Short name, unique in the scene: the stem of the photo's file name.
    pub name: String,
    /// The camera, in the world of the scene.
    pub camera: Camera,
    /// The photograph, of the camera's size.
    pub photo: Photo,
    /// What each pixel is evidence for, of the camera's size.
    pub states: Image<PixelState>,
    /// Kept out of the fit, to judge it.
    pub held_out: bool,
    /// By how many stops the photo is exposed more than the mean of all, as EXIF says; `None` where it does not.
    pub exposure_prior_stops: Option<f32>,
}

/// A scene in Patina's world: +y up, right-handed.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name of the scene: its folder's name.
    pub name: String,
    /// Folder it was read from; `None` for a scene made in code.
    pub folder: Option<PathBuf>,
    /// The surface.
    pub mesh: Mesh,
    /// The photographs, in the order of their names.
    pub views: Vec<View>,
    /// How the data set's world was turned into this one.
    pub world_from_source: WorldFromSource,
    /// What the background pixels show.
    pub background: Background,
    /// The truth, where it is known.
    pub truth: Option<Truth>,
    /// What the reader noticed.
    pub findings: Vec<Finding>,
}

impl View {
    /// Whether a mask says what is surface: some pixel is background. Without one every pixel is said to be surface, and
    /// rays decide.
    pub fn has_mask(&self) -> bool {
        self.states.pixels().iter().any(|state| state.is_background())
    }
}

impl Scene {
    /// Whether it was read from a folder with a `scene.toml`, where conventions can be named.
    pub fn has_manifest(&self) -> bool {
        self.folder.as_ref().is_some_and(|folder| folder.join(read::manifest::FILE_NAME).is_file())
    }

    /// Index of the view that a user names: by its name or by its photo's, in either form of Unicode.
    pub fn view_named(&self, typed: &str) -> Option<usize> {
        let typed = composed(typed);
        let named = |wanted: &str| self.views.iter().position(|view| view.name == wanted);
        named(&typed).or_else(|| {
            let (stem, ending) = typed.rsplit_once('.')?;
            read::PHOTO_EXTENSIONS.iter().any(|own| ending.eq_ignore_ascii_case(own)).then(|| named(stem))?
        })
    }

    /// Puts the names of views in the place of those that a user has for them; unknown ones stay.
    pub fn spell_names(&self, typed: &mut [String]) {
        for typed in typed {
            if let Some(view) = self.view_named(typed) {
                typed.clone_from(&self.views[view].name);
            }
        }
    }

    /// Puts a linear picture in the place of a view's photo; every pixel becomes evidence, except those that are not
    /// finite.
    ///
    /// # Errors
    /// `InvalidScene` when there is no such view or the picture is not of its camera's size.
    pub fn set_photo(&mut self, view: usize, picture: RgbImage) -> Result<()> {
        let count = self.views.len();
        let Some(view) = self.views.get_mut(view) else {
            return Err(Error::new(ErrorKind::InvalidScene, format!("there is no view {view} among {count}")));
        };
        let (width, height) = (view.camera.width, view.camera.height);
        if (picture.width(), picture.height()) != (width, height) {
            let message =
                format!("a picture of {} x {} for a camera of {width} x {height}", picture.width(), picture.height());
            return Err(Error::new(ErrorKind::InvalidScene, message).at(Place::View(view.name.clone())));
        }
        view.states = picture.map(|pixel| if pixel.is_finite() { PixelState::Surface } else { PixelState::Ignored });
        view.photo = Photo::Linear32(picture.map(|&pixel| if pixel.is_finite() { pixel } else { glam::Vec3::ZERO }));
        Ok(())
    }
}

/// `point_in_world = rotation * (point_in_source - origin_in_source)`. Units are kept.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WorldFromSource {
    /// Proper rotation.
    pub rotation: DMat3,
    /// The point of the source that becomes the origin: zero unless coordinates are too large for `f32`.
    pub origin_in_source: DVec3,
    /// How many metres a unit of both is, where it is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit_in_metres: Option<f64>,
}

impl Default for WorldFromSource {
    fn default() -> Self {
        WorldFromSource { rotation: DMat3::IDENTITY, origin_in_source: DVec3::ZERO, unit_in_metres: None }
    }
}

/// What pixels show where no surface is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Background {
    /// The environment itself, as in a photograph.
    Environment,
    /// Black, as in many synthetic data sets: background pixels say nothing.
    Black,
}

/// The truth of a synthetic scene.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The maps, on the UVs the mesh came with.
    pub maps: MaterialMaps,
    /// Texels to compare, of the maps' size: seen by a view.
    pub texels_seen: Image<bool>,
    /// The light of the photographs.
    pub environment: Environment,
    /// A light never seen in the photographs, with pictures under it.
    pub relight: Option<TruthRelight>,
    /// Number of surface hits on the longest path of the pictures: 1 is direct light only.
    pub max_bounces: usize,
    /// The microfacets of what was photographed.
    pub lobe: LobeModel,
}

/// Pictures under a light that was not in the photographs.
#[derive(Clone, Debug)]
pub struct TruthRelight {
    /// The light.
    pub environment: Environment,
    /// (index of the view, linear picture).
    pub pictures: Vec<(usize, crate::image::RgbImage)>,
}
