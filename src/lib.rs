//! Patina turns a photographed scene into materials one can relight.
//!
//! Given a mesh and calibrated photos taken under one unknown environment, it estimates diffuse, specular and roughness maps
//! and that environment as an HDR image, on the CPU: by a solver over cached light transport (the default), or by Adam through
//! a differentiable path tracer.
//!
//! # The map
//! Dependencies point one way; `tests/program/layers.rs` fails when a lower layer imports a higher one.
//!
//! | folder | what it holds |
//! |---|---|
//! | `error`, `files` | errors with kind, place and remedy; files that are written whole or not at all |
//! | `guide` | the guide: nine topics, also in the terminal and the window |
//! | `math` | random numbers, frames, the sphere, sampling tables, statistics, numbers with derivatives |
//! | `image` | linear images, image files, metrics |
//! | `trace` | rays and the bounding volume hierarchy |
//! | `light` | the environment |
//! | `material` | texture maps and the reflection lobe |
//! | `measured` | measured reflectance: tables, models that stand for them, figures between the two |
//! | `neural` | the invertible neural model of reflectance: flow, training, fit, sampler |
//! | `scene` | mesh, cameras, photographs, their readers and the pre-flight check |
//! | `atlas` | from any mesh to a texture atlas |
//! | `render` | where light is added up: the path tracer with its reverse pass, and cached transport |
//! | `fit` | where a texel is changed: the solver, Adam, losses, consistency, schedule, checkpoint |
//! | `insight` | coverage, comparison, report |
//! | `export` | the run folder and the files in it |
//! | `object` | environment and measured reflectance from one photo |
//! | `job` | the only door between a fit and whoever watches it |
//! | `cli` | the command line; it holds no algorithm |
//! | `studio` | the window, behind the feature of that name; it holds no algorithm either |
//! | `lab` | experiments on all of it, behind the feature of that name, with the program `patina-lab` |
//!
//! # Conventions
//! * **World**: right-handed, +y up. Directions towards the light. Lengths in the units of the mesh.
//! * **Camera**: x right, y down, z forward; `camera_from_world` is rigid. Pixel (row i, column j) covers
//!   `[j, j+1) x [i, i+1)`, its centre is at +0.5.
//! * **Pixels**: linear RGB `f32`, row 0 at the top; transfer curves only at the file border.
//! * **Texture**: texel (row r, column c) of a `W x H` map is centred at `u = (c + 0.5)/W`, `v = 1 - (r + 0.5)/H`;
//!   bilinear between centres, clamped at the border.
//! * **Environment**: latitude-longitude, row 0 up: `theta = acos(d.y)`, `phi = atan2(d.x, -d.z) mod 2 pi`; bilinear
//!   in (phi, theta), wraps in phi, clamps at the poles.
//! * **Names**: transforms are `target_from_source`; `d_x` is the derivative of the loss by `x`, of the shape of `x`.
//! * **Roughness**: maps and files hold `r = a^2`, with `a` the microfacet width; inside, `log a` is what moves.
//! * **Random numbers** are a pure function of (seed, step, view, pixel, sample, dimension), sums are reduced in a
//!   fixed order: same seed, same bits, whatever the thread count. Processors with other vectors round otherwise.
//!
//! # From a folder to a picture under another light
//! ```
//! use patina::{Event, ReadSettings, RunFolder, RunSettings};
//! use std::{path::Path, sync::atomic::AtomicBool};
//!
//! # fn main() -> patina::Result<()> {
//! # let beside = tempfile::tempdir().unwrap();
//! # let (capture, output) = (&beside.path().join("capture"), &beside.path().join("run"));
//! # patina::write_demo_folder(&patina::DemoSettings { views: 6, held_out: 1, width: 32, height: 24, map_size: 64, seed: 1, ..Default::default() }, capture)?;
//! # let fit = patina::FitSettings { map_size: 64, solver_rounds: 2, ..Default::default() };
//! # let (capture, output): (&Path, &Path) = (capture, output);
//! let stop = AtomicBool::new(false);
//!
//! // Read the folder and check it: findings say what is wrong, where, and what helps.
//! let opened = patina::open_scene(capture, &ReadSettings::default(), &stop, &|_, _| {})?;
//! opened.report.findings.iter().for_each(|finding| println!("{finding}"));
//! let camera = opened.scene.views[0].camera;
//!
//! // Fit maps and environment on a worker thread, and watch it.
//! let settings = RunSettings { scene: capture.into(), fit, ..RunSettings::default() };
//! let (prepared, fitter, settings) = patina::start_new(opened, settings, &stop, &|_, _| {})?;
//! let job = patina::start(prepared, fitter, settings, RunFolder::create(output)?)?;
//! for event in &job.events {
//!     match event {
//!         Event::Progress(progress) => println!("{:.0} s left", progress.seconds_left),
//!         Event::Finished(report) => println!("{} held-out views", report.views.len()),
//!         Event::Failed(error) => return Err(error),
//!         _ => {}
//!     }
//! }
//!
//! // The run folder holds maps, environment and report. Render it under another environment.
//! let run = RunFolder::open(output)?;
//! let evening = patina::Environment::read(&output.join("env.exr"))?.0.rotated_about_up(1.5);
//! let picture = patina::relight(&run, &camera, &evening, 16, &stop)?;
//! assert_eq!(picture.width(), camera.width);
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]
// Documentation is built with private items: links to them lead somewhere there.
#![allow(rustdoc::private_intra_doc_links)]
// What only the lab or a test asks for is not dead; the build of the tests, lab included, finds what is.
#![cfg_attr(not(test), allow(dead_code, unused_imports))]
// Tests write files that are theirs alone, and directions that are no zero.
#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod atlas;
#[cfg(feature = "cli")]
mod cli;
mod error;
mod export;
mod files;
mod fit;
mod guide;
mod image;
mod insight;
mod job;
#[cfg(any(feature = "lab", all(test, feature = "cli")))]
mod lab;
mod light;
mod material;
mod math;
mod measured;
mod neural;
mod object;
mod render;
mod scene;
#[cfg(feature = "studio")]
mod studio;
mod trace;

#[cfg(test)]
extern crate self as patina;
#[cfg(all(test, feature = "cli"))]
#[path = "../tests/core/mod.rs"]
mod core_tests;
#[cfg(all(test, feature = "studio"))]
#[path = "../tests/studio/mod.rs"]
mod window_tests;

pub use atlas::{Atlas, AtlasSettings, KeepUv, build as build_atlas};
#[cfg(feature = "cli")]
pub use cli::run as run_command_line;
pub use error::{Error, ErrorKind, Finding, Place, Result, Severity};
pub use export::RunFolder;
pub use fit::{FitSettings, Fitter, LossRow, Method, Preset, ViewUse};
pub use image::file::keep_decoders_quiet;
pub use image::{GreyImage, Image, RgbImage};
pub use job::demo::write_folder as write_demo_folder;
pub use job::open::{OpenStage, OpenedRun, OpenedScene, open_demo, open_scene, resume, start_new, view_run};
pub use job::relight::relight;
pub use job::{Command, Event, JobHandle, JobOptions, Progress, RunSettings, Snapshot, start, start_with};
#[cfg(feature = "lab")]
pub use lab::cli::run as run_lab;
pub use light::Environment;
pub use material::{LobeModel, MaterialMaps};
pub use render::Surface;
pub use scene::demo::DemoSettings;
pub use scene::doctor::{Report as CheckReport, check};
pub use scene::settings::{BackgroundChoice, ColourEncoding, MaskUse, PixelCentre, Up};
pub use scene::{Background, Camera, Mesh, Photo, PixelState, ReadSettings, Scene, Truth, View, WorldFromSource};
pub use scene::{read, read_mesh};

/// Object mode: light and measured reflectance from one photo of a single object, as `patina object` finds them.
pub mod object_mode {
    pub use crate::measured::{HalfDifference, MeasuredBrdf, ReflectanceModel};
    pub use crate::object::{
        Estimate, Known, ObjectGeometry, ObjectPhoto, ObjectSettings, ObjectView, StartedModel, estimate,
    };
}
