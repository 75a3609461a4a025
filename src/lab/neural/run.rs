//! A sitting of training: steps, checkpoints, the table of the curve, and the weights at the end.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::neural::architecture::Architecture;
use crate::neural::library::Library;
use crate::neural::train::{TrainSettings, Training};
use crate::neural::weights::{self, Account};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Seconds between checkpoints.
const CHECKPOINT_SECONDS: u64 = 60;
/// Steps that one row of the curve sums up.
const STEPS_PER_ROW: u64 = 100;

/// What to train and where to leave it.
#[derive(Clone, Debug)]
pub struct Sitting {
    /// The file of weights; checkpoint and curve lie beside it.
    pub output: PathBuf,
    /// What the flow is made of.
    pub architecture: Architecture,
    /// How to train.
    pub settings: TrainSettings,
    /// Names of materials kept out on purpose, for the account.
    pub left_out: Vec<String>,
    /// The command, for the account.
    pub command: String,
    /// Stop after this long, to be taken up again.
    pub time: Option<Duration>,
    /// Take up the checkpoint beside the output.
    pub resume: bool,
}

/// Where the checkpoint of an output is.
pub fn checkpoint_path(output: &Path) -> PathBuf {
    output.with_extension("checkpoint.safetensors")
}

/// Where the curve of an output is.
pub fn curve_path(output: &Path) -> PathBuf {
    output.with_extension("curve.csv")
}

/// Trains until the last step, the time or `stop`; returns the account. `tell` hears of the progress.
///
/// Whenever a sitting ends, weights and checkpoint are written; `resume` goes on from there with the same bits. Only in the
/// curve, the row that was interrupted is the mean of the steps after it.
///
/// Errors: a checkpoint that is not there, of another architecture or of other materials; a file that cannot be
/// written.
pub fn train(sitting: &Sitting, library: &Library, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<Account> {
    let (checkpoint, curve) = (checkpoint_path(&sitting.output), curve_path(&sitting.output));
    let mut rows = String::from("step,seconds,log_likelihood_nats,divergence_nats,log_error,rate_factor\n");
    let (mut training, mut account) = if sitting.resume {
        let (training, account) = weights::read_checkpoint(&checkpoint)?;
        check(&account, sitting, library).map_err(|error| error.at(Place::File(checkpoint.clone())))?;
        rows = std::fs::read_to_string(&curve).map_err(|source| Error::reading(&curve, source))?;
        (training, account)
    } else {
        let training = Training::new(sitting.architecture.clone(), library, sitting.settings.clone())?;
        let account = Account::new(
            &sitting.architecture,
            &sitting.settings,
            library.names.clone(),
            sitting.left_out.clone(),
            library.statement.clone(),
            sitting.command.clone(),
        );
        (training, account)
    };
    let log_colours = Training::log_colours(library);
    let begin = Instant::now();
    let before = account.seconds;
    let mut saved = Instant::now();
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    loop {
        let time_is_up = sitting.time.is_some_and(|time| begin.elapsed() >= time);
        let end = training.step >= training.settings.steps || stop.load(Ordering::Relaxed) || time_is_up;
        if end || saved.elapsed().as_secs() >= CHECKPOINT_SECONDS {
            account.step = training.step;
            account.seconds = before + begin.elapsed().as_secs_f64();
            let figures = training.figures(library);
            account.log_likelihood = figures.log_likelihood;
            account.divergence = figures.divergence;
            account.log_error = figures.squared_log_error.sqrt();
            weights::write(&checkpoint, &account, &training, &log_colours, true)?;
            weights::write(&sitting.output, &account, &training, &log_colours, false)?;
            write_bytes(&curve, rows.as_bytes())?;
            saved = Instant::now();
            tell(&format!(
                "step {} of {}: log likelihood {:.5}, short of its bound by {:.5} nats, log error {:.4}, {:.0} s",
                training.step,
                training.settings.steps,
                account.log_likelihood,
                account.divergence,
                account.log_error,
                account.seconds
            ));
        }
        if end {
            return Ok(account);
        }
        let figures = training.step(library);
        sum[0] += figures.log_likelihood;
        sum[1] += figures.divergence;
        sum[2] += figures.squared_log_error;
        count += 1.0;
        if training.step % STEPS_PER_ROW == 0 {
            let factor = training.settings.schedule.factor(training.step, training.settings.steps);
            let seconds = before + begin.elapsed().as_secs_f64();
            let [likelihood, divergence, squared] = sum.map(|sum| sum / count);
            rows.push_str(&format!(
                "{},{seconds:.1},{likelihood:.6},{divergence:.6},{:.5},{factor:.5}\n",
                training.step,
                squared.sqrt()
            ));
            (sum, count) = ([0.0; 3], 0.0);
        }
    }
}

/// Whether a checkpoint is of what was asked for.
fn check(account: &Account, sitting: &Sitting, library: &Library) -> Result<()> {
    let refuse = |what: &str| {
        Err(Error::new(ErrorKind::InvalidSetting, what.to_string())
            .remedy("take the run up with the options it began with, or begin anew without --resume"))
    };
    if account.architecture != sitting.architecture {
        return refuse("the checkpoint is of another architecture");
    }
    if account.materials != library.names {
        return refuse("the checkpoint was trained on other materials");
    }
    if account.data != library.statement {
        return refuse(&format!("the checkpoint was trained on {}, not on {}", account.data, library.statement));
    }
    if account.left_out != sitting.left_out {
        return refuse("the checkpoint left out other materials");
    }
    if account.settings != sitting.settings {
        return refuse("the checkpoint was trained with other settings");
    }
    Ok(())
}
