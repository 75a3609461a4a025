//! One case: estimate, then measure against the truth.

use super::asked::{Case, Figure};
use super::inputs::{Inputs, Photographed};
use crate::error::Result;
use crate::image::RgbImage;
use crate::insight::truth::environment_errors;
use crate::lab::study::sitting::Figures;
use crate::light::blur::BANDS;
use crate::measured::coordinates::HalfDifference;
use crate::measured::fits::NeuralFit;
use crate::measured::grid;
use crate::measured::metrics::{log_raw, model_error};
use crate::measured::model::ReflectanceModel;
use crate::measured::sphere;
use crate::measured::table::MeasuredBrdf;
use crate::object::joint::{Estimate, Known, estimate};
use crate::object::nodes::NodeGrid;
use crate::object::observations::ObjectView;
use crate::object::picture::{log_errors, render};
use crate::object::reflectance_step::ParameterPrior;
use crate::object::settings::ObjectSettings;
use crate::object::starts::{Start, StartedModel};
use crate::object::transport::TexelDirections;
use glam::{DVec3, Vec3};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Key in the results file, name in tables and unit of each measure.
pub const MEASURES: [(&str, &str, &str); 15] = [
    ("reflectance_log_rmse", "reflectance, raw", "ln"),
    ("reflectance_aligned", "reflectance, aligned", "ln"),
    ("light_log_rmse", "light, raw", "ln"),
    ("light_aligned", "light, aligned", "ln"),
    ("light_5_degrees", "light blurred by 5 degrees", "ln"),
    ("light_15_degrees", "light blurred by 15 degrees", "ln"),
    ("light_30_degrees", "light blurred by 30 degrees", "ln"),
    ("light_60_degrees", "light blurred by 60 degrees", "ln"),
    ("light_angle_degrees", "brightest light", "degrees"),
    ("rerender_log_rmse", "re-render, raw", "ln"),
    ("rerender_aligned", "re-render, aligned", "ln"),
    ("relit_log_rmse", "relit, raw", "ln"),
    ("relit_aligned", "relit, aligned", "ln"),
    ("lamps_psnr_db", "under single lamps, PSNR", "dB"),
    ("estimation_seconds", "time", "s"),
];

/// Keys of the errors of the light by the angle both lights are blurred by.
const BLURRED: [&str; 4] = ["light_5_degrees", "light_15_degrees", "light_30_degrees", "light_60_degrees"];

/// Side of the pictures under single lamps, in pixels.
const LAMP_PICTURE_SIZE: usize = 64;

/// Pictures of a case, each with its caption.
pub type CasePictures = Vec<(String, RgbImage)>;

/// A measured reflectance as a model without parameters: for cases in which it is known.
struct Measured(NeuralFit);

impl ReflectanceModel for Measured {
    fn name(&self) -> &str {
        "measured"
    }
    fn parameter_count(&self) -> usize {
        0
    }
    fn start(&self) -> Vec<f64> {
        Vec::new()
    }
    fn evaluate(&self, _: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
        self.0.evaluate(at, values);
    }
    fn pull_back(&self, _: &[f64], _: &[HalfDifference], _: &[[f64; 3]], _: &mut [f64]) {}
}

/// Estimates and measures one case.
///
/// # Errors
/// What the estimation fails for.
pub fn run(case: &Case, inputs: &Inputs, photos: &Photographed, stop: &AtomicBool) -> Result<(Figures, CasePictures)> {
    let (prior, shadows, seed) = (case.prior, case.shadows, case.seed);
    let settings = ObjectSettings { prior, shadows, seed, ..case.way.settings(&inputs.settings) };
    let geometry = inputs.geometry(case);
    let fit = inputs.fits.find(&case.material)?;
    let light = inputs.light(&case.light)?;
    let photo = photos.photo(geometry, case.spoilt, case.seed)?;
    let views = [ObjectView::new(photo, geometry.clone())?];
    let (model, known) = match (case.figure, case.model) {
        (figure, Some(kind)) => {
            // What is estimated must not be among the starts.
            let without = [case.material.clone()];
            let weights = || Ok(Arc::clone(&inputs.trained));
            let model = StartedModel::without(kind, &weights, 2, &settings, &without)?;
            let light = (figure == Figure::Reflectance).then(|| light.clone());
            (model, Known { light, ..Known::default() })
        }
        (_, None) => {
            let start = Start { name: "measured".into(), parameters: Vec::new() };
            let model = StartedModel {
                model: Box::new(Measured(fit.clone())),
                starts: vec![start],
                prior: ParameterPrior::none(0),
            };
            (model, Known { reflectance: Some(Vec::new()), ..Known::default() })
        }
    };
    let found = estimate(&views, &model, &known, &settings, stop, &|_| {})?;
    measure(case, inputs, &settings, &model, &found, photos)
}

fn measure(
    case: &Case,
    inputs: &Inputs,
    settings: &ObjectSettings,
    model: &StartedModel,
    found: &Estimate,
    photos: &Photographed,
) -> Result<(Figures, CasePictures)> {
    let mut figures = Figures::new();
    let geometry = inputs.geometry(case);
    if case.model.is_some() {
        let truth = inputs.fits.find(&case.material)?.table();
        let error = model_error(model.model.as_ref(), &found.parameters, &truth)?.log_rmse;
        figures.push(("reflectance_log_rmse", error));
        figures.push(("reflectance_aligned", aligned_error(model.model.as_ref(), &found.parameters, &truth)));
    }
    let (width, height) = settings.light_size();
    let true_light = inputs.light(&case.light)?.resampled(width, height);
    let light = found.light.environment();
    if case.figure != Figure::Reflectance {
        let errors = environment_errors(&light, &true_light)?;
        figures.push(("light_log_rmse", errors.log_rmse.raw));
        figures.push(("light_aligned", errors.log_rmse.aligned));
        for (key, degrees) in BLURRED.into_iter().zip(BANDS) {
            let (own, truth) = (light.blurred(degrees), true_light.blurred(degrees));
            figures.push((key, environment_errors(&own, &truth)?.log_rmse.aligned));
        }
        figures.push(("light_angle_degrees", errors.brightest_angle_degrees.unwrap_or(f64::NAN)));
    }
    let grid = NodeGrid::new(settings.nodes);
    let directions = TexelDirections::new(width, height)?;
    let held_out = inputs.held_out.1.resampled(width, height);
    // What is judged is the result: shadows are traced here whether the estimation knew of them or not.
    let visibility = geometry.visibility(&geometry.pixels, width, height);
    let render =
        |light| render(geometry, visibility.as_ref(), &directions, &grid, &found.table, &[light]).swap_remove(0);
    let (own, relit) = (render(&light), render(&held_out));
    let errors = |picture: &RgbImage, truth: &RgbImage| {
        log_errors(geometry, picture, truth, 1e-3 * mean(truth, geometry.pixels.len()))
    };
    let (raw, aligned) = errors(&own, &photos.truth);
    figures.extend([("rerender_log_rmse", raw), ("rerender_aligned", aligned)]);
    if case.model.is_some() {
        let (raw, aligned) = errors(&relit, &photos.held_out);
        figures.extend([("relit_log_rmse", raw), ("relit_aligned", aligned)]);
    }
    let mut pictures = vec![
        ("photo".to_string(), photos.truth.clone()),
        ("re-render".to_string(), own),
        ("true light".to_string(), true_light.radiance),
        ("light".to_string(), light.radiance),
        (format!("truth under {}", inputs.held_out.0), photos.held_out.clone()),
        (format!("found under {}", inputs.held_out.0), relit),
    ];
    if let (Figure::Reflectance, true) = (case.figure, case.model.is_some()) {
        let fit = inputs.fits.find(&case.material)?;
        let truths = under_single_lamps(|at, values| fit.evaluate(at, values));
        let estimates = under_single_lamps(|at, values| model.model.evaluate(&found.parameters, at, values));
        let mut psnr = 0.0;
        for (number, (truth, estimate)) in truths.iter().zip(&estimates).enumerate() {
            psnr += sphere::displayed_scores(estimate, truth)?.psnr / truths.len() as f64;
            pictures.push((format!("truth under lamp {}", number + 1), truth.clone()));
            pictures.push((format!("found under lamp {}", number + 1), estimate.clone()));
        }
        figures.push(("lamps_psnr_db", psnr));
    }
    figures.push(("estimation_seconds", found.seconds));
    Ok((figures, pictures))
}

/// A sphere under each of the lamps by itself that materials are shown under (figure 3 b of the paper). `evaluate` fills
/// in reflectances at angles.
fn under_single_lamps(evaluate: impl Fn(&[HalfDifference], &mut [[f64; 3]])) -> Vec<RgbImage> {
    let normals = sphere::sphere_normals(LAMP_PICTURE_SIZE);
    let of_lamp = |lamp: sphere::DistantLamp| {
        let (mut pixels, mut at, mut cosines) = (Vec::new(), Vec::new(), Vec::new());
        for (pixel, normal) in normals.pixels().iter().enumerate() {
            let Some(normal) = normal else { continue };
            let cosine = normal.dot(lamp.to_light);
            if cosine > 0.0 {
                pixels.push(pixel);
                cosines.push(cosine);
                at.push(sphere::angles_about(*normal, lamp.to_light, DVec3::Z));
            }
        }
        let mut values = vec![[0.0; 3]; at.len()];
        evaluate(&at, &mut values);
        let mut picture = RgbImage::filled(LAMP_PICTURE_SIZE, LAMP_PICTURE_SIZE, Vec3::ZERO);
        for ((pixel, cosine), value) in pixels.into_iter().zip(cosines).zip(values) {
            picture.pixels_mut()[pixel] = (DVec3::from_array(value) * lamp.irradiance * cosine).as_vec3();
        }
        picture
    };
    sphere::showing_lamps().into_iter().map(of_lamp).collect()
}

fn mean(picture: &RgbImage, pixels: usize) -> f32 {
    picture.pixels().iter().map(|pixel| pixel.element_sum()).sum::<f32>() / (3 * pixels.max(1)) as f32
}

/// The figure of [`model_error`] after the best factor per channel, over every eleventh cell that counts.
fn aligned_error(model: &dyn ReflectanceModel, parameters: &[f64], truth: &MeasuredBrdf) -> f64 {
    let cells: Vec<usize> = truth.counted_cells().into_iter().step_by(11).map(|cell| cell as usize).collect();
    let at: Vec<HalfDifference> = cells.iter().map(|&cell| grid::coordinates_of_cell(cell)).collect();
    let mut values = vec![[0.0; 3]; at.len()];
    model.evaluate(parameters, &at, &mut values);
    let variance = |channel: usize| {
        let (mut first, mut second) = (0.0, 0.0);
        for (&cell, value) in cells.iter().zip(&values) {
            let difference = log_raw(value[channel], channel) - log_raw(truth.value(cell)[channel], channel);
            first += difference;
            second += difference * difference;
        }
        let count = cells.len().max(1) as f64;
        (second / count - (first / count).powi(2)).max(0.0)
    };
    ((0..3).map(variance).sum::<f64>() / 3.0).sqrt()
}
