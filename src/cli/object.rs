//! `patina object`: light and reflectance from photos of one object.

use super::interrupt::stop_on_interrupt;
use crate::error::{Error, Result};
use crate::files::{stem_of, unrepeated};
use crate::job::object::estimate_as_far_as_it_goes;
use crate::light::Environment;
use crate::object::inputs::ObjectInputs;
use crate::object::prior::LightPriorKind;
use crate::object::progress::ObjectEvent;
use crate::object::read::{ObjectFiles, read_views};
use crate::object::settings::{LightMethod, LightsOf, ObjectSettings};
use crate::object::starts::{ModelKind, StartedModel};
use crate::object::{result_folder, split};
use crate::scene::settings::{PixelCentre, Up};
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Options of `patina object`.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("shape").required(true).args(["mesh", "sphere", "normals"])))]
pub struct ObjectOptions {
    /// One photo or several of the same object: EXR, HDR, PFM, PNG, TIFF or JPEG.
    #[arg(required = true)]
    pub photos: Vec<PathBuf>,
    /// The mesh of the object: OBJ, PLY, glTF, GLB or STL.
    #[arg(long, requires = "camera")]
    pub mesh: Option<PathBuf>,
    /// The object is a sphere, seen from infinitely far along -z: the circle of its mask, or without one the circle that
    /// fills the shorter side of the photo.
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
    /// Whether the photos are under one environment, or each under one of its own; they share the reflectance.
    #[arg(long, value_enum, default_value_t = LightsOf::One, conflicts_with = "env")]
    pub lights: LightsOf,
    /// Known environments of the first photos, with `--lights each`: they fix the scale that photos leave open.
    #[arg(long, num_args = 1..)]
    pub probe: Vec<PathBuf>,
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
        settings.lights = self.lights;
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
    settings.validate_for(options.env.is_some())?;
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
    let inputs = ObjectInputs {
        files,
        light: options.env.clone(),
        probes: options.probe.clone(),
        model: options.model,
        lobes: usize::from(options.lobes),
        weights: options.weights.clone(),
    };
    let (views, mut findings) = read_views(&inputs.files)?;
    let (known, noticed) = inputs.known()?;
    findings.extend(noticed);
    let mut lights = Vec::new();
    for path in &options.relight {
        let (light, noticed) = Environment::read(path)?;
        findings.extend(noticed);
        lights.push(light);
    }
    let names: Vec<String> = options.relight.iter().map(|path| stem_of(path)).collect();
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
            "light_bands": found.light_bands,
        });
        println!("{line}");
    } else {
        found.findings.iter().for_each(|finding| println!("{finding}"));
        if let Some(bands) = &found.light_bands {
            println!("environment: {}", bands.sentence());
        }
        let spread = split::SplitSpread::of(&found.candidates);
        println!(
            "began as {}; picture within {:.3} in logarithms; {}; {:.1} s: {}",
            found.start,
            found.picture_log_rmse,
            match (found.candidates.len(), spread.light.or(spread.reflectance)) {
                (count, Some(apart)) => format!("{count} starts were followed and end {apart:.2} apart"),
                _ => "one start".into(),
            },
            found.seconds,
            options.output.display()
        );
    }
    Ok(())
}
