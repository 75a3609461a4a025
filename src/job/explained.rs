//! Does the fit explain the photos at all?
//!
//! A score in decibels is low for a dark glossy thing and high for a plain wall, whatever the fit is worth. What is asked
//! here is how much of the variation over the surface within a photo the picture has: one less the mean squared
//! difference over the variance, after the best factor per channel. A mean grey would explain nothing.

use super::shown::ScoredView;
use crate::error::{Finding, Place, Severity};
use crate::fit::ViewUse;
use crate::insight::report::images::ViewPictures;
use crate::math::statistics::{Moments, quantile};
use crate::scene::doctor::worst_first;

/// Where the middle training photo is explained by less than this, the fit as a whole is not to be believed.
const LEAST_MIDDLE: f64 = 0.5;
/// A single photo explained by less than this, where the others are, is named.
const LEAST_OF_ONE: f64 = 0.25;
/// Names that are listed.
const SHOWN: usize = 6;

/// What is told when photos are not explained; `None` when they are, or where too little is seen to judge.
pub(super) fn finding(views: &[ScoredView]) -> Option<Finding> {
    let training = views.iter().filter(|view| view.kind == ViewUse::Training);
    let shares: Vec<(f64, &str)> =
        training.filter_map(|view| Some((share(view)?, view.pictures.name.as_str()))).collect();
    if shares.is_empty() {
        return None;
    }
    let middle = quantile(&shares.iter().map(|(share, _)| *share).collect::<Vec<_>>(), 0.5);
    let percent = (100.0 * middle).max(0.0);
    if middle < LEAST_MIDDLE {
        let message = format!(
            "the fit does not explain the photos: its renders reproduce {percent:.0} % of their variation \
             over the surface (median of the training photos)"
        );
        return Some(Finding::new(Severity::Warning, "photos-not-explained", message).remedy(
            "do not rely on these maps: photos, cameras and mesh may not belong together (run `patina check`), \
             or the surface is outside the model, such as a mirror or glass",
        ));
    }
    let bad = shares.iter().filter(|(share, _)| *share < LEAST_OF_ONE).map(|&(share, name)| (-share, name)).collect();
    let (worst, bad) = worst_first(bad)?;
    let &first = bad.first()?;
    let listed = bad.iter().take(SHOWN).copied().collect::<Vec<_>>().join(", ");
    let more = if bad.len() > SHOWN { format!(" and {} more", bad.len() - SHOWN) } else { String::new() };
    let message = format!(
        "the fit does not explain {} training photos (it reproduces {:.0} % of the variation of the first and {percent:.0} % \
         of that of the median one): {listed}{more}",
        bad.len(),
        (-100.0 * worst).max(0.0)
    );
    Some(
        Finding::new(Severity::Warning, "photos-not-explained", message)
            .at(Place::View(first.into()))
            .remedy("check these photos, and exclude them with --exclude if they do not belong"),
    )
}

/// Share of a photo's variance over the surface that the picture has; `None` where nothing varies or is seen.
fn share(view: &ScoredView) -> Option<f64> {
    let ViewPictures { photo, counted, .. } = &view.pictures;
    let counted = counted.as_ref()?;
    let pixels = photo.pixels().iter().zip(counted.pixels()).filter(|(_, counted)| **counted);
    let mut channels = [Moments::default(); 3];
    for (pixel, _) in pixels {
        for (moments, value) in channels.iter_mut().zip(pixel.to_array()) {
            moments.add(f64::from(value));
        }
    }
    let variance = channels.iter().map(Moments::variance).sum::<f64>() / 3.0;
    let mean = channels.iter().map(|moments| moments.mean).sum::<f64>() / 3.0;
    let error = view.scores.sums.rmse_at(view.scores.sums.scale()).powi(2);
    // A photo of one grey says nothing of whether it is explained.
    (channels[0].count > 100 && variance > (0.02 * mean).powi(2) && error.is_finite()).then(|| 1.0 - error / variance)
}
