//! The pictures by which a fit is judged: of its views with their scores, and relit.

use super::pictures::{light_of, matched, relit};
use super::prepare::RunSettings;
use crate::error::{Error, ErrorKind, Result};
use crate::export::RunResult;
use crate::fit::targets::Target;
use crate::fit::views::views_of;
use crate::fit::{CachedPicture, Fitter, ViewUse};
use crate::image::{Image, RgbImage};
use crate::insight::nearest_photo::{Reprojected, reprojected};
use crate::insight::report::{RelitPicture, RelitStrip, ViewPictures};
use crate::insight::scores::{ViewScores, mean_of, score_halves, score_view};
use crate::light::sky::BuiltInSky;
use crate::render::picture::{Picture, PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::{Background, PixelState, Scene};
use std::sync::atomic::{AtomicBool, Ordering};

/// Pixels of a held-out view in the report, at most; larger photos are halved first.
const HELD_OUT_PIXELS: usize = 4_000_000;
/// The same where paths are traced.
const TRACED_PIXELS: usize = 400_000;
/// Pixels of a training view in the report, at most.
const TRAINING_PIXELS: usize = 60_000;
/// Paths a pixel in the report's pictures of held-out views.
const HELD_OUT_SAMPLES: usize = 32;
/// Paths a pixel in the report's pictures of training views.
const TRAINING_SAMPLES: usize = 8;
/// Paths a pixel in relit pictures.
const RELIT_SAMPLES: usize = 16;
/// Pixels of a relit picture, at most.
const RELIT_PIXELS: usize = 130_000;

/// A view at the size the report shows, with its score.
pub(super) struct ScoredView {
    pub index: usize,
    pub kind: ViewUse,
    pub scores: ViewScores,
    /// Of the texture without a light, on the same pixels.
    pub of_texture: Option<ViewScores>,
    /// Of the nearest photo, on those of the same pixels that it shows.
    pub of_nearest: Option<ViewScores>,
    pub pictures: ViewPictures,
}

/// A picture in two halves, which are the same where it has no noise.
struct Drawn {
    halves: [RgbImage; 2],
    coverage: Image<bool>,
    texture: Option<RgbImage>,
}

impl Drawn {
    fn of_cache(picture: CachedPicture) -> Self {
        let CachedPicture { radiance, texture, covered } = picture;
        Drawn { halves: [radiance.clone(), radiance], coverage: covered, texture }
    }

    fn of_paths(halves: [Picture; 2]) -> Self {
        let coverage = fully_covered(&halves);
        Drawn { halves: halves.map(|half| half.radiance), coverage, texture: None }
    }
}

fn picture_settings(scene: &Scene, settings: &RunSettings, samples: usize) -> PictureSettings {
    PictureSettings {
        samples,
        max_bounces: settings.fit.bounces,
        filter: settings.fit.pixel_filter,
        background_visible: scene.background == Background::Environment,
        lobe_strength: if settings.fit.has_lobe() { 1.0 } else { 0.0 },
        // A scan has holes through which its inside shows; a scene with a truth is drawn as its truth was.
        two_sided: scene.truth.is_none(),
        seed: settings.fit.seed ^ 0x5c0e,
        ..Default::default()
    }
}

/// Two pictures with independent noise, of half the paths each.
pub fn in_halves(settings: &PictureSettings, draw: impl Fn(&PictureSettings) -> Picture) -> [Picture; 2] {
    [0, 0x1a1f].map(|other| {
        draw(&PictureSettings { samples: (settings.samples / 2).max(1), seed: settings.seed ^ other, ..*settings })
    })
}

/// Pixels that surface covers wholly in both halves.
pub fn fully_covered(halves: &[Picture; 2]) -> Image<bool> {
    let [first, second] = halves.each_ref().map(Picture::fully_covered);
    Image::from_fn(first.width(), first.height(), |row, column| first[(row, column)] && second[(row, column)])
}

pub(super) fn score_views(
    fitter: &Fitter,
    surface: &Surface,
    own: &Parameters<f32>,
    settings: &RunSettings,
    stop: &AtomicBool,
) -> Result<Vec<ScoredView>> {
    let scene = fitter.scene().as_ref();
    let cached = fitter.cached_view();
    let has_held_out = fitter.view_uses().contains(&ViewUse::HeldOut);
    let texture = has_held_out
        .then(|| fitter.bake(stop))
        .flatten()
        .map(|bake| bake.texels.iter().map(|texel| texel.diffuse).collect::<Vec<_>>());
    let training = views_of(fitter.view_uses(), ViewUse::Training);
    let mut scored = Vec::with_capacity(scene.views.len());
    for (index, (view, &kind)) in scene.views.iter().zip(fitter.view_uses()).enumerate() {
        let (most, samples) = match kind {
            ViewUse::HeldOut if cached.is_some() => (HELD_OUT_PIXELS, HELD_OUT_SAMPLES),
            ViewUse::HeldOut => (TRACED_PIXELS, HELD_OUT_SAMPLES),
            ViewUse::Training | ViewUse::LeftOut => (TRAINING_PIXELS, TRAINING_SAMPLES),
        };
        let picture_settings = picture_settings(scene, settings, samples);
        let target = Target::new(scene, index, scene.views[index].camera.level_within(most));
        let gain = fitter.state().log_gains[index].exp();
        let camera = &target.camera;
        let is_held_out = kind == ViewUse::HeldOut;
        let Drawn { halves, coverage, texture } = match &cached {
            Some(cached) => Drawn::of_cache(cached.picture(&target, texture.as_deref().filter(|_| is_held_out))),
            None => Drawn::of_paths(in_halves(&picture_settings, |settings| {
                render(surface, camera, own, index as u32, settings, stop)
            })),
        };
        go_on(stop)?;
        let halves = halves.map(|half| half.map(|&pixel| pixel * gain));
        let pictures = halves.each_ref();
        let (width, height) = (target.camera.width, target.camera.height);
        let pixel = |row: usize, column: usize| target.at(scene, row * width + column);
        let photo: RgbImage = Image::from_fn(width, height, |row, column| pixel(row, column).0);
        let states: Image<PixelState> = Image::from_fn(width, height, |row, column| pixel(row, column).1);
        let stops = exposure_of(scene);
        let scores = score_halves(&photo, pictures, &states, Some(&coverage), stops)?;
        let of_texture =
            texture.map(|texture| score_view(&photo, &texture, &states, Some(&coverage), stops)).transpose()?;
        let of_nearest = if is_held_out {
            let Reprojected { radiance, known } = reprojected(scene, surface, camera, &training);
            let both = Image::from_fn(width, height, |row, column| coverage[(row, column)] && known[(row, column)]);
            Some(score_view(&photo, &radiance, &states, Some(&both), stops)?)
        } else {
            None
        };
        let fit = mean_of(pictures);
        let counted = crate::insight::scores::counted_pixels(&states, Some(&coverage));
        let pictures =
            ViewPictures { name: view.name.clone(), held_out: view.held_out, photo, fit, counted: Some(counted) };
        scored.push(ScoredView { index, kind, scores, of_texture, of_nearest, pictures });
    }
    Ok(scored)
}

/// An error of kind `Stopped` once the flag is raised: a picture that was begun is then not whole.
pub(super) fn go_on(stop: &AtomicBool) -> Result<()> {
    match stop.load(Ordering::Relaxed) {
        false => Ok(()),
        true => Err(Error::new(ErrorKind::Stopped, "stopped while the report was made")
            .remedy("the maps are written; `patina resume` makes the report from the checkpoint")),
    }
}

/// Stops that bring photographs without an exposure of their own to a visible range: 0 for 8-bit photographs.
pub fn exposure_of(scene: &Scene) -> f32 {
    let Some(view) = scene.views.first() else { return 0.0 };
    if !view.photo.is_linear() {
        return 0.0;
    }
    let mut luminances: Vec<f64> = Vec::new();
    for row in (0..view.photo.height()).step_by(4) {
        for column in (0..view.photo.width()).step_by(4) {
            let luminance = crate::math::luminance(view.photo.radiance(row, column));
            if luminance > 0.0 {
                luminances.push(f64::from(luminance));
            }
        }
    }
    let bright = crate::math::statistics::quantile(&luminances, 0.95);
    if bright.is_finite() && bright > 0.0 { (0.8 / bright).log2() as f32 } else { 0.0 }
}

/// Pictures under the light of the truth, when there is one, and under built-in skies.
pub(super) fn relit_strips(
    fitter: &Fitter,
    surface: &Surface,
    own: &Parameters<f32>,
    result: &RunResult,
    settings: &RunSettings,
    stop: &AtomicBool,
) -> Result<(Vec<RelitStrip>, Vec<ViewScores>)> {
    let scene = fitter.scene().as_ref();
    let uses = fitter.view_uses();
    let mut strips = Vec::new();
    let mut errors = Vec::new();
    if let Some(truth) = scene.truth.as_ref().and_then(|truth| truth.relight.as_ref()) {
        let own_settings = picture_settings(scene, settings, 2 * RELIT_SAMPLES);
        let mut strip = RelitStrip {
            light: "novel lighting".into(),
            environment: Some(truth.environment.radiance.clone()),
            pictures: Vec::new(),
        };
        for (view, picture) in &truth.pictures {
            let camera = &scene.views[*view].camera;
            let halves = in_halves(&own_settings, |settings| {
                relit(surface, own, &truth.environment, camera, *view, settings, stop)
            });
            go_on(stop)?;
            let pictures = halves.each_ref().map(|half| &half.radiance);
            let states = scene.views[*view].states.clone();
            let coverage = fully_covered(&halves);
            errors.push(score_halves(picture, pictures, &states, Some(&coverage), exposure_of(scene))?);
            if strip.pictures.len() < 6 {
                strip.pictures.push(RelitPicture {
                    caption: scene.views[*view].name.clone(),
                    picture: mean_of(pictures),
                    truth: Some(picture.clone()),
                });
            }
        }
        strips.push(strip);
    }
    // Held-out views first: they are the ones a reader compares.
    let mut order = views_of(uses, ViewUse::HeldOut);
    order.extend(views_of(uses, ViewUse::Training));
    let shown: Vec<usize> = order.iter().copied().step_by((order.len() / 3).max(1)).take(3).collect();
    let relight_settings =
        PictureSettings { background_visible: true, ..picture_settings(scene, settings, RELIT_SAMPLES) };
    let turned =
        |degrees: f32| (format!("the estimated environment rotated by {degrees} degrees"), degrees.to_radians());
    let mut lights = Vec::new();
    for sky in BuiltInSky::ALL {
        let sky = light_of(sky.name(), settings.fit.environment_height.max(64))?;
        lights.push((format!("built-in sky: {}", sky.name), matched(&sky.environment, &result.environment).0));
    }
    for (name, radians) in [turned(90.0), turned(180.0)] {
        lights.push((name, result.environment.rotated_about_up(radians)));
    }
    for (name, light) in lights {
        let mut strip = RelitStrip { light: name, environment: Some(light.radiance.clone()), pictures: Vec::new() };
        for &view in &shown {
            let level = scene.views[view].camera.level_within(RELIT_PIXELS);
            let camera = scene.views[view].camera.shrunk(1 << level);
            let picture = relit(surface, own, &light, &camera, view, &relight_settings, stop);
            go_on(stop)?;
            let caption = scene.views[view].name.clone();
            strip.pictures.push(RelitPicture { caption, picture: picture.radiance, truth: None });
        }
        strips.push(strip);
    }
    Ok((strips, errors))
}
