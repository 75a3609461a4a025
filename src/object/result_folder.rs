//! What an estimation leaves behind, under fixed names.
//!
//! | file | what |
//! |---|---|
//! | `object.json` | model, parameters (codes, then colours), start, gauge, spread, findings; marks the folder |
//! | `settings.toml` | the settings |
//! | `reflectance.binary` | the reflectance as a table of MERL's format |
//! | `env.exr` `env_N.exr` | the light; of the further photos, where each has its own |
//! | `environment_seen.exr` | how much each direction matters to the photos, see [`LightSeen`](super::seen::LightSeen) |
//! | `rerender_N.exr` `relit_N_LIGHT.exr` | the object under the fitted light, and under others |
//! | `loss.csv` | the objective after every step |
//! | `report.html` | all of it to look at |

use super::geometry::Visibility;
use super::inputs::ObjectInputs;
use super::joint::Estimate;
use super::nodes::NodeGrid;
use super::observations::ObjectView;
use super::page::{self, Shown};
use super::picture::render;
use super::prior::LogLight;
use super::progress::write_rows;
use super::result_read::{MARK, SEEN, light_file};
use super::settings::ObjectSettings;
use super::split::{Gauge, SplitSpread};
use super::starts::StartedModel;
use super::transport::TexelDirections;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::file;
use crate::light::Environment;
use crate::measured::table::MeasuredBrdf;
use std::path::Path;

/// Makes the folder, or takes an empty one or one of an earlier estimation.
///
/// # Errors
/// `Unwritable` when it holds other things, or cannot be made.
pub fn prepare(folder: &Path) -> Result<()> {
    if folder.exists() && !folder.join(MARK).is_file() {
        let mut entries = std::fs::read_dir(folder).map_err(|source| Error::writing(folder, source))?;
        if entries.next().is_some() {
            return Err(Error::new(ErrorKind::Unwritable, "the folder holds other files than an estimation's")
                .at(Place::File(folder.into()))
                .remedy("name a new or an empty folder with -o; nothing was changed"));
        }
    }
    std::fs::create_dir_all(folder).map_err(|source| Error::writing(folder, source))
}

/// Renders, and writes everything. `inputs` is what was estimated from; `relights` are other lights with their names.
///
/// # Errors
/// Files that cannot be written.
pub fn write(
    folder: &Path,
    views: &[ObjectView],
    model: &StartedModel,
    estimate: &Estimate,
    settings: &ObjectSettings,
    inputs: &ObjectInputs,
    relights: &[(String, Environment)],
) -> Result<()> {
    let grid = NodeGrid::new(settings.nodes);
    let (width, height) = settings.light_size();
    let directions = TexelDirections::new(width, height)?;
    let environment = estimate.light.environment();
    remove_pictures(folder)?;
    let further: Vec<Environment> = estimate.further_lights.iter().map(LogLight::environment).collect();
    for (photo, light) in std::iter::once(&environment).chain(&further).enumerate() {
        light.write(&folder.join(light_file(photo)))?;
    }
    match &estimate.light_seen {
        Some(seen) => file::write_exr_rgb(&folder.join(SEEN), &seen.sensitivity)?,
        // What an earlier estimation left here is not true of this one; it need not be there.
        None => drop(std::fs::remove_file(folder.join(SEEN))),
    }
    MeasuredBrdf::from_model(model.model.as_ref(), &estimate.parameters).write(&folder.join("reflectance.binary"))?;
    write_rows(&folder.join("loss.csv"), &estimate.rows)?;
    let settings_text = toml::to_string_pretty(settings)
        .map_err(|source| Error::new(ErrorKind::Internal, format!("settings cannot be written: {source}")))?;
    crate::files::write_bytes(&folder.join("settings.toml"), settings_text.as_bytes())?;

    let gauge = Gauge::of(&estimate.light, &grid, &estimate.table);
    let spread = SplitSpread::of(&estimate.candidates);
    let json = serde_json::json!({
        "format": "patina object 1",
        "model": model.model.name(),
        "parameters": estimate.parameters,
        "start": estimate.start,
        "light_unseen_share": estimate.light_seen.as_ref().map(|seen| seen.unseen_share),
        "light_bands": estimate.light_bands,
        "picture_log_rmse": estimate.picture_log_rmse,
        "seconds": estimate.seconds,
        "gauge": gauge,
        "split": spread,
        "followed": estimate.candidates.iter().map(|candidate| serde_json::json!({
            "start": candidate.name, "objective": candidate.total(), "parameters": candidate.parameters,
            "evidence": candidate.evidence,
        })).collect::<Vec<_>>(),
        "findings": estimate.findings,
        "inputs": inputs.absolute(),
    });
    crate::files::write_bytes(&folder.join(MARK), format!("{json:#}\n").as_bytes())?;

    let resampled: Vec<Environment> = relights.iter().map(|(_, light)| light.resampled(width, height)).collect();
    let mut sections = vec![("Found", page::facts(estimate, model.model.name(), &gauge, &spread))];
    let mut galleries = String::new();
    for (index, view) in views.iter().enumerate() {
        let geometry = view.geometry.with_grazing();
        let visibility: Option<Visibility> =
            geometry.visibility(&geometry.pixels, width, height).filter(|_| settings.shadows);
        let own = index.checked_sub(1).and_then(|index| further.get(index)).unwrap_or(&environment);
        let lights: Vec<&Environment> = std::iter::once(own).chain(&resampled).collect();
        let pictures = render(&geometry, visibility.as_ref(), &directions, &grid, &estimate.table, &lights);
        let stops = page::stops_of(&view.photo.radiance);
        let mut shown = vec![
            Shown { caption: format!("photo {}", view.photo.name), picture: &view.photo.radiance, stops },
            Shown { caption: "re-render".into(), picture: &pictures[0], stops },
        ];
        file::write_exr_rgb(&folder.join(format!("rerender_{index}.exr")), &pictures[0])?;
        for ((name, _), picture) in relights.iter().zip(&pictures[1..]) {
            file::write_exr_rgb(&folder.join(format!("relit_{index}_{name}.exr")), picture)?;
            let stops = page::stops_of(picture);
            shown.push(Shown { caption: format!("under {name}"), picture, stops });
        }
        galleries += &page::gallery(&shown, 256)?;
    }
    sections.push(("Photo and pictures", galleries));
    let stops = page::stops_of(&environment.radiance);
    let caption = match further.is_empty() {
        true => "estimated light".to_owned(),
        false => format!("light of {}", views.first().map_or("", |view| &view.photo.name)),
    };
    let mut lights = vec![Shown { caption, picture: &environment.radiance, stops }];
    for (view, light) in views.iter().skip(1).zip(&further) {
        let (caption, picture) = (format!("light of {}", view.photo.name), &light.radiance);
        lights.push(Shown { caption, picture, stops: page::stops_of(picture) });
    }
    if let Some(seen) = &estimate.light_seen {
        let caption = "how much each direction matters to the photos".into();
        lights.push(Shown { caption, picture: &seen.sensitivity, stops: page::stops_of(&seen.sensitivity) });
    }
    sections.push(("Light", page::gallery(&lights, 512)?));
    sections.push(("Objective", page::curve(&estimate.rows)));
    let findings: String = estimate
        .findings
        .iter()
        .map(|finding| format!("<li>{}</li>", crate::insight::report::number::escaped(&finding.to_string())))
        .collect();
    sections.push(("Findings", format!("<ul>{findings}</ul>")));
    crate::files::write_bytes(&folder.join("report.html"), page::page("Object", &sections).as_bytes())
}

/// Removes the pictures of an earlier estimation: they show another reflectance, and not all of them are made anew.
fn remove_pictures(folder: &Path) -> Result<()> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    for path in entries.flatten().map(|entry| entry.path()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.ends_with(".exr") && ["rerender_", "relit_", "env_"].iter().any(|start| name.starts_with(start)) {
            std::fs::remove_file(&path).map_err(|source| Error::writing(&path, source))?;
        }
    }
    Ok(())
}
