//! A plastic by formula under a sky: photos of it, and how far a light that was found is from the true one.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::image::{Image, RgbImage};
use patina::insight::truth::environment_errors;
use patina::light::Environment;
use patina::measured::analytic::{LambertLobes, LobeKind};
use patina::measured::coordinates::HalfDifference;
use patina::measured::model::ReflectanceModel;
use patina::object::joint::{Estimate, Known};
use patina::object::observations::ObjectView;
use patina::object::picture::render_exact;
use patina::object::reflectance_step::ParameterPrior;
use patina::object::settings::ObjectSettings;
use patina::object::starts::{Start, StartedModel};
use patina::object::transport::TexelDirections;
use patina::object::{ObjectGeometry, ObjectPhoto};
use patina::scene::Mesh;

pub fn small() -> ObjectSettings {
    ObjectSettings {
        light_height: 16,
        pixels: 400,
        nodes: [20, 10, 6],
        outer_loops: 4,
        grey_loops: 1,
        net_channels: 8,
        net_steps: 10,
        followed: 3,
        ..ObjectSettings::default()
    }
}

/// A sky with a sun over a floor, four times as fine as the light that is fitted.
pub fn sky() -> Environment {
    let (width, height) = (64, 32);
    let radiance = Image::from_fn(width, height, |row, column| {
        let sun = (-((row as f32 - 9.0).powi(2) + (column as f32 - 40.0).powi(2)) / 6.0).exp();
        let base = if row < 16 { Vec3::new(0.5, 0.7, 1.0) } else { Vec3::new(0.25, 0.2, 0.15) };
        base + sun * Vec3::new(30.0, 27.0, 22.0)
    });
    Environment { radiance }
}

/// Not one of the starts, not of the library, and not the kind that is fitted.
pub fn truth_model() -> (LambertLobes, Vec<f64>) {
    let parameters =
        [0.3f64, 0.12, 0.06].iter().map(|v| v.ln()).chain([0.5f64.ln(); 3]).chain([0.11f64.ln(), -2.6]).collect();
    (LambertLobes::new(LobeKind::Ggx, 1), parameters)
}

pub fn photograph(geometry: &ObjectGeometry, light: &Environment) -> RgbImage {
    let (model, parameters) = truth_model();
    photograph_of(geometry, light, &model, &parameters)
}

pub fn photograph_of(
    geometry: &ObjectGeometry,
    light: &Environment,
    model: &dyn ReflectanceModel,
    parameters: &[f64],
) -> RgbImage {
    let directions = TexelDirections::of_any_size(light.width(), light.height());
    let visibility = geometry.visibility(&geometry.pixels, light.width(), light.height());
    let evaluate = |at: &[HalfDifference], values: &mut [[f64; 3]]| model.evaluate(parameters, at, values);
    render_exact(geometry, visibility.as_ref(), &directions, &evaluate, &[light]).swap_remove(0)
}

pub fn view_of(geometry: &ObjectGeometry, picture: RgbImage) -> ObjectView {
    let photo = ObjectPhoto::new("photo", picture, f32::INFINITY, 0.0).unwrap().0;
    ObjectView::new(photo, geometry.clone()).unwrap()
}

/// The true reflectance as a model that is known.
pub fn known_truth() -> (StartedModel, Known) {
    let (model, parameters) = truth_model();
    let prior = ParameterPrior::none(parameters.len());
    let starts = vec![Start { name: "truth".into(), parameters: parameters.clone() }];
    (
        StartedModel { model: Box::new(model), starts, prior },
        Known { reflectance: Some(parameters), ..Known::default() },
    )
}

pub fn light_error(found: &Estimate) -> f64 {
    let light = found.light.environment();
    environment_errors(&light, &sky().resampled(light.width(), light.height())).unwrap().log_rmse.raw
}

/// A floor before a wall, the sun behind the wall's edge: a third of the floor lies in shadow.
pub fn floor_and_wall() -> Mesh {
    let positions = [
        (-3.0, 0.0, -3.0),
        (3.0, 0.0, -3.0),
        (3.0, 0.0, 3.0),
        (-3.0, 0.0, 3.0),
        (0.5, 0.0, -3.0),
        (0.5, 0.0, 3.0),
        (0.5, 2.5, -3.0),
        (0.5, 2.5, 3.0),
    ];
    Mesh {
        positions: positions.iter().map(|&(x, y, z)| Vec3::new(x, y, z)).collect(),
        triangles: vec![[0, 2, 1], [0, 3, 2], [4, 5, 7], [4, 7, 6]],
        ..Mesh::default()
    }
}
