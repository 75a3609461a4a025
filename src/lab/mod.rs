//! The lab: experiments on the program, behind the feature `lab`, with a program of its own, `patina-lab`.
//!
//! It is the top layer: it may use everything, and nothing in the product uses it. [`cli`] is its command line.
//!
//! | folder | what it measures |
//! |---|---|
//! | [`contest`] | methods held against each other by the clock, Mitsuba 3 among them |
//! | [`hard`] | cases that break fits |
//! | [`scale`], [`tracer_speed`], [`window`] | seconds and memory of whole fits, of rays and paths, of the window |
//! | [`atlas_quality`], [`cached_error`] | distortion of atlases; cached transport against the path tracer |
//! | [`audit`] | derivatives against central differences |
//! | [`fuzz`] | damaged files of every kind that is read |
//! | [`nightly`] | what takes too long to be asked on every change |
//! | [`proof`], [`readers`] | exports, opened and rendered by other programs; what they write, read here |
//! | [`pipelines`] | the workflow for many captures, with kills and failures |
//! | [`consistency`], [`object_study`] | the figures of the two papers |
//! | [`study`] | studies as lists of cases that several sittings work off |
//! | [`rivals`], [`neural`] | reflectance models on measured tables; training of the neural one |
//! | [`scenes`] | scenes made in code with their truth |
//! | [`study_table`], [`bar_table`], [`bar_picture`] | tables over seeds, of bars; bars without a browser |
//! | [`other_programs`] | scripts of this project in another program |

pub mod atlas_quality;
pub mod audit;
pub mod bar_picture;
pub mod bar_table;
pub mod cached_error;
pub mod cli;
pub mod consistency;
pub mod contest;
pub mod fuzz;
pub mod hard;
pub mod neural;
pub mod nightly;
pub mod object_study;
pub mod other_programs;
pub mod pipelines;
pub mod proof;
pub mod readers;
pub mod rivals;
pub mod scale;
pub mod scenes;
pub mod study;
pub mod study_table;
pub mod tracer_speed;
#[cfg(feature = "studio")]
pub mod window;
