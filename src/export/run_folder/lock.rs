//! One fit a run folder: who writes into it holds its lock.
//!
//! The lock is one of the operating system on the file `lock`, so that it ends with its process, however that ends. The
//! file says who holds it. Reading a run needs no lock.

use super::RunFolder;
use crate::error::{Error, ErrorKind, Place, Result};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Name of the file.
const LOCK_FILE: &str = "lock";
/// How long a fit of this process that ends is waited for.
const PATIENCE: Duration = Duration::from_secs(3);
/// Time between two attempts.
const PAUSE: Duration = Duration::from_millis(20);

/// The lock of a run folder, held until it is dropped.
#[derive(Debug)]
pub(super) struct RunLock {
    path: PathBuf,
    /// Kept open: the lock ends with it.
    _file: File,
}

impl RunFolder {
    /// The same folder, held: no other process begins or resumes a fit in it until this value and all its copies are
    /// gone. Where the file system knows no locks, none is held.
    ///
    /// # Errors
    /// `Unwritable` when another fit works in the folder, with its owner, or when the folder cannot be written.
    pub fn held(mut self) -> Result<Self> {
        if self.lock.is_none() {
            self.lock = RunLock::take(&self.file(LOCK_FILE))?.map(Arc::new);
        }
        Ok(self)
    }
}

impl RunLock {
    fn take(path: &Path) -> Result<Option<RunLock>> {
        let began = Instant::now();
        loop {
            let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
            let mut file = open.map_err(|source| Error::writing(path, source))?;
            match file.try_lock() {
                // Its holder before may have removed the file since it was opened here.
                Ok(()) if is_at(&file, path) => {
                    // What is written is for a person to read; that it is held does not hang on it.
                    let _ = file
                        .set_len(0)
                        .and_then(|()| file.rewind())
                        .and_then(|()| writeln!(file, "{}", this_process()));
                    return Ok(Some(RunLock { path: path.into(), _file: file }));
                }
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut owner = String::new();
                    let _ = file.read_to_string(&mut owner);
                    let owner = owner.trim();
                    // A fit of this program that was stopped still writes its last words.
                    if owner != this_process() || began.elapsed() > PATIENCE {
                        return Err(held_by(owner, path));
                    }
                }
                Err(TryLockError::Error(_)) => return Ok(None),
            }
            std::thread::sleep(PAUSE);
        }
    }
}

impl Drop for RunLock {
    fn drop(&mut self) {
        // Removed while it is held: whoever opened it meanwhile sees that it is not there any more.
        let _ = std::fs::remove_file(&self.path);
    }
}

fn held_by(owner: &str, path: &Path) -> Error {
    let owner = if owner.is_empty() { "another process" } else { owner };
    Error::new(ErrorKind::Unwritable, format!("another fit works in this run folder: {owner}"))
        .at(Place::File(crate::files::folder_of(path).into()))
        .remedy("wait until it ends, stop it, or fit into another folder")
}

/// This process in words.
fn this_process() -> String {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").ok().or_else(|| std::env::var("COMPUTERNAME").ok());
    let host = host.map(|host| format!(" on {}", host.trim())).unwrap_or_default();
    format!("process {}{host}", std::process::id())
}

/// Whether the open file is the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    file.metadata().is_ok_and(|own| std::fs::metadata(path).is_ok_and(|there| identity(own) == identity(there)))
}

/// Whether the open file is the one at a path; an open one cannot be removed here.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_folder_is_refused_with_its_owner_and_free_again_afterwards() {
        let parent = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(&parent.path().join("run")).unwrap().held().unwrap();
        let copy = folder.clone().held().unwrap();
        // Another process: its file says so.
        crate::files::write_bytes(&parent.path().join("other"), b"").unwrap();
        let file = OpenOptions::new().write(true).open(folder.file(LOCK_FILE)).unwrap();
        file.set_len(0).unwrap();
        writeln!(&file, "process 0 on elsewhere").unwrap();
        drop(folder);
        let error = RunFolder::open(copy.path()).unwrap().held().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Unwritable);
        assert!(error.message().contains("process 0 on elsewhere"), "{error}");
        let path = copy.path().to_path_buf();
        drop((copy, file));
        assert!(RunFolder::open(&path).unwrap().held().is_ok());
        assert!(!path.join(LOCK_FILE).exists(), "nothing is left of it");
    }
}
