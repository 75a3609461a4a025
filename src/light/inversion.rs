//! Sampling tables of weights by inversion, which keeps neighbours neighbours.
//!
//! An alias table is a little faster, but it scatters evenly spread numbers over the table. Measured on 64 x 32 skies
//! with 16 scrambled Sobol samples, the error of an irradiance was 1.9 to 2.8 times as large with alias tables, as if a
//! quarter of the samples had been taken; a sample took as long.
//!
//! Running sums are whole numbers, shares of 2^32 rounded down: with their guide a third shorter than in `f64`, and exact
//! where they are taken apart.

/// Tables of so many weights each, one after the other in memory.
#[derive(Clone, Debug)]
pub struct InversionTables {
    /// Weights of a table.
    count: usize,
    /// Table by table: for each of as many equal parts of [0, 1) the entry in which it begins (Chen and Asau 1974), then
    /// the running sums before each entry and at the end.
    numbers: Vec<u32>,
}

impl InversionTables {
    /// No tables yet, for tables of `count` weights.
    pub fn new(count: usize) -> Self {
        InversionTables { count, numbers: Vec::new() }
    }

    /// Adds a table in proportion to `weights`, as many as all tables have. `None`, and nothing is added, when they are
    /// not finite, less than 0, or all 0.
    pub fn push(&mut self, weights: &[f64]) -> Option<()> {
        let total: f64 = weights.iter().sum();
        let valid = weights.iter().all(|&weight| weight >= 0.0) && total > 0.0 && total.is_finite();
        if !valid || weights.len() != self.count || self.count > 1 << 24 {
            return None;
        }
        // The end is one short of 2^32, which no number that is drawn reaches.
        let mut sum = 0.0;
        let mut cumulative: Vec<u32> = vec![0];
        cumulative.extend(weights.iter().map(|weight| {
            sum += weight;
            (sum / total * 4_294_967_296.0) as u32
        }));
        // Where only zeros follow, rounding must not leave a rest for them.
        let last = weights.iter().rposition(|&weight| weight > 0.0).unwrap_or(0);
        cumulative[last + 1..].fill(u32::MAX);
        let mut entry = 0;
        for part in 0..self.count {
            let place = ((part as u64) << 32).div_ceil(self.count as u64) as u32;
            while cumulative[entry + 1] <= place {
                entry += 1;
            }
            self.numbers.push(entry as u32);
        }
        self.numbers.extend(cumulative);
        Some(())
    }

    /// The entry of a table that a number uniform in [0, 1) falls into, and where in it: uniform in [0, 1) again.
    #[inline]
    pub fn sample(&self, table: usize, u: f32) -> (usize, f32) {
        let stride = 2 * self.count + 1;
        let (guide, cumulative) = self.numbers[table * stride..(table + 1) * stride].split_at(self.count);
        // A number of 24 bits, exactly.
        let place = (u * 16_777_216.0).clamp(0.0, 16_777_215.0) as u32;
        let part = ((u64::from(place) * self.count as u64) >> 24) as usize;
        let place = place << 8;
        let mut entry = guide[part] as usize;
        while cumulative[entry + 1] <= place {
            entry += 1;
        }
        let (start, end) = (cumulative[entry], cumulative[entry + 1]);
        (entry, ((place - start) as f32 / (end - start) as f32).min(0.999_999_94))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_are_the_weights_and_order_is_kept() {
        let mut tables = InversionTables::new(6);
        tables.push(&[1.0, 1.0, 1.0, 1.0, 1.0, 1.0]).unwrap();
        let weights = [1.0, 0.0, 3.0, 1e-9, 6.0, 0.0];
        tables.push(&weights).unwrap();
        let mut counts = [0usize; 6];
        let mut last = (0, 0.0);
        for step in 0..100_000 {
            let sample = tables.sample(1, (step as f32 + 0.5) / 100_000.0);
            assert!(sample.0 > last.0 || (sample.0 == last.0 && sample.1 >= last.1));
            counts[sample.0] += 1;
            last = sample;
        }
        for (count, weight) in counts.iter().zip(weights) {
            assert!((*count as f64 / 10_000.0 - weight).abs() < 1e-3, "{counts:?}");
        }
        assert_eq!(tables.sample(1, 0.0).0, 0);
        for beyond in [1.0, 2.0, -1.0, f32::NAN] {
            let (entry, rest) = tables.sample(1, beyond);
            assert!(weights[entry] > 0.0, "{beyond}: an entry of weight 0 is never drawn");
            assert!((0.0..1.0).contains(&rest));
        }
        assert_eq!(tables.sample(0, 0.51), (3, (0.51f32 - 0.5) * 6.0), "tables do not mix");
        for bad in
            [&[][..], &[0.0; 6], &[-1.0, 2.0, 0.0, 0.0, 0.0, 0.0], &[f64::NAN; 6], &[f64::INFINITY; 6], &[1.0; 5]]
        {
            assert!(InversionTables::new(6).push(bad).is_none());
        }
    }
}
