//! What the pipelines of a frame are made for.
//!
//! A processor that stands in for a graphics card computes both sides of every branch, also of those that depend on nothing
//! but a setting. So settings are constants of a pipeline, and each combination in use has one, made when it is first
//! drawn with.

use super::content::{Backdrop, Crossfade, Layer, PhotoMode, StageFrame};
use super::eye::Eye;
use super::uniforms::light_wipe;
use crate::image::display::ToneCurve;

/// What the constants of a shader are set to.
pub(super) type Constants = Vec<(&'static str, f64)>;

fn flag(value: bool) -> f64 {
    f64::from(u8::from(value))
}

/// What is drawn on the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct MeshVariant {
    /// All layers of a quantity are one.
    layer: Layer,
    has_lobe: bool,
    has_other_light: bool,
    has_colours: bool,
    /// A crossfade ends at the materials under the light.
    fades_to_lit: bool,
}

impl MeshVariant {
    pub fn new(frame: &StageFrame) -> Self {
        let layer = if frame.look.layer.is_quantity() { Layer::PhotoError } else { frame.look.layer };
        let fades_to_lit = matches!(frame.crossfade(), Some(Crossfade::Lit(_)));
        let lit = layer == Layer::Lit || fades_to_lit;
        MeshVariant {
            layer,
            has_lobe: lit && frame.content.lobe_strength > 0.0,
            has_other_light: lit && light_wipe(frame).is_some(),
            has_colours: layer == Layer::Photos && frame.content.vertex_colours.is_some(),
            fades_to_lit,
        }
    }

    pub fn constants(&self) -> Constants {
        vec![
            ("LAYER", f64::from(self.layer as u32)),
            ("HAS_LOBE", flag(self.has_lobe)),
            ("HAS_OTHER_LIGHT", flag(self.has_other_light)),
            ("HAS_COLOURS", flag(self.has_colours)),
            ("FADES_TO_LIT", flag(self.fades_to_lit)),
        ]
    }
}

/// What is drawn behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct BehindVariant {
    /// 0 one colour, 1 the light, 2 the light out of focus.
    backdrop: u8,
    has_other_light: bool,
}

impl BehindVariant {
    pub fn new(frame: &StageFrame) -> Self {
        let backdrop = match frame.look.backdrop {
            _ if frame.content.light.is_none() => 0,
            Backdrop::Colour(_) => 0,
            Backdrop::Light => 1,
            Backdrop::BlurredLight => 2,
        };
        BehindVariant { backdrop, has_other_light: backdrop > 0 && light_wipe(frame).is_some() }
    }

    pub fn constants(&self) -> Constants {
        vec![("BACKDROP", f64::from(self.backdrop)), ("HAS_OTHER_LIGHT", flag(self.has_other_light))]
    }
}

/// How the drawn scene becomes a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct ScreenVariant {
    curve: ToneCurve,
    false_colour: bool,
    stripes: bool,
    /// 0 off, 1 under, 2 over, 3 wipe.
    photo_mode: u8,
    photo_is_exact: bool,
    has_traced: bool,
    /// The drawn scene shows through the traced picture.
    fades_to_traced: bool,
    traced_is_exact: bool,
    has_light_wipe: bool,
    through_photo: bool,
}

impl ScreenVariant {
    /// `photo` and `traced` tell of pictures that are there whether their pixels are those of the target.
    pub fn new(frame: &StageFrame, photo: Option<bool>, traced: Option<bool>) -> Self {
        let display = &frame.look.display;
        let fades_to_traced = matches!(frame.crossfade(), Some(Crossfade::Traced(_)));
        // Over what a crossfade draws between photos and diffuse map lies none.
        let traced = traced.filter(|_| fades_to_traced || frame.crossfade().is_none());
        let through_photo = matches!(frame.eye, Eye::Photo(_));
        let photo_mode = match frame.look.photo_mode {
            _ if photo.is_none() || !through_photo => 0,
            PhotoMode::Off => 0,
            PhotoMode::Under => 1,
            PhotoMode::Over(_) => 2,
            PhotoMode::Wipe(_) => 3,
        };
        ScreenVariant {
            curve: display.curve,
            false_colour: display.false_colour,
            stripes: display.stripes,
            photo_mode,
            photo_is_exact: photo_mode > 0 && photo == Some(true),
            has_traced: traced.is_some(),
            fades_to_traced: fades_to_traced && traced.is_some(),
            traced_is_exact: traced == Some(true),
            has_light_wipe: light_wipe(frame).is_some(),
            through_photo,
        }
    }

    pub fn constants(&self) -> Constants {
        let curve = match self.curve {
            ToneCurve::Srgb => 0.0,
            ToneCurve::Filmic => 1.0,
            ToneCurve::Linear => 2.0,
        };
        vec![
            ("CURVE", curve),
            ("FALSE_COLOUR", flag(self.false_colour)),
            ("STRIPES", flag(self.stripes)),
            ("PHOTO_MODE", f64::from(self.photo_mode)),
            ("PHOTO_IS_EXACT", flag(self.photo_is_exact)),
            ("HAS_TRACED", flag(self.has_traced)),
            ("FADES_TO_TRACED", flag(self.fades_to_traced)),
            ("TRACED_IS_EXACT", flag(self.traced_is_exact)),
            ("HAS_LIGHT_WIPE", flag(self.has_light_wipe)),
            ("THROUGH_PHOTO", flag(self.through_photo)),
        ]
    }
}
