//! Pixels, transport and loss of one estimation, at one resolution.

use super::likelihood::Likelihood;
use super::matrices::LightMatrix;
use super::nodes::NodeGrid;
use super::observations::{ObjectView, Observations};
use super::prior::LogLight;
use super::settings::ObjectSettings;
use super::transport::{TexelDirections, Transport};
use crate::error::{Finding, Result};
use std::sync::Arc;

/// Rows of the light at which starts are tried.
const COARSE_HEIGHT: usize = 16;
/// Rows of the light, at most, at which it is asked which of its details the photo tells: the finest are below the smallest
/// blur.
const BAND_ROWS: usize = 24;
/// Pixels with which starts are tried.
const COARSE_PIXELS: usize = 384;

/// Pixels, transport and loss.
pub struct ObjectProblem {
    /// The pixels.
    pub observations: Observations,
    /// The linear image model.
    pub transport: Transport,
    /// The loss.
    pub likelihood: Likelihood,
}

impl ObjectProblem {
    /// Gathers pixels of the photos and finds their transport.
    ///
    /// # Errors
    /// Those of [`ObjectSettings::validate`] and [`Observations::gather`].
    pub fn new(views: &[ObjectView], settings: &ObjectSettings) -> Result<(Self, Vec<Finding>)> {
        settings.validate()?;
        let size = settings.light_size();
        let (observations, findings) =
            Observations::gather(views, settings.pixels, size, settings.shadows, settings.seed)?;
        let directions = Arc::new(TexelDirections::new(size.0, size.1)?);
        let grid = Arc::new(NodeGrid::new(settings.nodes));
        let transport = Transport::new(grid, directions, &observations.pixels, observations.visibility.as_ref());
        let likelihood = Likelihood::new(&observations, settings.epsilon_share, settings.loss_width);
        Ok((ObjectProblem { observations, transport, likelihood }, findings))
    }

    /// The same photos at a resolution at which many starts can be tried.
    ///
    /// # Errors
    /// As [`ObjectProblem::new`].
    pub fn coarse(views: &[ObjectView], settings: &ObjectSettings) -> Result<Self> {
        let coarse = ObjectSettings {
            light_height: settings.light_height.min(COARSE_HEIGHT),
            pixels: settings.pixels.min(COARSE_PIXELS),
            nodes: [24, 12, 8],
            ..settings.clone()
        };
        ObjectProblem::new(views, &coarse).map(|(problem, _)| problem)
    }

    /// The same photos with few pixels and a light of few rows, to ask which of its
    /// details they tell.
    ///
    /// # Errors
    /// As [`ObjectProblem::new`].
    pub fn for_bands(views: &[ObjectView], settings: &ObjectSettings) -> Result<Self> {
        let (rows, pixels) = (BAND_ROWS, COARSE_PIXELS);
        let small = ObjectSettings {
            light_height: settings.light_height.min(rows),
            pixels: settings.pixels.min(pixels),
            ..settings.clone()
        };
        ObjectProblem::new(views, &small).map(|(problem, _)| problem)
    }

    /// The even light under which pictures of a reflectance are as bright as the photos: the median of the ratios, per
    /// channel.
    pub fn even_light(&self, matrix: &LightMatrix, width: usize, height: usize) -> LogLight {
        let ones = LogLight::constant(width, height, [0.0; 3]);
        let picture = matrix.forward(&ones.radiance());
        let mut logs = [0.0; 3];
        for channel in 0..3 {
            // The median of the ratios: saturated and black pixels do not move it.
            let mut ratios: Vec<f64> = picture
                .iter()
                .zip(&self.observations.measured)
                .filter(|(value, measured)| value[channel] > 0.0 && measured[channel] > 0.0)
                .map(|(value, measured)| f64::from(measured[channel]).ln() - f64::from(value[channel]).ln())
                .filter(|ratio| ratio.is_finite())
                .collect();
            ratios.sort_by(f64::total_cmp);
            logs[channel] = ratios.get(ratios.len() / 2).copied().unwrap_or(0.0) as f32;
        }
        LogLight::constant(width, height, logs)
    }
}
