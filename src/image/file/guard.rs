//! A decoder that panics on a damaged file becomes an error; in our programs without a word on the terminal.
//!
//! What a panic writes is up to the hook of the process, which is not the library's: [`keep_decoders_quiet`] is for
//! programs. Where nobody calls it, the message of the decoder's panic appears beside the error.

use crate::error::{Error, ErrorKind, Place, Result};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Once;

thread_local! {
    static SILENT: Cell<bool> = const { Cell::new(false) };
}

/// Lets panics of guarded decoders pass without a word from now on, in the whole process; every other panic is passed on
/// to the hook that was there before. For programs, at their start.
pub fn keep_decoders_quiet() {
    static INSTALL: Once = Once::new();
    INSTALL.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |information| {
            if !SILENT.with(Cell::get) {
                previous(information);
            }
        }));
    });
}

/// Restores the thread's previous state when dropped, also while unwinding.
struct Silence(bool);

impl Silence {
    fn start() -> Self {
        Silence(SILENT.with(|silent| silent.replace(true)))
    }
}

impl Drop for Silence {
    fn drop(&mut self) {
        SILENT.with(|silent| silent.set(self.0));
    }
}

/// Runs a decoder of outside bytes. A panic in it is a file that breaks its format, not the end of the program.
///
/// The decoder must work on the calling thread: a panic elsewhere is neither caught nor silent.
pub fn guarded<T>(path: &Path, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    let outcome = {
        let _silence = Silence::start();
        catch_unwind(AssertUnwindSafe(decode))
    };
    outcome.unwrap_or_else(|_| {
        Err(Error::new(ErrorKind::Malformed, "the file is damaged in a way its decoder did not expect")
            .at(Place::File(path.into()))
            .remedy("open it in an image editor and save it again"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_and_the_guard_can_be_used_again() {
        for _ in 0..2 {
            let error = guarded::<()>(Path::new("a.hdr"), || panic!("attempt to multiply with overflow")).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Malformed);
            assert_eq!(error.place(), &Place::File("a.hdr".into()));
        }
        assert!(!SILENT.with(Cell::get));
        assert_eq!(guarded(Path::new("a"), || Ok(3)).unwrap(), 3);
    }
}
