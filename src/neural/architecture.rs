//! What a flow is made of, as it stands in the metadata of a file of weights.

use super::dense::{Activation, DenseNet, Layer};
use super::spline::{FLOOR_DIGITS, SplineShape};
use super::warp::{AZIMUTH, DIFFERENCE, HALF};
use std::f64::consts::TAU;

/// Length of a code.
pub const CODE: usize = 16;

/// One coupling: which coordinate it transforms, and what its conditioner sees beside the code.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Coupling {
    /// The coordinate that is transformed: 0 `theta_half`, 1 `theta_difference`, 2 `phi_difference`.
    pub transforms: usize,
    /// The coordinates that the conditioner sees.
    pub given: Vec<usize>,
    /// Bins of the spline.
    pub bins: usize,
    /// Whether the density is the same at both ends of the coordinate.
    pub periodic: bool,
    /// Layers of the conditioner; the last one makes the spline.
    pub layers: Vec<Layer>,
}

/// All couplings of a flow, from the data to the uniform cube.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Architecture {
    /// Name of the configuration.
    pub name: String,
    /// Length of the code; 0 for a flow of one density.
    pub code: usize,
    /// How many of a code's numbers, its last ones, are the same for the three channels of a material: its shape. What
    /// is before them is the channel's own.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub shape: usize,
    /// Whether codes scale and shift every layer of the conditioners, see [`super::modulation`], or are seen by the
    /// first ones alone.
    #[serde(default, skip_serializing_if = "is_false")]
    pub gates: bool,
    /// Whether conditioners see waves of the coordinates, periodic ones of `phi_difference`, or the bare numbers.
    pub waves: bool,
    /// What stands behind the layers of the conditioners.
    pub activation: Activation,
    /// No density of a coupling is lower at a knot than ten to the minus this. Four keeps training calm; what is measured
    /// as nothing at all, as in parts of metals, needs more.
    #[serde(default = "usual_floor", skip_serializing_if = "is_usual_floor")]
    pub floor_digits: u8,
    /// The couplings in the order in which data pass them.
    pub couplings: Vec<Coupling>,
}

fn usual_floor() -> u8 {
    FLOOR_DIGITS
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

fn is_false(value: &bool) -> bool {
    !*value
}

fn is_usual_floor(digits: &u8) -> bool {
    *digits == FLOOR_DIGITS
}

impl Architecture {
    /// The paper's: six couplings of eight bins, each given both other coordinates by a U-Net. 840,006 weights with
    /// codes, 815,430 without. Not periodic in `phi_difference`, as the paper's is not.
    pub fn paper(code: usize) -> Self {
        let coupling = |transforms: usize| {
            let given: Vec<usize> = (0..3).filter(|&axis| axis != transforms).collect();
            Coupling { transforms, given, bins: 8, periodic: false, layers: unet_layers(17) }
        };
        Architecture {
            name: "paper".into(),
            code,
            shape: 0,
            gates: false,
            waves: false,
            activation: Activation::Rectifier,
            floor_digits: FLOOR_DIGITS,
            couplings: [0, 1, 2, 0, 1, 2].map(coupling).into(),
        }
    }

    /// Ours: three couplings of more bins in triangular order. The density of `theta_half` is conditioned on both
    /// other angles, that of `theta_difference` on `phi_difference`, that of `phi_difference` on the code alone
    /// (Rosenblatt 1952). A whole column of `theta_half` then costs one pass of one net, and the conditional
    /// densities that a renderer asks for are exact. Periodic in `phi_difference`.
    pub fn compact(code: usize) -> Self {
        Self::triangular(code, "compact", 128, 3)
    }

    /// The compact flow with a shape of `shape` numbers a material beside the codes of its channels, both of which
    /// scale and shift every layer: three times 16 numbers, a shape of 102 and three colours are 153 a material. Its
    /// floor is lower, since logarithms of what is measured as nothing are learned too.
    pub fn shaped(own: usize, shape: usize) -> Self {
        let compact = Self::triangular(own + shape, "shaped", 128, 3);
        Architecture { shape, gates: true, floor_digits: 8, ..compact }
    }

    /// The triangular order with another size of its largest net.
    pub fn triangular(code: usize, name: &str, width: usize, depth: usize) -> Self {
        let dense = |width: usize, depth: usize, last: usize| {
            let mut layers = vec![Layer { outputs: width, beside: None }; depth];
            layers.push(Layer { outputs: last, beside: None });
            layers
        };
        Architecture {
            name: name.into(),
            code,
            shape: 0,
            gates: false,
            waves: true,
            activation: Activation::Squareplus,
            floor_digits: FLOOR_DIGITS,
            couplings: vec![
                Coupling {
                    transforms: HALF,
                    given: vec![DIFFERENCE, AZIMUTH],
                    bins: 32,
                    periodic: false,
                    layers: dense(width, depth, 65),
                },
                Coupling {
                    transforms: DIFFERENCE,
                    given: vec![AZIMUTH],
                    bins: 24,
                    periodic: false,
                    layers: dense(64, 2, 49),
                },
                Coupling { transforms: AZIMUTH, given: vec![], bins: 12, periodic: true, layers: dense(32, 1, 24) },
            ],
        }
    }

    /// The configuration of that name.
    pub fn named(name: &str, code: usize) -> Option<Self> {
        match name {
            "paper" => Some(Self::paper(code)),
            "compact" => Some(Self::compact(code)),
            _ => None,
        }
    }

    /// Whether each coordinate is transformed once, given coordinates not transformed before: then a column of
    /// `theta_half` needs one conditioner.
    pub fn is_triangular(&self) -> bool {
        self.couplings.len() == 3
            && self
                .couplings
                .iter()
                .zip(0..3)
                .all(|(coupling, axis)| coupling.transforms == axis && coupling.given.iter().copied().eq(axis + 1..3))
    }

    /// Whether every part fits every other one: sizes, coordinates, skips. Files come from anywhere.
    pub fn is_sound(&self) -> bool {
        let sound = |coupling: &Coupling| {
            let layers = &coupling.layers;
            coupling.transforms < 3
                && coupling.given.iter().all(|&axis| axis < 3 && axis != coupling.transforms)
                && (1..=256).contains(&coupling.bins)
                && layers.last().is_some_and(|last| last.outputs == self.spline(coupling).raw_count())
                && layers.iter().enumerate().all(|(index, layer)| {
                    (1..=4096).contains(&layer.outputs)
                        && layer.beside.is_none_or(|beside| index > 0 && beside < index && !self.gates)
                })
        };
        self.code <= 256
            && self.shape <= self.code
            && (self.code > 0 || !self.gates)
            && (1..=12).contains(&self.floor_digits)
            && (1..=64).contains(&self.couplings.len())
            && self.couplings.iter().all(|coupling| coupling.layers.len() <= 64 && sound(coupling))
    }

    /// Lobes with which a table is represented by 153 numbers: one where codes hold a shape, three of codes alone.
    pub fn usual_lobes(&self) -> usize {
        if self.shape > 0 { 1 } else { 3 }
    }

    /// The spline of a coupling.
    pub fn spline(&self, coupling: &Coupling) -> SplineShape {
        SplineShape { bins: coupling.bins, periodic: coupling.periodic, floor_digits: self.floor_digits }
    }

    /// How many numbers a conditioner sees of one coordinate.
    fn feature_count(&self, axis: usize) -> usize {
        match (self.waves, axis) {
            (false, _) => 1,
            (true, AZIMUTH) => 4,
            (true, _) => 4,
        }
    }

    /// The conditioner of a coupling.
    pub fn net(&self, coupling: &Coupling) -> DenseNet {
        let features = coupling.given.iter().map(|&axis| self.feature_count(axis)).sum();
        let net = DenseNet::new(features, self.code, coupling.layers.clone(), self.activation);
        if self.gates { net.with_gates() } else { net }
    }

    /// Appends what a conditioner sees of one coordinate at `u`.
    pub fn push_features(&self, axis: usize, u: f64, features: &mut Vec<f32>) {
        let (one, two) = (TAU * u, 2.0 * TAU * u);
        match (self.waves, axis) {
            (false, _) => features.push(u as f32),
            (true, AZIMUTH) => features.extend([one.cos(), one.sin(), two.cos(), two.sin()].map(|wave| wave as f32)),
            (true, _) => features.extend([2.0 * u - 1.0, one.cos(), two.cos(), u.powi(16)].map(|wave| wave as f32)),
        }
    }

    /// The adjoint of the coordinate, given that of what [`Self::push_features`] made of it.
    pub fn pull_features(&self, axis: usize, u: f64, d_features: &[f32]) -> f64 {
        let (one, two) = (TAU * u, 2.0 * TAU * u);
        let slopes = match (self.waves, axis) {
            (false, _) => return f64::from(d_features[0]),
            (true, AZIMUTH) => [-TAU * one.sin(), TAU * one.cos(), -2.0 * TAU * two.sin(), 2.0 * TAU * two.cos()],
            (true, _) => [2.0, -TAU * one.sin(), -2.0 * TAU * two.sin(), 16.0 * u.powi(15)],
        };
        slopes.iter().zip(d_features).map(|(slope, &adjoint)| slope * f64::from(adjoint)).sum()
    }
}

/// Layers of the paper's conditioner, a U-Net without convolutions: 256, 128, 64, 32, 16, and back with skips.
fn unet_layers(last: usize) -> Vec<Layer> {
    let plain = |outputs| Layer { outputs, beside: None };
    let beside = |outputs, index| Layer { outputs, beside: Some(index) };
    let down = [256, 128, 64, 32, 16].map(plain);
    let up = [plain(32), beside(64, 3), beside(128, 2), beside(256, 1), plain(last)];
    down.into_iter().chain(up).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_configurations_are_sound_and_of_known_size() {
        let weights = |architecture: &Architecture| -> usize {
            assert!(architecture.is_sound());
            architecture.couplings.iter().map(|coupling| architecture.net(coupling).weight_count()).sum()
        };
        assert_eq!(weights(&Architecture::paper(CODE)), 840_006);
        assert_eq!(weights(&Architecture::paper(0)), 815_430);
        assert!(weights(&Architecture::compact(CODE)) < 120_000);
        assert!(Architecture::compact(CODE).is_triangular() && !Architecture::paper(CODE).is_triangular());
        assert!((200_000..230_000).contains(&weights(&Architecture::shaped(CODE, 102))));
        let mut broken = Architecture::compact(CODE);
        broken.couplings[0].bins += 1;
        assert!(!broken.is_sound());
        assert!(!Architecture { shape: CODE + 1, ..Architecture::compact(CODE) }.is_sound());
        assert!(!Architecture { gates: true, ..Architecture::compact(0) }.is_sound());
        assert!(!Architecture { gates: true, ..Architecture::paper(CODE) }.is_sound());
        for architecture in [Architecture::compact(CODE), Architecture::shaped(CODE, 102)] {
            let text = serde_json::to_string(&architecture).unwrap();
            assert_eq!(serde_json::from_str::<Architecture>(&text).unwrap(), architecture);
        }
    }
}
