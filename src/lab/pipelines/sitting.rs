//! Snakemake as a process with all that it starts, to be waited for, told to end, or killed.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::lab::other_programs::{Remedies, last_lines, output_of};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often a process is looked at.
const INTERVAL: Duration = Duration::from_millis(20);
/// A sitting that takes longer hangs.
const LONGEST: Duration = Duration::from_secs(1200);

const REMEDIES: Remedies = Remedies {
    unstarted: "name the Python that has snakemake with --python",
    failed: "install snakemake (tests/pipelines/README.md) and name its Python with --python",
};

/// What Snakemake is started with.
#[derive(Clone, Debug)]
pub struct Workflow {
    /// The Python that has it.
    pub python: PathBuf,
    /// The workflow.
    pub snakefile: PathBuf,
    /// Its configuration.
    pub config: PathBuf,
    /// Where it keeps its own state, and where logs go.
    pub folder: PathBuf,
    /// Where the workflow writes.
    pub results: PathBuf,
}

impl Workflow {
    fn command(&self, more: &[&str]) -> Command {
        let mut command = Command::new(&self.python);
        command.current_dir(&self.folder).args(["-m", "snakemake", "--cores", "2", "--keep-going", "--snakefile"]);
        command.arg(&self.snakefile).arg("--configfile").arg(&self.config).args(more).stdin(Stdio::null());
        command
    }

    /// Takes away the lock that a killed Snakemake leaves.
    ///
    /// # Errors
    /// What Snakemake says.
    pub fn unlock(&self) -> Result<()> {
        output_of(&mut self.command(&["--unlock"]), REMEDIES).map(|_| ())
    }
}

/// A Snakemake that runs. Dropped on the way, it is killed with all that it started.
pub struct Sitting {
    child: Child,
    log: PathBuf,
    began: Instant,
    is_over: bool,
}

/// How a sitting ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// Its exit code.
    pub status: ExitStatus,
    /// Seconds it took.
    pub seconds: f64,
    /// The last lines of its log.
    pub said: String,
}

impl Sitting {
    /// Starts the workflow; what it says goes to `NAME.log`.
    ///
    /// # Errors
    /// A Python that cannot be started; `Unsupported` where processes have no groups.
    pub fn start(workflow: &Workflow, more: &[&str], name: &str) -> Result<Self> {
        let log = workflow.folder.join(format!("{name}.log"));
        let written = File::create(&log).map_err(|source| Error::writing(&log, source))?;
        let again = written.try_clone().map_err(|source| Error::writing(&log, source))?;
        let mut command = workflow.command(more);
        in_own_group(&mut command)?;
        let child = command.stdout(written).stderr(again).spawn().map_err(|source| {
            Error::new(ErrorKind::Missing, format!("{} cannot be started: {source}", workflow.python.display()))
                .remedy(REMEDIES.unstarted)
        })?;
        Ok(Sitting { child, log, began: Instant::now(), is_over: false })
    }

    /// Waits until something happened.
    ///
    /// # Errors
    /// `Unsupported` when the sitting ends first; `Stopped`.
    pub fn wait_until(&mut self, happened: impl Fn() -> bool, stop: &AtomicBool) -> Result<()> {
        while !happened() {
            if self.status()?.is_some() {
                let message = format!("Snakemake ended before its fit could be interrupted:\n{}", said(&self.log));
                return Err(Error::new(ErrorKind::Unsupported, message)
                    .at(Place::File(self.log.clone()))
                    .remedy(REMEDIES.failed));
            }
            self.look_again(stop)?;
        }
        Ok(())
    }

    /// Waits until something happened that the sitting's end does not hinder.
    ///
    /// # Errors
    /// `Numerical` when it takes too long; `Stopped`.
    pub fn wait_until_left(&mut self, happened: impl Fn() -> bool, stop: &AtomicBool) -> Result<()> {
        while !happened() {
            self.look_again(stop)?;
        }
        Ok(())
    }

    /// Waits for the end.
    ///
    /// # Errors
    /// `Numerical` when it takes too long; `Stopped`.
    pub fn wait(mut self, stop: &AtomicBool) -> Result<Ended> {
        loop {
            if let Some(status) = self.status()? {
                self.is_over = true;
                let seconds = self.began.elapsed().as_secs_f64();
                return Ok(Ended { status, seconds, said: said(&self.log) });
            }
            self.look_again(stop)?;
        }
    }

    /// Tells all its processes to end, as a queue does before it kills.
    ///
    /// # Errors
    /// A signal that cannot be sent.
    pub fn tell_to_end(&mut self) -> Result<()> {
        signal("TERM", self.child.id())
    }

    /// Kills all its processes at once.
    ///
    /// # Errors
    /// A signal that cannot be sent.
    pub fn kill(mut self) -> Result<()> {
        self.is_over = true;
        // Those that were told to end may be gone: then there is nobody to kill.
        let killed = signal("KILL", self.child.id());
        let ended = self.child.wait().map_err(|source| Error::reading(&self.log, source));
        ended.map(|_| ()).or(killed)
    }

    fn status(&mut self) -> Result<Option<ExitStatus>> {
        self.child.try_wait().map_err(|source| Error::reading(&self.log, source))
    }

    fn look_again(&self, stop: &AtomicBool) -> Result<()> {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(ErrorKind::Stopped, "stopped while the workflow ran"));
        }
        if self.began.elapsed() > LONGEST {
            return Err(Error::new(ErrorKind::Numerical, format!("the workflow hangs:\n{}", said(&self.log)))
                .at(Place::File(self.log.clone()))
                .remedy("its log says what it waits for"));
        }
        std::thread::sleep(INTERVAL);
        Ok(())
    }
}

impl Drop for Sitting {
    fn drop(&mut self) {
        if !self.is_over {
            let _ = signal("KILL", self.child.id());
            let _ = self.child.wait();
        }
    }
}

fn said(log: &Path) -> String {
    std::fs::read(log).map_or_else(|_| String::new(), |bytes| last_lines(&String::from_utf8_lossy(&bytes)))
}

/// Makes a process and all that it starts one group, which is signalled at once.
#[cfg(unix)]
fn in_own_group(command: &mut Command) -> Result<()> {
    std::os::unix::process::CommandExt::process_group(command, 0);
    Ok(())
}

#[cfg(not(unix))]
fn in_own_group(_: &mut Command) -> Result<()> {
    Err(Error::new(ErrorKind::Unsupported, "processes have no groups here, and cannot be killed with all they started")
        .remedy("run it on Linux or macOS"))
}

/// Sends a signal to a group of processes.
fn signal(name: &str, group: u32) -> Result<()> {
    let remedies = Remedies { unstarted: "install the program `kill`", failed: "the processes ended by themselves" };
    output_of(Command::new("kill").args(["-s", name, "--", &format!("-{group}")]), remedies).map(|_| ())
}
