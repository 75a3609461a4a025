//! From settings to stages: which parameters move, at which resolution, for how many steps.

use super::settings::{FitSettings, Steps};

/// Which maps move in a stage. The light moves in all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StageKind {
    /// Diffuse alone; the specular lobe is absent (first step of the paper).
    Diffuse,
    /// Diffuse, specular and roughness (second step).
    All,
}

/// A run of steps at one resolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stage {
    /// Which maps move.
    pub kind: StageKind,
    /// Photographs are shrunk by `2^photo_level`.
    pub photo_level: usize,
    /// Width and height of the maps in this stage.
    pub map_size: usize,
    /// Number of optimiser steps.
    pub steps: usize,
    /// Steps of stages of the same kind before this one.
    pub steps_before: usize,
    /// Steps of all stages of this kind.
    pub steps_of_kind: usize,
}

impl Stage {
    /// Name for logs: `diffuse 1/4` or `all 1/1`.
    pub fn name(&self) -> String {
        let kind = match self.kind {
            StageKind::Diffuse => "diffuse",
            StageKind::All => "all",
        };
        format!("{kind} 1/{}", 1usize << self.photo_level)
    }

    /// Factor of the step sizes at a step of this stage: a half cosine over all steps of the kind, from 1 to
    /// `final_rate`.
    pub fn rate(&self, step: usize, final_rate: f32) -> f32 {
        let progress = (self.steps_before + step) as f32 / self.steps_of_kind.max(1) as f32;
        final_rate + (1.0 - final_rate) * 0.5 * (1.0 + (std::f32::consts::PI * progress).cos())
    }

    /// Strength of the specular lobe at a step of this stage: rises linearly over the first `ramp` steps of its kind.
    pub fn lobe_strength(&self, step: usize, ramp: usize) -> f32 {
        match self.kind {
            StageKind::Diffuse => 0.0,
            StageKind::All if ramp == 0 => 1.0,
            StageKind::All => ((self.steps_before + step + 1) as f32 / ramp as f32).min(1.0),
        }
    }
}

/// The stages of a fit. The first step goes from coarse to fine with maps that grow along; the second works on maps of
/// full size, on halved photographs first.
pub fn stages(settings: &FitSettings) -> Vec<Stage> {
    let mut stages = Vec::new();
    let levels = settings.levels;
    let mut add = |kind: StageKind, total: usize, levels_used: usize, maps_grow: bool| {
        let mut before = 0;
        for (position, photo_level) in (0..levels_used).rev().enumerate() {
            let end = total * (position + 1) / levels_used;
            let map_size = if maps_grow { settings.map_size >> photo_level } else { settings.map_size };
            let steps = end - before;
            if steps > 0 {
                let stage = Stage { kind, photo_level, map_size, steps, steps_before: before, steps_of_kind: total };
                stages.push(stage);
            }
            before = end;
        }
    };
    match settings.steps {
        Steps::TwoStep => {
            add(StageKind::Diffuse, settings.steps_diffuse, levels, true);
            let levels_of_all = if settings.steps_diffuse > 0 { levels.min(2) } else { levels };
            add(StageKind::All, settings.steps_all, levels_of_all, settings.steps_diffuse == 0);
        }
        Steps::OneStep => add(StageKind::All, settings.steps_diffuse + settings.steps_all, levels, true),
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_go_from_coarse_to_fine_and_keep_every_step() {
        let settings = FitSettings { steps_diffuse: 10, steps_all: 7, levels: 3, map_size: 64, ..Default::default() };
        let stages = stages(&settings);
        assert_eq!(stages.iter().map(|stage| stage.steps).sum::<usize>(), 17);
        assert_eq!(stages.iter().map(|stage| stage.map_size).collect::<Vec<_>>(), [16, 32, 64, 64, 64]);
        assert_eq!(stages[3].kind, StageKind::All);
        assert_eq!(stages[0].lobe_strength(3, 20), 0.0);
        assert!(stages[3].lobe_strength(0, 20) > 0.0);
        assert!((stages[0].rate(0, 0.1) - 1.0).abs() < 1e-6);
        assert!(stages[2].rate(stages[2].steps, 0.1) < 0.11);
    }
}
