//! What a finished fit leaves behind: maps, scores, pictures, report.

use super::pictures::{light_of, matched, parameters, relit};
use super::prepare::{Prepared, RunSettings, covered, timed};
use crate::atlas::{AtlasQuality, dilate, nearest_covered};
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::export::{LossRow, RunFolder, RunResult};
use crate::fit::settings::BackgroundEvidence;
use crate::fit::state::FitState;
use crate::fit::targets::Target;
use crate::fit::views::views_of;
use crate::fit::{Fitter, ViewUse};
use crate::image::{GreyImage, Image, RgbImage};
use crate::insight::report::data::{
    Fact, NamedAggregate, NonFiniteCount, ReportData, SettingLine, StageTime, TexelCounts, TruthErrors, ViewLine,
};
use crate::insight::report::{RelitPicture, RelitStrip, ReportImages, ViewPictures, write_report};
use crate::insight::scores::{ViewScores, aggregate, score_view};
use crate::insight::truth::{environment_errors, map_errors};
use crate::insight::{coverage, memory};
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::render::picture::{PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::{Background, PixelState, Scene};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Pixels of a held-out view in the report, at most; larger photos are halved first.
const HELD_OUT_PIXELS: usize = 400_000;
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

/// The loss history as the run folder keeps it.
pub fn loss_rows(state: &FitState) -> Vec<LossRow> {
    let row = |row: &crate::fit::LossRow| LossRow {
        step: row.step as u64,
        stage: row.stage.clone(),
        seconds: row.seconds,
        loss: row.loss,
        image_loss: row.image_loss,
        mvcl: row.consistency,
        surface_rmse: row.surface_rmse,
        held_out_rmse: row.held_out_rmse,
    };
    state.losses.iter().map(row).collect()
}

/// A view at the size the report shows, with its score.
struct ScoredView {
    index: usize,
    kind: ViewUse,
    scores: ViewScores,
    pictures: ViewPictures,
}

/// Renders, scores and writes everything into the run folder; returns what the report says.
pub fn write(
    fitter: &Fitter,
    mut prepared: Prepared,
    settings: &RunSettings,
    folder: &RunFolder,
    began: Instant,
    stop: &AtomicBool,
    tell: &dyn Fn(&str),
) -> Result<ReportData> {
    let scene = fitter.scene().as_ref();
    let surface = fitter.surface().as_ref();
    let mut timings = std::mem::take(&mut prepared.timings);
    // The clock of the job began after these, and after earlier sessions of a resumed fit.
    let before_job: f64 = timings.iter().filter(|time| time.stage != "fit").map(|time| time.seconds).sum();
    tell("maps");
    let training = views_of(fitter.view_uses(), ViewUse::Training);
    let times_seen =
        timed(&mut timings, "coverage", || coverage::times_seen_by(scene, surface, &training, settings.fit.map_size));
    let covered = covered(surface, settings.fit.map_size);
    let maps = fill_outside(&fitter.maps(), &times_seen, &covered);
    let environment = fitter.environment();
    let result = RunResult { maps, environment, mesh: surface.mesh().clone(), times_seen };
    timed(&mut timings, "write maps", || folder.write_result(&result))?;
    folder.write_loss(&loss_rows(fitter.state()))?;

    tell("pictures of the views");
    let own = parameters(&result.maps, &result.environment);
    let views = timed(&mut timings, "score views", || score_views(fitter, surface, &own, settings, stop))?;
    tell("relit pictures");
    let (relit, relit_errors) =
        timed(&mut timings, "relight", || relit_strips(fitter, surface, &own, &result, settings, stop))?;
    if stop.load(Ordering::Relaxed) {
        return Err(Error::new(ErrorKind::Stopped, "stopped while the report was made")
            .remedy("the maps are written; `patina resume` makes the report"));
    }

    let mut data = describe(fitter, &prepared, settings, &result, &covered);
    data.views = views
        .iter()
        .map(|view| {
            let gain = f64::from(fitter.state().log_gains[view.index].exp());
            let line = ViewLine::new(&view.pictures.name, view.pictures.held_out, &view.scores, gain);
            ViewLine { left_out: view.kind == ViewUse::LeftOut, ..line }
        })
        .collect();
    for (name, kind) in [("held-out views", ViewUse::HeldOut), ("training views", ViewUse::Training)] {
        let of_kind: Vec<_> = views.iter().filter(|view| view.kind == kind).collect();
        if !of_kind.is_empty() {
            let score = aggregate(of_kind.iter().map(|view| &view.scores));
            data.aggregates.push(NamedAggregate { name: name.into(), score });
        }
    }
    data.truth = truth_errors(scene, surface, &result.maps, &result.environment)?;
    if let Some(truth) = data.truth.as_mut().filter(|_| !relit_errors.is_empty()) {
        truth.relit = Some(aggregate(&relit_errors));
    }
    let named: f64 = timings.iter().map(|time| time.seconds).sum();
    let rest = (began.elapsed().as_secs_f64() + before_job - named).max(0.0);
    timings.push(StageTime { stage: "other".into(), seconds: rest });
    data.timings = timings;
    data.peak_memory_bytes = memory::peak_bytes();

    tell("report");
    let truth = scene.truth.as_ref();
    let images = ReportImages {
        // What was left out is no evidence of how good the fit is: its scores are listed, its pictures are not shown.
        views: views.into_iter().filter(|view| view.kind != ViewUse::LeftOut).map(|view| view.pictures).collect(),
        exposure_stops: exposure_of(scene),
        maps: Some(&result.maps),
        truth_maps: truth.map(|truth| &truth.maps).filter(|maps| !maps.diffuse.pixels().is_empty()),
        times_seen: Some(&result.times_seen),
        environment: Some(&result.environment),
        truth_environment: truth.map(|truth| &truth.environment),
        relit,
    };
    write_report(folder, &data, &images)?;
    Ok(data)
}

/// Texels outside every chart, and those inside that no photograph saw, take the value of the nearest texel that one
/// saw, so that no filter reads junk; `seen.exr` tells which they are.
fn fill_outside(maps: &MaterialMaps, times_seen: &GreyImage, covered: &Image<bool>) -> MaterialMaps {
    let seen = Image::from_fn(covered.width(), covered.height(), |row, column| {
        covered[(row, column)] && times_seen[(row, column)] > 0.0
    });
    if !seen.pixels().iter().any(|&seen| seen) {
        return maps.clone();
    }
    let nearest = nearest_covered(&seen);
    let filled = |index: usize| seen.pixels()[index];
    fn join<T: Clone>(own: &Image<T>, grown: Image<T>, keep: impl Fn(usize) -> bool) -> Image<T> {
        let pixels = own.pixels().iter().zip(grown.pixels()).enumerate();
        let pixels = pixels.map(|(index, (own, grown))| if keep(index) { own.clone() } else { grown.clone() });
        Image::from_pixels(own.width(), own.height(), pixels.collect())
    }
    MaterialMaps {
        diffuse: join(&maps.diffuse, dilate(&maps.diffuse, &nearest), filled),
        specular: join(&maps.specular, dilate(&maps.specular, &nearest), filled),
        roughness: join(&maps.roughness, dilate(&maps.roughness, &nearest), filled),
    }
}

/// The level at which a view has at most so many pixels.
fn level_of(scene: &Scene, view: usize, most_pixels: usize) -> usize {
    let camera = &scene.views[view].camera;
    (0..12).find(|level| (camera.width >> level) * (camera.height >> level) <= most_pixels).unwrap_or(12)
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

fn score_views(
    fitter: &Fitter,
    surface: &Surface,
    own: &Parameters<f32>,
    settings: &RunSettings,
    stop: &AtomicBool,
) -> Result<Vec<ScoredView>> {
    let scene = fitter.scene().as_ref();
    let mut scored = Vec::with_capacity(scene.views.len());
    for (index, (view, &kind)) in scene.views.iter().zip(fitter.view_uses()).enumerate() {
        let (most, samples) = match kind {
            ViewUse::HeldOut => (HELD_OUT_PIXELS, HELD_OUT_SAMPLES),
            ViewUse::Training | ViewUse::LeftOut => (TRAINING_PIXELS, TRAINING_SAMPLES),
        };
        let picture_settings = picture_settings(scene, settings, samples);
        let target = Target::new(scene, index, level_of(scene, index, most));
        let gain = fitter.state().log_gains[index].exp();
        let mut picture = render(surface, &target.camera, own, index as u32, &picture_settings, stop);
        picture.radiance.pixels_mut().iter_mut().for_each(|pixel| *pixel *= gain);
        let (width, height) = (target.camera.width, target.camera.height);
        let pixel = |row: usize, column: usize| target.at(scene, row * width + column);
        let photo: RgbImage = Image::from_fn(width, height, |row, column| pixel(row, column).0);
        let states: Image<PixelState> = Image::from_fn(width, height, |row, column| pixel(row, column).1);
        let coverage = picture.coverage.map(|&coverage| coverage >= 0.999);
        let scores = score_view(&photo, &picture.radiance, &states, Some(&coverage), exposure_of(scene))?;
        let counted = crate::insight::scores::counted_pixels(&states, Some(&coverage));
        let pictures = ViewPictures {
            name: view.name.clone(),
            held_out: view.held_out,
            photo,
            fit: picture.radiance,
            counted: Some(counted),
        };
        scored.push(ScoredView { index, kind, scores, pictures });
    }
    Ok(scored)
}

/// Stops that bring photographs without an exposure of their own to a visible range: 0 for 8-bit photographs.
pub fn exposure_of(scene: &Scene) -> f32 {
    let Some(view) = scene.views.first() else { return 0.0 };
    if matches!(view.photo, crate::scene::Photo::Srgb8(_)) {
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
fn relit_strips(
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
            light: "a light that no photo shows".into(),
            environment: Some(truth.environment.radiance.clone()),
            pictures: Vec::new(),
        };
        for (view, picture) in &truth.pictures {
            let camera = &scene.views[*view].camera;
            let ours = relit(surface, own, &truth.environment, camera, *view, &own_settings, stop);
            let states = scene.views[*view].states.clone();
            let coverage = ours.coverage.map(|&coverage| coverage >= 0.999);
            errors.push(score_view(picture, &ours.radiance, &states, Some(&coverage), exposure_of(scene))?);
            if strip.pictures.len() < 6 {
                strip.pictures.push(RelitPicture {
                    caption: scene.views[*view].name.clone(),
                    picture: ours.radiance,
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
    let turned = |degrees: f32| (format!("the fitted light turned by {degrees} degrees"), degrees.to_radians());
    let mut lights = Vec::new();
    for name in ["noon", "evening", "overcast"] {
        let (name, light) = light_of(name, settings.fit.environment_height.max(64))?;
        lights.push((format!("built-in sky: {name}"), matched(&light, &result.environment).0));
    }
    for (name, radians) in [turned(90.0), turned(180.0)] {
        lights.push((name, result.environment.rotated_about_up(radians)));
    }
    for (name, light) in lights {
        let mut strip = RelitStrip { light: name, environment: Some(light.radiance.clone()), pictures: Vec::new() };
        for &view in &shown {
            let level = level_of(scene, view, RELIT_PIXELS);
            let camera = scene.views[view].camera.shrunk(1 << level);
            let picture = relit(surface, own, &light, &camera, view, &relight_settings, stop);
            let caption = scene.views[view].name.clone();
            strip.pictures.push(RelitPicture { caption, picture: picture.radiance, truth: None });
        }
        strips.push(strip);
    }
    Ok((strips, errors))
}

/// Whether the fit kept the texture coordinates the mesh came with, so that its maps lie on those of the truth.
fn same_atlas(scene: &Scene, surface: &Surface) -> bool {
    let (before, after) = (&scene.mesh, surface.mesh());
    !before.uvs.is_empty()
        && before.triangles.len() == after.triangles.len()
        && before.triangles.iter().zip(&after.triangles).all(|(before_corners, after_corners)| {
            (0..3).all(|corner| {
                let (a, b) = (before.uvs[before_corners[corner] as usize], after.uvs[after_corners[corner] as usize]);
                (a - b).abs().max_element() < 1e-5
            })
        })
}

/// Errors of maps and light against the truth of a scene, without relit pictures; `None` where no truth is known. Maps
/// are compared only where they lie on the texture coordinates of the truth.
pub(super) fn truth_errors(
    scene: &Scene,
    surface: &Surface,
    maps: &MaterialMaps,
    environment: &Environment,
) -> Result<Option<TruthErrors>> {
    let Some(truth) = &scene.truth else { return Ok(None) };
    let mut errors = TruthErrors::default();
    let size = (truth.texels_seen.width(), truth.texels_seen.height());
    if same_atlas(scene, surface) && size == (truth.maps.diffuse.width(), truth.maps.diffuse.height()) {
        let fitted = resampled(maps, size);
        errors.maps = Some(map_errors(&fitted, &truth.maps, &truth.texels_seen)?);
    }
    let light = &truth.environment;
    errors.environment = Some(environment_errors(&environment.resampled(light.width(), light.height()), light)?);
    Ok(Some(errors))
}

/// Maps read at the texel centres of another size.
fn resampled(maps: &MaterialMaps, (width, height): (usize, usize)) -> MaterialMaps {
    if (maps.diffuse.width(), maps.diffuse.height()) == (width, height) {
        return maps.clone();
    }
    use crate::material::texels::{maps_from_texels, texels_from_maps};
    let own = TexelImage { texels: texels_from_maps(maps), width: maps.diffuse.width(), height: maps.diffuse.height() };
    let texels = (0..width * height).map(|index| own.at(index, width, height)).collect::<Vec<_>>();
    maps_from_texels(&texels, width, height)
}

struct TexelImage {
    texels: Vec<crate::material::texels::Texel<f32>>,
    width: usize,
    height: usize,
}

impl TexelImage {
    /// Mean over the texels that a texel of another size covers, or the nearest one.
    fn at(&self, index: usize, width: usize, height: usize) -> crate::material::texels::Texel<f32> {
        let (row, column) = (index / width, index % width);
        let range = |place: usize, size: usize, own: usize| {
            let first = place * own / size;
            first..((place + 1) * own / size).max(first + 1).min(own)
        };
        let mut sum = [0.0; 8];
        let mut count = 0.0;
        for row in range(row, height, self.height) {
            for column in range(column, width, self.width) {
                let texel = &self.texels[row * self.width + column];
                sum.iter_mut().zip(texel).for_each(|(sum, value)| *sum += value);
                count += 1.0;
            }
        }
        sum.map(|sum| sum / count)
    }
}

fn describe(
    fitter: &Fitter,
    prepared: &Prepared,
    settings: &RunSettings,
    result: &RunResult,
    covered: &Image<bool>,
) -> ReportData {
    let scene = fitter.scene();
    let count = |kind| fitter.view_uses().iter().filter(|own| **own == kind).count();
    let left_out = match count(ViewUse::LeftOut) {
        0 => String::new(),
        count => format!(", {count} left out"),
    };
    let fact = |name: &str, value: String| Fact { name: name.into(), value };
    let mut scene_facts = vec![
        fact("triangles", surface_size(fitter)),
        fact("views", format!("{} to fit, {} held out{left_out}", count(ViewUse::Training), count(ViewUse::HeldOut))),
    ];
    if let Some(view) = scene.views.first() {
        scene_facts.push(fact("photographs", format!("{} x {} pixels", view.camera.width, view.camera.height)));
    }
    scene_facts.push(fact("maps", format!("{0} x {0} texels", settings.fit.map_size)));
    if let Some(quality) = &prepared.quality {
        scene_facts.extend(atlas_facts(quality));
    }
    let mut findings: Vec<Finding> = prepared.findings.clone();
    findings.extend(fitter.findings());
    if !settings.fit.has_lobe() {
        findings.push(Finding::new(Severity::Note, "no-lobe", "the specular lobe was left out: no step frees it"));
    }
    let seen = |times: f32, covered: bool| covered && times > 0.0;
    let pixels = || result.times_seen.pixels().iter().zip(covered.pixels());
    let seen_count = pixels().filter(|(times, covered)| seen(**times, **covered)).count() as u64;
    let covered_count = covered.pixels().iter().filter(|&&covered| covered).count() as u64;
    ReportData {
        title: scene.name.clone(),
        program: format!("Patina {}", env!("CARGO_PKG_VERSION")),
        scene_facts,
        settings: settings
            .fit
            .listed()
            .into_iter()
            .map(|(name, value, is_default)| SettingLine { name, value, is_default })
            .collect(),
        findings: findings.iter().map(Into::into).collect(),
        loss_history: loss_rows(fitter.state()),
        gauge_statement: fitter.gauge().sentence().into(),
        evidence_statement: evidence(scene, settings),
        non_finite: fitter
            .state()
            .non_finite
            .iter()
            .map(|(name, count)| NonFiniteCount { name: name.clone(), count: *count })
            .collect(),
        texels: TexelCounts { seen: seen_count, unseen: covered_count - seen_count },
        ..Default::default()
    }
}

fn surface_size(fitter: &Fitter) -> String {
    fitter.surface().mesh().triangles.len().to_string()
}

fn atlas_facts(quality: &AtlasQuality) -> Vec<Fact> {
    let fact = |name: &str, value: String| Fact { name: name.into(), value };
    vec![
        fact("charts", quality.charts.to_string()),
        fact("atlas filled", format!("{:.1} %", 100.0 * quality.share_covered)),
        fact(
            "angle distortion",
            format!("mean {:.3}, worst {:.2}", quality.angle_distortion_mean, quality.angle_distortion_max),
        ),
        fact("area distortion", format!("mean {:.3}", quality.area_distortion_mean)),
        fact("overlapping texels", quality.overlapping_texels.to_string()),
        fact("flipped triangles", quality.flipped_triangles.to_string()),
    ]
}

fn evidence(scene: &Scene, settings: &RunSettings) -> String {
    let background = match (scene.background, settings.fit.background) {
        (Background::Black, _) => "The background is black: pixels without surface say nothing of the light.",
        (Background::Environment, BackgroundEvidence::Use) => {
            "Pixels without surface were used: they show the light itself."
        }
        (Background::Environment, BackgroundEvidence::Ignore) => "Pixels without surface were left out.",
    };
    format!(
        "{background} Clipped channels only push the fit up to the clip, never down; masked and mixed pixels were left \
         out. Scores count unclipped surface pixels; PSNR and SSIM are of sRGB-encoded values."
    )
}
