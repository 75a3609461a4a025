//! Which of the two ways to find maps and light: Adam by paths, or the solver.

use serde::{Deserialize, Serialize};

/// How maps and light are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Adam only, as in the paper: many small steps along gradients of the path tracer.
    #[default]
    #[serde(rename = "adam", alias = "paper")]
    #[value(name = "adam", alias = "paper")]
    Paper,
    /// A few large steps without noise: rays are traced once, texels are solved in closed form, and the environment by
    /// Gauss-Newton with the texels eliminated. Settings of Adam's steps do not apply to it.
    Solver,
}

impl Method {
    /// Whether one of the settings, by their names, means something to Adam alone.
    pub fn means_adam(chosen: &[String]) -> bool {
        chosen.iter().any(|name| OF_ADAM.contains(&name.as_str()))
    }
}

/// Settings that say nothing to the solver, unless it polishes.
const OF_ADAM: [&str; 18] = [
    "steps",
    "steps-diffuse",
    "steps-all",
    "views-per-step",
    "pixels-per-step",
    "samples",
    "levels",
    "pixel-filter",
    "consistency",
    "start",
    "rate-diffuse",
    "rate-specular",
    "rate-roughness",
    "rate-light",
    "light-smoothness",
    "final-rate",
    "first-hits-mib",
    "lobe-ramp",
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::FitSettings;

    #[test]
    fn the_word_of_older_settings_files_is_still_read() {
        for text in ["method = \"adam\"", "method = \"paper\""] {
            assert_eq!(FitSettings::from_toml(text).unwrap().method, Method::Paper);
        }
        assert_eq!(FitSettings::default().get_text("method").unwrap(), "adam");
    }

    #[test]
    fn what_is_adams_alone_are_settings() {
        assert!(OF_ADAM.iter().all(|name| FitSettings::default().get(name).is_ok()));
    }
}
