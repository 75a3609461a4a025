//! A folder of results that can be computed again at any time, found by what they were computed from.
//!
//! [`Kept::read`] gives an entry back bit for bit or not at all: a file that is cut, changed, of another version or of
//! another build of the program counts as missing, and so does everything in a folder that cannot be read. [`Kept::write`]
//! never fails for who computed the entry: where there is no room the next opening computes it again. The folder has a
//! largest size, beyond which what was not used for longest goes first.

use super::digest::{Digest, Digester};
use std::io::{Read, Write};
use std::path::PathBuf;
use std::time::SystemTime;

/// What files of this layout begin with.
const MAGIC: &[u8; 16] = b"patina kept   1\n";
/// Ending of the files.
const ENDING: &str = "kept";
/// Bytes around what is kept: magic, key, length, checksum.
const AROUND: usize = 16 + 16 + 8 + 16;
/// By this file programs that make backups know that they may leave the folder out (bford.info/cachedir).
const TAG: (&str, &str) = (
    "CACHEDIR.TAG",
    "Signature: 8a477f597d28d172789f06886806bc55\n# Results that Patina computes again where they are missing. This folder may be deleted at any time.\n",
);

/// A folder of results, or none.
#[derive(Clone, Debug, Default)]
pub struct Kept(Option<Folder>);

#[derive(Clone, Debug)]
struct Folder {
    path: PathBuf,
    maker: Digest,
    most_bytes: u64,
}

impl Kept {
    /// Nothing is kept.
    pub fn nowhere() -> Self {
        Kept(None)
    }

    /// Results in a folder, which need not be there yet, of at most so many bytes together. `maker` is what makes them: those
    /// of another maker are not found, since it might compute them otherwise.
    pub fn at(path: PathBuf, maker: Digest, most_bytes: u64) -> Self {
        Kept(Some(Folder { path, maker, most_bytes }))
    }

    /// A digest to add what a result is computed from to, its kind and its maker added; `None` where nothing is kept.
    pub fn key(&self, kind: &str) -> Option<Digester> {
        let own = self.0.as_ref()?;
        let mut key = Digester::default();
        key.add(&own.maker.to_bytes());
        key.add_list(kind.as_bytes());
        Some(key)
    }

    /// What was kept of this kind under a key, bit for bit; `None` where nothing whole is there.
    pub fn read(&self, kind: &str, key: Digest) -> Option<Vec<u8>> {
        let own = self.0.as_ref()?;
        let path = own.file_of(kind, key);
        // Some systems let only who may write set the time of a file.
        let to_touch = std::fs::OpenOptions::new().read(true).write(true).open(&path);
        let mut file = to_touch.or_else(|_| std::fs::File::open(&path)).ok()?;
        let size = file.metadata().ok().filter(std::fs::Metadata::is_file)?.len();
        if size < AROUND as u64 || size > own.most_bytes {
            return None;
        }
        let mut front = [0; AROUND - 16];
        file.read_exact(&mut front).ok()?;
        if front != front_of(key, size - AROUND as u64) {
            return None;
        }
        // One byte more than there should be room for: a file that has grown since is found out.
        let mut body = Vec::with_capacity(size as usize - front.len());
        (&file).take(size).read_to_end(&mut body).ok()?;
        let end = body.len().checked_sub(16).filter(|end| (end + AROUND) as u64 == size)?;
        if body[end..] != checksum(&front, &body[..end]) {
            return None;
        }
        body.truncate(end);
        // What was used last goes last.
        let _ = file.set_modified(SystemTime::now());
        Some(body)
    }

    /// Keeps a result of this kind under a key, if there is room for it.
    pub fn write(&self, kind: &str, key: Digest, body: &[u8]) {
        let Some(own) = &self.0 else { return };
        if (body.len() + AROUND) as u64 > own.most_bytes {
            return;
        }
        let front = front_of(key, body.len() as u64);
        // Nobody waits for the disk: a file that a power cut leaves cut is found out.
        let is_new = !own.path.exists();
        let written = super::replace(&own.file_of(kind, key), false, |writer| {
            writer.write_all(&front)?;
            writer.write_all(body)?;
            writer.write_all(&checksum(&front, body))
        });
        if written.is_ok() {
            if is_new {
                own.tag();
            }
            own.make_room();
        }
    }
}

impl Folder {
    fn file_of(&self, kind: &str, key: Digest) -> PathBuf {
        self.path.join(format!("{kind}-{key}.{ENDING}"))
    }

    /// Only of a folder that was made here: backups pass it over.
    fn tag(&self) {
        let _ = super::replace(&self.path.join(TAG.0), false, |writer| writer.write_all(TAG.1.as_ref()));
    }

    /// Whether a file is one of these, or what a writer that was killed left of one: `KIND-DIGEST.kept`, `KIND-DIGEST.kept.PID.tmp`.
    fn is_own(path: &std::path::Path) -> bool {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let Some((stem, endings)) = name.split_once('.') else { return false };
        let digest = stem.rsplit_once('-').map_or("", |(_, digest)| digest);
        let is_digest = digest.len() == 32 && digest.bytes().all(|own| own.is_ascii_hexdigit());
        is_digest && (endings == ENDING || endings.starts_with(&format!("{ENDING}.")) && endings.ends_with(".tmp"))
    }

    /// Deletes what was not used for longest until the rest is small enough.
    fn make_room(&self) {
        let Ok(listed) = std::fs::read_dir(&self.path) else { return };
        let mut files: Vec<(SystemTime, u64, PathBuf)> = listed
            .filter_map(|entry| {
                let path = entry.ok()?.path();
                let about =
                    std::fs::symlink_metadata(&path).ok().filter(|about| Self::is_own(&path) && about.is_file())?;
                Some((about.modified().ok()?, about.len(), path))
            })
            .collect();
        files.sort();
        let mut total: u64 = files.iter().map(|(_, size, _)| size).sum();
        for (_, size, path) in files {
            if total <= self.most_bytes {
                return;
            }
            if std::fs::remove_file(path).is_ok() {
                total -= size;
            }
        }
    }
}

fn front_of(key: Digest, length: u64) -> [u8; AROUND - 16] {
    let mut front = [0; AROUND - 16];
    front[..16].copy_from_slice(MAGIC);
    front[16..32].copy_from_slice(&key.to_bytes());
    front[32..].copy_from_slice(&length.to_le_bytes());
    front
}

fn checksum(front: &[u8], body: &[u8]) -> [u8; 16] {
    let mut digester = Digester::default();
    digester.add(front);
    digester.add(body);
    digester.finish().to_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::time::Duration;

    fn key_of(kept: &Kept, what: &[u8]) -> Digest {
        let mut key = kept.key("atlas").unwrap();
        key.add(what);
        key.finish()
    }

    fn files_in(folder: &Path) -> Vec<PathBuf> {
        let listed = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<PathBuf> = listed.filter(|path| path.extension().is_some_and(|own| own == ENDING)).collect();
        files.sort();
        files
    }

    #[test]
    fn what_is_kept_comes_back_and_every_damage_counts_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Kept::at(folder.path().join("deep"), Digest::of(b"this build"), 1000);
        let key = key_of(&kept, b"mesh");
        assert_eq!(kept.read("atlas", key), None);
        let body: Vec<u8> = (0..200).collect();
        kept.write("atlas", key, &body);
        assert_eq!(kept.read("atlas", key).as_ref(), Some(&body));
        let path = files_in(&folder.path().join("deep")).pop().unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(kept.read("atlas", key), None, "cut to {length} bytes");
        }
        for byte in 0..whole.len() {
            let mut flipped = whole.clone();
            flipped[byte] ^= 1 << (byte % 8);
            std::fs::write(&path, &flipped).unwrap();
            assert_eq!(kept.read("atlas", key), None, "byte {byte} changed");
        }
        std::fs::write(&path, [whole.as_slice(), b"more"].concat()).unwrap();
        assert_eq!(kept.read("atlas", key), None);
        kept.write("atlas", key, &body);
        assert_eq!(kept.read("atlas", key).as_ref(), Some(&body), "a damaged file is replaced");
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        assert_eq!(kept.read("atlas", key), None, "a folder of that name");
        kept.write("atlas", key, &body);
    }

    #[test]
    fn another_maker_another_kind_and_another_name_find_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let kept = Kept::at(folder.path().into(), Digest::of(b"this build"), 1000);
        let other = Kept::at(folder.path().into(), Digest::of(b"another build"), 1000);
        let key = key_of(&kept, b"mesh");
        kept.write("atlas", key, b"charts");
        assert!(
            key_of(&other, b"mesh") != key
                && kept.key("check").unwrap().finish() != kept.key("atlas").unwrap().finish()
        );
        let moved = key_of(&kept, b"other mesh");
        let path = files_in(folder.path()).pop().unwrap();
        std::fs::rename(path, folder.path().join(format!("atlas-{moved}.{ENDING}"))).unwrap();
        assert_eq!(kept.read("atlas", moved), None, "a file under another's name");
    }

    #[test]
    fn what_was_not_used_for_longest_goes_first() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("kept");
        let kept = Kept::at(place.clone(), Digest::of(b""), 3 * (100 + AROUND as u64));
        let keys: Vec<Digest> = (0..4u8).map(|number| key_of(&kept, &[number])).collect();
        let age = |number: usize, hours: u64| {
            let path = place.join(format!("atlas-{}.{ENDING}", keys[number]));
            let then = SystemTime::now() - Duration::from_secs(3600 * hours);
            std::fs::File::options().write(true).open(path).unwrap().set_modified(then).unwrap();
        };
        for number in 0..3 {
            kept.write("atlas", keys[number], &[number as u8; 100]);
            age(number, 9 - number as u64);
        }
        assert!(kept.read("atlas", keys[0]).is_some(), "used now");
        for other in ["letter.txt", "render.tmp", "scene.kept"] {
            std::fs::write(place.join(other), [0; 5000]).unwrap();
        }
        kept.write("atlas", keys[3], &[3; 100]);
        let there: Vec<bool> = keys.iter().map(|&key| kept.read("atlas", key).is_some()).collect();
        assert_eq!(there, [true, false, true, true]);
        kept.write("atlas", key_of(&kept, b"large"), &[0; 1000]);
        assert_eq!(files_in(&place).len(), 4, "too large to be kept at all");
        assert!(["letter.txt", "render.tmp", "scene.kept", TAG.0].iter().all(|name| place.join(name).is_file()));
        // A folder that was there before is not marked as one that backups may pass over.
        let kept = Kept::at(folder.path().into(), Digest::of(b""), 1000);
        kept.write("atlas", keys[0], &[0; 100]);
        assert!(kept.read("atlas", keys[0]).is_some() && !folder.path().join(TAG.0).exists());
    }

    #[test]
    fn a_place_that_takes_no_files_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a file");
        std::fs::write(&file, b"").unwrap();
        for kept in [Kept::at(file.join("below"), Digest::of(b""), 1000), Kept::at(file, Digest::of(b""), 1000)] {
            let key = key_of(&kept, b"mesh");
            kept.write("atlas", key, b"charts");
            assert_eq!(kept.read("atlas", key), None);
        }
        assert!(Kept::nowhere().key("atlas").is_none() && Kept::nowhere().read("atlas", Digest::of(b"")).is_none());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
