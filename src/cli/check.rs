//! `patina check`: what was understood of a scene, on a page, and what would spoil a fit of it.

use super::arguments::CheckOptions;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file;
use crate::insight::report::number;
use crate::job::ask::Ask;
use crate::scene::doctor::{self, Report, lights::LightKind};
use crate::scene::read::{self, Understood};
use crate::scene::{self, Scene};
use crate::trace::Bvh;
use std::path::Path;

/// The picture of all photos in the folder of outlines.
const CONTACT_SHEET: &str = "contact_sheet.png";

/// Refuses a folder whose pictures a reader would take for photos or masks of the scene.
fn refuse_folder_of_photos(output: &Path, scene: &Path) -> Result<()> {
    let real = |path: &Path| std::fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    let Ok(output) = real(output) else { return Ok(()) };
    let folders = crate::scene::read::picture_folders(scene)?;
    if folders.iter().any(|folder| real(folder).is_ok_and(|folder| folder == output)) {
        return Err(Error::new(ErrorKind::InvalidSetting, "the folder holds the photos or masks of the scene")
            .at(Place::File(output))
            .remedy("name another folder with --output: its pictures would be read as photos the next time"));
    }
    Ok(())
}

/// Checks a scene and prints what was found.
pub fn check(options: &CheckOptions, json: bool) -> Result<()> {
    if let Some(output) = &options.output {
        refuse_folder_of_photos(output, &options.scene)?;
    }
    let settings = options.read.settings();
    let scene = scene::read(&options.scene, &settings)?;
    let understood = read::understand(&options.scene, &settings, &scene)?;
    let bvh = Bvh::build(&scene.mesh.positions, &scene.mesh.triangles)?;
    let report = doctor::check_with(&scene, &bvh);
    let ask = Ask::of(&scene, &report);
    if json {
        println!(
            "{}",
            serde_json::json!({"event": "check", "understood": understood, "findings": report.findings,
            "views": report.views, "texels_resolved": report.texels_resolved,
            "texels_resolved_sharpest": report.texels_resolved_sharpest, "surface": report.surface,
            "agreement": report.agreement, "light": report.light, "pixel_centre": report.pixel_centre, "ask": ask})
        );
    } else {
        print_page(&scene, &understood, &report, &ask);
    }
    if let Some(folder) = &options.output {
        for (index, view) in scene.views.iter().enumerate() {
            let picture = doctor::overlay(&scene, &bvh, index);
            file::write_png_srgb8(&folder.join(format!("{}_outline.png", view.name)), &picture)?;
        }
        file::write_png_srgb8(&folder.join(CONTACT_SHEET), &doctor::contact_sheet(&scene, &bvh))?;
        if !json {
            println!("outlines over the photos: {}, all at a glance in {CONTACT_SHEET}", folder.display());
        }
    }
    if report.is_fatal() {
        return Err(Error::new(ErrorKind::InvalidScene, "a fit of this scene cannot work")
            .remedy("fix what is marked fatal above"));
    }
    Ok(())
}

fn print_page(scene: &Scene, understood: &Understood, report: &Report, ask: &Ask) {
    println!("{}", scene.name);
    println!("{understood}");
    if let Some(measured) = &report.pixel_centre {
        println!("centres     pixel centres are at {}; (0.5, 0.5) is right", measured.in_words());
    }
    if let Some(texels) = report.texels_resolved {
        let texels = number::whole(texels as u64);
        println!("detail      the photos resolve {texels} texels of the surface: maps of {0} x {0}", ask.map_size);
    }
    if let Some(agreement) = report.agreement {
        println!("agreement   photos agree by {agreement:.2} where they show the same surface (1 is alike)");
    }
    if let Some(light) = &report.light {
        let share = 100.0 * light.of_each;
        match light.kind() {
            LightKind::One if light.is_all_explained() => println!(
                "light       one for all photos: their shading differs from it by {:.1} %",
                100.0 * light.one_light_residual
            ),
            LightKind::One => println!(
                "light       one for all photos: another for each would explain {share:.0} % of what differs in shading"
            ),
            LightKind::WithCamera => println!("light       turns with the camera: see light-turns-with-camera below"),
            LightKind::InGroups | LightKind::InAnyGroups => {
                println!("light       differs between groups of photos: see light-in-groups below")
            }
            LightKind::OfEach => println!("light       differs from photo to photo: see light-differs below"),
        }
    }
    let minutes = (ask.processor_seconds as f64 / 60.0).ceil();
    let memory = number::memory(ask.memory_mib << 20);
    println!("needs       a fit on its defaults at most some {memory} of memory and {minutes} processor minutes");
    println!("findings    {}", count_of(&report.findings));
    for finding in &report.findings {
        println!("{finding}");
    }
}

/// How many findings there are of each severity.
fn count_of(findings: &[Finding]) -> String {
    let count = |severity| findings.iter().filter(|finding| finding.severity == severity).count();
    let named = |count: usize, one: &str, many: &str| match count {
        0 => None,
        1 => Some(format!("1 {one}")),
        count => Some(format!("{count} {many}")),
    };
    let parts: Vec<String> = [
        named(count(Severity::Fatal), "fatal", "fatal"),
        named(count(Severity::Warning), "warning", "warnings"),
        named(count(Severity::Note), "note", "notes"),
    ]
    .into_iter()
    .flatten()
    .collect();
    if parts.is_empty() { "none".into() } else { parts.join(", ") }
}
