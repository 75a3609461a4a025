//! `patina object`: light and reflectance from photos of one object.

use super::fit::stop_on_interrupt;
use crate::error::{Error, Result};
use crate::files::unrepeated;
use crate::job::object::estimate_as_far_as_it_goes;
use crate::light::Environment;
use crate::object::joint::Known;
use crate::object::prior::LightPriorKind;
use crate::object::progress::ObjectEvent;
use crate::object::read::{ObjectFiles, read_views};
use crate::object::result_read::ObjectInputs;
use crate::object::settings::{LightMethod, ObjectSettings};
use crate::object::starts::{ModelKind, StartedModel};
use crate::object::{result_folder, split, study};
use crate::scene::settings::{PixelCentre, Up};
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Options of `patina object`.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("shape").required(true).args(["mesh", "sphere", "normals"])))]
pub struct ObjectOptions {
    /// One photo or several of the same object under the same environment: EXR, HDR, PFM, PNG or JPEG.
    #[arg(required = true)]
    pub photos: Vec<PathBuf>,
    /// The mesh of the object: OBJ or PLY.
    #[arg(long, requires = "camera")]
    pub mesh: Option<PathBuf>,
    /// The object is a sphere that fills the shorter side of the photo, seen from infinitely far along -z.
    #[arg(long)]
    pub sphere: bool,
    /// Normals of the object in place of a mesh, one EXR or PFM a photo, of its size: unit vectors in the world (+y up,
    /// +z towards the camera), zero beside the object; seen from infinitely far along -z.
    #[arg(long, num_args = 1..)]
    pub normals: Vec<PathBuf>,
    /// Cameras: a cameras.json that lists the photos, or one BlendedMVS camera file a photo.
    #[arg(long, num_args = 1..)]
    pub camera: Vec<PathBuf>,
    /// Masks, one a photo: white is object.
    #[arg(long, num_args = 1..)]
    pub mask: Vec<PathBuf>,
    /// A known environment: only the reflectance is estimated.
    #[arg(long)]
    pub env: Option<PathBuf>,
    /// Model of the reflectance.
    #[arg(long, value_enum, default_value_t = ModelKind::default())]
    pub model: ModelKind,
    /// Weights of the neural model; those that come with the program when not given.
    #[arg(long)]
    pub weights: Option<PathBuf>,
    /// Lobes of the neural model.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=3))]
    pub lobes: u8,
    /// Prior of the environment [default: deep].
    #[arg(long, value_enum)]
    pub prior: Option<LightPriorKind>,
    /// How the environment is optimised.
    #[arg(long, value_enum)]
    pub method: Option<LightMethod>,
    /// A first look: a coarse environment, few pixels and few rounds.
    #[arg(long)]
    pub quick: bool,
    /// The schedule released with the paper, in place of the program's own.
    #[arg(long, conflicts_with = "quick")]
    pub released: bool,
    /// Environment resolution in rows, 8 to 180; an even number with the deep prior.
    #[arg(long)]
    pub light_height: Option<usize>,
    /// Pixels that are used.
    #[arg(long)]
    pub pixels: Option<usize>,
    /// Added to radiance before the logarithm, over the exposure of the photos: dark pixels say less the larger it is.
    #[arg(long)]
    pub epsilon_share: Option<f64>,
    /// Do not trace shadows of the object on itself.
    #[arg(long)]
    pub no_shadows: bool,
    /// Environments to relight the object under.
    #[arg(long, num_args = 1..)]
    pub relight: Vec<PathBuf>,
    /// Axis of mesh and cameras that points up: auto, or one of +x -x +y -y +z -z [default: auto].
    #[arg(long, allow_hyphen_values = true)]
    pub up: Option<Up>,
    /// Pixel-centre convention of the cameras: auto, integer or half [default: auto].
    #[arg(long)]
    pub pixel_centre: Option<PixelCentre>,
    /// Seed of pixels and net.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// The result folder.
    #[arg(short, long)]
    pub output: PathBuf,
}

impl ObjectOptions {
    fn settings(&self) -> ObjectSettings {
        let mut settings = match (self.quick, self.released) {
            (true, _) => ObjectSettings::quick(),
            (_, true) => ObjectSettings::released(),
            _ => ObjectSettings::default(),
        };
        settings.seed = self.seed;
        settings.shadows = !self.no_shadows;
        settings.prior = self.prior.unwrap_or(settings.prior);
        settings.method = self.method.unwrap_or(settings.method);
        settings.light_height = self.light_height.unwrap_or(settings.light_height);
        settings.pixels = self.pixels.unwrap_or(settings.pixels);
        settings.epsilon_share = self.epsilon_share.unwrap_or(settings.epsilon_share);
        settings
    }
}

/// Estimates and writes the result folder.
pub fn object(options: &ObjectOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let settings = options.settings();
    settings.validate()?;
    result_folder::prepare(&options.output)?;
    let files = ObjectFiles {
        photos: options.photos.clone(),
        masks: options.mask.clone(),
        mesh: options.mesh.clone(),
        normals: options.normals.clone(),
        cameras: options.camera.clone(),
        up: options.up.unwrap_or_default(),
        pixel_centre: options.pixel_centre.unwrap_or_default(),
    };
    let (views, mut findings) = read_views(&files)?;
    let mut known = Known::default();
    if let Some(path) = &options.env {
        let (light, mut noticed) = Environment::read(path)?;
        findings.append(&mut noticed);
        known.light = Some(light);
    }
    let (mut names, mut lights) = (Vec::new(), Vec::new());
    for path in &options.relight {
        let (light, mut noticed) = Environment::read(path)?;
        findings.append(&mut noticed);
        names.push(path.file_stem().unwrap_or_default().to_string_lossy().into_owned());
        lights.push(light);
    }
    let relights: Vec<(String, Environment)> = unrepeated(&names).into_iter().zip(lights).collect();
    let model = StartedModel::of(options.model, options.weights.as_deref(), usize::from(options.lobes), &settings)?;
    let watch = |event: ObjectEvent| match (event, json) {
        (ObjectEvent::Stage(stage), false) => eprintln!("{stage}"),
        (ObjectEvent::Stage(stage), true) => println!("{}", serde_json::json!({"event": "stage", "name": stage})),
        (ObjectEvent::Row(row), false) => eprintln!(
            "{:6.1} s  round {:2}  {:11}  objective {:.5} = picture {:.5} + light {:.5} + codes {:.5}",
            row.seconds,
            row.round,
            row.kind.label(),
            row.total(),
            row.data,
            row.light_prior,
            row.code_prior
        ),
        (ObjectEvent::Row(row), true) => println!("{}", serde_json::json!({"event": "step", "row": row})),
        (ObjectEvent::State { .. }, _) => {}
    };
    let (mut found, ended_early) = estimate_as_far_as_it_goes(&views, &model, &known, &settings, &stop, &watch)?;
    found.findings.splice(0..0, findings);
    let inputs = ObjectInputs {
        files,
        light: options.env.clone(),
        model: options.model,
        lobes: usize::from(options.lobes),
        weights: options.weights.clone(),
    };
    result_folder::write(&options.output, &views, &model, &found, &settings, &inputs, &relights)?;
    if let Some(error) = ended_early {
        // What was reached is written; that it is not the end is no success.
        let message = format!("{}; what was reached is in {}", error.message(), options.output.display());
        return Err(Error::new(error.kind(), message).at(error.place().clone()).remedy(error.remedy_text()));
    }
    if json {
        let line = serde_json::json!({
            "event": "finished", "run": options.output, "start": found.start, "seconds": found.seconds,
            "picture_log_rmse": found.picture_log_rmse, "findings": found.findings,
        });
        println!("{line}");
    } else {
        found.findings.iter().for_each(|finding| println!("{finding}"));
        let spread = split::SplitSpread::of(&found.candidates);
        println!(
            "began as {}; picture within {:.3} in logarithms; as well by {}; {:.1} s: {}",
            found.start,
            found.picture_log_rmse,
            match spread.starts.len().saturating_sub(1) {
                0 => "no other start".into(),
                1 => "another start".into(),
                others => format!("{others} other starts"),
            },
            found.seconds,
            options.output.display()
        );
    }
    Ok(())
}

/// Options of `patina study ibrdf`.
#[derive(Debug, Args)]
pub struct StudyIbrdfOptions {
    /// Folder of the neural fits of the MERL materials.
    pub library: PathBuf,
    /// Folder of latitude-longitude environments.
    pub envmaps: PathBuf,
    /// Mesh of an object that shadows itself.
    #[arg(long)]
    pub mesh: Option<PathBuf>,
    /// Weights of the neural model; those that come with the program for studies of materials left out when not given.
    #[arg(long)]
    pub weights: Option<PathBuf>,
    /// Further weights for figure 2, each fitted to the materials it was trained without.
    #[arg(long, value_delimiter = ',')]
    pub leave_out_weights: Vec<PathBuf>,
    /// Models of the reflectance; the neural one and Cook-Torrance when not given.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub models: Vec<ModelKind>,
    /// A few small cases, some minutes.
    #[arg(long)]
    pub quick: bool,
    /// Materials of each figure at most, in place of two with --quick and the paper's number without.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub materials: Option<u16>,
    /// Lights of each figure at most, in place of one or two with --quick and the paper's number without.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub lights: Option<u16>,
    /// Only these parts; without it, all but `schedules`.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub parts: Vec<study::Part>,
    /// Minutes after which figure 2 begins no further fit of DSBRDF; none are begun with --quick, and all without.
    #[arg(long, value_parser = super::neural::minutes)]
    pub dsbrdf_minutes: Option<f64>,
    /// Seed of pixels, noise and nets.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder of results, tables and page; results that stand there are not made again.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Studies what one photo tells.
pub fn study(options: &StudyIbrdfOptions, json: bool) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_interrupt(Arc::clone(&stop));
    let models = match options.models.is_empty() {
        false => options.models.clone(),
        true => vec![ModelKind::Ibrdf, ModelKind::CookTorrance],
    };
    let asked = study::StudyOptions {
        library: options.library.clone(),
        envmaps: options.envmaps.clone(),
        mesh: options.mesh.clone(),
        weights: options.weights.clone(),
        leave_out_weights: options.leave_out_weights.clone(),
        models,
        quick: options.quick,
        materials: options.materials.map(usize::from),
        lights: options.lights.map(usize::from),
        parts: options.parts.clone(),
        dsbrdf_minutes: options.dsbrdf_minutes.unwrap_or(if options.quick { 0.0 } else { f64::INFINITY }),
        seed: options.seed,
        output: options.output.clone(),
    };
    let tell = |text: &str| match json {
        true => println!("{}", serde_json::json!({"event": "study", "message": text})),
        false => eprintln!("{text}"),
    };
    let tables = study::run(&asked, &stop, &tell)?;
    if !json {
        println!("{tables}");
    }
    tell(&format!("tables and page: {}", options.output.display()));
    Ok(())
}
