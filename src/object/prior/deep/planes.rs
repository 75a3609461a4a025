//! Stacks of maps on the sphere, and what lies beyond their borders.
//!
//! A latitude-longitude map has no border: it wraps in longitude, and beyond a pole lies the same row half a turn away.

/// Channels of `height x width` values, channel after channel, row 0 up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planes {
    /// Number of channels.
    pub channels: usize,
    /// Rows of a channel.
    pub height: usize,
    /// Columns of a channel.
    pub width: usize,
    /// The values.
    pub values: Vec<f32>,
}

impl Planes {
    /// Planes of zeros.
    pub fn zeros(channels: usize, height: usize, width: usize) -> Self {
        Planes { channels, height, width, values: vec![0.0; channels * height * width] }
    }

    /// Values of a channel.
    pub fn area(&self) -> usize {
        self.height * self.width
    }

    /// One channel.
    pub fn channel(&self, channel: usize) -> &[f32] {
        &self.values[channel * self.area()..(channel + 1) * self.area()]
    }

    /// The planes with one more row and column at each side, taken from where the sphere goes on.
    pub fn padded(&self) -> Planes {
        let (height, width) = (self.height, self.width);
        let mut padded = Planes::zeros(self.channels, height + 2, width + 2);
        let area = padded.area();
        for (channel, target) in padded.values.chunks_exact_mut(area).enumerate() {
            let source = self.channel(channel);
            for (row, target) in target.chunks_exact_mut(width + 2).enumerate() {
                let (from, turn) = source_row(row, height, width);
                let line = &source[from * width..(from + 1) * width];
                // The row from `turn` on, then what lies before it; a column of the other end at each side.
                target[1..=width - turn].copy_from_slice(&line[turn..]);
                target[1 + width - turn..=width].copy_from_slice(&line[..turn]);
                (target[0], target[width + 1]) = (target[width], target[1]);
            }
        }
        padded
    }

    /// The transpose of [`Planes::padded`]: what was derived by the padding is added where it came from.
    pub fn unpadded(&self) -> Planes {
        let (height, width) = (self.height - 2, self.width - 2);
        let mut planes = Planes::zeros(self.channels, height, width);
        let area = planes.area();
        for (channel, target) in planes.values.chunks_exact_mut(area).enumerate() {
            for (row, line) in self.channel(channel).chunks_exact(width + 2).enumerate() {
                let (from, turn) = source_row(row, height, width);
                let target = &mut target[from * width..(from + 1) * width];
                let add = |sums: &mut [f32], values: &[f32]| {
                    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
                };
                add(&mut target[turn..], &line[1..=width - turn]);
                add(&mut target[..turn], &line[1 + width - turn..=width]);
                target[(turn + width - 1) % width] += line[0];
                target[turn] += line[width + 1];
            }
        }
        planes
    }

    /// The channels of `self`, then those of `other`.
    pub fn joined(&self, other: &Planes) -> Planes {
        let values = self.values.iter().chain(&other.values).copied().collect();
        Planes { channels: self.channels + other.channels, height: self.height, width: self.width, values }
    }

    /// The first `channels` channels, and the others.
    pub fn parted(mut self, channels: usize) -> (Planes, Planes) {
        let rest = self.values.split_off(channels * self.area());
        let second =
            Planes { channels: self.channels - channels, height: self.height, width: self.width, values: rest };
        self.channels = channels;
        (self, second)
    }

    /// Twice the size in both directions, bilinear between the centres of texels.
    pub fn doubled(&self) -> Planes {
        let padded = self.padded();
        let mut large = Planes::zeros(self.channels, 2 * self.height, 2 * self.width);
        let area = large.area();
        for (channel, target) in large.values.chunks_exact_mut(area).enumerate() {
            let source = padded.channel(channel);
            for (row, target) in target.chunks_exact_mut(2 * self.width).enumerate() {
                let (near, far) = neighbours(row);
                let line = |index: usize| &source[index * (self.width + 2)..(index + 1) * (self.width + 2)];
                let (near_line, far_line) = (line(near), line(far));
                for (column, value) in target.iter_mut().enumerate() {
                    let (own, beside) = neighbours(column);
                    *value = 0.75 * (0.75 * near_line[own] + 0.25 * near_line[beside])
                        + 0.25 * (0.75 * far_line[own] + 0.25 * far_line[beside]);
                }
            }
        }
        large
    }

    /// The transpose of [`Planes::doubled`].
    pub fn doubled_transposed(&self) -> Planes {
        let (height, width) = (self.height / 2, self.width / 2);
        let mut padded = Planes::zeros(self.channels, height + 2, width + 2);
        let area = padded.area();
        for (channel, target) in padded.values.chunks_exact_mut(area).enumerate() {
            for (row, line) in self.channel(channel).chunks_exact(self.width).enumerate() {
                let (near, far) = neighbours(row);
                for (column, value) in line.iter().enumerate() {
                    let (own, beside) = neighbours(column);
                    target[near * (width + 2) + own] += 0.5625 * value;
                    target[near * (width + 2) + beside] += 0.1875 * value;
                    target[far * (width + 2) + own] += 0.1875 * value;
                    target[far * (width + 2) + beside] += 0.0625 * value;
                }
            }
        }
        padded.unpadded()
    }
}

/// The row that a padded row shows, and by how many columns it is turned.
fn source_row(padded_row: usize, height: usize, width: usize) -> (usize, usize) {
    match padded_row {
        0 => (0, width / 2),
        row if row == height + 1 => (height - 1, width / 2),
        row => (row - 1, 0),
    }
}

/// The padded indices of the nearer and the farther neighbour of a place on twice the grid.
fn neighbours(place: usize) -> (usize, usize) {
    let own = place / 2 + 1;
    (own, if place.is_multiple_of(2) { own - 1 } else { own + 1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(channels: usize, height: usize, width: usize, step: f32) -> Planes {
        let mut planes = Planes::zeros(channels, height, width);
        planes.values.iter_mut().enumerate().for_each(|(index, value)| *value = (index as f32 * step).sin());
        planes
    }

    fn dot(a: &Planes, b: &Planes) -> f64 {
        a.values.iter().zip(&b.values).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    }

    #[test]
    fn beyond_a_pole_lies_the_other_side() {
        let planes = ramp(1, 4, 8, 1.3);
        let padded = planes.padded();
        assert_eq!(padded.values[1], planes.values[4]);
        assert_eq!(padded.values[5], planes.values[0]);
        assert_eq!(padded.values[10], planes.values[7]);
        assert_eq!(padded.values[19], planes.values[0]);
        assert_eq!(padded.values[5 * 10 + 1], planes.values[3 * 8 + 4]);
    }

    #[test]
    fn transposes_are_transposes() {
        let (small, padded) = (ramp(3, 4, 8, 0.7), ramp(3, 6, 10, 1.1));
        let (left, right) = (dot(&small.padded(), &padded), dot(&small, &padded.unpadded()));
        assert!((left - right).abs() < 1e-5 * left.abs().max(1.0));
        let large = ramp(3, 8, 16, 0.9);
        let (left, right) = (dot(&small.doubled(), &large), dot(&small, &large.doubled_transposed()));
        assert!((left - right).abs() < 1e-5 * left.abs().max(1.0));
    }
}
