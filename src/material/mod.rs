//! What a surface does with light: texture maps and the reflection lobe.
//!
//! Read [`maps`] for what is stored, then [`lobe`] for the reflection model.

pub mod maps;

pub use maps::MaterialMaps;
