//! `patina relight`, `render` and `compare`.

use super::arguments::{CompareOptions, Layer, ReadOptions, RelightOptions, RenderOptions};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::export::RunFolder;
use crate::files::unrepeated;
use crate::fit::views::{ViewUse, uses_of};
use crate::image::file;
use crate::insight::scores::{aggregate, score_halves};
use crate::job::benchmark::Drawing;
use crate::job::pictures::{OpenedLight, light_of, matched, parameters_of_truth, relit, surface_of};
use crate::job::prepare::RunSettings;
use crate::job::regions;
use crate::job::shown::{exposure_of, fully_covered, in_halves};
use crate::render::measured_regions::render_regions;
use crate::render::picture::{Picture, PictureSettings, layers, render as render_picture};
use crate::render::{Parameters, Surface};
use crate::scene::{Background, Scene};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The scene whose cameras a command uses, read as the run read its own but for what was typed.
fn camera_scene(folder: &RunFolder, given: Option<&Path>, typed: &ReadOptions) -> Result<(Scene, RunSettings)> {
    let settings: RunSettings = folder.read_settings()?;
    let path = given.map_or_else(|| settings.scene.clone(), Path::to_path_buf);
    if path.as_os_str().is_empty() {
        let seed = settings.fit.seed;
        let demo = crate::scene::demo::build(&crate::scene::demo::DemoSettings { seed, ..Default::default() })?;
        let (mut scene, read) = (demo.scene, typed.settings());
        read.validate()?;
        scene.views.iter_mut().for_each(|view| view.camera = view.camera.shrunk(read.shrink));
        return Ok((scene, settings));
    }
    let read = typed.over(settings.read.clone());
    Ok((crate::scene::read(&path, &read)?, settings))
}

/// Indices of the named views; `otherwise` chooses when none is named.
fn chosen_views(scene: &Scene, names: &[String], otherwise: impl Fn(&Scene) -> Vec<usize>) -> Result<Vec<usize>> {
    if names.is_empty() {
        return Ok(otherwise(scene));
    }
    names
        .iter()
        .map(|name| {
            scene.view_named(name).ok_or_else(|| {
                Error::new(ErrorKind::InvalidSetting, format!("the scene has no view named {name}"))
                    .at(Place::Setting("views".into()))
                    .remedy("names are those of the photos, with or without their ending")
            })
        })
        .collect()
}

/// Says that a picture is written: its path, or an event with it.
fn tell_written(path: &Path, json: bool) {
    match json {
        true => println!("{}", serde_json::json!({"event": "written", "path": path})),
        false => println!("{}", path.display()),
    }
}

/// Says what was noticed, a line each.
pub(super) fn tell_findings(findings: &[Finding], json: bool) {
    for finding in findings {
        match json {
            true => println!("{}", serde_json::json!({"event": "finding", "finding": finding})),
            false => eprintln!("{finding}"),
        }
    }
}

/// Says that pixels of a picture were not finite, if any were: they are black in it.
fn tell_non_finite(picture: &Picture, name: &str, json: bool) {
    if picture.non_finite_pixels > 0 {
        let message = format!("{} pixels of {name} were not finite and are black", picture.non_finite_pixels);
        let finding = Finding::new(Severity::Warning, "picture-not-finite", message)
            .remedy("the light or the maps hold numbers too large to trace: look at them, or lower the light");
        tell_findings(&[finding], json);
    }
}

/// Renders a run under other lights.
pub fn relight(options: &RelightOptions, json: bool) -> Result<()> {
    let folder = RunFolder::open(&options.run)?;
    let (scene, settings) = camera_scene(&folder, options.cameras.as_deref(), &options.read)?;
    let result = folder.read_result()?;
    let (surface, own) = surface_of(&result)?;
    let output = options.output.clone().unwrap_or_else(|| folder.path().join("relight"));
    let views = chosen_views(&scene, &options.views, |scene| {
        let held_out: Vec<usize> = (0..scene.views.len()).filter(|&view| scene.views[view].held_out).take(4).collect();
        if held_out.is_empty() { (0..scene.views.len().min(4)).collect() } else { held_out }
    })?;
    let picture_settings = PictureSettings {
        samples: options.samples,
        max_bounces: options.bounces,
        background_visible: !options.hide_background,
        background_blur_degrees: options.background_blur,
        ground: if options.ground { surface.mesh().bounds().map(|(low, _)| low.y) } else { None },
        two_sided: scene.truth.is_none(),
        lobe_strength: if settings.fit.has_lobe() { 1.0 } else { 0.0 },
        ..Default::default()
    };
    let regions = regions::read(&options.material, &options.region, options.library.as_deref())?;
    let regions = regions.map(|(regions, findings)| {
        tell_findings(&findings, json);
        regions
    });
    let lights = options.env.iter().map(|name| light_of(name, 256)).collect::<Result<Vec<_>>>()?;
    let names: Vec<String> = lights.iter().map(|light| light.name.clone()).collect();
    lights.iter().for_each(|light| tell_findings(&light.findings, json));
    for (stem, light) in unrepeated(&names).into_iter().zip(lights) {
        let light = light.environment.rotated_about_up(options.rotate.to_radians());
        let light = if options.absolute { light } else { matched(&light, &result.environment).0 };
        if let Some(frames) = options.turntable.turntable {
            let Some(&first) = views.first() else {
                return Err(Error::new(ErrorKind::InvalidScene, "the scene has no view for the camera to start from")
                    .remedy("name a scene with cameras: --cameras SCENE"));
            };
            let start = scene.views[first].camera;
            let lit = Parameters::new(own.texels.clone(), &light);
            let folder = output.join(format!("turntable_{stem}"));
            let (turn, exposure, picture) = (&options.turntable, options.exposure, &picture_settings);
            let regions = regions.as_ref();
            let written =
                super::turntable::write(&folder, &surface, &lit, regions, &start, turn, frames, picture, exposure)?;
            written.iter().for_each(|path| tell_written(path, json));
            continue;
        }
        for &view in &views {
            let camera = scene.views[view].camera;
            let stop = AtomicBool::new(false);
            let picture = match &regions {
                Some(regions) => {
                    let lit = Parameters::new(own.texels.clone(), &light);
                    render_regions(&surface, &camera, &lit, regions, view as u32, &picture_settings, &stop)
                }
                None => relit(&surface, &own, &light, &camera, view, &picture_settings, &stop),
            };
            tell_non_finite(&picture, &scene.views[view].name, json);
            // Names of photos and lights may hold dots: nothing after one is an extension.
            let path = |extension: &str| output.join(format!("{}_{stem}.{extension}", scene.views[view].name));
            file::write_exr_rgb(&path("exr"), &picture.radiance)?;
            let bytes = file::srgb8_from_linear(&picture.radiance, options.exposure);
            file::write_png_srgb8(&path("png"), &bytes)?;
            tell_written(&path("png"), json);
        }
    }
    Ok(())
}

/// That a background is to be blurred where none is drawn.
fn blur_without_effect(degrees: f32, background: Background, is_lit: bool) -> Option<Finding> {
    let why = match (background, is_lit) {
        _ if degrees == 0.0 => return None,
        (Background::Environment, true) => return None,
        (Background::Environment, false) => "no layer is lit",
        (Background::Black, _) => "the scene has no background",
    };
    let message = format!("{why}: --background-blur has no effect");
    Some(Finding::new(Severity::Warning, "blur-without-effect", message).remedy(match background {
        Background::Environment => "leave it out, or add --aov shaded",
        Background::Black => "leave it out, or show the environment with --scene-background environment",
    }))
}

/// Renders pictures and layers of a run, or of the truth of an exchange folder.
pub fn render(options: &RenderOptions, json: bool) -> Result<()> {
    let is_run = RunFolder::open(&options.run).is_ok_and(|folder| folder.is_run());
    let (scene, surface, mut own, strength) = if is_run {
        let folder = RunFolder::open(&options.run)?;
        let (scene, settings) = camera_scene(&folder, options.cameras.as_deref(), &options.read)?;
        let (surface, own) = surface_of(&folder.read_result()?)?;
        (scene, surface, own, if settings.fit.has_lobe() { 1.0 } else { 0.0 })
    } else {
        let (scene, surface, own) = truth_of(&options.run, options)?;
        (scene, surface, own, 1.0)
    };
    if let Some(name) = &options.env {
        let OpenedLight { environment: light, findings, .. } = light_of(name, 256)?;
        tell_findings(&findings, json);
        own.light = light.radiance.pixels().iter().map(|radiance| radiance.to_array()).collect();
        own.environment_size = (light.width(), light.height());
    }
    let output = options.output.clone().unwrap_or_else(|| options.run.join("render"));
    let groups = if options.aov.contains(&Layer::Variance) { 8 } else { 1 };
    let picture_settings = PictureSettings {
        samples: options.samples.div_ceil(groups),
        groups,
        max_bounces: options.bounces,
        background_visible: !options.hide_background && scene.background == Background::Environment,
        background_blur_degrees: options.background_blur,
        two_sided: scene.truth.is_none(),
        lobe_strength: strength,
        seed: options.seed,
        ..Default::default()
    };
    let is_lit = options.aov.iter().any(|layer| matches!(layer, Layer::Shaded | Layer::Variance));
    tell_findings(blur_without_effect(options.background_blur, scene.background, is_lit).as_slice(), json);
    for view in chosen_views(&scene, &options.views, |scene| (0..scene.views.len()).collect())? {
        let camera = &scene.views[view].camera;
        let name = &scene.views[view].name;
        let path = |layer: &str| output.join(format!("{name}_{layer}.exr"));
        let shaded = is_lit
            .then(|| render_picture(&surface, camera, &own, view as u32, &picture_settings, &AtomicBool::new(false)));
        if let Some(picture) = &shaded {
            tell_non_finite(picture, name, json);
        }
        let flat = layers(&surface, camera, &own, 16);
        for layer in &options.aov {
            match (layer, &shaded) {
                (Layer::Shaded, Some(picture)) => file::write_exr_rgb(&path("shaded"), &picture.radiance)?,
                (Layer::Variance, Some(picture)) => {
                    if let Some(variance) = &picture.variance {
                        file::write_exr_rgb(&path("variance"), variance)?;
                    }
                }
                (Layer::Diffuse, _) => file::write_exr_rgb(&path("diffuse"), &flat.diffuse)?,
                (Layer::Specular, _) => file::write_exr_rgb(&path("specular"), &flat.specular)?,
                (Layer::Roughness, _) => file::write_exr_grey(&path("roughness"), &flat.roughness)?,
                (Layer::Normal, _) => file::write_exr_rgb(&path("normal"), &flat.normal)?,
                (Layer::Coverage, _) => file::write_exr_grey(&path("coverage"), &flat.coverage)?,
                (Layer::Shaded | Layer::Variance, None) => {}
            }
        }
        match json {
            true => println!("{}", serde_json::json!({"event": "written", "view": name, "folder": output})),
            false => println!("{name}"),
        }
    }
    Ok(())
}

fn truth_of(path: &Path, options: &RenderOptions) -> Result<(Scene, Surface, Parameters<f32>)> {
    let scene = crate::scene::read(path, &options.read.settings())?;
    let Some(truth) = &scene.truth else {
        return Err(Error::new(ErrorKind::Missing, "neither a run nor a scene with its truth")
            .at(Place::File(path.into()))
            .remedy("name a run folder made by `patina fit` or `patina demo`"));
    };
    let own = parameters_of_truth(truth);
    let surface = Surface::new(scene.mesh.clone())?;
    Ok((scene, surface, own))
}

/// Scores a run against the photographs of a scene, at their full size.
pub fn compare(options: &CompareOptions, json: bool) -> Result<()> {
    let folder = RunFolder::open(&options.run)?;
    let settings: RunSettings = folder.read_settings()?;
    // As the run read it: views that it held out are those that judge it.
    let scene = crate::scene::read(&options.scene, &options.read.over(settings.read.clone()))?;
    let (surface, own) = surface_of(&folder.read_result()?)?;
    let picture_settings = PictureSettings {
        samples: options.samples,
        max_bounces: options.bounces.unwrap_or(settings.fit.bounces),
        background_visible: scene.background == Background::Environment,
        two_sided: scene.truth.is_none(),
        lobe_strength: if settings.fit.has_lobe() { 1.0 } else { 0.0 },
        ..Default::default()
    };
    if let Some(protocol) = options.protocol {
        let drawing = Drawing { surface: &surface, own: &own, settings: picture_settings };
        return super::benchmark::compare(protocol, &options.scene, &scene, &drawing, json);
    }
    let mut scored = Vec::new();
    let uses = uses_of(&scene, &settings.fit.exclude);
    for (index, (view, kind)) in scene.views.iter().zip(uses).enumerate() {
        let halves = in_halves(&picture_settings, |settings| {
            render_picture(&surface, &view.camera, &own, index as u32, settings, &AtomicBool::new(false))
        });
        let photo = view.photo.to_linear();
        let pictures = halves.each_ref().map(|half| &half.radiance);
        let scores = score_halves(&photo, pictures, &view.states, Some(&fully_covered(&halves)), exposure_of(&scene))?;
        if json {
            println!(
                "{}",
                serde_json::json!({"event": "view", "view": view.name, "held_out": view.held_out, "use": kind,
                "scores": scores})
            );
        } else {
            let kind = kind.label();
            println!(
                "{:12} {kind}: RMSE {:.4}, PSNR {:.2} dB, SSIM {:.3} (aligned {:.4}, {:.2} dB, {:.3})",
                view.name,
                scores.raw.rmse_linear,
                scores.raw.psnr_srgb_db,
                scores.raw.ssim_srgb,
                scores.aligned.rmse_linear,
                scores.aligned.psnr_srgb_db,
                scores.aligned.ssim_srgb
            );
        }
        scored.push((kind, scores));
    }
    for (name, kind) in [("held-out views", ViewUse::HeldOut), ("training views", ViewUse::Training)] {
        let of_kind: Vec<_> = scored.iter().filter(|(own, _)| *own == kind).map(|(_, scores)| scores).collect();
        if of_kind.is_empty() {
            continue;
        }
        let score = aggregate(of_kind);
        if json {
            println!("{}", serde_json::json!({"event": "aggregate", "name": name, "score": score}));
        } else {
            println!(
                "{name}: RMSE {:.4}, PSNR {:.2} dB, SSIM {:.3}; scale-aligned {:.4}, {:.2} dB, {:.3}",
                score.raw.rmse_linear,
                score.raw.psnr_srgb_db,
                score.raw.ssim_srgb,
                score.aligned.rmse_linear,
                score.aligned.psnr_srgb_db,
                score.aligned.ssim_srgb
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blur_of_no_background_is_told() {
        let told =
            |degrees, background, is_lit| blur_without_effect(degrees, background, is_lit).map(|own| own.message);
        assert_eq!(told(20.0, Background::Environment, true), None);
        assert_eq!(told(0.0, Background::Black, false), None);
        assert!(told(20.0, Background::Black, true).is_some_and(|message| message.contains("--background-blur")));
        assert!(told(20.0, Background::Environment, false).is_some_and(|message| message.contains("no layer")));
    }
}
