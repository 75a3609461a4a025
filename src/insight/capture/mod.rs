//! What is wrong with the capture, told by name after a fit: the photos beside the fitted model's pictures.
//!
//! The pre-flight check ([`crate::scene::doctor`]) sees what photos, masks and mesh say before there is a model. Much is
//! known only afterwards: a camera that is turned by a pixel, a mask that is wrong here and there, a part that the mesh
//! lacks, an exposure that differs by a tenth. [`check`] renders the training views once more, small, and asks:
//!
//! | file | what it asks | what is told |
//! |---|---|---|
//! | [`pictures`] | the photos and the model's pictures, at most 24 views and 400,000 pixels | |
//! | [`gain`] | how much brighter is each photo than its picture | `exposure-varies` |
//! | [`shift`] | by how many pixels is it shifted and rolled | `camera-turned` |
//! | [`unlike`], [`patches`] | which patches does the model not explain | |
//! | [`masks`] | does the mask contradict mesh and photo | `mask-doubtful` |
//! | [`points`] | which points of the surface look unlike from most sides | `mesh-unlike-photos` |
//! | [`space`] | is there something where the mesh has nothing | `mesh-missing-part` |
//! | [`sides`] | from how many sides was it seen | `one-sided` |
//! | [`told`] | figures against thresholds: what is a warning, and what to do | |
//! | [`table`] | the figures of each view, for `capture.csv` in the run folder | |
//!
//! The maps were fitted to the same photos: where cameras are turned, maps are the blur of what all of them show, and
//! shifts are relative to that mean. A figure is told when it is larger than its own error could make it *and* large
//! enough to matter; errors are of blocks of pixels, as what a model misses is no noise of single pixels.
//!
//! It takes a few seconds whatever the size of the scene, depends on the seed alone and not on the number of threads, and
//! refuses to repair anything.

pub mod gain;
pub mod masks;
pub mod patches;
pub mod pictures;
pub mod points;
pub mod shift;
pub mod sides;
pub mod smooth;
pub mod space;
pub mod table;
pub mod told;
pub mod unlike;

use crate::error::Finding;
use crate::export::loss_log::number_or_nan;
use crate::fit::Fitter;
use crate::image::Image;
use crate::math::parallel;
use crate::scene::PixelState;
use pictures::{Compared, Comparison, compare, compressed};
use serde::{Deserialize, Serialize};
use shift::Shift;
use space::MissingPart;
use std::sync::atomic::AtomicBool;

/// What was found out about the capture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Capture {
    /// Figures of the views that were looked at, in the order of the scene.
    pub views: Vec<ViewCapture>,
    /// The largest part that the mesh lacks, if any.
    pub missing: Option<MissingPart>,
    /// What to tell, the gravest first.
    pub findings: Vec<Finding>,
}

/// Figures of a view. What could not be measured is NaN, in a file empty or `null`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewCapture {
    /// Name of the view.
    pub name: String,
    /// How far the photo lies to the right of the model's picture, in pixels of the photo.
    #[serde(deserialize_with = "number_or_nan")]
    pub shift_x_pixels: f64,
    /// How far it lies below.
    #[serde(deserialize_with = "number_or_nan")]
    pub shift_y_pixels: f64,
    /// Standard error of the length of the shift, in pixels of the photo.
    #[serde(deserialize_with = "number_or_nan")]
    pub shift_error_pixels: f64,
    /// Roll of the photo, clockwise, in degrees.
    #[serde(deserialize_with = "number_or_nan")]
    pub roll_degrees: f64,
    /// Its standard error in degrees.
    #[serde(deserialize_with = "number_or_nan")]
    pub roll_error_degrees: f64,
    /// How far the roll moves the photo's corners, in pixels of the photo.
    #[serde(deserialize_with = "number_or_nan")]
    pub roll_corner_pixels: f64,
    /// Which share of the squared differences of photo and model shift and roll explain; below 0 when they make it worse.
    #[serde(deserialize_with = "number_or_nan")]
    pub shift_explains: f64,
    /// Brightness of the photo over that of the model's picture, the fitted exposure taken off, over the median of the
    /// views.
    #[serde(deserialize_with = "number_or_nan")]
    pub gain: f64,
    /// Standard error of the logarithm of the gain.
    #[serde(deserialize_with = "number_or_nan")]
    pub gain_error: f64,
    /// Share in [0, 1] of the pixels away from the outline whose mask is doubtful; NaN without a mask.
    #[serde(deserialize_with = "number_or_nan")]
    pub doubtful_mask_share: f64,
    /// Share in [0, 1] of the pixels in patches that the model does not explain.
    #[serde(deserialize_with = "number_or_nan")]
    pub unlike_share: f64,
}

/// What one view says.
struct ViewSays {
    figures: ViewCapture,
    unlike: Image<bool>,
    /// Doubtful and judged pixels of the mask.
    mask: Option<(usize, usize)>,
}

/// Looks over the capture of a fit. Empty when `stop` was raised.
pub fn check(fitter: &Fitter, stop: &AtomicBool) -> Capture {
    let Some(comparison) = compare(fitter, stop) else { return Capture::default() };
    let scene = fitter.scene();
    let mut says: Vec<ViewSays> =
        parallel::map_items(&comparison.views, |own| look_at(&comparison, own, &scene.views[own.view].name));
    // The light takes over what all exposures have in common.
    let logs: Vec<f64> = says.iter().map(|own| own.figures.gain.ln()).filter(|log| log.is_finite()).collect();
    let middle = crate::math::statistics::quantile(&logs, 0.5);
    says.iter_mut().for_each(|own| own.figures.gain /= middle.exp());

    let unlike: Vec<Image<bool>> = says.iter().map(|own| own.unlike.clone()).collect();
    let points = points::points_of(&comparison, fitter.surface(), &unlike);
    let missing = space::missing_part(&comparison, &points, &unlike);
    let sides = sides::sides_of(&comparison, fitter.surface());
    let masks: Vec<Option<(usize, usize)>> = says.iter().map(|own| own.mask).collect();
    let views: Vec<ViewCapture> = says.into_iter().map(|own| own.figures).collect();
    let findings = told::findings(&told::Figures {
        views: &views,
        masks: &masks,
        points: &points,
        missing: missing.as_ref(),
        sides,
        gains_are_fitted: fitter.settings().exposure,
    });
    Capture { views, missing, findings }
}

/// The figures of one view, its gain not yet against the others.
fn look_at(comparison: &Comparison, own: &Compared, name: &str) -> ViewSays {
    let (width, height) = own.size();
    let level = comparison.level;
    let is_surface = own.coverage.map(|&coverage| coverage >= 0.999);
    let inside = Image::from_fn(width, height, |row, column| {
        own.states[(row, column)].is_surface() && own.is_inside(row, column, true)
    });
    let gain = gain::gain_between(&own.photo, &own.model(), &inside, level);
    let factor = gain.map_or(1.0, |gain| gain.mean().exp() as f32);
    let photo = compressed(&own.photo, level);
    let halves = own.halves.each_ref().map(|half| compressed(&half.map(|&radiance| radiance * factor), level));

    // The mask is not asked here: where it is wrong, photo and model still tell.
    let comparable = Image::from_fn(width, height, |row, column| {
        let is_known = comparison.background_known || own.is_inside(row, column, true);
        own.states[(row, column)] != PixelState::Ignored && is_known
    });
    let shift = shift::shift_between(&photo, [&halves[0], &halves[1]], &comparable);
    // A turned camera is told as that, not as patches along its edges.
    let moved = halves.each_ref().map(|half| shift.map_or_else(|| half.clone(), |shift| shift.moved(half)));
    let unlike = unlike::unlike_patches(&photo, [&moved[0], &moved[1]], &comparable, &is_surface);
    let model = pictures::mean_of(&moved);
    let doubt = masks::doubt(own, &photo, &model, &unlike);
    let judged = patches::count(&comparable).max(1) as f64;

    let of_shift = |pick: &dyn Fn(&Shift) -> f64| shift.as_ref().map_or(f64::NAN, pick);
    let pixels = own.photo_pixels;
    let figures = ViewCapture {
        name: name.into(),
        shift_x_pixels: of_shift(&|shift| shift.pixels[0] * pixels),
        shift_y_pixels: of_shift(&|shift| shift.pixels[1] * pixels),
        shift_error_pixels: of_shift(&|shift| shift.length().1 * pixels),
        roll_degrees: of_shift(&|shift| shift.roll_radians.to_degrees()),
        roll_error_degrees: of_shift(&|shift| shift.roll_error_radians.to_degrees()),
        roll_corner_pixels: of_shift(&|shift| shift.roll_pixels().0 * pixels),
        shift_explains: of_shift(&|shift| shift.explained),
        gain: gain.map_or(f64::NAN, |gain| gain.mean().exp()),
        gain_error: gain.map_or(f64::NAN, |gain| gain.error),
        doubtful_mask_share: doubt
            .as_ref()
            .map_or(f64::NAN, |doubt| patches::count(&doubt.doubtful) as f64 / doubt.judged.max(1) as f64),
        unlike_share: patches::count(&unlike) as f64 / judged,
    };
    ViewSays { figures, unlike, mask: doubt.map(|doubt| (patches::count(&doubt.doubtful), doubt.judged)) }
}
