//! Where an edge passes: which texels differ from one of those around them.

/// Which texels of a light are like the eight around them: across the seam, and not beyond the poles.
#[derive(Default)]
pub(super) struct AlikeAround {
    pub(super) of: Vec<bool>,
    /// A row, begun with its last value and ended with its first.
    row: Vec<u8>,
    /// Least and most of three beside each other.
    least: Vec<u8>,
    most: Vec<u8>,
}

impl AlikeAround {
    /// Looks at a light of this width. Whole rows at a time, which the compiler makes vectors of.
    pub(super) fn look_at(&mut self, values: &[u8], width: usize) {
        self.of.clear();
        self.least.clear();
        self.most.clear();
        let Some(height) = values.len().checked_div(width) else { return };
        for values in values.chunks_exact(width) {
            self.row.clear();
            self.row.push(values[width - 1]);
            self.row.extend_from_slice(values);
            self.row.push(values[0]);
            let three = || self.row.iter().zip(&self.row[1..]).zip(&self.row[2..]);
            self.least.extend(three().map(|((a, b), c)| *a.min(b).min(c)));
            self.most.extend(three().map(|((a, b), c)| *a.max(b).max(c)));
        }
        for row in 0..height {
            let [above, own, below] = [row.saturating_sub(1), row, (row + 1).min(height - 1)]
                .map(|row| row * width..(row + 1) * width)
                .map(|row| self.least[row.clone()].iter().zip(&self.most[row]));
            self.of.extend(own.zip(above.zip(below)).map(|((least, most), (above, below))| {
                least.min(above.0).min(below.0) == most.max(above.1).max(below.1)
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    #[test]
    fn texels_like_those_around_them_are_found_across_the_seam() {
        let mut random = SequentialRandom::new(8);
        for (width, height) in [(1usize, 1usize), (2, 1), (3, 5), (64, 32)] {
            let values: Vec<u8> = (0..width * height).map(|_| random.below(40).saturating_sub(37) as u8).collect();
            let mut around = AlikeAround::default();
            around.look_at(&values, width);
            for texel in 0..width * height {
                let (row, column) = (texel / width, texel % width);
                let rows = row.saturating_sub(1)..(row + 2).min(height);
                let mut near = rows.flat_map(|row| [width - 1, 0, 1].map(|step| row * width + (column + step) % width));
                assert_eq!(around.of[texel], near.all(|near| values[near] == values[texel]), "{texel} of {width}");
            }
            assert!(width < 64 || around.of.iter().filter(|alike| **alike).count() > 200);
        }
        AlikeAround::default().look_at(&[], 0);
    }
}
