//! Cases, and the order in which they are taken: whenever a study ends, what it has is a fair sample of the whole.

use super::line::{CaseInputs, part_of};
use std::collections::HashMap;

/// A case that can be done.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyCase {
    /// Its name: `part/...`, unlike any other of the study.
    pub key: String,
    /// Cases of one block are rivals on the same input, and are done one after the other.
    pub block: String,
    /// Seed of everything random in it.
    pub seed: u64,
    /// What it is made from: a line of other inputs is of another case.
    pub inputs: CaseInputs,
}

impl StudyCase {
    /// A case without inputs.
    pub fn new(key: String, block: String, seed: u64) -> Self {
        StudyCase { key, block, seed, inputs: CaseInputs::new() }
    }

    /// The part of the study it belongs to.
    pub fn part(&self) -> &str {
        part_of(&self.key)
    }
}

/// Places of the cases in the order in which they are taken.
///
/// Cases of one block stay together: they are rivals on the same input, and half a comparison is none. The blocks of a
/// part are shuffled by their names, so the order is the same in every sitting, and blocks that are added later do not
/// turn it around. Parts take turns in proportion to their sizes.
pub fn interleaved(cases: &[StudyCase]) -> Vec<usize> {
    let mut blocks: HashMap<(&str, &str), Vec<usize>> = HashMap::new();
    for (place, case) in cases.iter().enumerate() {
        blocks.entry((case.part(), &case.block)).or_default().push(place);
    }
    let mut parts: HashMap<&str, Vec<(u64, &str)>> = HashMap::new();
    for (part, block) in blocks.keys() {
        parts.entry(part).or_default().push((hash(block), block));
    }
    let mut turns: Vec<(f64, &str, &str)> = Vec::new();
    for (part, mut own) in parts {
        own.sort_unstable();
        let count = own.len() as f64;
        turns.extend(own.into_iter().enumerate().map(|(rank, (_, block))| ((rank as f64 + 0.5) / count, part, block)));
    }
    turns.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| (a.1, a.2).cmp(&(b.1, b.2))));
    turns.into_iter().flat_map(|(_, part, block)| blocks.remove(&(part, block)).unwrap_or_default()).collect()
}

/// FNV-1a of a name, its bits mixed once more (the last step of MurmurHash3): the same on every machine.
fn hash(name: &str) -> u64 {
    let mut hash = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    hash = (hash ^ (hash >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    hash ^ (hash >> 33)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_beginning_of_a_study_is_a_fair_sample() {
        let mut cases = Vec::new();
        for (part, materials, lights) in [("fig3", 40, 5), ("fig5", 10, 4)] {
            for material in 0..materials {
                for light in 0..lights {
                    for model in ["a", "b"] {
                        let block = format!("material {material}/light {light}");
                        cases.push(StudyCase::new(format!("{part}/{block}/{model}"), block, 1));
                    }
                }
            }
        }
        let order = interleaved(&cases);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..cases.len()).collect::<Vec<_>>(), "each case once");
        // Rivals on one input follow each other.
        assert!(order.chunks_exact(2).all(|pair| pair[1] == pair[0] + 1));
        // A fifth of the study holds a fifth of each part, with most materials and all lights in it.
        let begun: Vec<&StudyCase> = order[..cases.len() / 5].iter().map(|&place| &cases[place]).collect();
        let of = |part: &str| begun.iter().filter(|case| case.part() == part).count();
        assert!(of("fig3").abs_diff(80) <= 2 && of("fig5").abs_diff(16) <= 2, "{} {}", of("fig3"), of("fig5"));
        for light in 0..5 {
            let count = begun.iter().filter(|case| case.key.contains(&format!("light {light}"))).count();
            assert!((8..=34).contains(&count), "light {light}: {count} of {}", begun.len());
        }
        let materials: std::collections::HashSet<&str> =
            begun.iter().filter(|case| case.part() == "fig3").filter_map(|case| case.key.split('/').nth(1)).collect();
        assert!(materials.len() >= 20, "{}", materials.len());
    }
}
