//! Damaged files of every kind that is read: an error with a remedy or a result, never a panic, never more memory than ten
//! times what lies there, never more than seconds.
//!
//! [`corpus`] has a few small whole files of each kind, [`mutate`] damages one of them at a time. An input is a pure function
//! of its seed, its kind and its number: what went wrong is asked for again with `--kind`, `--from` and `--inputs 1`.
//!
//! Memory is that of the whole process, as the allocator of `patina-lab` counts it, so inputs are opened one after the
//! other; for more than one processor, run several kinds side by side. In another program nothing is counted.

pub mod corpus;
pub mod mutate;

use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::file::{self, PhotoOptions};
use crate::math::random::{SequentialRandom, mix};
use crate::scene::{ReadSettings, doctor, read};
use corpus::{Kind, Opening, kinds};
use std::io::Write;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// Memory may be so many times what lies in the folder,
const MEMORY_FACTOR: usize = 10;
/// and so many bytes that do not grow with it: buffers of decoders, tables, threads' own.
const MEMORY_BASE: usize = 4 << 20;
/// Of a picture that is really there, bytes a pixel: its stored values, linear ones, states, a mask.
const MEMORY_PER_PIXEL: usize = 96;
/// No input may take longer, in seconds: a thousand times what a whole one takes.
const MOST_SECONDS: f64 = 5.0;
/// Of the inputs of a scene one in so many is read to its end and checked, if its cameras can be listed.
const WHOLE_EVERY: u64 = 16;

/// What is asked.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Inputs a kind.
    pub inputs: u64,
    /// Number of the first input.
    pub from: u64,
    /// Seed of all.
    pub seed: u64,
    /// Kinds by name; empty for all.
    pub kinds: Vec<String>,
    /// Where inputs that went wrong are kept.
    pub output: Option<PathBuf>,
}

/// What was seen of a kind.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Outcome {
    /// Its name.
    pub kind: String,
    /// Inputs that were opened.
    pub inputs: u64,
    /// Those that were read.
    pub read: u64,
    /// Those that were refused with an error.
    pub refused: u64,
    /// The most memory that one took beyond what was taken before, in bytes, and its number.
    pub most_memory: (usize, u64),
    /// The longest that one took, in seconds, and its number.
    pub longest: (f64, u64),
    /// What went wrong: number of the input, and in words.
    pub failures: Vec<(u64, String)>,
    /// How many went wrong; only the first of each sort are listed.
    pub failed: u64,
}

/// Opens damaged inputs of the asked kinds.
///
/// # Errors
/// A kind that is not known, a corpus that cannot be written or is not readable whole.
pub fn run(settings: &Settings, tell: &dyn Fn(&str)) -> Result<Vec<Outcome>> {
    let mut all = kinds()?;
    if let Some(unknown) = settings.kinds.iter().find(|name| !all.iter().any(|kind| kind.name == **name)) {
        let names: Vec<&str> = all.iter().map(|kind| kind.name).collect();
        return Err(Error::new(ErrorKind::InvalidSetting, format!("there is no kind '{unknown}'"))
            .at(Place::Setting("kind".into()))
            .remedy(format!("kinds are {}", names.join(", "))));
    }
    all.retain(|kind| settings.kinds.is_empty() || settings.kinds.iter().any(|name| name == kind.name));
    all.iter()
        .map(|kind| {
            let outcome = run_kind(kind, settings)?;
            tell(&outcome.line());
            Ok(outcome)
        })
        .collect()
}

impl Outcome {
    /// One line of a table.
    fn line(&self) -> String {
        let (memory, longest) = (self.most_memory, self.longest);
        let mut text = format!(
            "{:18} {:9} inputs: {} read, {} refused, {} failed; at most {} KiB (input {}), {:.3} s (input {})",
            self.kind,
            self.inputs,
            self.read,
            self.refused,
            self.failed,
            memory.0 >> 10,
            memory.1,
            longest.0,
            longest.1
        );
        for (number, what) in &self.failures {
            text += &format!("\n    input {number}: {what}");
        }
        text
    }

    fn fail(&mut self, number: u64, what: String) -> bool {
        const LISTED: usize = 12;
        self.failed += 1;
        // The same panic over and over is one thing to mend.
        let sort = |text: &str| text.chars().filter(|letter| !letter.is_ascii_digit()).take(120).collect::<String>();
        let is_new = !self.failures.iter().any(|(_, other)| sort(other) == sort(&what));
        if is_new && self.failures.len() < LISTED {
            self.failures.push((number, what));
            return true;
        }
        false
    }
}

/// Where the last panic was.
static PANICKED_AT: Mutex<String> = Mutex::new(String::new());

/// Notes where a panic is, without a word on the terminal: a hook for the program that fuzzes.
pub fn note_panic(panic: &PanicHookInfo) {
    if let (Ok(mut place), Some(location)) = (PANICKED_AT.lock(), panic.location()) {
        *place = location.to_string();
    }
}

/// A folder of a kind's files that goes when it is dropped.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A plain file, written at once: it is to be read a moment later, by nobody else.
fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).map_err(|source| Error::writing(parent, source))?;
    }
    let written = std::fs::File::create(path).and_then(|mut file| file.write_all(bytes));
    written.map_err(|source| Error::writing(path, source))
}

fn run_kind(kind: &Kind, settings: &Settings) -> Result<Outcome> {
    let folder = Folder(std::env::temp_dir().join(format!("patina-fuzz-{}-{}", kind.name, std::process::id())));
    let root = folder.0.as_path();
    for (path, bytes) in &kind.others {
        write(&root.join(path), bytes)?;
    }
    for target in &kind.targets {
        write(&root.join(&target.path), &(target.wrap)(&target.whole))?;
    }
    // A corpus that is refused would test nothing but its refusal.
    for target in &kind.targets {
        open(kind.opening, root, &root.join(&target.path), true)?;
    }
    let mut outcome = Outcome { kind: kind.name.into(), ..Default::default() };
    let seed = kind.name.bytes().fold(settings.seed, |seed, byte| mix(seed ^ u64::from(byte)));
    for number in settings.from..settings.from.saturating_add(settings.inputs) {
        let mut random = SequentialRandom::new(mix(seed ^ mix(number)));
        let target = &kind.targets[random.below(kind.targets.len())];
        let path = root.join(&target.path);
        let bytes = (target.wrap)(&mutate::damaged(&target.whole, &mut random));
        write(&path, &bytes)?;
        if let Some(what) = open_and_measure(kind, root, &path, number, &mut outcome)
            && outcome.fail(number, what)
            && let Some(output) = &settings.output
        {
            let name = target.path.rsplit('/').next().unwrap_or_default();
            write(&output.join(format!("{}-{number}-{name}", kind.name)), &bytes)?;
        }
        write(&path, &(target.wrap)(&target.whole))?;
    }
    Ok(outcome)
}

/// Opens an input; what went wrong, if anything did.
fn open_and_measure(kind: &Kind, root: &Path, path: &Path, number: u64, outcome: &mut Outcome) -> Option<String> {
    outcome.inputs += 1;
    let whole = number.is_multiple_of(WHOLE_EVERY);
    let before = memory::restart();
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| open(kind.opening, root, path, whole)));
    let seconds = start.elapsed().as_secs_f64();
    let taken = memory::peak().saturating_sub(before);
    if taken > outcome.most_memory.0 {
        outcome.most_memory = (taken, number);
    }
    if seconds > outcome.longest.0 {
        outcome.longest = (seconds, number);
    }
    let what = match &result {
        Ok(Ok(())) => {
            outcome.read += 1;
            None
        }
        Ok(Err(error)) => {
            outcome.refused += 1;
            let is_bare = error.message().is_empty() || error.remedy_text().is_empty();
            is_bare.then(|| format!("an error without words or remedy: {error}"))
        }
        Err(panic) => {
            let place = PANICKED_AT.lock().map(|mut place| std::mem::take(&mut *place)).unwrap_or_default();
            Some(format!("panic: {} at {place}", crate::error::text_of_panic(panic.as_ref())))
        }
    };
    let pixels = match kind.opening {
        Opening::Photo => file::read_size(path).map_or(0, |(width, height)| width.saturating_mul(height)),
        _ => 0,
    };
    let lies_there: usize = std::iter::once(path.to_path_buf())
        .chain(kind.others.iter().map(|(other, _)| root.join(other)))
        .filter_map(|path| Some(std::fs::metadata(path).ok()?.len() as usize))
        .sum();
    let allowed = MEMORY_BASE + MEMORY_FACTOR * lies_there + pixels.saturating_mul(MEMORY_PER_PIXEL);
    what.or_else(|| (taken > allowed).then(|| format!("memory: {taken} bytes for {lies_there}, {allowed} allowed")))
        .or_else(|| (seconds > MOST_SECONDS).then(|| format!("time: {seconds:.1} seconds")))
}

fn open(opening: Opening, root: &Path, path: &Path, whole: bool) -> Result<()> {
    match opening {
        Opening::Mesh => read::read_mesh(path).map(drop),
        Opening::Photo => {
            let photo = file::read_photo(path, &PhotoOptions::default());
            let mask = file::read_grey(path);
            photo.and(mask.map(drop))
        }
        Opening::Scene => {
            let settings = ReadSettings { hold_out_every: 0, ..Default::default() };
            read::locate(root)?.list(&settings)?;
            if whole {
                let scene = read::read(root, &settings)?;
                doctor::check(&scene);
            }
            Ok(())
        }
    }
}

/// Memory of the process, by the allocator that counts.
mod memory {
    /// Forgets the peak; what is taken now, in bytes.
    pub fn restart() -> usize {
        peak_alloc::PeakAlloc.reset_peak_usage();
        peak_alloc::PeakAlloc.current_usage()
    }

    /// The most that was taken since then, in bytes.
    pub fn peak() -> usize {
        peak_alloc::PeakAlloc.peak_usage()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_files_open_and_damaged_ones_never_end_the_program() {
        let settings = Settings { inputs: 150, from: 0, seed: 7, kinds: Vec::new(), output: None };
        let outcomes = run(&settings, &|_| {}).unwrap();
        assert_eq!(outcomes.len(), kinds().unwrap().len());
        for outcome in &outcomes {
            assert_eq!(outcome.failed, 0, "{}", outcome.line());
            assert_eq!(outcome.read + outcome.refused, outcome.inputs);
            assert!(outcome.refused > 0, "{}: damage that is never found tests nothing", outcome.kind);
        }
        assert!(outcomes.iter().map(|outcome| outcome.read).sum::<u64>() > 300);
        let unknown = Settings { kinds: vec!["psd".into()], ..settings };
        assert_eq!(run(&unknown, &|_| {}).unwrap_err().kind(), ErrorKind::InvalidSetting);
    }

    #[test]
    fn every_format_of_scenes_has_a_kind() {
        let scenes = kinds().unwrap().into_iter().filter(|kind| kind.opening == Opening::Scene);
        let format_of = |kind: Kind| {
            let folder = tempfile::tempdir().unwrap();
            kind.others.iter().for_each(|(path, bytes)| write(&folder.path().join(path), bytes).unwrap());
            for target in &kind.targets {
                write(&folder.path().join(&target.path), &(target.wrap)(&target.whole)).unwrap();
            }
            read::locate(folder.path()).unwrap().format
        };
        let formats: Vec<read::Format> = scenes.map(format_of).collect();
        let without: Vec<_> = read::Format::ALL.iter().filter(|format| !formats.contains(format)).collect();
        assert!(without.is_empty(), "{without:?}");
    }
}
