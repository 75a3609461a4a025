//! A number that tells contents apart.
//!
//! It finds cuts and flips and names what is the same; it is no defence against intent. The function is that of the standard
//! library, which promises nothing from one version of Rust to the next: what is kept by it is of one build of the program.

use std::hash::{DefaultHasher, Hasher};

/// What distinguishes one content from another: its hash and its length in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Digest([u64; 2]);

impl Digest {
    /// The digest of some bytes.
    pub fn of(bytes: &[u8]) -> Self {
        let mut digester = Digester::default();
        digester.add(bytes);
        digester.finish()
    }

    /// Its sixteen bytes.
    pub fn to_bytes(self) -> [u8; 16] {
        (u128::from(self.0[0]) | u128::from(self.0[1]) << 64).to_le_bytes()
    }
}

impl std::fmt::Display for Digest {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{:016x}{:016x}", self.0[0], self.0[1])
    }
}

/// A digest in the making.
#[derive(Clone, Debug, Default)]
pub struct Digester {
    hasher: DefaultHasher,
    length: u64,
}

impl Digester {
    /// Adds a run of bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        self.length += bytes.len() as u64;
        self.hasher.write(bytes);
    }

    /// Adds bytes with their number, so that two lists in a row are not those of another cut.
    pub fn add_list(&mut self, bytes: &[u8]) {
        self.add(&(bytes.len() as u64).to_le_bytes());
        self.add(bytes);
    }

    /// The digest of all that was added.
    pub fn finish(&self) -> Digest {
        Digest([self.hasher.finish(), self.length])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_and_every_cut_tells() {
        let bytes: Vec<u8> = (0..77).collect();
        let whole = Digest::of(&bytes);
        assert_eq!(Digest::of(&bytes.clone()), whole);
        for cut in 0..bytes.len() {
            let mut other = bytes.clone();
            other[cut] ^= 1;
            assert!(Digest::of(&other) != whole && Digest::of(&bytes[..cut]) != whole);
            let lists = [cut, (cut + 1) % bytes.len()].map(|cut| {
                let mut digester = Digester::default();
                let (front, behind) = bytes.split_at(cut);
                digester.add_list(front);
                digester.add_list(behind);
                digester.finish()
            });
            assert_ne!(lists[0], lists[1]);
        }
    }
}
