//! What a contest compares, and for how long.

use super::contestant::Contestant;
use crate::scene::ReadSettings;
use std::path::PathBuf;

/// What is compared.
#[derive(Clone, Debug)]
pub struct ContestOptions {
    /// Exchange folders with their truth; when empty, the demo is made in code and written as one.
    pub scenes: Vec<PathBuf>,
    /// How they are read; views it holds out are kept from every method.
    pub read: ReadSettings,
    /// The methods, in this order.
    pub methods: Vec<Contestant>,
    /// Seconds that each fit may take.
    pub seconds: f64,
    /// Seconds at which each shows what it has; when empty, ten and its doublings below `seconds`.
    pub at: Vec<f64>,
    /// Seeds 1 to this number; at least 1.
    pub seeds: usize,
    /// A tiny demo when no scene is named.
    pub quick: bool,
    /// Judge what an earlier contest left in the output folder, and run only what it lacks.
    pub reuse: bool,
    /// Threads of every method; all processors when not given.
    pub threads: Option<usize>,
    /// Paths a pixel in pictures that are judged.
    pub samples: usize,
    /// Pictures of each kind that are judged, at most.
    pub most_views: usize,
    /// A TOML file of settings of this program's methods that differ from the defaults.
    pub settings: Option<PathBuf>,
    /// This program.
    pub program: PathBuf,
    /// The Python that has Mitsuba.
    pub python: PathBuf,
    /// The folder of `fit_exchange.py`.
    pub scripts: PathBuf,
    /// Folder of the tables, plots and snapshots.
    pub output: PathBuf,
}

impl ContestOptions {
    /// Seconds at which snapshots are due.
    pub fn due(&self) -> Vec<f64> {
        if !self.at.is_empty() {
            return self.at.clone();
        }
        let first = if self.seconds > 20.0 { 10.0 } else { self.seconds / 8.0 };
        (0..40)
            .map(|power| first * f64::from(1u32 << power.min(30)))
            .take_while(|due| *due < 0.99 * self.seconds)
            .collect()
    }
}
