//! `patina measured`: tables of measured reflectance.

mod arguments;

pub use self::arguments::*;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::image::file;
use crate::insight::material_pictures::{self as pictures, ShowLight};
use crate::light::Environment;
use crate::measured::analytic::OwnLobe;
use crate::measured::analytic::own_lobe::MapValues;
use crate::measured::baseline::Baseline;
use crate::measured::fit_model::ModelFitSettings;
use crate::measured::fits::{DATA_STATEMENT, NeuralFits, PublishedFits};
use crate::measured::metrics::TableError;
use crate::measured::sphere::{self, EnvironmentLevels};
use crate::measured::{Category, MeasuredBrdf};
use crate::neural::source;
use std::path::{Path, PathBuf};

/// Does what was asked.
pub fn run(task: &MeasuredTask, json: bool) -> Result<()> {
    match task {
        MeasuredTask::List(options) => list(options, json),
        MeasuredTask::Show(options) => show(options, json),
        MeasuredTask::Convert(options) => convert(options, json),
        MeasuredTask::Fit(options) => fit(options, json),
        MeasuredTask::Project(options) => project(options, json),
    }
}

/// The table of a source, and its name.
pub(crate) fn table_of(source: &Source) -> Result<(MeasuredBrdf, String)> {
    let path = Path::new(&source.material);
    if let Some(published) = &source.published {
        let fits = PublishedFits::read(published)?;
        let fit = fits.find(&source.material).ok_or_else(|| {
            Error::new(ErrorKind::Missing, format!("no material is called {}", source.material))
                .at(Place::File(published.clone()))
        })?;
        return Ok((fit.table()?, source.material.clone()));
    }
    match &source.library {
        Some(library) => Ok((NeuralFits::read(library)?.find(&source.material)?.table(), source.material.clone())),
        None if path.extension().is_some() || path.exists() => {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            Ok((MeasuredBrdf::read(path)?, name))
        }
        None => Err(Error::new(ErrorKind::Missing, format!("{} is not a file", source.material))
            .remedy("give a .binary file, or a material's name with --library FOLDER")),
    }
}

pub(crate) fn light_of(env: Option<&PathBuf>) -> Result<ShowLight> {
    let Some(path) = env else { return Ok(ShowLight::Lamps(sphere::showing_lamps())) };
    let (environment, findings) = Environment::read(path)?;
    findings.iter().for_each(|finding| eprintln!("{finding}"));
    Ok(ShowLight::Environment(EnvironmentLevels::new(&environment)))
}

fn list(options: &ListOptions, json: bool) -> Result<()> {
    let fits = NeuralFits::read(&options.library)?;
    for fit in &fits.materials {
        let kind = Category::of(&fit.name);
        match json {
            true => println!("{}", serde_json::json!({"event": "material", "name": fit.name, "kind": kind})),
            false => println!("{:<26} {}", fit.name, kind.label()),
        }
    }
    if !json {
        println!("{} materials. {DATA_STATEMENT}", fits.materials.len());
    }
    Ok(())
}

/// Says what was written where: a line of text, or an event.
pub(crate) fn tell_written(what: &str, path: &Path, json: bool) {
    match json {
        true => println!("{}", serde_json::json!({"event": "written", "what": what, "path": path})),
        false => println!("{what}: {}", path.display()),
    }
}

fn show(options: &ShowOptions, json: bool) -> Result<()> {
    let (table, name) = table_of(&options.source)?;
    let light = light_of(options.env.as_ref())?;
    let value = |at| table.lookup(at).unwrap_or_default();
    let picture = pictures::sphere_of(&value, options.size as usize, &light);
    file::write_png_srgb8(&options.output.join("sphere.png"), &picture)?;
    write_bytes(&options.output.join("lobes.svg"), pictures::lobes_svg(&[(&name, &value)]).as_bytes())?;
    write_bytes(&options.output.join("lobes.csv"), pictures::lobes_csv(&value).as_bytes())?;
    tell_written(&format!("{name}: {} cells measured", table.counted_cells().len()), &options.output, json);
    Ok(())
}

fn convert(options: &ConvertOptions, json: bool) -> Result<()> {
    let (table, name) = table_of(&options.source)?;
    table.write(&options.output)?;
    tell_written(&name, &options.output, json);
    Ok(())
}

fn fit(options: &MeasuredFitOptions, json: bool) -> Result<()> {
    let baseline = Baseline::of_key(&options.model).map_err(|error| error.at(Place::Setting("model".into())))?;
    let (table, name) = table_of(&options.source)?;
    report_fit(&Fitted::of(baseline, &table)?, &name, &table, Some(&options.output), "fit", json)
}

fn project(options: &ProjectOptions, json: bool) -> Result<()> {
    let found = source::read(&options.material, options.library.as_deref(), options.weights.as_deref())?;
    if !json {
        println!("{}: {}", found.name, found.origin);
    }
    let fitted = Fitted::of(Baseline::OwnLobe, &found.table)?;
    report_fit(&fitted, &found.name, &found.table, options.output.as_deref(), "project", json)
}

/// A model after its fit.
pub(crate) struct Fitted {
    pub(crate) model: &'static str,
    pub(crate) table: MeasuredBrdf,
    pub(crate) error: TableError,
    pub(crate) maps: Option<MapValues>,
    pub(crate) parameters: Vec<f64>,
}

impl Fitted {
    fn of(baseline: Baseline, table: &MeasuredBrdf) -> Result<Self> {
        let fit = baseline.fit(table, &ModelFitSettings::default())?;
        Ok(Fitted {
            model: baseline.name(),
            table: fit.table(),
            error: fit.error,
            maps: (baseline == Baseline::OwnLobe).then(|| OwnLobe::map_values(&fit.parameters)),
            parameters: fit.parameters,
        })
    }
}

/// Writes `STEM.json`, `STEM.binary`, spheres and lobes of a fit if a folder is given, and prints its errors.
pub(crate) fn report_fit(
    fit: &Fitted,
    name: &str,
    table: &MeasuredBrdf,
    output: Option<&Path>,
    stem: &str,
    json: bool,
) -> Result<()> {
    let (fitted, maps) = (&fit.table, fit.maps);
    let lamps = sphere::showing_lamps();
    let truth = sphere::render_table(256, table, &lamps);
    let estimate = sphere::render_table(256, fitted, &lamps);
    let psnr = sphere::displayed_scores(&estimate, &truth)?.psnr;
    let report = serde_json::json!({
        "event": "measured-fit", "material": name, "model": fit.model, "error": fit.error, "sphere_psnr_db": psnr,
        "maps": maps, "parameters": fit.parameters,
    });
    if let Some(output) = output {
        write_bytes(&output.join(format!("{stem}.json")), format!("{report:#}\n").as_bytes())?;
        fitted.write(&output.join(format!("{stem}.binary")))?;
        let value = |at| table.lookup(at).unwrap_or_default();
        let fitted_value = |at| fitted.lookup(at).unwrap_or_default();
        let exposure = sphere::display_exposure(&truth, &sphere::sphere_mask(256));
        let tiles = [
            (name.to_string(), pictures::shown_sphere_at(&truth, exposure)),
            (fit.model.to_string(), pictures::shown_sphere_at(&estimate, exposure)),
        ];
        file::write_png_srgb8(&output.join("spheres.png"), &pictures::sheet(&tiles, Some(2)))?;
        let svg = pictures::lobes_svg(&[("", &value), (stem, &fitted_value)]);
        write_bytes(&output.join("lobes.svg"), svg.as_bytes())?;
    }
    if json {
        println!("{report}");
        return Ok(());
    }
    println!("{name}, {}: log-RMSE {:.4}, sphere {psnr:.1} dB", fit.model, fit.error.log_rmse);
    if let Some(maps) = maps {
        println!("diffuse {:.4?}, specular {:.4?}, roughness {:.5}", maps.diffuse, maps.specular, maps.roughness);
    }
    if let Some(output) = output {
        println!("{}", output.display());
    }
    Ok(())
}
