//! Where a texel is changed: losses, consistency between views, Adam, schedule, checkpoint.
//!
//! Read in this order: [`settings`] says what can be chosen (`limits`: in which ranges), [`schedule`] turns it into
//! stages, [`targets`] holds the photographs at the resolution of a stage, [`loss`] compares a pixel with its photo,
//! [`consistency`] compares the gradients of views, [`adam`] moves the numbers, and [`fitter`] is the loop body: one
//! call, one step. Its parts stand in the order they run: `begin` makes it of a scene or takes it up, `evidence` looks
//! at what is given, `work` prepares a stage, `batch` picks views and pixels, `gradient` adds them up, `weigh` applies
//! consistency, `advance` moves the numbers, `held_out` judges them. [`state`] is all they change, [`event`] what it
//! tells of. `change` takes other settings between two steps, `cut_short` ends a fit before its last one, [`views`]
//! leaves photos out, [`figures`] are for who watches, `underway` within a step.
//! [`by_name`] reads and sets each setting by its name, `describe` says with the command line's help what it means,
//! [`presets`] are whole sets of them.
//! [`solver`] is the other method, `solver_step` does its steps, [`known_maps`] are maps that it keeps and `keeping` how,
//! [`suited`] says which of both a scene asks for, and what else it does.
//! [`start`] chooses where to begin, [`gauge`] names the freedom that photographs leave, [`checkpoint`] saves it all.
//!
//! A fit knows nothing of threads that watch it, of files it came from or of windows: that is `job`.

pub mod adam;
mod advance;
mod batch;
mod begin;
pub mod by_name;
mod cached_pictures;
mod change;
pub mod checkpoint;
pub mod consistency;
mod cut_short;
#[cfg(feature = "cli")]
pub mod describe;
pub mod event;
mod evidence;
pub mod figures;
pub mod fitter;
pub mod gauge;
mod gradient;
mod held_out;
mod keeping;
pub mod known_maps;
pub mod light_prior;
mod limits;
pub mod loss;
mod method;
pub mod presets;
pub mod schedule;
pub mod settings;
pub mod solver;
mod solver_step;
mod stage_work;
pub mod start;
pub mod state;
mod step_sums;
pub mod suited;
pub mod targets;
pub(crate) mod underway;
pub mod views;
mod weigh;
mod work;

pub use cached_pictures::CachedPicture;
pub use fitter::{Fitter, StepOutcome};
pub use known_maps::KnownMaps;
pub use presets::Preset;
pub use settings::{FitSettings, Method};
pub use state::LossRow;
pub use suited::Suited;
pub use views::ViewUse;
