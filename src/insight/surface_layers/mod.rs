//! What all photographs together say of each texel: error, disagreement, and how often it was seen.
//!
//! Each view is traced at a reduced size and compared with its photo, pixel by pixel. A pixel's values go to the texels
//! its centre reads, with bilinear weights; where a pixel covers several texels, its whole block takes part.
//! * **Photo error**: root of the mean squared residual of the views that see the texel, each view counting once.
//! * **Disagreement**: the variance over views of the gradient by diffuse, eq. 3 of Joy and Poullis 2023, in the form
//!   of [`crate::fit::consistency`]: `2 V_p / s^2`. Here a view's gradient at a texel is the mean over its pixels of
//!   `-2 (photo - model) d model / d diffuse`, exact for the first vertex of each path; a mean and not a sum, so that
//!   a view near by does not disagree by its many pixels alone. The range `s` is that between the quantiles 0.001 and
//!   0.999 of all gradients, so that one bright pixel does not make all else look at one; what lies beyond is held at 1.
//!
//! Squares and products are of two independent halves of the samples, so noise of the paths adds nothing to the photo
//! error on average; to the disagreement it adds its variance over the range's square. One sample cannot be halved:
//! two is the least.
//!
//! `pixels` holds what a pixel says, `texels` the sums over pixels and views.

mod pixels;
mod texels;

use super::scores::AlignmentSums;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::targets::Target;
use crate::image::{GreyImage, Image, RgbImage};
use crate::math::random::mix;
use crate::math::statistics::quantile;
use crate::render::picture::PictureSettings;
use crate::render::progressive::PictureTracer;
use crate::render::{Parameters, Surface};
use crate::scene::Scene;
use pixels::{PixelSays, pixels_of_view};
use std::sync::atomic::{AtomicBool, Ordering};
use texels::{OverViews, ViewTexels};

/// Gradients that are kept to find their range, about.
const KEPT_GRADIENTS: f64 = 200_000.0;

/// How layers are made.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerSettings {
    /// Width and height of the layers in texels.
    pub map_size: usize,
    /// Pixels of a view, at most; larger photos are halved first.
    pub most_pixels: usize,
    /// How views are traced; `samples` a pixel, at least 2, and `groups` is not read.
    pub picture: PictureSettings,
    /// Factor of each view's model radiance, as a fit with exposure gains found it; 1 where the list ends.
    pub gains: Vec<f32>,
    /// Views that say nothing of the texels (their own error is told all the same); false where the list ends.
    pub excluded: Vec<bool>,
    /// Keep photo and model of each view, at the reduced size.
    pub keep_pictures: bool,
}

impl Default for LayerSettings {
    fn default() -> Self {
        LayerSettings {
            map_size: 512,
            most_pixels: 60_000,
            picture: PictureSettings { samples: 8, ..Default::default() },
            gains: Vec::new(),
            excluded: Vec::new(),
            keep_pictures: false,
        }
    }
}

/// How well one view is explained.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ViewError {
    /// Index of the view.
    pub view: usize,
    /// Its name.
    pub name: String,
    /// Kept out of the fit, to judge it.
    pub held_out: bool,
    /// Linear RMSE over surface pixels that are not clipped, with the noise of the paths; NaN when no pixel counts.
    pub rmse: f64,
    /// The same after the best factor per channel for this view.
    pub aligned_rmse: f64,
    /// How many stops brighter the photo is than the model, over all channels: 0 when exposures agree.
    pub exposure_stops: f64,
    /// Pixels that count.
    pub pixels: u64,
    /// Share in [0, 1] of the surface pixels that are clipped; NaN without any.
    pub clipped_share: f64,
}

/// Photo and model of a view at the reduced size, in linear radiance.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerPictures {
    /// The photo.
    pub photo: RgbImage,
    /// The model, times the view's gain.
    pub model: RgbImage,
}

/// Layers over the texels, and errors of the views. Held-out and excluded views have no part in the layers.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceLayers {
    /// RMS residual in linear radiance over channels and views; NaN where no view judges the texel.
    pub photo_error: GreyImage,
    /// `2 V_p / s^2` in [0, 1]; NaN where fewer than two views judge the texel.
    pub disagreement: GreyImage,
    /// Range `s` of the gradients; 0 when there were none.
    pub gradient_range: f64,
    /// Share of the views that see the texel, in (0, 1]; NaN where none does.
    pub coverage: GreyImage,
    /// Number of the views that see the texel, at their reduced size; clipped pixels see too.
    pub times_seen: GreyImage,
    /// All views, in their order.
    pub views: Vec<ViewError>,
    /// Pictures of all views, where they were to be kept.
    pub pictures: Vec<LayerPictures>,
}

/// Makes the layers; the same settings give the same bits. `progress` gets the share done, in [0, 1].
///
/// # Errors
/// `Stopped` when `stop` was raised; `InvalidSetting` for maps without texels.
pub fn surface_layers(
    scene: &Scene,
    surface: &Surface,
    parameters: &Parameters<f32>,
    settings: &LayerSettings,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<SurfaceLayers> {
    let size = settings.map_size;
    if size == 0 {
        return Err(Error::new(ErrorKind::InvalidSetting, "layers of no texels").remedy("ask for 64 texels or more"));
    }
    let texels = size * size;
    let mut total = OverViews::new(texels);
    let mut own = ViewTexels::new(texels);
    let tracer = PictureTracer::new(surface, parameters, settings.picture);
    let takes_part =
        |view: usize| !scene.views[view].held_out && !settings.excluded.get(view).copied().unwrap_or(false);
    let taking_part = (0..scene.views.len()).filter(|&view| takes_part(view)).count();
    let kept_share = (KEPT_GRADIENTS / (3.0 * texels as f64 * taking_part.max(1) as f64)).min(1.0);
    let mut kept = Vec::new();
    let (mut views, mut pictures) = (Vec::new(), Vec::new());
    for view in 0..scene.views.len() {
        let target = Target::new(scene, view, scene.views[view].camera.level_within(settings.most_pixels));
        let gain = settings.gains.get(view).copied().unwrap_or(1.0);
        let says = pixels_of_view(scene, &tracer, &target, gain, size, stop);
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(ErrorKind::Stopped, "stopped while layers were made"));
        }
        let (error, picture) = error_of_view(scene, &target, &says);
        views.push(error);
        if settings.keep_pictures {
            pictures.push(picture);
        }
        if takes_part(view) {
            own.gather(&says, size);
            total.add(&mut own, |texel, gradient| {
                let draw = mix(texel as u64 ^ (view as u64) << 40) as f64 / u64::MAX as f64;
                if draw < kept_share {
                    kept.extend(gradient.to_array().map(f64::from));
                }
            });
        }
        progress((view + 1) as f32 / scene.views.len() as f32);
    }
    let range = quantile(&kept, 0.999) - quantile(&kept, 0.001);
    let range = if range.is_finite() { range } else { 0.0 };
    Ok(total.layers(size, taking_part, range, views, pictures))
}

fn error_of_view(scene: &Scene, target: &Target, says: &[PixelSays]) -> (ViewError, LayerPictures) {
    let (width, height) = (target.camera.width, target.camera.height);
    let photo = Image::from_pixels(width, height, says.iter().map(|says| says.photo).collect());
    let model = Image::from_pixels(width, height, says.iter().map(|says| says.model).collect());
    let is_counted = |says: &PixelSays| says.is_judged() && says.model.is_finite();
    let counted = Image::from_pixels(width, height, says.iter().map(is_counted).collect());
    let sums = AlignmentSums::of(&photo, [&model; 2], &counted);
    let on_surface = says.iter().filter(|says| says.is_covered && says.state.is_surface()).count();
    let clipped =
        says.iter().filter(|says| says.is_covered && says.state.is_surface() && says.state.is_clipped()).count();
    let ratio = sums.product.iter().sum::<f64>() / sums.picture_squared.iter().sum::<f64>();
    let view = &scene.views[target.view];
    let error = ViewError {
        view: target.view,
        name: view.name.clone(),
        held_out: view.held_out,
        rmse: sums.rmse(),
        aligned_rmse: sums.rmse_at(sums.scale()),
        exposure_stops: if ratio > 0.0 { ratio.log2() } else { f64::NAN },
        pixels: sums.pixels,
        clipped_share: clipped as f64 / on_surface as f64,
    };
    (error, LayerPictures { photo, model })
}
