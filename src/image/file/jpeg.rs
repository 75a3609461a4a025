//! The segments of a JPEG: whether it is whole, how many colours it has, what lies between them that does not belong.
//!
//! ITU-T T.81, annex B. Cameras and cut downloads leave out the end marker, and some programs leave bytes between segments;
//! both are read when all pixels are there. Whether they are is told by decoding (see [`is_whole_without_end`]).

use crate::error::{Finding, Severity};

/// What the segments say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JpegFacts {
    /// Number of colour components: 1 grey, 3 colour, 4 CMYK or its like; 0 when no frame header was found.
    pub components: u8,
    /// Whether the end marker follows the pixels.
    pub has_end: bool,
    /// Whether a scan with pixels was found.
    pub has_scan: bool,
    /// Bytes between segments that belong to none.
    pub stray_bytes: usize,
    /// Whether all bits of all coefficients have their scan; only a progressive file can lack some.
    pub has_all_scans: bool,
}

const END: u8 = 0xd9;
const START_OF_SCAN: u8 = 0xda;

/// Walks over the segments of a file.
pub fn facts(bytes: &[u8]) -> JpegFacts {
    let mut facts = JpegFacts { has_all_scans: true, ..Default::default() };
    let mut progress = None;
    let mut position = 2;
    while position < bytes.len() {
        let Some(marker_at) = next_marker(bytes, position) else { break };
        facts.stray_bytes += marker_at - position;
        let marker = bytes[marker_at + 1];
        position = marker_at + 2;
        match marker {
            END => {
                // A thumbnail's end is inside a segment and is stepped over.
                facts.has_end = facts.has_scan;
                break;
            }
            0x01 | 0xd0..=0xd8 => continue,
            _ => {}
        }
        let Some(&[high, low]) = bytes.get(position..position + 2) else { break };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let body = bytes.get(position + 2..position + length.max(2)).unwrap_or_default();
        position += length.max(2);
        match marker {
            0xc0..=0xcf if !matches!(marker, 0xc4 | 0xc8 | 0xcc) => {
                facts.components = body.get(5).copied().unwrap_or_default();
                progress = matches!(marker, 0xc2 | 0xc6 | 0xca | 0xce).then(Progress::default);
            }
            START_OF_SCAN => {
                facts.has_scan = true;
                if let Some(progress) = &mut progress {
                    progress.add(body);
                }
                position = end_of_scan(bytes, position);
            }
            _ => {}
        }
    }
    facts.has_all_scans = progress.is_none_or(|progress| progress.is_complete(facts.components));
    facts
}

/// The next 0xFF that begins a marker.
fn next_marker(bytes: &[u8], from: usize) -> Option<usize> {
    (from..bytes.len().saturating_sub(1))
        .find(|&place| bytes[place] == 0xff && !matches!(bytes[place + 1], 0x00 | 0xff))
}

/// Where the coded data of a scan end: at a marker that is not a restart. Lower codes than 0xC0 are reserved and come from
/// damage.
fn end_of_scan(bytes: &[u8], from: usize) -> usize {
    (from..bytes.len().saturating_sub(1))
        .find(|&place| bytes[place] == 0xff && matches!(bytes[place + 1], 0xc0..=0xcf | 0xd8..=0xfe))
        .unwrap_or(bytes.len())
}

/// Which bits of which coefficients the scans of a progressive file have brought, for each component by its name.
#[derive(Default)]
struct Progress {
    /// (name of the component, for each coefficient the lowest bit known; 255 for none).
    lowest: Vec<(u8, [u8; 64])>,
}

impl Progress {
    fn add(&mut self, scan: &[u8]) {
        let Some((&count, rest)) = scan.split_first() else { return };
        let names = rest.chunks_exact(2).take(usize::from(count)).map(|pair| pair[0]);
        let Some(&[first, last, bits]) = rest.get(2 * usize::from(count)..2 * usize::from(count) + 3) else { return };
        for name in names.collect::<Vec<_>>() {
            let index = self.lowest.iter().position(|(own, _)| *own == name).unwrap_or_else(|| {
                self.lowest.push((name, [255; 64]));
                self.lowest.len() - 1
            });
            let range = usize::from(first.min(63))..=usize::from(last.min(63));
            if range.start() <= range.end() {
                self.lowest[index].1[range].fill(bits & 15);
            }
        }
        // Names are a byte: a damaged file brings at most 256.
    }

    fn is_complete(&self, components: u8) -> bool {
        self.lowest.len() >= usize::from(components.max(1))
            && self.lowest.iter().all(|(_, bits)| bits.iter().all(|&bit| bit == 0))
    }
}

/// Rows that blocks have at most, where colour has half the resolution.
const ROWS_OF_BLOCK: usize = 16;

/// Tells of rows at the end that decoders fill in for pixels that are missing, of rows of so many samples: blocks of the last
/// mean or of grey, so that each row is the one of the block above. Rows of one colour are none of those: a background may be.
pub fn told_of_filled(samples: &[u8], samples_per_row: usize, samples_per_pixel: usize) -> Option<Finding> {
    const GREY: u8 = 128;
    let rows: Vec<&[u8]> = samples.chunks_exact(samples_per_row.max(1)).collect();
    let is_filled = |&row: &usize| {
        let pixels = rows[row].chunks_exact(samples_per_pixel.max(1));
        let is_of_one_colour = pixels.clone().zip(pixels.skip(1)).all(|(one, next)| one == next);
        rows[row] == rows[row - ROWS_OF_BLOCK] && (!is_of_one_colour || rows[row][0] == GREY)
    };
    let filled = (ROWS_OF_BLOCK..rows.len()).rev().take_while(is_filled).count();
    (filled >= ROWS_OF_BLOCK).then(|| {
        let message = format!(
            "the last {filled} of {} rows repeat those above, as decoders do for pixels that are missing: the JPEG was probably \
             cut short",
            rows.len()
        );
        Finding::new(Severity::Warning, "photo-cut", message).remedy("copy the photo again, or leave it out")
    })
}

/// Whether a file without an end marker holds all its pixels.
///
/// Decoders fill what is missing. The file is decoded with different bytes after its end: what depends on them was missing.
/// `decode` gives the pixels of a file, or nothing.
pub fn is_whole_without_end<T: PartialEq>(bytes: &[u8], mut decode: impl FnMut(&[u8]) -> Option<T>) -> bool {
    // A lone 0xFF would make a marker of the first byte after it.
    let end = bytes.iter().rposition(|&byte| byte != 0xff).map_or(0, |place| place + 1);
    let bytes = &bytes[..end];
    let with = |filler: &[u8]| {
        let mut longer = Vec::with_capacity(bytes.len() + filler.len() + 2);
        longer.extend_from_slice(bytes);
        longer.extend_from_slice(filler);
        longer.extend_from_slice(&[0xff, END]);
        longer
    };
    // Patterns in which every short code of a Huffman table comes to an end sooner or later.
    let fillers: [&[u8]; 3] = [&[], &[0x5a; 48], &[0x93, 0xc4, 0x1e, 0x71, 0xe8, 0x0b, 0x36, 0xad].repeat(8)];
    let mut decoded = fillers.iter().map(|filler| decode(&with(filler)));
    let Some(Some(first)) = decoded.next() else { return false };
    decoded.all(|other| other.as_ref() == Some(&first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scans_of_a_progressive_file_are_counted() {
        let mut progress = Progress::default();
        progress.add(&[2, 1, 0, 2, 0, 0, 0, 0x01]);
        assert!(!progress.is_complete(2), "the lowest bit and the higher coefficients are missing");
        progress.add(&[1, 1, 0, 1, 63, 0x00]);
        progress.add(&[1, 2, 0, 1, 63, 0x00]);
        assert!(!progress.is_complete(2));
        progress.add(&[2, 1, 0, 2, 0, 0, 0, 0x10]);
        assert!(progress.is_complete(2) && !progress.is_complete(3));
    }

    #[test]
    fn rows_that_were_filled_in_are_told() {
        let photo = |rows: usize, filled: usize, of: &dyn Fn(usize) -> u8| {
            let noise = (0..30 * rows).map(|k| (k * k % 251) as u8);
            let filling = (0..30 * filled).map(|k| of(k % 30));
            noise.chain(filling).collect::<Vec<u8>>()
        };
        let told = told_of_filled(&photo(40, 40, &|column| 90 + column as u8), 30, 3).unwrap();
        assert!(told.message.contains("24 of 80 rows"), "{told}");
        assert!(told_of_filled(&photo(40, 40, &|_| 128), 30, 3).is_some());
        // Too few, a white background, and no photo at all.
        assert_eq!(told_of_filled(&photo(40, 20, &|column| column as u8), 30, 3), None);
        assert_eq!(told_of_filled(&photo(40, 40, &|_| 255), 30, 3), None);
        assert_eq!(told_of_filled(&[], 0, 3), None);
    }

    #[test]
    fn nonsense_has_no_facts() {
        assert_eq!(facts(&[]).components, 0);
        assert!(!facts(&[0xff, 0xd8, 0xff, 0xd9]).has_end, "there is no scan before the end");
        assert_eq!(facts(&[0xff, 0xd8, 1, 2, 3, 0xff, 0xe1, 0, 2]).stray_bytes, 3);
    }
}
