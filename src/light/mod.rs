//! The light of a scene: an environment infinitely far away.
//!
//! Read [`environment`] first: a latitude-longitude map of radiance, looked up bilinearly, and what can be asked of it.
//! [`sampler`] draws directions for next-event estimation, [`resample`] turns and resizes a map without losing
//! energy, [`sky`] makes a daylight when there is no photograph of one, [`day`] that of an hour and a latitude, [`ball`]
//! shows a light on two balls, [`blur`] takes its details away.
//!
//! What is not here: lamps, area lights and anything near; and no visibility, that is the tracer's.

pub mod ball;
pub mod blur;
pub mod day;
pub mod environment;
mod inversion;
pub mod resample;
pub mod sampler;
pub mod sky;

pub use environment::Environment;
pub use sampler::{EnvironmentSampler, LightSample};
