//! Pixels, transport and loss of one estimation, at one resolution.

use super::likelihood::Likelihood;
use super::matrices::LightMatrix;
use super::nodes::NodeGrid;
use super::observations::{FEWEST_PIXELS, ObjectView, Observations};
use super::prior::LogLight;
use super::settings::{LightsOf, ObjectSettings};
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

    /// One problem for all photos, or one for each where each has a light of its own; they share the pixels.
    ///
    /// # Errors
    /// As [`ObjectProblem::new`].
    pub fn by_light(views: &[ObjectView], settings: &ObjectSettings) -> Result<(Vec<Self>, Vec<Finding>)> {
        let groups: Vec<&[ObjectView]> = match settings.lights {
            LightsOf::One => vec![views],
            LightsOf::Each => views.chunks(1).collect(),
        };
        let pixels = settings.pixels.div_ceil(groups.len().max(1)).max(FEWEST_PIXELS);
        let own = ObjectSettings { pixels, ..settings.clone() };
        let (mut problems, mut findings) = (Vec::new(), Vec::new());
        for group in groups {
            let (problem, noticed) = ObjectProblem::new(group, &own)?;
            problems.push(problem);
            findings.extend(noticed);
        }
        Ok((problems, findings))
    }

    /// The same photos at a resolution at which many starts can be tried.
    ///
    /// # Errors
    /// As [`ObjectProblem::new`].
    pub fn coarse(views: &[ObjectView], settings: &ObjectSettings) -> Result<Vec<Self>> {
        let coarse = ObjectSettings {
            light_height: settings.light_height.min(COARSE_HEIGHT),
            pixels: settings.pixels.min(COARSE_PIXELS),
            nodes: [24, 12, 8],
            ..settings.clone()
        };
        ObjectProblem::by_light(views, &coarse).map(|(problems, _)| problems)
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
        let logs = self.median_log_ratios(&matrix.forward(&ones.radiance()));
        LogLight::constant(width, height, logs)
    }

    /// Brings a light, under which pictures are like this one, to the level and colour of the photos.
    pub fn level(&self, light: &mut LogLight, picture: &[[f32; 3]]) {
        for (channel, ratio) in light.channels.iter_mut().zip(self.median_log_ratios(picture)) {
            channel.iter_mut().for_each(|log| *log += ratio);
        }
    }

    /// Natural logarithm of the photos over a picture, per channel: the median, so that saturated and black pixels do not move
    /// it.
    fn median_log_ratios(&self, picture: &[[f32; 3]]) -> [f32; 3] {
        let mut logs = [0.0; 3];
        for channel in 0..3 {
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
        logs
    }
}
