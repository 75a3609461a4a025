//! Patina turns a photographed scene into materials one can relight.
//!
//! Given a mesh and calibrated photographs taken under one unknown daylight, it fits a diffuse, a specular and a
//! roughness map and an HDR environment with a differentiable path tracer on the CPU.
//!
//! # The map
//! Dependencies point one way; `tests/layers.rs` fails when a lower layer imports a higher one.
//!
//! | folder | what it holds |
//! |---|---|
//! | [`error`], [`files`] | errors with kind, place and remedy; files that are written whole or not at all |
//! | [`guide`] | the guide: capture, formats, objective, benchmarks, limits |
//! | [`math`] | random numbers, frames, the sphere, sampling tables, statistics, numbers with derivatives |
//! | [`image`] | linear images, image files, metrics |
//! | [`trace`] | rays and the bounding volume hierarchy |
//! | [`light`] | the environment |
//! | [`material`] | texture maps and the reflection lobe |
//! | [`measured`] | measured reflectance: tables, models that stand for them, figures between the two |
//! | [`neural`] | the invertible neural model of reflectance: flow, training, fit, sampler |
//! | [`scene`] | mesh, cameras, photographs, their readers and the pre-flight check |
//! | [`atlas`] | from any mesh to a texture atlas |
//! | [`render`] | where light is added up: the path tracer and its reverse pass |
//! | [`fit`] | where a texel is changed: losses, consistency, Adam, schedule, checkpoint |
//! | [`insight`] | coverage, comparison, report |
//! | [`export`] | the run folder and the files in it |
//! | [`object`] | light and measured reflectance from one photo |
//! | [`job`] | the only door between a fit and whoever watches it |
//! | [`cli`] | the command line; it holds no algorithm |
//! | `studio` | the window, behind the feature of that name; it holds no algorithm either |
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
//! # A fit in twenty lines
//! ```
//! use patina::fit::{FitSettings, Fitter, StepOutcome};
//! use patina::{render::Surface, scene::demo};
//! use std::sync::{Arc, atomic::AtomicBool};
//!
//! # fn main() -> patina::Result<()> {
//! // A scene made in code, photographed by the path tracer: small, so that this runs in a moment.
//! let small = demo::DemoSettings { views: 4, held_out: 1, width: 24, height: 18, map_size: 64, seed: 1 };
//! let stop = AtomicBool::new(false);
//! let scene = patina::job::demo::scene(&small, &mut Vec::new(), &stop, &|_| {})?;
//! let surface = Surface::new(scene.mesh.clone())?;
//!
//! // Two steps of diffuse and light, two of everything.
//! let settings = FitSettings { map_size: 64, levels: 1, steps_diffuse: 2, steps_all: 2, ..FitSettings::default() };
//! let mut fitter = Fitter::new(Arc::new(scene), Arc::new(surface), settings, None)?;
//! while let StepOutcome::Stepped(row) = fitter.step(&stop)? {
//!     println!("step {}: mean squared error {:.4}", row.step, row.image_loss);
//! }
//! assert_eq!((fitter.state().step, fitter.maps().diffuse.width()), (4, 64));
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

pub mod atlas;
pub mod cli;
pub mod error;
pub mod export;
pub mod files;
pub mod fit;
pub mod guide;
pub mod image;
pub mod insight;
pub mod job;
pub mod light;
pub mod material;
pub mod math;
pub mod measured;
pub mod neural;
pub mod object;
pub mod render;
pub mod scene;
#[cfg(feature = "studio")]
pub mod studio;
pub mod trace;

pub use error::{Error, ErrorKind, Finding, Place, Result, Severity};
