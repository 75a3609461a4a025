//! What opening a scene takes long to make, kept on disk, so that opening it again takes seconds.
//!
//! [`atlas`](self::atlas()) keeps charts, [`check`](self::check()) the verdict on a scene, [`photograph`] the pictures of the
//! built-in scene, [`transport`](self::transport()) what relights a surface; each looks into a [`Kept`] folder first and
//! makes what is not there. A result is found by its content: by the digest of all that it is made of and of the program that makes it ([`program`]). So no result is ever stale, two
//! scenes with one mesh share their atlas, and a folder that was moved is known again.
//!
//! What comes back from disk is what would be made, bit for bit; what is damaged is made anew, without a word. The folder is
//! handed in: who hands in [`Kept::nowhere`] has everything made.

mod atlas;
mod check;
mod content;
mod findings;
mod pictures;
#[cfg(test)]
mod tests;
mod transport;

pub use crate::files::kept::Kept;
pub use atlas::atlas;
pub use check::check;
pub use pictures::photograph;
pub use transport::transport;

use crate::files::digest::{Digest, Digester};
use std::path::PathBuf;
use std::time::UNIX_EPOCH;

/// Bytes that a user's folder holds at most.
const MOST_BYTES: u64 = 1 << 30;

/// Results of this program in a folder of at most a gibibyte; nowhere if the system does not tell what program this is.
pub fn in_folder(folder: PathBuf) -> Kept {
    program().map_or_else(Kept::nowhere, |program| Kept::at(folder, program, MOST_BYTES))
}

/// Tells this build of the program on this processor from any other, which might compute other bits.
fn program() -> Option<Digest> {
    let about = std::fs::metadata(std::env::current_exe().ok()?).ok()?;
    let built = about.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    let mut digester = Digester::default();
    digester.add_list(env!("CARGO_PKG_VERSION").as_bytes());
    digester.add(&about.len().to_le_bytes());
    digester.add(&built.as_nanos().to_le_bytes());
    digester.add_list(std::env::consts::ARCH.as_bytes());
    #[cfg(target_arch = "x86_64")]
    {
        use crate::math::vector::{has_avx2, has_avx512};
        digester.add(&[u8::from(has_avx2()), u8::from(has_avx512())]);
    }
    Some(digester.finish())
}
