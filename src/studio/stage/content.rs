//! What the stage shows and how: handed in anew each frame, cheap to clone, nothing of it is kept by the caller's side.
//!
//! Everything large is behind an [`Arc`] and is uploaded when the pointer changes, never by comparing values: whoever
//! changes an image makes a new one.

use super::eye::Eye;
use crate::image::display::DisplaySettings;
use crate::image::{GreyImage, Image, RgbImage};
use crate::light::Environment;
use crate::material::{LobeModel, MaterialMaps};
use crate::scene::{Camera, Mesh};
use eframe::egui::Color32;
use std::sync::{Arc, LazyLock};

/// What is drawn on the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layer {
    /// The materials under the light, without shadows and interreflection; backs of triangles are lit like fronts.
    #[default]
    Lit,
    /// The diffuse map.
    Diffuse,
    /// The specular map.
    Specular,
    /// Perceptual roughness, the square root of the microfacet width, as grey.
    Roughness,
    /// Shading normals of the world, `0.5 n + 0.5`.
    Normal,
    /// The quantity of the content: error of the fit against the photos.
    PhotoError,
    /// The quantity of the content: how well the photos cover a texel.
    Coverage,
    /// The quantity of the content: how many photos see a texel.
    TimesSeen,
    /// The quantity of the content: how far the gradients of the photos disagree.
    Disagreement,
    /// The quantity of the content: standard deviation of the diffuse map.
    DiffuseDeviation,
    /// The quantity of the content: standard deviation of the specular map.
    SpecularDeviation,
    /// The quantity of the content: standard deviation of the roughness map.
    RoughnessDeviation,
    /// The quantity of the content: how many texels share a lobe.
    LobeSharing,
    /// The quantity of the content: what judging views chose.
    Choice,
    /// A checker of texture coordinates.
    Uv,
    /// The photos, laid on the surface: colours of vertices where the content has them, else its diffuse map as radiance.
    Photos,
    /// Between the photos of the content and its diffuse map, and between that and its materials under the light.
    Crossfade,
}

impl Layer {
    /// All layers with their names on screen.
    pub const NAMED: [(Layer, &str); 17] = [
        (Layer::Lit, "Shaded"),
        (Layer::Diffuse, "Diffuse"),
        (Layer::Specular, "Specular"),
        (Layer::Roughness, "Roughness"),
        (Layer::Normal, "Surface normal"),
        (Layer::PhotoError, "Residual"),
        (Layer::Coverage, "Coverage"),
        (Layer::TimesSeen, "View count"),
        (Layer::Disagreement, "Multi-view inconsistency"),
        (Layer::DiffuseDeviation, "Std. dev. (diffuse)"),
        (Layer::SpecularDeviation, "Std. dev. (specular)"),
        (Layer::RoughnessDeviation, "Std. dev. (roughness)"),
        (Layer::LobeSharing, "Lobe cluster size"),
        (Layer::Choice, "Lobe model"),
        (Layer::Uv, "UV coordinates"),
        (Layer::Photos, "Projected photos"),
        (Layer::Crossfade, "Photo – albedo – relit"),
    ];

    /// Whether the layer shows [`StageContent::quantity`] by the colour scale.
    pub fn is_quantity(self) -> bool {
        use Layer::*;
        matches!(self, PhotoError | Coverage | TimesSeen | Disagreement)
            || matches!(self, DiffuseDeviation | SpecularDeviation | RoughnessDeviation | LobeSharing | Choice)
    }
}

/// How the photo of [`StageContent::photo`] is laid on the picture; it only shows through [`Eye::Photo`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PhotoMode {
    /// Not at all.
    #[default]
    Off,
    /// Behind the mesh, instead of the background.
    Under,
    /// Over it, with an opacity in [0, 1].
    Over(f32),
    /// The photo left of a place in [0, 1] of the rectangle's width, the mesh right of it.
    Wipe(f32),
}

/// A light of the stage.
#[derive(Clone, Debug)]
pub struct StageLight {
    /// Radiance from every direction.
    pub environment: Arc<Environment>,
    /// Turned about +y by this angle in radians, as [`Environment::rotated_about_up`] does.
    pub rotation_radians: f32,
    /// Radiance is scaled by this factor.
    pub strength: f32,
}

impl StageLight {
    /// The light as it is.
    pub fn new(environment: Arc<Environment>) -> Self {
        StageLight { environment, rotation_radians: 0.0, strength: 1.0 }
    }
}

/// One number a texel of the atlas.
#[derive(Clone, Debug)]
pub struct StageQuantity {
    /// The numbers; a NaN is a texel of which nothing is known and is shown grey.
    pub texels: Arc<GreyImage>,
    /// The numbers at the lower and at the upper end of the colour scale.
    pub range: [f32; 2],
}

/// A camera drawn as a frustum.
#[derive(Clone, Debug)]
pub struct StageCamera {
    /// Its lens and pose.
    pub camera: Camera,
    /// How wrong the fit is there, on the colour scale from 0 to 1; grey when unknown.
    pub error_0_1: Option<f32>,
    /// It judges the fit and takes no part in it: dashed.
    pub held_out: bool,
    /// It was left out by the user: dashed and dim.
    pub excluded: bool,
    /// It is selected: thick, in the accent colour.
    pub selected: bool,
    /// Its photo, linear, of any size, shown on its image plane.
    pub thumbnail: Option<Arc<RgbImage>>,
}

impl StageCamera {
    /// A camera of which nothing else is known.
    pub fn new(camera: Camera) -> Self {
        StageCamera { camera, error_0_1: None, held_out: false, excluded: false, selected: false, thumbnail: None }
    }
}

/// Texels inside a chart, found where they are first asked for: on the thread that uploads the maps.
pub type CoveredTexels = LazyLock<Image<bool>, Box<dyn FnOnce() -> Image<bool> + Send>>;

/// The mean of the photos in each texel as the diffuse map, and which texels some photo sees.
pub type PhotosOnTexels = (Arc<MaterialMaps>, Arc<CoveredTexels>);

/// What the stage shows.
#[derive(Clone, Debug)]
pub struct StageContent {
    /// The mesh; nothing but the background without.
    pub mesh: Option<Arc<Mesh>>,
    /// Its maps; grey clay without.
    pub maps: Option<Arc<MaterialMaps>>,
    /// Texels of the maps inside a chart. Where known, the filters of the textures do not mix in what is outside.
    pub covered: Option<Arc<CoveredTexels>>,
    /// Linear colours of the mesh's vertices times their weights, and the weights in [0, 1]; for [`Layer::Photos`].
    pub vertex_colours: Option<Arc<Vec<[f32; 4]>>>,
    /// Photos laid on the atlas, as [`Layer::Crossfade`] begins with them, and which of the texels some photo sees; black
    /// without.
    pub photos: Option<PhotosOnTexels>,
    /// Strength of the specular lobe in [0, 1]; 0 for maps without one.
    pub lobe_strength: f32,
    /// The microfacets of the lobe.
    pub lobe: LobeModel,
    /// The light; black without.
    pub light: Option<StageLight>,
    /// A second light, right of [`StageLook::light_wipe`].
    pub other_light: Option<StageLight>,
    /// What the layers of a quantity show.
    pub quantity: Option<StageQuantity>,
    /// The photo of the eye's camera, linear.
    pub photo: Option<Arc<RgbImage>>,
    /// A path-traced picture at exactly this eye ([`Eye::as_camera`] of the rectangle's shape), shown instead of the mesh;
    /// by [`Layer::Crossfade`] over it.
    pub traced: Option<Arc<RgbImage>>,
    /// Cameras drawn as frustums.
    pub cameras: Arc<Vec<StageCamera>>,
    /// Length of the frustums in world units, see [`super::frustum_depth`]; none are drawn at 0.
    pub frustum_depth: f32,
}

impl Default for StageContent {
    fn default() -> Self {
        StageContent {
            mesh: None,
            maps: None,
            covered: None,
            vertex_colours: None,
            photos: None,
            lobe_strength: 1.0,
            lobe: LobeModel::default(),
            light: None,
            other_light: None,
            quantity: None,
            photo: None,
            traced: None,
            cameras: Arc::default(),
            frustum_depth: 0.0,
        }
    }
}

/// What is behind the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Backdrop {
    /// The light itself.
    Light,
    /// The light out of focus.
    BlurredLight,
    /// One colour, not changed by exposure or curve.
    Colour(Color32),
}

/// How the stage shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageLook {
    /// What is drawn on the surface.
    pub layer: Layer,
    /// From radiance to the screen. Maps are shown with curve, false colour and stripes, but without exposure.
    pub display: DisplaySettings,
    /// How the photo is laid on the picture.
    pub photo_mode: PhotoMode,
    /// What [`Layer::Crossfade`] shows, in [0, 2]: the photos at 0, the diffuse map at 1, the materials under the light at 2.
    pub crossfade: f32,
    /// Place in [0, 1] of the width where the first light ends and the other begins; only with two lights.
    pub light_wipe: Option<f32>,
    /// What is behind the mesh.
    pub backdrop: Backdrop,
    /// Colour of what is selected.
    pub accent: Color32,
    /// Pixels drawn per pixel of the screen, along a side: 0.5 while something moves on a slow adapter, 2 for smooth
    /// edges on a quick one. In [0.25, 2]. Below 1, a mesh of very many triangles is drawn with fewer.
    pub resolution_scale: f32,
}

impl Default for StageLook {
    fn default() -> Self {
        StageLook {
            layer: Layer::Lit,
            display: DisplaySettings::default(),
            photo_mode: PhotoMode::Off,
            crossfade: 1.0,
            light_wipe: None,
            backdrop: Backdrop::Colour(Color32::from_gray(38)),
            accent: Color32::from_rgb(255, 170, 40),
            resolution_scale: 1.0,
        }
    }
}

/// Everything about one frame of the stage.
#[derive(Clone, Debug, Default)]
pub struct StageFrame {
    /// Where it is looked at from.
    pub eye: Eye,
    /// What is shown.
    pub content: StageContent,
    /// How it is shown.
    pub look: StageLook,
    /// Waits for uploads within the frame, as a picture file needs; a window rather shows the last state meanwhile.
    pub wait_for_uploads: bool,
    /// Nobody waits for what is uploaded: it is shown by whatever frame comes next, and asks for none.
    pub quiet_uploads: bool,
}

/// What a crossfade goes to, with the share of it in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Crossfade {
    /// The diffuse map, from the photos.
    Diffuse(f32),
    /// The materials under the light as the mesh is drawn, from the diffuse map.
    Lit(f32),
    /// The path-traced picture, from the diffuse map.
    Traced(f32),
}

impl StageFrame {
    /// The crossfade that is shown, if one is.
    pub(super) fn crossfade(&self) -> Option<Crossfade> {
        let place = self.look.crossfade.clamp(0.0, 2.0);
        match self.look.layer {
            Layer::Crossfade if place.is_nan() || place <= 1.0 => Some(Crossfade::Diffuse(place.max(0.0))),
            Layer::Crossfade if self.content.traced.is_some() => Some(Crossfade::Traced(place - 1.0)),
            Layer::Crossfade => Some(Crossfade::Lit(place - 1.0)),
            _ => None,
        }
    }
}
