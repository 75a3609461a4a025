//! Neural fits of MERL materials (Sztrajman, Rainer, Ritschel and Weyrich 2021): a tiny net for each.
//!
//! A net maps the half vector at azimuth 0 and the difference vector, six numbers, through two layers of 21 units with
//! a ramp to three: `f = max(exp(a W3 + b3) - 1, 0)`, reflectance in 1/sr, linear RGB, without the cosine.
//!
//! A library folder holds `merl_dev88_names.txt`, a name a line, and `merl_dev88_weights_f32le.bin`, 675 numbers a
//! material in the order W1 (6 x 21, row-major by input), b1, W2 (21 x 21), b2, W3 (21 x 3), b3.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::measured::coordinates::HalfDifference;
use crate::measured::table::MeasuredBrdf;
use std::path::Path;

/// Name of the list of materials in a library folder.
pub const NAMES_FILE: &str = "merl_dev88_names.txt";
/// Name of the weights in a library folder.
pub const WEIGHTS_FILE: &str = "merl_dev88_weights_f32le.bin";
/// Weights of one material.
pub const WEIGHT_COUNT: usize = INPUTS * UNITS + UNITS + UNITS * UNITS + UNITS + UNITS * 3 + 3;

const INPUTS: usize = 6;
const UNITS: usize = 21;
/// Points that go through a net together: the innermost loops run over them.
const LANES: usize = 32;
/// Most materials of a library; more means that the file is something else.
const MOST_MATERIALS: usize = 10_000;

/// The net of one material.
#[derive(Clone, Debug, PartialEq)]
pub struct NeuralFit {
    /// MERL's name of the material, such as `alum-bronze`.
    pub name: String,
    weights: Vec<f32>,
}

/// The nets of a library, in the order of its list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NeuralFits {
    /// One a material.
    pub materials: Vec<NeuralFit>,
}

impl NeuralFits {
    /// Reads the fits of a library folder.
    ///
    /// Errors: a missing file; a list that is empty, too long or names a material twice; weights of another number; a
    /// weight that is not finite.
    pub fn read(folder: &Path) -> Result<Self> {
        let names_path = folder.join(NAMES_FILE);
        let explain = |error: Error| error.remedy("give the folder that holds the neural fits of the MERL materials");
        let text =
            std::fs::read_to_string(&names_path).map_err(|source| explain(Error::reading(&names_path, source)))?;
        let names: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        if names.is_empty() || names.len() > MOST_MATERIALS {
            return Err(Error::new(ErrorKind::Malformed, format!("a list of {} materials", names.len()))
                .at(Place::File(names_path)));
        }
        for (index, name) in names.iter().enumerate() {
            if names[..index].contains(name) {
                return Err(Error::new(ErrorKind::Malformed, format!("the material {name} is listed twice"))
                    .at(Place::File(names_path)));
            }
        }

        let weights_path = folder.join(WEIGHTS_FILE);
        let expected = (names.len() * WEIGHT_COUNT * 4) as u64;
        let metadata =
            std::fs::metadata(&weights_path).map_err(|source| explain(Error::reading(&weights_path, source)))?;
        if metadata.len() != expected {
            let message = format!("{} bytes, where {} materials need {expected}", metadata.len(), names.len());
            return Err(explain(Error::new(ErrorKind::Malformed, message).at(Place::File(weights_path))));
        }
        let bytes = std::fs::read(&weights_path).map_err(|source| Error::reading(&weights_path, source))?;
        let weights: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        if let Some(place) = weights.iter().position(|weight| !weight.is_finite()) {
            return Err(Error::new(ErrorKind::NonFinite, "a weight is not finite")
                .at(Place::Byte(weights_path, 4 * place as u64))
                .remedy("copy the file again"));
        }
        let materials = names
            .iter()
            .zip(weights.chunks_exact(WEIGHT_COUNT))
            .map(|(name, weights)| NeuralFit { name: (*name).into(), weights: weights.into() })
            .collect();
        Ok(NeuralFits { materials })
    }

    /// The fit of this name; the error names the closest ones.
    pub fn find(&self, name: &str) -> Result<&NeuralFit> {
        self.materials.iter().find(|fit| fit.name == name).ok_or_else(|| {
            let part = name.split('-').next().unwrap_or(name);
            let near: Vec<&str> =
                self.materials.iter().map(|fit| fit.name.as_str()).filter(|n| n.contains(part)).take(5).collect();
            let remedy = match near.is_empty() {
                true => "`patina measured list` shows all names".to_string(),
                false => format!("there are {}", near.join(", ")),
            };
            Error::new(ErrorKind::Missing, format!("no material is called {name}")).remedy(remedy)
        })
    }
}

impl NeuralFit {
    /// Reflectance in 1/sr.
    pub fn value(&self, at: HalfDifference) -> [f64; 3] {
        let mut value = [[0.0; 3]];
        self.evaluate(&[at], &mut value);
        value[0]
    }

    /// Writes reflectance in 1/sr at each point; `at` and `values` have the same length.
    pub fn evaluate(&self, at: &[HalfDifference], values: &mut [[f64; 3]]) {
        for (at, values) in at.chunks(LANES).zip(values.chunks_mut(LANES)) {
            self.evaluate_lanes(at, values);
        }
    }

    /// The whole table: "MERL via neural fits". Cells below the horizon are invalid.
    pub fn table(&self) -> MeasuredBrdf {
        MeasuredBrdf::from_batches(|at, values| self.evaluate(at, values))
    }

    fn evaluate_lanes(&self, at: &[HalfDifference], values: &mut [[f64; 3]]) {
        let mut input = [[0.0f32; LANES]; INPUTS];
        for (lane, at) in at.iter().enumerate() {
            let (sin_half, cos_half) = at.theta_half.sin_cos();
            let (sin_difference, cos_difference) = at.theta_difference.sin_cos();
            let (sin_phi, cos_phi) = at.phi_difference.sin_cos();
            let vector = [sin_half, 0.0, cos_half, sin_difference * cos_phi, sin_difference * sin_phi, cos_difference];
            for (row, value) in input.iter_mut().zip(vector) {
                row[lane] = value as f32;
            }
        }
        let (first, rest) = self.weights.split_at(INPUTS * UNITS + UNITS);
        let (second, third) = rest.split_at(UNITS * UNITS + UNITS);
        let mut hidden = [[0.0f32; LANES]; UNITS];
        let mut hidden_second = [[0.0f32; LANES]; UNITS];
        let mut output = [[0.0f32; LANES]; 3];
        layer(first, &input, &mut hidden);
        ramp(&mut hidden);
        layer(second, &hidden, &mut hidden_second);
        ramp(&mut hidden_second);
        layer(third, &hidden_second, &mut output);
        for (lane, value) in values.iter_mut().enumerate() {
            *value = std::array::from_fn(|channel| f64::from(output[channel][lane]).exp_m1().max(0.0));
        }
    }
}

/// `output = input W + b`, weights row-major by input with the biases behind them.
fn layer<const IN: usize, const OUT: usize>(
    weights: &[f32],
    input: &[[f32; LANES]; IN],
    output: &mut [[f32; LANES]; OUT],
) {
    let (matrix, biases) = weights.split_at(IN * OUT);
    for (unit, output) in output.iter_mut().enumerate() {
        *output = [biases[unit]; LANES];
        for (source, input) in input.iter().enumerate() {
            let weight = matrix[source * OUT + unit];
            for lane in 0..LANES {
                output[lane] += weight * input[lane];
            }
        }
    }
}

fn ramp<const UNITS: usize>(values: &mut [[f32; LANES]; UNITS]) {
    values.as_flattened_mut().iter_mut().for_each(|value| *value = value.max(0.0));
}
