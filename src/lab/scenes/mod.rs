//! Scenes made in code with their truth, to judge fits by: [`study`] holds a vase, [`hard`] what breaks fits.

pub mod hard;
pub mod study;
