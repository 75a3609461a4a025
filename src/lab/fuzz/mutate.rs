//! Damage to files: bytes as cables and disks do it, headers as liars do it, text as other programs write it.
//!
//! What is done is a pure function of the random numbers, so that an input is known by its seed and its number.

use crate::math::random::SequentialRandom;

/// Words that stand where a reader expects a number or a name.
const WORDS: [&str; 30] = [
    "nan",
    "-nan(ind)",
    "inf",
    "-1",
    "0",
    "",
    "1e308",
    "-1e308",
    "1e-320",
    "4294967295",
    "4294967296",
    "99999999999999999999",
    "18446744073709551615",
    "-9223372036854775808",
    "2147483647",
    "1,5",
    ".5",
    "1.",
    "+",
    "-",
    "\\",
    "#",
    "\"",
    "null",
    "{}",
    "[]",
    "[[[[[[[[[[[[[[[[",
    "a/b/c",
    "..",
    "\u{feff}ü",
];
/// Numbers that headers claim.
const CLAIMS: [u64; 10] =
    [0, 1, 0x7f, 0xffff, 0x1_0000, 0x7fff_ffff, 0xffff_ffff, 0x1_0000_0000, 0x7fff_ffff_ffff_ffff, u64::MAX];

/// A damaged copy: one to four pieces of damage.
pub fn damaged(whole: &[u8], random: &mut SequentialRandom) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    let is_text = std::str::from_utf8(whole).is_ok();
    for _ in 0..1 + random.below(4) {
        if bytes.is_empty() {
            break;
        }
        if is_text && random.below(3) > 0 { damage_text(&mut bytes, random) } else { damage_bytes(&mut bytes, random) }
    }
    bytes
}

/// A place in the file. Headers are short and claim much: half of the damage goes to the first fifth.
fn place(length: usize, random: &mut SequentialRandom) -> usize {
    let within = if random.below(2) == 0 { length } else { length.div_ceil(5) };
    random.below(within.max(1))
}

/// A piece of the file, of any length up to an eighth of it.
fn piece(length: usize, random: &mut SequentialRandom) -> std::ops::Range<usize> {
    let start = place(length, random);
    start..(start + 1 + random.below(length.div_ceil(8).max(1))).min(length)
}

fn damage_bytes(bytes: &mut Vec<u8>, random: &mut SequentialRandom) {
    let length = bytes.len();
    match random.below(7) {
        0 => bytes.truncate(random.below(length)),
        1 => bytes[place(length, random)] ^= 1 << random.below(8),
        2 => bytes[place(length, random)] = random.below(256) as u8,
        3 => {
            let claim = CLAIMS[random.below(CLAIMS.len())];
            let width = [1, 2, 4, 8][random.below(4)];
            let little = claim.to_le_bytes();
            let word: Vec<u8> = match random.below(2) {
                0 => little[..width].to_vec(),
                _ => little[..width].iter().rev().copied().collect(),
            };
            let start = place(length, random);
            bytes.iter_mut().skip(start).zip(word).for_each(|(byte, own)| *byte = own);
        }
        4 => {
            let range = piece(length, random);
            let again = bytes[range.clone()].to_vec();
            bytes.splice(range.start..range.start, again);
        }
        5 => {
            let range = piece(length, random);
            bytes.drain(range);
        }
        _ => {
            let (from, to) = (piece(length, random), place(length, random));
            let moved = bytes[from].to_vec();
            bytes.iter_mut().skip(to).zip(moved).for_each(|(byte, own)| *byte = own);
        }
    }
}

fn damage_text(bytes: &mut Vec<u8>, random: &mut SequentialRandom) {
    let is_part_of_word = |byte: u8| !byte.is_ascii_whitespace() && !b"\",<>{}[]:=;/".contains(&byte);
    let line_around = |bytes: &[u8], at: usize| {
        let start = bytes[..at].iter().rposition(|byte| *byte == b'\n').map_or(0, |place| place + 1);
        let end = bytes[at..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |place| at + place + 1);
        start..end
    };
    let at = random.below(bytes.len());
    match random.below(5) {
        // Another word, most of all.
        0 | 1 => {
            let start = bytes[..at].iter().rposition(|byte| !is_part_of_word(*byte)).map_or(0, |place| place + 1);
            let end = bytes[at..].iter().position(|byte| !is_part_of_word(*byte)).map_or(bytes.len(), |own| at + own);
            let word = WORDS[random.below(WORDS.len())].bytes();
            bytes.splice(start..end.max(start), word);
        }
        2 => {
            let line = line_around(bytes, at);
            bytes.drain(line);
        }
        3 => {
            let line = line_around(bytes, at);
            let again = bytes[line].to_vec();
            let to = line_around(bytes, random.below(bytes.len())).start;
            bytes.splice(to..to, again);
        }
        _ => {
            let ends: [&[u8]; 6] = [b"\r", b"\r\n", b"\0", b"\n\n", b"\\\n", b"\xff"];
            let end = ends[random.below(ends.len())];
            bytes.splice(at..at, end.iter().copied());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_is_a_function_of_the_seed_and_seldom_none() {
        let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let of = |seed| damaged(text, &mut SequentialRandom::new(seed));
        let mut changed = 0;
        for seed in 0..200 {
            assert_eq!(of(seed), of(seed));
            changed += usize::from(of(seed) != text);
        }
        assert!(changed > 180, "{changed}");
        assert!((0..200).any(|seed| of(seed).windows(3).any(|part| part == b"nan")));
        damaged(&[], &mut SequentialRandom::new(1));
    }
}
