//! Training: codes and weights together by maximum likelihood (generative latent optimisation, section 4.3).
//!
//! Each material and channel has a code that starts near zero and is moved by Adam like the weights; after each step
//! codes outside the unit ball are put back on it. A step is a pure function of the seed and its number, so that a run
//! taken up again goes on with the same bits.

use super::adam::{Adam, RateSchedule};
use super::architecture::Architecture;
use super::batch::{Figures, Objective, Task, evaluate};
use super::columns::Nest;
use super::flow::Flow;
use super::library::Library;
use crate::error::Result;
use crate::math::random::{SequentialRandom, mix};

/// How to train.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TrainSettings {
    /// Seed of weights, codes and points.
    pub seed: u64,
    /// Steps in all; the rates fall along them.
    pub steps: u64,
    /// Rate of the weights.
    pub rate: f32,
    /// Rate of the codes.
    pub code_rate: f32,
    /// Weight of the squared log error beside the likelihood, see [`super::batch::Objective`].
    pub log_error_weight: f64,
    /// How rates fall.
    pub schedule: RateSchedule,
    /// Densities in a step; all of them when there are fewer.
    pub densities_per_step: usize,
    /// Values of `phi_difference`, of `theta_difference` in each, and of `theta_half` in each of these.
    pub strata: [usize; 3],
}

impl TrainSettings {
    /// Settings that suit a configuration.
    pub fn of(architecture: &Architecture) -> Self {
        let compact = architecture.is_triangular();
        TrainSettings {
            seed: 1,
            steps: if compact { 6_000 } else { 10_000 },
            rate: if compact { 2e-3 } else { 3e-4 },
            code_rate: 1e-2,
            log_error_weight: if compact { 0.02 } else { 0.0 },
            schedule: RateSchedule::Cosine,
            densities_per_step: if compact { 88 } else { 16 },
            strata: if compact { [6, 8, 16] } else { [6, 6, 16] },
        }
    }

    fn nest(&self) -> Nest {
        Nest { azimuths: self.strata[0], differences: self.strata[1], halves: self.strata[2] }
    }
}

/// A flow that is being trained, or was.
#[derive(Clone, Debug)]
pub struct Training {
    /// The flow.
    pub flow: Flow,
    /// A row per material and channel, channels fastest.
    pub codes: Vec<f32>,
    /// Moments of the weights.
    pub of_weights: Adam,
    /// Moments of each code.
    pub of_codes: Vec<Adam>,
    /// Steps done.
    pub step: u64,
    /// How it is trained.
    pub settings: TrainSettings,
}

impl Training {
    /// A start: weights drawn, codes near zero.
    pub fn new(architecture: Architecture, library: &Library, settings: TrainSettings) -> Result<Self> {
        let flow = Flow::new(architecture, settings.seed)?;
        let length = flow.architecture().code;
        let densities = library.targets.len() * 3;
        let mut random = SequentialRandom::new(mix(settings.seed ^ 0xc0de));
        let codes = (0..densities * length).map(|_| 0.01 * random.next_normal()).collect();
        let of_weights = Adam::new(flow.weights.len());
        Ok(Training { flow, codes, of_weights, of_codes: vec![Adam::new(length); densities], step: 0, settings })
    }

    /// Which densities step `step` sees: every one once before any comes again.
    fn chosen(&self, densities: usize) -> Vec<usize> {
        let per_step = self.settings.densities_per_step.clamp(1, densities);
        let per_round = (densities / per_step).max(1) as u64;
        let (round, part) = (self.step / per_round, (self.step % per_round) as usize);
        let mut order: Vec<usize> = (0..densities).collect();
        SequentialRandom::new(mix(self.settings.seed ^ mix(round ^ 0x5eed))).shuffle(&mut order);
        let end = if part as u64 + 1 == per_round { densities } else { (part + 1) * per_step };
        let mut chosen = order[part * per_step..end].to_vec();
        chosen.sort_unstable();
        chosen
    }

    /// One step; returns the figures of its points before it.
    pub fn step(&mut self, library: &Library) -> Figures {
        let length = self.flow.architecture().code;
        let chosen = self.chosen(library.targets.len() * 3);
        let tasks: Vec<Task> =
            chosen.iter().map(|&index| Task { target: &library.targets[index / 3][index % 3] }).collect();
        let codes: Vec<f32> =
            chosen.iter().flat_map(|&index| self.codes[index * length..(index + 1) * length].iter().copied()).collect();
        let key = mix(self.settings.seed ^ mix(self.step ^ 0x57e9));
        let objective = Objective { log_error_weight: self.settings.log_error_weight };
        let found = evaluate(&self.flow, &tasks, &codes, self.settings.nest(), key, Some(objective));
        let factor = self.settings.schedule.factor(self.step, self.settings.steps);
        self.of_weights.step(&mut self.flow.weights, &found.d_weights, self.settings.rate * factor);
        for (row, &index) in chosen.iter().enumerate().filter(|_| length > 0) {
            let code = &mut self.codes[index * length..(index + 1) * length];
            let gradient = &found.d_codes[row * length..(row + 1) * length];
            self.of_codes[index].step(code, gradient, self.settings.code_rate * factor);
            project_to_ball(code);
        }
        self.step += 1;
        found.figures
    }

    /// Figures over all densities on fixed points.
    pub fn figures(&self, library: &Library) -> Figures {
        let tasks: Vec<Task> = (0..library.targets.len() * 3)
            .map(|index| Task { target: &library.targets[index / 3][index % 3] })
            .collect();
        let nest = Nest { azimuths: 9, differences: 16, halves: 24 };
        evaluate(&self.flow, &tasks, &self.codes, nest, 0xf19, None).figures
    }

    /// Logarithm of each density's mean: the colour with which it gives the stored values back.
    pub fn log_colours(library: &Library) -> Vec<f32> {
        library.targets.iter().flatten().map(|target| target.mean().ln() as f32).collect()
    }
}

/// Puts a code outside the unit ball on it, along its ray; one that is not finite becomes zero.
pub fn project_to_ball(code: &mut [f32]) {
    let length = code.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
    if !length.is_finite() {
        code.fill(0.0);
    } else if length > 1.0 {
        code.iter_mut().for_each(|x| *x = (f64::from(*x) / length) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neural::architecture::CODE;
    use crate::neural::target::TargetGrid;

    /// Two made-up materials.
    pub(crate) fn small_library() -> Library {
        let material = |sharpness: f64| {
            TargetGrid::of_reflectance(move |at, values| {
                for (at, value) in at.iter().zip(values) {
                    let lobe = (-sharpness * at.theta_half.powi(2)).exp() * (1.0 + at.theta_difference.powi(4));
                    *value = [0.1 + lobe, 0.02 + lobe, 0.01 * (1.0 + at.phi_difference.cos().powi(2)) + lobe];
                }
            })
        };
        Library {
            statement: "made up".into(),
            names: vec!["dull".into(), "shiny".into()],
            targets: vec![material(3.0), material(60.0)],
        }
    }

    #[test]
    fn training_learns_and_a_run_taken_up_again_ends_with_the_same_bits() {
        let library = small_library();
        for architecture in [Architecture::triangular(CODE, "small", 24, 2), Architecture::paper(CODE)] {
            let steps = if architecture.is_triangular() { 300 } else { 12 };
            let settings =
                TrainSettings { steps, strata: [3, 4, 8], densities_per_step: 4, ..TrainSettings::of(&architecture) };
            let mut training = Training::new(architecture, &library, settings).unwrap();
            let before = training.figures(&library);
            for _ in 0..steps / 2 {
                training.step(&library);
            }
            let mut other = training.clone();
            for _ in 0..steps / 2 {
                training.step(&library);
            }
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            for _ in 0..steps / 2 {
                pool.install(|| other.step(&library));
            }
            assert_eq!((&training.flow.weights, &training.codes), (&other.flow.weights, &other.codes));
            let after = training.figures(&library);
            assert!(after.divergence < 0.5 * before.divergence || steps < 100, "{before:?} {after:?}");
            assert!(after.log_likelihood > before.log_likelihood);
            let inside = |code: &[f32]| code.iter().map(|x| x * x).sum::<f32>() <= 1.0 + 1e-5;
            assert!(training.codes.chunks(CODE).all(inside));
        }
    }

    #[test]
    fn codes_outside_the_ball_come_back() {
        let mut code = [3.0, 4.0];
        project_to_ball(&mut code);
        assert_eq!(code, [0.6, 0.8]);
        let mut code = [f32::NAN, 4.0];
        project_to_ball(&mut code);
        assert_eq!(code, [0.0, 0.0]);
    }
}
