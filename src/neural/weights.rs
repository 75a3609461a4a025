//! Files of weights: safetensors with an account of how they were made.
//!
//! Tensors: `weights` (all conditioners, one after the other), `codes` (row per material and channel), `shapes` (row per
//! material, where codes have a part that its channels share), `log_colours` (one a row), and in a checkpoint the moments
//! of Adam. The account is JSON under the key `patina` of the metadata.

use super::adam::Adam;
use super::architecture::Architecture;
use super::flow::Flow;
use super::train::{TrainSettings, Training};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use std::path::Path;

/// Key of the account in the metadata of a file.
const KEY: &str = "patina";
/// What the account says such a file is.
const KIND: &str = "ibrdf";

/// How weights were made.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Account {
    /// `ibrdf`.
    pub kind: String,
    /// What the flow is made of.
    pub architecture: Architecture,
    /// Names of the materials whose codes are in the file.
    pub materials: Vec<String>,
    /// Names of materials kept from it on purpose.
    pub left_out: Vec<String>,
    /// What was learned from.
    pub data: String,
    /// The command that made it.
    pub command: String,
    /// How it was trained.
    pub settings: TrainSettings,
    /// Steps done.
    pub step: u64,
    /// Seconds of training, all sittings together.
    pub seconds: f64,
    /// Mean log likelihood in nats over all materials (equation 7), on points not trained on.
    pub log_likelihood: f64,
    /// What that lacks to its bound, in nats.
    pub divergence: f64,
    /// Root of the mean squared difference of the logarithms of stored values over the cube.
    pub log_error: f64,
}

/// A trained flow with the codes of the materials it was trained on.
#[derive(Clone, Debug)]
pub struct Trained {
    /// How it was made.
    pub account: Account,
    /// The flow.
    pub flow: Flow,
    /// A row per material and channel, channels fastest; its last numbers are the material's shape, if there is one.
    pub codes: Vec<f32>,
    /// The colour of each density, as a logarithm.
    pub log_colours: Vec<f32>,
}

impl Account {
    /// An account of training that has not begun.
    pub fn new(
        architecture: &Architecture,
        settings: &TrainSettings,
        materials: Vec<String>,
        left_out: Vec<String>,
        data: String,
        command: String,
    ) -> Self {
        Account {
            kind: KIND.into(),
            architecture: architecture.clone(),
            materials,
            left_out,
            data,
            command,
            settings: settings.clone(),
            step: 0,
            seconds: 0.0,
            log_likelihood: f64::NAN,
            divergence: f64::NAN,
            log_error: f64::NAN,
        }
    }
}

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Writes weights, codes and colours, and for a checkpoint the moments too; whole or not at all.
pub fn write(path: &Path, account: &Account, training: &Training, log_colours: &[f32], checkpoint: bool) -> Result<()> {
    let rows = log_colours.len();
    let mut parts = parts_of(account, &training.flow, &training.codes, log_colours);
    if checkpoint {
        let of_codes = |pick: fn(&Adam) -> &Vec<f32>| -> Vec<f32> {
            training.of_codes.iter().flat_map(|adam| pick(adam).iter().copied()).collect()
        };
        let steps: Vec<u8> = training.of_codes.iter().flat_map(|adam| (adam.steps as f32).to_le_bytes()).collect();
        let count = training.flow.weights.len();
        parts.push(("weights_first", vec![count], bytes(&training.of_weights.first)));
        parts.push(("weights_second", vec![count], bytes(&training.of_weights.second)));
        parts.push(("codes_first", vec![rows, account.architecture.code], bytes(&of_codes(|adam| &adam.first))));
        parts.push(("codes_second", vec![rows, account.architecture.code], bytes(&of_codes(|adam| &adam.second))));
        parts.push(("codes_steps", vec![rows], steps));
    }
    pack(path, account, &parts)
}

/// A tensor to be written: name, shape, bytes.
type Part = (&'static str, Vec<usize>, Vec<u8>);

/// What every file of weights holds. The part of codes that the channels of a material share is written once.
fn parts_of(account: &Account, flow: &Flow, codes: &[f32], log_colours: &[f32]) -> Vec<Part> {
    let (rows, length, shape) = (log_colours.len(), account.architecture.code, account.architecture.shape);
    let own = length - shape;
    let mut parts = vec![("weights", vec![flow.weights.len()], bytes(&flow.weights))];
    if shape > 0 {
        let of_channels: Vec<f32> = codes.chunks_exact(length).flat_map(|row| row[..own].to_vec()).collect();
        let shared: Vec<f32> = codes.chunks_exact(length).step_by(3).flat_map(|row| row[own..].to_vec()).collect();
        parts.push(("codes", vec![rows, own], bytes(&of_channels)));
        parts.push(("shapes", vec![rows / 3, shape], bytes(&shared)));
    } else {
        parts.push(("codes", vec![rows, length], bytes(codes)));
    }
    parts.push(("log_colours", vec![rows], bytes(log_colours)));
    parts
}

/// The codes of a file, a whole row for each material and channel.
fn codes_of(tensors: &SafeTensors, architecture: &Architecture, materials: usize) -> Result<Vec<f32>> {
    let (shape, own) = (architecture.shape, architecture.code - architecture.shape);
    let codes = numbers(tensors, "codes", 3 * materials * own)?;
    if shape == 0 {
        return Ok(codes);
    }
    let shapes = numbers(tensors, "shapes", materials * shape)?;
    let row = |index: usize| {
        let of_channel = &codes[index * own..(index + 1) * own];
        of_channel.iter().chain(&shapes[index / 3 * shape..(index / 3 + 1) * shape]).copied()
    };
    Ok((0..3 * materials).flat_map(row).collect())
}

/// Writes tensors with their account; whole or not at all.
fn pack(path: &Path, account: &Account, parts: &[Part]) -> Result<()> {
    let internal = |cause: String| Error::new(ErrorKind::Internal, format!("weights cannot be packed: {cause}"));
    let text = serde_json::to_string(account).map_err(|source| internal(source.to_string()))?;
    let mut views = Vec::new();
    for (name, shape, data) in parts {
        let view = TensorView::new(Dtype::F32, shape.clone(), data).map_err(|source| internal(source.to_string()))?;
        views.push((*name, view));
    }
    let metadata = std::iter::once((KEY.to_string(), text)).collect();
    let packed = serialize(views, Some(metadata)).map_err(|source| internal(source.to_string()))?;
    write_bytes(path, &packed)
}

/// Numbers of a tensor; an error when it is absent, of another length, or holds numbers that are not finite.
fn numbers(tensors: &SafeTensors, name: &str, count: usize) -> Result<Vec<f32>> {
    let damaged = |what: String| {
        Error::new(ErrorKind::Malformed, what).remedy("these are weights of another architecture, or a damaged file")
    };
    let view = tensors.tensor(name).map_err(|_| damaged(format!("there is no tensor `{name}`")))?;
    if view.dtype() != Dtype::F32 || view.data().len() != 4 * count {
        let found = view.shape().iter().product::<usize>();
        return Err(damaged(format!("tensor `{name}` holds {found} numbers where {count} f32 are needed")));
    }
    let values: Vec<f32> =
        view.data().chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect();
    if values.iter().any(|value| !value.is_finite()) {
        return Err(Error::new(ErrorKind::NonFinite, format!("tensor `{name}` holds numbers that are not finite"))
            .remedy("take another file of weights"));
    }
    Ok(values)
}

fn parse(content: &[u8]) -> Result<(Account, SafeTensors<'_>)> {
    let malformed =
        |what: String| Error::new(ErrorKind::Malformed, what).remedy("name a file that `patina measured train` wrote");
    let (_, header) =
        SafeTensors::read_metadata(content).map_err(|cause| malformed(format!("no safetensors file: {cause}")))?;
    let tensors =
        SafeTensors::deserialize(content).map_err(|cause| malformed(format!("no safetensors file: {cause}")))?;
    let text = header.metadata().as_ref().and_then(|metadata| metadata.get(KEY).cloned());
    let text = text.ok_or_else(|| malformed("these weights do not say what they are".into()))?;
    let account: Account = serde_json::from_str(&text)
        .map_err(|cause| malformed(format!("the account of these weights is not understood: {cause}")))?;
    if account.kind != KIND {
        return Err(malformed(format!("these are weights of `{}`, not of `{KIND}`", account.kind)));
    }
    Ok((account, tensors))
}

impl Trained {
    /// Reads weights from the content of a file.
    ///
    /// Errors: not safetensors, weights of another architecture than the account says, numbers that are not finite.
    pub fn parse(content: &[u8]) -> Result<Self> {
        let (account, tensors) = parse(content)?;
        let mut flow = Flow::new(account.architecture.clone(), 0)?;
        flow.weights = numbers(&tensors, "weights", flow.weights.len())?;
        let rows = 3 * account.materials.len();
        let codes = codes_of(&tensors, &account.architecture, account.materials.len())?;
        let log_colours = numbers(&tensors, "log_colours", rows)?;
        Ok(Trained { account, flow, codes, log_colours })
    }

    /// Reads a file of weights; see [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self> {
        let content = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
        Self::parse(&content).map_err(|error| error.at(Place::File(path.into())))
    }

    /// Writes the weights, to be read again by [`Self::read`]; whole or not at all.
    ///
    /// Errors: a file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        pack(path, &self.account, &parts_of(&self.account, &self.flow, &self.codes, &self.log_colours))
    }

    /// The codes of a material, one a channel, with the logarithms of its colours; `None` for a name not known.
    pub fn material(&self, name: &str) -> Option<([&[f32]; 3], [f32; 3])> {
        let index = self.account.materials.iter().position(|own| own == name)?;
        let length = self.account.architecture.code;
        let row = |channel: usize| &self.codes[(3 * index + channel) * length..(3 * index + channel + 1) * length];
        let colours = [0, 1, 2].map(|channel| self.log_colours[3 * index + channel]);
        Some(([row(0), row(1), row(2)], colours))
    }
}

/// Reads a checkpoint: training as it stood, and its account.
pub fn read_checkpoint(path: &Path) -> Result<(Training, Account)> {
    let content = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    let read = || -> Result<(Training, Account)> {
        let (account, tensors) = parse(&content)?;
        let trained = Trained::parse(&content)?;
        let (count, length, rows) =
            (trained.flow.weights.len(), account.architecture.code, 3 * account.materials.len());
        let of_weights = Adam {
            first: numbers(&tensors, "weights_first", count)?,
            second: numbers(&tensors, "weights_second", count)?,
            steps: account.step,
        };
        let first = numbers(&tensors, "codes_first", rows * length)?;
        let second = numbers(&tensors, "codes_second", rows * length)?;
        let steps = numbers(&tensors, "codes_steps", rows)?;
        let of_codes = (0..rows)
            .map(|row| {
                let range = row * length..(row + 1) * length;
                Adam { first: first[range.clone()].into(), second: second[range].into(), steps: steps[row] as u64 }
            })
            .collect();
        let (flow, codes, settings, step) = (trained.flow, trained.codes, account.settings.clone(), account.step);
        Ok((Training { flow, codes, of_weights, of_codes, step, settings }, account))
    };
    read().map_err(|error| error.at(Place::File(path.into())))
}
