//! The proof of speed against error: several methods fit the same exchange scene, each in a process of its own, and the
//! maps and lights they have at rising seconds are judged alike. `patina bench fit`.
//!
//! [`options`] says what is compared, [`Contestant`] names the methods. [`entry`] is what a process of this program does; `tests/mitsuba/fit_exchange.py`
//! is its counterpart. Both write [`snapshot`]s, timed by a [`clock`] that starts with the process; [`pace`] makes Adam
//! end with its time. [`race`] starts the processes, [`judge`] scores what they wrote, [`tables`] and [`reach`] say it.
//!
//! [`all`] does so on every scene of a folder, and [`all_table`] is its one table of scenes by measures.
//!
//! What counts: seconds from the start of the process, reading and compiling included. What does not: writing snapshots,
//! and judging, which is done afterwards. All begin from the same maps and light, of the same sizes, with the same views,
//! and paths of the same length. Judges never see which method made a file. What it refuses to do: to compare methods on
//! scenes without truth, and to hide one that could not run; the tables say so.

pub mod all;
pub mod all_table;
pub mod clock;
pub mod contestant;
pub mod entry;
pub mod judge;
pub mod options;
pub mod pace;
pub mod race;
pub mod reach;
pub mod snapshot;
pub mod tables;

pub use contestant::Contestant;
pub use options::ContestOptions;
pub use race::run;
