//! Scores of one fit.

use crate::error::Result;
use crate::fit::Fitter;
use crate::image::{Image, RgbImage};
use crate::insight::scores::{AlignmentSums, counted_pixels};
use crate::job::against_truth::truth_errors;
use crate::light::Environment;
use crate::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use crate::render::Parameters;
use crate::render::picture::{PictureSettings, render};
use crate::scene::Background;
use std::sync::atomic::AtomicBool;

/// Name and unit of each score.
pub const COLUMNS: [(&str, &str); 16] = [
    ("image RMSE", ""),
    ("image RMSE aligned", ""),
    ("diffuse RMSE", ""),
    ("diffuse aligned", ""),
    ("specular RMSE", ""),
    ("specular aligned", ""),
    ("roughness RMSE", ""),
    ("roughness aligned", ""),
    ("light rel. L2", ""),
    ("light aligned", ""),
    ("relit RMSE", ""),
    ("relit aligned", ""),
    ("rise when relit", "%"),
    ("rise at equal brightness", "%"),
    ("exponent", ""),
    ("time", "s"),
];
/// Column of the image error.
pub const IMAGE: usize = 0;
/// Column of the diffuse error, raw; the aligned one follows.
pub const DIFFUSE: usize = 2;
/// Column of the error of the light, aligned.
pub const LIGHT_ALIGNED: usize = 9;
/// Column of the relit error, raw; the aligned one follows.
pub const RELIT: usize = 10;
/// Column of the rise of the error from the own light to the other.
pub const RISE: usize = 12;
/// Column of the mean exponent of the factor.
pub const EXPONENT: usize = 14;
/// Groups of paths a pixel in pictures that are scored: they give the variance that is taken off the squared error.
const GROUPS: usize = 4;
/// Paths a pixel in each group.
const SAMPLES: usize = 8;

/// The scores of a finished fit, one a column of [`COLUMNS`]; NaN where the truth lacks what a score needs.
pub fn measure(fitter: &Fitter, stop: &AtomicBool) -> Result<Vec<f64>> {
    let scene = fitter.scene().as_ref();
    let maps = fitter.maps();
    let environment = fitter.environment();
    let mut judged: Vec<usize> = (0..scene.views.len()).filter(|&view| scene.views[view].held_out).collect();
    if judged.is_empty() {
        judged = (0..scene.views.len()).collect();
    }
    // Pictures read the finest texels only.
    let weights = PyramidWeights::flat(maps.diffuse.width(), maps.diffuse.height());
    let texels = TexelPyramid::from_base(texels_from_maps(&maps), &weights);
    let under = |light: &Environment| Parameters::new(texels.clone(), light);
    let own = under(&environment);
    let photo = |view: usize| {
        let photo = &scene.views[view].photo;
        Image::from_fn(photo.width(), photo.height(), |row, column| photo.radiance(row, column))
    };
    let image = sums(fitter, &own, judged.iter().map(|&view| (view, photo(view))), stop);

    let mut relit = AlignmentSums::default();
    if let Some(relight) = scene.truth.as_ref().and_then(|truth| truth.relight.as_ref()) {
        let lit = under(&relight.environment);
        let also_judged = relight.pictures.iter().any(|(view, _)| judged.contains(view));
        let pictures = relight.pictures.iter().filter(|(view, _)| !also_judged || judged.contains(view));
        relit = sums(fitter, &lit, pictures.map(|(view, picture)| (*view, picture.clone())), stop);
    }
    let errors = truth_errors(scene, fitter.surface(), &maps, None, &environment)?.unwrap_or_default();
    let pair =
        |pair: Option<crate::insight::truth::ErrorPair>| pair.map_or([f64::NAN; 2], |pair| [pair.raw, pair.aligned]);
    let maps = errors.maps.as_ref();
    let losses = &fitter.state().losses;
    let exponent = losses.iter().map(|row| row.consistency).sum::<f64>() / losses.len().max(1) as f64;
    let rise = relit.rmse() / image.rmse();
    let mut values = vec![image.rmse(), image.rmse_at(image.scale())];
    values.extend(pair(maps.map(|maps| maps.diffuse)));
    values.extend(pair(maps.map(|maps| maps.specular)));
    values.extend(pair(maps.map(|maps| maps.roughness)));
    values.extend(pair(errors.environment.as_ref().map(|light| light.relative_l2)));
    values.extend([relit.rmse(), relit.rmse_at(relit.scale())]);
    values.extend([100.0 * (rise - 1.0), 100.0 * (rise * brightness(&image) / brightness(&relit) - 1.0)]);
    values.extend([exponent, fitter.state().seconds]);
    Ok(values)
}

/// Root mean square of the photographs.
fn brightness(sums: &AlignmentSums) -> f64 {
    (sums.photo_squared.iter().sum::<f64>() / (3 * sums.pixels) as f64).sqrt()
}

/// Compares our pictures of some views with true ones, over unclipped surface pixels. The noise of our pictures is
/// taken off: the expected square of a mean of paths is too large by its variance, which groups of paths estimate.
fn sums(
    fitter: &Fitter,
    lit: &Parameters<f32>,
    pictures: impl Iterator<Item = (usize, RgbImage)>,
    stop: &AtomicBool,
) -> AlignmentSums {
    let scene = fitter.scene().as_ref();
    let fit = fitter.settings();
    let settings = PictureSettings {
        two_sided: false,
        ground: None,
        samples: SAMPLES,
        groups: GROUPS,
        filter: fit.pixel_filter,
        max_bounces: fit.bounces,
        lobe_strength: if fit.has_lobe() { 1.0 } else { 0.0 },
        background_visible: scene.background == Background::Environment,
        background_blur_degrees: 0.0,
        seed: fit.seed ^ 0x57d7,
    };
    let mut total = AlignmentSums::default();
    for (view, truth) in pictures {
        let ours = render(fitter.surface(), &scene.views[view].camera, lit, view as u32, &settings, stop);
        let covered = ours.fully_covered();
        let counted = counted_pixels(&scene.views[view].states, Some(&covered));
        total.add(&AlignmentSums::without_variance(&truth, &ours.radiance, ours.variance.as_ref(), &counted));
    }
    total.squared_difference = total.squared_difference.max(0.0);
    total
}
