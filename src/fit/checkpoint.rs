//! A fit's state as one file, written whole or not at all.
//!
//! Layout: the line `PATINA CHECKPOINT 1`, eight bytes with the length of a JSON text, that text, then the arrays as
//! `f32` in a fixed order, in the byte order of the machine, which is little-endian on all that are supported, then
//! eight bytes with a checksum over all before them.

use super::adam::Moments;
use super::event::FitEvent;
use super::schedule::Stage;
use super::solver::TexelVariance;
use super::state::{FitState, LossRow};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_atomically;
use crate::material::Material;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use std::path::Path;

const MAGIC: &[u8] = b"PATINA CHECKPOINT 1\n";

/// How the numbers of a texel stand in the file: seven of them, and one more that goes with them, or 0.
type Row = [f32; 8];

fn row([a, b, c, d, e, f, g]: [f32; 7], last: f32) -> Row {
    [a, b, c, d, e, f, g, last]
}

fn of_row([a, b, c, d, e, f, g, last]: Row) -> ([f32; 7], f32) {
    ([a, b, c, d, e, f, g], last)
}

#[derive(Serialize, Deserialize)]
struct Header {
    /// Empty in files of versions that could not change it on the way.
    #[serde(default)]
    plan: Vec<Stage>,
    stage: usize,
    step_in_stage: usize,
    step: usize,
    map_size: usize,
    /// Texels of which variances are known; none in files of versions that kept them elsewhere.
    #[serde(default)]
    variances: usize,
    light_texels: usize,
    /// Of versions that kept it.
    #[serde(default)]
    light_scale_deviation: Option<f64>,
    views: usize,
    losses: Vec<LossRow>,
    non_finite: Vec<(String, u64)>,
    events: Vec<FitEvent>,
    seconds: f64,
}

/// Writes a state; the file that was there before stays until the new one is complete.
///
/// # Errors
/// `Unwritable`, with the place.
pub fn write(path: &Path, state: &FitState) -> Result<()> {
    let header = Header {
        plan: state.plan.clone(),
        stage: state.stage,
        step_in_stage: state.step_in_stage,
        step: state.step,
        map_size: state.map_size,
        variances: state.variances.len(),
        light_texels: state.light.len(),
        light_scale_deviation: state.light_scale_deviation,
        views: state.log_gains.len(),
        losses: state.losses.clone(),
        non_finite: state.non_finite.clone(),
        events: state.events.clone(),
        seconds: state.seconds,
    };
    let json = serde_json::to_vec(&header)
        .map_err(|source| Error::new(ErrorKind::Internal, format!("cannot encode a checkpoint: {source}")))?;
    write_atomically(path, |writer| {
        let mut checksum = Checksum::default();
        let mut put = |bytes: &[u8]| {
            checksum.add(bytes);
            writer.write_all(bytes)
        };
        put(MAGIC)?;
        put(&(json.len() as u64).to_le_bytes())?;
        put(&json)?;
        let mut put_rows = |rows: &mut dyn Iterator<Item = Row>| {
            for row in rows {
                put(bytemuck::bytes_of(&row))?;
            }
            std::io::Result::Ok(())
        };
        put_rows(&mut state.texels.iter().map(|texel| row(texel.to_array(), 0.0)))?;
        for moments in [&state.moments, &state.light_moments, &state.gain_moments] {
            put_rows(
                &mut moments.first.iter().zip(&moments.updates).map(|(numbers, updates)| row(*numbers, *updates)),
            )?;
            put_rows(&mut moments.second.iter().map(|numbers| row(*numbers, 0.0)))?;
        }
        put_rows(&mut state.variances.iter().map(|own| row(own.variance.to_array(), own.lobe_cluster_size)))?;
        put(bytemuck::cast_slice(&state.light))?;
        put(bytemuck::cast_slice(&state.log_gains))?;
        let checksum = checksum.0;
        writer.write_all(&checksum.to_le_bytes())
    })
}

/// How far a checkpoint is.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Steps done.
    pub step: usize,
    /// Steps of all stages; 0 in files of versions that did not write them.
    pub steps_total: usize,
    /// Width and height of the maps in texels.
    pub map_size: usize,
    /// The curve so far.
    pub losses: Vec<LossRow>,
}

/// Reads how far a checkpoint is, without its arrays and without looking at its checksum.
///
/// # Errors
/// `Missing`, `Unreadable` or `Malformed`, with the place.
pub fn summary(path: &Path) -> Result<Summary> {
    let mut file = std::fs::File::open(path).map_err(|source| Error::reading(path, source))?;
    let broken = || {
        Error::new(ErrorKind::Malformed, "not a whole checkpoint: its header is damaged")
            .at(Place::Byte(path.into(), 0))
            .remedy("start the run again, or copy the checkpoint anew")
    };
    let size = file.metadata().map_err(|source| Error::reading(path, source))?.len();
    let mut front = [0u8; MAGIC.len() + 8];
    file.read_exact(&mut front).map_err(|_| broken())?;
    let (magic, length) = front.split_at(MAGIC.len());
    let length = u64::from_le_bytes(length.try_into().unwrap_or_default());
    if magic != MAGIC || length > size {
        return Err(broken());
    }
    let mut json = vec![0u8; length as usize];
    file.read_exact(&mut json).map_err(|_| broken())?;
    let header: Header = serde_json::from_slice(&json).map_err(|_| broken())?;
    Ok(Summary {
        step: header.step,
        steps_total: header.plan.iter().map(|stage| stage.steps).sum(),
        map_size: header.map_size,
        losses: header.losses,
    })
}

/// Reads a state back, bit for bit.
///
/// # Errors
/// `Missing`, `Unreadable` or `Malformed`, with the place.
pub fn read(path: &Path) -> Result<FitState> {
    let bytes = std::fs::read(path).map_err(|source| {
        Error::reading(path, source).with_remedy("a run writes it while it goes; start the run again with `patina fit`")
    })?;
    let broken = |byte: usize, what: &str| {
        Error::new(ErrorKind::Malformed, format!("not a whole checkpoint: {what}"))
            .at(Place::Byte(path.into(), byte as u64))
            .remedy("the file is damaged: start the run again, or copy the checkpoint anew")
    };
    let body_end = bytes.len().checked_sub(8).ok_or_else(|| broken(0, "it is too short"))?;
    if !bytes.starts_with(MAGIC) {
        return Err(broken(0, "it does not begin with its name"));
    }
    let mut checksum = Checksum::default();
    checksum.add(&bytes[..body_end]);
    if bytes[body_end..] != checksum.0.to_le_bytes() {
        return Err(broken(body_end, "the checksum does not match"));
    }
    let mut rest = &bytes[MAGIC.len()..body_end];
    let length = rest.split_off(..8).ok_or_else(|| broken(MAGIC.len(), "it has no header"))?;
    let length = u64::from_le_bytes(length.try_into().unwrap_or_default()) as usize;
    let json = rest.split_off(..length).ok_or_else(|| broken(MAGIC.len(), "its header is cut"))?;
    let header: Header = serde_json::from_slice(json).map_err(|source| broken(MAGIC.len() + 8, &source.to_string()))?;

    let mut take = |floats: usize| -> Result<Vec<f32>> {
        let bytes = floats.checked_mul(4).and_then(|count| rest.split_off(..count));
        let bytes = bytes.ok_or_else(|| broken(body_end, "an array is cut"))?;
        Ok(bytes.chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect())
    };
    let mut rows = |count: usize| -> Result<Vec<([f32; 7], f32)>> {
        let floats = take(count.saturating_mul(8))?;
        Ok(floats.as_chunks().0.iter().copied().map(of_row).collect())
    };
    let count = header.map_size.saturating_mul(header.map_size);
    let texels = rows(count)?.into_iter().map(|(numbers, _)| Material::from_array(numbers)).collect();
    let mut moments = |count: usize| -> Result<Moments> {
        let (first, updates) = rows(count)?.into_iter().unzip();
        Ok(Moments { first, updates, second: rows(count)?.into_iter().map(|(numbers, _)| numbers).collect() })
    };
    let texel_moments = moments(count)?;
    let light_moments = moments(header.light_texels)?;
    let gain_moments = moments(header.views)?;
    let variance =
        |(numbers, lobe_cluster_size)| TexelVariance { variance: Material::from_array(numbers), lobe_cluster_size };
    let variances = rows(header.variances)?.into_iter().map(variance).collect();
    let light = take(header.light_texels.saturating_mul(3))?.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    let log_gains = take(header.views)?;
    if !rest.is_empty() {
        return Err(broken(body_end - rest.len(), "it is too long"));
    }
    Ok(FitState {
        plan: header.plan,
        stage: header.stage,
        step_in_stage: header.step_in_stage,
        step: header.step,
        map_size: header.map_size,
        texels,
        moments: texel_moments,
        variances,
        light,
        light_scale_deviation: header.light_scale_deviation,
        light_moments,
        log_gains,
        gain_moments,
        losses: header.losses,
        non_finite: header.non_finite,
        events: header.events,
        seconds: header.seconds,
    })
}

/// Fowler, Noll and Vo 1a over bytes: finds cuts and flips, no defence against intent.
#[derive(Default)]
struct Checksum(u64);

impl Checksum {
    /// Adds a run of bytes; how the bytes are split into runs does not matter.
    fn add(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> FitState {
        FitState {
            plan: crate::fit::schedule::stages(&crate::fit::FitSettings {
                method: crate::fit::Method::Adam,
                ..Default::default()
            }),
            stage: 1,
            step_in_stage: 2,
            step: 7,
            map_size: 2,
            texels: (0..4).map(|t| Material::from_array(std::array::from_fn(|n| (t * 7 + n) as f32 * 0.1))).collect(),
            moments: Moments {
                first: vec![[0.125; 7]; 4],
                second: vec![[0.5; 7]; 4],
                updates: vec![0.0, 1.0, 2.0, 3.0],
            },
            variances: vec![TexelVariance { variance: Material::from_array([0.25; 7]), lobe_cluster_size: 12.0 }; 4],
            light: vec![[1.5, 1e5, 1e-7]; 8],
            light_scale_deviation: Some(f64::MAX),
            light_moments: Moments::zeros(8),
            log_gains: vec![0.1, -0.1],
            gain_moments: Moments::zeros(2),
            losses: vec![LossRow {
                step: 1,
                stage: "diffuse 1/4".into(),
                seconds: 0.1 + 0.2,
                loss: 1.0 / 3.0,
                image_loss: 0.3,
                consistency: 0.0,
                surface_rmse: Some(0.2),
                held_out_rmse: Some(0.1),
            }],
            non_finite: vec![("x".into(), 3)],
            events: vec![FitEvent::saddle_left(0.0, 1.0 / 3.0), FitEvent::Told("of another version".into())],
            seconds: 12.3,
        }
    }

    #[test]
    fn round_trips_bit_for_bit_and_refuses_damage() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        write(&path, &state()).unwrap();
        assert_eq!(read(&path).unwrap(), state());
        let summary_of = |path: &Path| summary(path).map(|summary| (summary.step, summary.steps_total));
        assert_eq!(summary_of(&path).unwrap(), (7, 300));
        let good = std::fs::read(&path).unwrap();
        for cut in [0, 5, MAGIC.len() + 3, good.len() / 2, good.len() - 1] {
            crate::files::write_bytes(&path, &good[..cut]).unwrap();
            assert_eq!(read(&path).unwrap_err().kind(), ErrorKind::Malformed, "cut at {cut}");
            assert!(cut >= good.len() / 2 || summary(&path).is_err(), "cut at {cut}");
        }
        let mut flipped = good.clone();
        flipped[good.len() / 2] ^= 1;
        crate::files::write_bytes(&path, &flipped).unwrap();
        assert!(read(&path).is_err());
    }
}
