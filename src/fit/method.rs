//! Which of the two ways to find maps and light: Adam along gradients of the path tracer, or the solver.

use serde::{Deserialize, Serialize};

/// How maps and light are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Method {
    // Resolved once, before a fit begins, by `Suited`; no run records it.
    /// Chosen for the scene: the solver, unless there are no photos or a setting is given that applies to Adam only.
    #[default]
    #[serde(rename = "auto")]
    #[cfg_attr(feature = "cli", value(name = "auto"))]
    Automatic,
    /// Adam only, as in the paper (Joy and Poullis 2023): many small steps along gradients of the path tracer.
    #[serde(alias = "paper")]
    #[cfg_attr(feature = "cli", value(alias = "paper"))]
    Adam,
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

/// Settings that say nothing to the solver.
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
            assert_eq!(FitSettings::from_toml(text).unwrap().method, Method::Adam);
        }
        assert_eq!(FitSettings::default().get_text("method").unwrap(), "auto");
    }

    #[test]
    fn what_is_adams_alone_are_settings() {
        assert!(OF_ADAM.iter().all(|name| FitSettings::default().get(name).is_ok()));
    }

    #[test]
    fn files_of_earlier_versions_name_adam_by_the_paper() {
        for (text, method) in [
            ("", Method::Automatic),
            ("method = \"auto\"", Method::Automatic),
            ("method = \"paper\"", Method::Adam),
            ("method = \"adam\"", Method::Adam),
            ("method = \"solver\"", Method::Solver),
        ] {
            assert_eq!(FitSettings::from_toml(text).unwrap().method, method, "{text}");
        }
        assert!(FitSettings::from_toml("method = \"fast\"").is_err());
        assert_eq!(FitSettings { method: Method::Adam, ..Default::default() }.to_toml().trim(), "method = \"adam\"");
    }
}
