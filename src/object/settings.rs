//! What an estimation is asked to do, and three sets of answers.

use super::observations::FEWEST_PIXELS;
use super::prior::LightPriorKind;
use super::prior::deep::net::levels_of;
use crate::error::{Error, ErrorKind, Place, Result};

/// Most rows of the light: texels are counted by 16 bits, and 360 x 180 is what the paper's own lights have.
pub const MOST_ROWS: usize = 180;

/// How the light is improved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum LightMethod {
    /// Damped steps of Newton, with the deep prior in alternation.
    #[default]
    ClosedForm,
    /// Adam through the net, as released.
    FirstOrder,
}

/// How many lights the photos are taken under.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum LightsOf {
    /// All under the same.
    #[default]
    One,
    /// Each photo under one of its own; they share the reflectance.
    Each,
}

/// Settings of an estimation.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct ObjectSettings {
    /// Height of the fitted light in texels; it is twice as wide.
    pub light_height: usize,
    /// Pixels that are used, spread over the photos.
    pub pixels: usize,
    /// Nodes along theta_half, theta_difference and phi_difference.
    pub nodes: [usize; 3],
    /// Whether shadow rays are traced.
    pub shadows: bool,
    /// Whether photos share a light.
    pub lights: LightsOf,
    /// Prior of the light.
    pub prior: LightPriorKind,
    /// How the light is improved.
    pub method: LightMethod,
    /// Rounds of light and reflectance.
    pub outer_loops: usize,
    /// First rounds in which the light is grey.
    pub grey_loops: usize,
    /// Steps on the light a round: of Newton, or of Adam.
    pub light_steps: usize,
    /// Products of the picture's matrix in each step of Newton.
    pub light_products: usize,
    /// Steps of Adam on the net for each step of Newton.
    pub net_steps: usize,
    /// Channels of the net; the paper's has 128.
    pub net_channels: usize,
    /// Rate of Adam on the net.
    pub net_rate: f32,
    /// Pull between light and net where reflectance is known: weight of their mean squared difference.
    pub net_weight: f64,
    /// The same where reflectance is estimated as well. What a model of it cannot follow is left to the light, which takes
    /// it up the more the looser it is held; held too fast, it cannot follow the net, which takes few steps a round.
    pub net_weight_of_both: f64,
    /// Weight of the mean absolute step of the gradient prior.
    pub gradient_weight: f64,
    /// Steps on the reflectance a round, at most.
    pub reflectance_steps: usize,
    /// Weight of the squared codes of a model that has codes.
    pub code_weight: f64,
    /// Added to radiance before the logarithm, over the exposure of the photos.
    pub epsilon_share: f64,
    /// Where the loss on logarithms turns from square to absolute.
    pub loss_width: f64,
    /// Starts that are followed at low resolution after all were tried.
    pub followed: usize,
    /// Seed of pixels and net.
    pub seed: u64,
}

impl Default for ObjectSettings {
    fn default() -> Self {
        ObjectSettings {
            light_height: 64,
            pixels: 2048,
            nodes: [48, 24, 15],
            shadows: true,
            lights: LightsOf::One,
            prior: LightPriorKind::Deep,
            method: LightMethod::ClosedForm,
            outer_loops: 8,
            grey_loops: 2,
            light_steps: 2,
            light_products: 12,
            net_steps: 30,
            net_channels: 32,
            net_rate: 0.01,
            net_weight: 0.05,
            net_weight_of_both: 0.5,
            gradient_weight: 0.01,
            reflectance_steps: 8,
            code_weight: 1e-5,
            epsilon_share: 1e-3,
            loss_width: 0.02,
            followed: 6,
            seed: 1,
        }
    }
}

impl ObjectSettings {
    /// Less of everything: a first look.
    pub fn quick() -> Self {
        ObjectSettings {
            light_height: 32,
            pixels: 1024,
            nodes: [28, 15, 8],
            outer_loops: 6,
            net_channels: 16,
            net_steps: 12,
            ..Self::default()
        }
    }

    /// The schedule that was released with the paper: Adam through the net, ten rounds, grey light in the first three.
    pub fn released() -> Self {
        ObjectSettings {
            method: LightMethod::FirstOrder,
            outer_loops: 10,
            grey_loops: 3,
            light_steps: 300,
            net_channels: 128,
            net_rate: 1e-3,
            reflectance_steps: 100,
            ..Self::default()
        }
    }

    /// Size of the fitted light in texels: width, height.
    pub fn light_size(&self) -> (usize, usize) {
        (2 * self.light_height, self.light_height)
    }

    /// Checks ranges.
    ///
    /// # Errors
    /// `InvalidSetting` with the name of the setting.
    pub fn validate(&self) -> Result<()> {
        let wrong = |name: &str, message: &str| {
            let remedy = match name {
                "light-height" => "give --light-height 64, or leave it out",
                "pixels" => "give --pixels 2048, or leave it out",
                "epsilon-share" => "give --epsilon-share 0.001, or leave it out",
                _ => "take what the program takes by itself",
            };
            Err(Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(name.into())).remedy(remedy))
        };
        if !(8..=MOST_ROWS).contains(&self.light_height) {
            return wrong("light-height", &format!("the light needs 8 to {MOST_ROWS} rows"));
        }
        if self.pixels < FEWEST_PIXELS {
            return wrong("pixels", &format!("at least {FEWEST_PIXELS} pixels are needed"));
        }
        let positive = [
            ("epsilon-share", self.epsilon_share),
            ("loss-width", self.loss_width),
            ("net-rate", f64::from(self.net_rate)),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return wrong(name, "this must be a number above 0");
            }
        }
        let weights = [
            ("net-weight", self.net_weight),
            ("net-weight-of-both", self.net_weight_of_both),
            ("gradient-weight", self.gradient_weight),
            ("code-weight", self.code_weight),
        ];
        for (name, value) in weights {
            if !(value >= 0.0 && value.is_finite()) {
                return wrong(name, "a weight must not be negative");
            }
        }
        Ok(())
    }

    /// [`ObjectSettings::validate`], and that an environment that is estimated has a size for which its prior is made.
    ///
    /// # Errors
    /// As [`ObjectSettings::validate`].
    pub fn validate_for(&self, has_known_light: bool) -> Result<()> {
        self.validate()?;
        if self.prior == LightPriorKind::Deep && !has_known_light {
            let (width, height) = self.light_size();
            levels_of(width, height)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_cannot_be_are_told_before_any_work_with_an_option_that_exists() {
        let of = |change: &dyn Fn(&mut ObjectSettings)| {
            let mut settings = ObjectSettings::default();
            change(&mut settings);
            settings
        };
        for (name, settings) in [
            ("--light-height", of(&|own| own.light_height = 33)),
            ("--light-height", of(&|own| own.light_height = 8)),
            ("--light-height", of(&|own| own.light_height = 181)),
            ("--pixels", of(&|own| own.pixels = 3)),
            ("--epsilon-share", of(&|own| own.epsilon_share = f64::NAN)),
        ] {
            let error = settings.validate_for(false).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidSetting);
            assert!(error.to_string().contains(name) && error.remedy_text().contains(name), "{error}");
        }
        // A light that is given, or held otherwise, may have any number of rows.
        let odd = of(&|own| own.light_height = 33);
        assert!(odd.validate_for(true).is_ok());
        assert!(ObjectSettings { prior: LightPriorKind::Gradient, ..odd }.validate_for(false).is_ok());
        for settings in [ObjectSettings::default(), ObjectSettings::quick(), ObjectSettings::released()] {
            settings.validate_for(false).unwrap();
        }
    }
}
