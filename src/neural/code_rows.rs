//! Parameters of a model and the rows of codes that its flow sees.
//!
//! A flow is asked with a code for each lobe and channel. Where codes have a part that is the material's (its shape, see
//! [`super::architecture::Architecture::shape`]), parameters hold it once a lobe, before the own codes of the three
//! channels; a row is the channel's own code, then the shape.

use super::architecture::Architecture;
use super::train::project_to_ball;

/// Codes may leave the unit ball by this factor: the released code's allowance on estimation.
const BALL: f64 = 1.01;

/// How parameters are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodeRows {
    own: usize,
    shape: usize,
    lobes: usize,
}

impl CodeRows {
    /// Of a model of some lobes.
    pub fn of(architecture: &Architecture, lobes: usize) -> Self {
        CodeRows { own: architecture.code - architecture.shape, shape: architecture.shape, lobes }
    }

    /// Parameters that are codes.
    pub fn parameters(self) -> usize {
        self.lobes * self.of_lobe()
    }

    /// Parameters of one lobe: its shape, then the own codes of its channels.
    fn of_lobe(self) -> usize {
        self.shape + 3 * self.own
    }

    /// Length of a row.
    fn length(self) -> usize {
        self.own + self.shape
    }

    /// Where parameters of a lobe and channel begin: its own code, and the shape.
    fn places(self, lobe: usize, channel: usize) -> (usize, usize) {
        let from = lobe * self.of_lobe();
        (from + self.shape + channel * self.own, from)
    }

    /// The rows, lobe by lobe, channels fastest; own codes and shapes are put back in the ball that they live in.
    pub fn rows(self, parameters: &[f64]) -> Vec<f32> {
        let mut rows = Vec::with_capacity(3 * self.lobes * self.length());
        let mut push = |numbers: &[f64]| {
            let from = rows.len();
            rows.extend(numbers.iter().map(|&value| (value as f32) / BALL as f32));
            project_to_ball(&mut rows[from..]);
            rows[from..].iter_mut().for_each(|value| *value *= BALL as f32);
        };
        for (lobe, channel) in (0..self.lobes).flat_map(|lobe| (0..3).map(move |channel| (lobe, channel))) {
            let (own, shape) = self.places(lobe, channel);
            push(&parameters[own..own + self.own]);
            push(&parameters[shape..shape + self.shape]);
        }
        rows
    }

    /// Adds the derivatives by rows to those by parameters.
    pub fn add_slopes(self, d_rows: &[f32], gradient: &mut [f64]) {
        for (index, row) in d_rows.chunks_exact(self.length().max(1)).enumerate() {
            let (own, shape) = self.places(index / 3, index % 3);
            let add = |(sum, value): (&mut f64, &f32)| *sum += f64::from(*value);
            gradient[own..own + self.own].iter_mut().zip(row).for_each(add);
            gradient[shape..shape + self.shape].iter_mut().zip(&row[self.own..]).for_each(add);
        }
    }

    /// Writes rows of one lobe into the parameters; the shape is that of the first one.
    pub fn set_lobe<'a>(self, lobe: usize, row_of: impl Fn(usize) -> &'a [f32], parameters: &mut [f64]) {
        for channel in (0..3).rev() {
            let (own, shape) = self.places(lobe, channel);
            let row = row_of(channel).iter().map(|&value| f64::from(value));
            let slots = (own..own + self.own).chain(shape..shape + self.shape);
            slots.zip(row).for_each(|(slot, value)| parameters[slot] = value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_share_the_shape_and_slopes_add_up_in_it() {
        let layout = CodeRows::of(&Architecture::shaped(2, 3), 2);
        assert_eq!(layout.parameters(), 18);
        let parameters: Vec<f64> = (0..18).map(|index| 0.01 * f64::from(index)).collect();
        let rows = layout.rows(&parameters);
        let near = |row: usize, expected: [f32; 5]| {
            rows[5 * row..5 * row + 5].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6)
        };
        assert!(near(0, [0.03, 0.04, 0.0, 0.01, 0.02]) && near(2, [0.07, 0.08, 0.0, 0.01, 0.02]), "{rows:?}");
        assert!(near(3, [0.12, 0.13, 0.09, 0.10, 0.11]), "{rows:?}");
        let mut back = vec![0.0; 18];
        (0..2).for_each(|lobe| layout.set_lobe(lobe, |channel| &rows[5 * (3 * lobe + channel)..][..5], &mut back));
        assert!(back.iter().zip(&parameters).all(|(a, b)| (a - b).abs() < 1e-6));
        let mut gradient = vec![0.0; 18];
        layout.add_slopes(&[1.0; 30], &mut gradient);
        let lobe = [3.0, 3.0, 3.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(gradient, [lobe, lobe].concat());
    }

    #[test]
    fn own_codes_and_shapes_each_come_back_to_the_ball() {
        let layout = CodeRows::of(&Architecture::shaped(2, 3), 1);
        let rows = layout.rows(&[0.0, 30.0, 40.0, 0.1, 0.2, f64::NAN, 0.0, 5.0, 0.0]);
        let length = |numbers: &[f32]| numbers.iter().map(|x| x * x).sum::<f32>().sqrt();
        assert!((length(&rows[2..5]) - 1.01).abs() < 1e-5 && (length(&rows[..2]) - 0.05f32.sqrt()).abs() < 1e-5);
        assert_eq!(&rows[5..7], [0.0, 0.0]);
        assert!((length(&rows[10..12]) - 1.01).abs() < 1e-5);
    }
}
