//! How far light is baked into the maps: the errors of pictures under lights the fit never saw.
//!
//! A fit may explain every photo and still hold a shadow in its diffuse map: then it is good under its own light and
//! wrong under any other. Where the truth is known, both are measured: the first row is the fit under its own light,
//! each further row the fit and the truth under the same new light. Scores come raw and scale-aligned, since a fit may
//! have moved its reflectance by a factor that no photo forbids.

use super::gallery::{NamedLight, drawn, set_light};
use super::pictures::parameters_of_truth;
use super::shown::exposure_of;
use crate::error::Result;
use crate::fit::targets::{Target, shrink_picture};
use crate::image::{Image, RgbImage};
use crate::insight::scores::{AggregateScore, ViewScores, aggregate, score_view};
use crate::render::picture::PictureSettings;
use crate::render::{Parameters, Surface};
use crate::scene::{PixelState, Scene, Truth};
use std::sync::atomic::AtomicBool;

/// How the table is made.
#[derive(Clone, Debug, PartialEq)]
pub struct EntanglementSettings {
    /// Views that are compared, at most; held-out ones first.
    pub most_views: usize,
    /// Pixels of a view, at most; larger ones are halved first.
    pub most_pixels: usize,
    /// How pictures are traced.
    pub picture: PictureSettings,
}

impl Default for EntanglementSettings {
    fn default() -> Self {
        let picture = PictureSettings { samples: 32, ..Default::default() };
        EntanglementSettings { most_views: 4, most_pixels: 60_000, picture }
    }
}

/// Errors under one light.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct EntanglementRow {
    /// Name of the light.
    pub light: String,
    /// Whether the light was in the photos; false for a light the fit never saw.
    pub is_own: bool,
    /// Scores over all pixels of all views.
    pub score: AggregateScore,
}

/// The table, or why there is none.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub enum Entanglement {
    /// One row a light, that of the photos first.
    Known(Vec<EntanglementRow>),
    /// One sentence for the panel.
    Unknown(&'static str),
}

/// Compares pictures of the fit with those of the truth under the light of the photos, under the light that the truth
/// brings with it, and under `lights`. `progress` gets the share done, in [0, 1].
///
/// # Errors
/// `Stopped` when `stop` was raised; errors of a truth that does not belong to its scene.
pub fn entanglement(
    scene: &Scene,
    surface: &Surface,
    own: &Parameters<f32>,
    lights: &[NamedLight],
    settings: &EntanglementSettings,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<Entanglement> {
    let Some(truth) = &scene.truth else {
        return Ok(Entanglement::Unknown(
            "This scene has no ground truth, so nothing shows how it would look under another environment.",
        ));
    };
    let mut order: Vec<usize> = (0..scene.views.len()).collect();
    order.sort_by_key(|&view| !scene.views[view].held_out);
    order.truncate(settings.most_views.max(1));
    let compare = Compare { scene, surface, settings, stop, exposure_stops: exposure_of(scene) };
    let has_maps = !truth.maps.diffuse.pixels().is_empty();
    let rows_to_come = 1 + usize::from(truth.relight.is_some()) + if has_maps { lights.len() } else { 0 };
    let mut rows = Vec::with_capacity(rows_to_come);
    let mut add = |light: &str, is_own: bool, scores: &[ViewScores]| {
        rows.push(EntanglementRow { light: light.into(), is_own, score: aggregate(scores) });
        progress(rows.len() as f32 / rows_to_come as f32);
    };

    let scores: Result<Vec<_>> = order.iter().map(|&view| compare.with_photo(own, view)).collect();
    add("the light of the photos", true, &scores?);
    let mut lit = own.clone();
    if let Some(relight) = &truth.relight {
        set_light(&mut lit, &relight.environment);
        let pictures = relight.pictures.iter().filter(|(view, _)| *view < scene.views.len()).take(settings.most_views);
        let scores: Result<Vec<_>> =
            pictures.map(|(view, picture)| compare.with_picture(&lit, *view, picture)).collect();
        add("novel lighting", false, &scores?);
    }
    if has_maps && !lights.is_empty() {
        let true_surface = Surface::new(scene.mesh.clone())?;
        let mut true_lit = parameters_of_truth(truth);
        for light in lights {
            set_light(&mut lit, &light.environment);
            set_light(&mut true_lit, &light.environment);
            let score = |&view: &usize| compare.with_truth(&lit, truth, &true_surface, &true_lit, view);
            let scores: Result<Vec<_>> = order.iter().map(score).collect();
            add(&light.name, false, &scores?);
        }
    }
    Ok(Entanglement::Known(rows))
}

struct Compare<'a> {
    scene: &'a Scene,
    surface: &'a Surface,
    settings: &'a EntanglementSettings,
    stop: &'a AtomicBool,
    exposure_stops: f32,
}

impl Compare<'_> {
    fn level(&self, view: usize) -> usize {
        self.scene.views[view].camera.level_within(self.settings.most_pixels)
    }

    /// Draws the fit and scores it against a picture of the same pixels.
    fn score(
        &self,
        lit: &Parameters<f32>,
        target: &Target,
        other: &RgbImage,
        states: &Image<PixelState>,
        picture: &PictureSettings,
    ) -> Result<ViewScores> {
        let ours = drawn(self.surface, &target.camera, lit, target.view as u32, picture, self.stop)?;
        let coverage = ours.fully_covered();
        score_view(other, &ours.radiance, states, Some(&coverage), self.exposure_stops)
    }

    fn with_photo(&self, own: &Parameters<f32>, view: usize) -> Result<ViewScores> {
        let target = Target::new(self.scene, view, self.level(view));
        let (width, height) = (target.camera.width, target.camera.height);
        let photo = Image::from_fn(width, height, |row, column| target.at(self.scene, row * width + column).0);
        let states = Image::from_fn(width, height, |row, column| target.at(self.scene, row * width + column).1);
        self.score(own, &target, &photo, &states, &self.settings.picture)
    }

    fn with_picture(&self, lit: &Parameters<f32>, view: usize, picture: &RgbImage) -> Result<ViewScores> {
        let target = Target::new(self.scene, view, self.level(view));
        let factor = self.scene.views[view].camera.width / target.camera.width;
        let picture = shrink_picture(picture, factor);
        let states = Image::filled(target.camera.width, target.camera.height, PixelState::Surface);
        self.score(lit, &target, &picture, &states, &self.settings.picture)
    }

    fn with_truth(
        &self,
        lit: &Parameters<f32>,
        truth: &Truth,
        true_surface: &Surface,
        true_lit: &Parameters<f32>,
        view: usize,
    ) -> Result<ViewScores> {
        let target = Target::new(self.scene, view, self.level(view));
        // Random numbers of its own: with those of the fit, noise would cancel and flatter it.
        let settings = PictureSettings {
            max_bounces: truth.max_bounces,
            lobe_strength: 1.0,
            seed: self.settings.picture.seed ^ 0x7247,
            ..self.settings.picture
        };
        let expected = drawn(true_surface, &target.camera, true_lit, view as u32, &settings, self.stop)?;
        let states = Image::filled(target.camera.width, target.camera.height, PixelState::Surface);
        self.score(lit, &target, &expected.radiance, &states, &self.settings.picture)
    }
}
