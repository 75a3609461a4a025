//! One case: estimate, then measure against the truth.

use super::StudyOptions;
use super::inputs::{Inputs, Photographed};
use super::plan::{Case, Figure};
use crate::error::Result;
use crate::image::RgbImage;
use crate::insight::truth::environment_errors;
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
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// First line of `results.csv`.
pub const HEADER: &str = "figure,material,light,variant,reflectance_log_rmse,reflectance_aligned,light_log_rmse,\
light_aligned,light_angle_degrees,rerender_log_rmse,rerender_aligned,relit_log_rmse,relit_aligned,lamps_psnr_db,seconds";

/// Names and units of the measures, in the order of a line.
pub const MEASURES: [(&str, &str); 11] = [
    ("reflectance, raw", "ln"),
    ("reflectance, aligned", "ln"),
    ("light, raw", "ln"),
    ("light, aligned", "ln"),
    ("brightest light", "degrees"),
    ("re-render, raw", "ln"),
    ("re-render, aligned", "ln"),
    ("relit, raw", "ln"),
    ("relit, aligned", "ln"),
    ("under single lamps, PSNR", "dB"),
    ("time", "s"),
];

/// Side of the pictures under single lamps, in pixels.
const LAMP_PICTURE_SIZE: usize = 64;

/// The measures of a case; NaN where there is nothing to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CaseResult(pub [f64; 11]);

impl CaseResult {
    /// A case that failed.
    pub fn failed() -> Self {
        CaseResult([f64::NAN; 11])
    }

    /// The columns behind the key.
    pub fn csv(&self) -> String {
        self.0.map(|value| format!("{value:.6}")).join(",")
    }

    /// The finite ones in words.
    pub fn text(&self) -> String {
        let parts = MEASURES.iter().zip(self.0).filter(|(_, value)| value.is_finite());
        parts.map(|((name, unit), value)| format!("  {name} {value:.3} {unit}")).collect()
    }
}

/// Pictures of a case, for the page.
pub struct CasePictures {
    /// The case in words.
    pub title: String,
    /// Caption and linear picture.
    pub pictures: Vec<(String, RgbImage)>,
}

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
pub fn run(
    case: &Case,
    inputs: &Inputs,
    photos: &HashMap<String, Photographed>,
    options: &StudyOptions,
    stop: &AtomicBool,
) -> Result<(CaseResult, Option<CasePictures>)> {
    let settings = ObjectSettings { prior: case.prior, shadows: case.shadows, ..case.way.settings(&inputs.settings) };
    let geometry = inputs.geometry(case);
    let fit = inputs.fits.find(&case.material)?;
    let light = inputs.light(&case.light)?;
    let missing = || crate::Error::new(crate::ErrorKind::Internal, "a light was not photographed under");
    let photographed = photos.get(&case.light).ok_or_else(missing)?;
    let relit_truth = photos.get(&inputs.held_out.0).ok_or_else(missing)?;
    let photo = photographed.photo(geometry, case.spoilt, options.seed)?;
    let views = [ObjectView::new(photo, geometry.clone())?];
    let (model, known) = match (case.figure, case.model) {
        (figure, Some(kind)) => {
            // What is estimated must not be among the starts.
            let without = [case.material.clone()];
            let weights = || Ok(Arc::clone(&inputs.trained));
            let model = StartedModel::without(kind, &weights, 2, &settings, &without)?;
            let light = (figure == Figure::Reflectance).then(|| light.clone());
            (model, Known { light, reflectance: None })
        }
        (_, None) => {
            let start = Start { name: "measured".into(), parameters: Vec::new() };
            let model = StartedModel {
                model: Box::new(Measured(fit.clone())),
                starts: vec![start],
                prior: ParameterPrior::none(0),
            };
            (model, Known { light: None, reflectance: Some(Vec::new()) })
        }
    };
    let found = estimate(&views, &model, &known, &settings, stop, &|_| {})?;
    measure(case, inputs, &settings, &model, &found, photographed, relit_truth)
}

fn measure(
    case: &Case,
    inputs: &Inputs,
    settings: &ObjectSettings,
    model: &StartedModel,
    found: &Estimate,
    photographed: &Photographed,
    relit_truth: &Photographed,
) -> Result<(CaseResult, Option<CasePictures>)> {
    let mut result = CaseResult::failed();
    let geometry = inputs.geometry(case);
    if case.model.is_some() {
        let truth = inputs.fits.find(&case.material)?.table();
        result.0[0] = model_error(model.model.as_ref(), &found.parameters, &truth)?.log_rmse;
        result.0[1] = aligned_error(model.model.as_ref(), &found.parameters, &truth);
    }
    let (width, height) = settings.light_size();
    let true_light = inputs.light(&case.light)?.resampled(width, height);
    let light = found.light.environment();
    if case.figure != Figure::Reflectance {
        let errors = environment_errors(&light, &true_light)?;
        result.0[2] = errors.log_rmse.raw;
        result.0[3] = errors.log_rmse.aligned;
        result.0[4] = errors.brightest_angle_degrees.unwrap_or(f64::NAN);
    }
    let grid = NodeGrid::new(settings.nodes);
    let directions = TexelDirections::new(width, height)?;
    let held_out = inputs.held_out.1.resampled(width, height);
    // What is judged is the result: shadows are traced here whether the estimation knew of them or not.
    let visibility = geometry.visibility(&geometry.pixels, width, height);
    let render =
        |light| render(geometry, visibility.as_ref(), &directions, &grid, &found.table, &[light]).swap_remove(0);
    let (own, relit) = (render(&light), render(&held_out));
    let epsilon = |truth: &RgbImage| 1e-3 * mean(truth, geometry.pixels.len());
    (result.0[5], result.0[6]) = log_errors(geometry, &own, &photographed.truth, epsilon(&photographed.truth));
    if case.model.is_some() {
        (result.0[7], result.0[8]) = log_errors(geometry, &relit, &relit_truth.truth, epsilon(&relit_truth.truth));
    }
    result.0[10] = found.seconds;
    let mut pictures = vec![
        ("photo".to_string(), photographed.truth.clone()),
        ("re-render".to_string(), own),
        ("true light".to_string(), true_light.radiance),
        ("light".to_string(), light.radiance),
        (format!("truth under {}", inputs.held_out.0), relit_truth.truth.clone()),
        (format!("found under {}", inputs.held_out.0), relit),
    ];
    if let (Figure::Reflectance, true) = (case.figure, case.model.is_some()) {
        let fit = inputs.fits.find(&case.material)?;
        let truths = under_single_lamps(|at, values| fit.evaluate(at, values));
        let estimates = under_single_lamps(|at, values| model.model.evaluate(&found.parameters, at, values));
        result.0[9] = 0.0;
        for (number, (truth, estimate)) in truths.iter().zip(&estimates).enumerate() {
            result.0[9] += sphere::displayed_scores(estimate, truth)?.psnr / truths.len() as f64;
            pictures.push((format!("truth under lamp {}", number + 1), truth.clone()));
            pictures.push((format!("found under lamp {}", number + 1), estimate.clone()));
        }
    }
    let title = format!("{} · {} · {} · {}", case.figure.key(), case.material, case.light, case.variant());
    Ok((result, Some(CasePictures { title, pictures })))
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
