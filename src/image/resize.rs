//! Smaller by the mean over areas, larger by bilinear interpolation.

use super::linear::Linear;
use super::raster::Image;

/// The image made smaller by a whole factor: each pixel is the mean of its block of `factor x factor`. Blocks at the
/// right and lower border may be cut; they are the mean of what is there. A factor of 0 counts as 1.
pub fn shrink<T: Linear>(image: &Image<T>, factor: usize) -> Image<T> {
    let factor = factor.max(1);
    let (width, height) = (image.width().div_ceil(factor), image.height().div_ceil(factor));
    Image::from_fn(width, height, |row, column| {
        let rows = row * factor..((row + 1) * factor).min(image.height());
        let columns = column * factor..((column + 1) * factor).min(image.width());
        let weight = 1.0 / (rows.len() * columns.len()) as f32;
        let mut sum = T::ZERO;
        for source_row in rows {
            for source_column in columns.clone() {
                sum.add_weighted(image[(source_row, source_column)], weight);
            }
        }
        sum
    })
}

/// The image sampled bilinearly at the pixel centres of another size; clamped at the border. Meant for enlarging: it
/// skips pixels when the new size is less than half the old. An image without pixels gives one of zeros.
pub fn enlarge<T: Linear>(image: &Image<T>, width: usize, height: usize) -> Image<T> {
    if image.pixels().is_empty() {
        return Image::filled(width, height, T::ZERO);
    }
    let columns: Vec<_> = (0..width).map(|column| interpolation(column, width, image.width())).collect();
    let rows: Vec<_> = (0..height).map(|row| interpolation(row, height, image.height())).collect();
    Image::from_fn(width, height, |row, column| {
        let mut sum = T::ZERO;
        for (source_row, row_weight) in rows[row] {
            for (source_column, column_weight) in columns[column] {
                sum.add_weighted(image[(source_row, source_column)], row_weight * column_weight);
            }
        }
        sum
    })
}

/// The two source pixels, and their weights, at the centre of a target pixel along one axis.
fn interpolation(target: usize, target_length: usize, source_length: usize) -> [(usize, f32); 2] {
    let place = (target as f64 + 0.5) * source_length as f64 / target_length as f64 - 0.5;
    let place = place.clamp(0.0, (source_length - 1) as f64);
    let low = place as usize;
    let fraction = (place - low as f64) as f32;
    [(low, 1.0 - fraction), ((low + 1).min(source_length - 1), fraction)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrinking_keeps_the_mean_and_cut_blocks_are_means() {
        let image = Image::from_fn(6, 4, |row, column| (row * 6 + column) as f32);
        let small = shrink(&image, 2);
        assert_eq!(small[(0, 0)], (0.0 + 1.0 + 6.0 + 7.0) / 4.0);
        let mean = |image: &Image<f32>| image.pixels().iter().sum::<f32>() / image.pixels().len() as f32;
        assert!((mean(&small) - mean(&image)).abs() < 1e-5);
        let cut = shrink(&Image::from_fn(5, 1, |_, column| column as f32), 2);
        assert_eq!(cut.pixels(), [0.5, 2.5, 4.0]);
    }

    #[test]
    fn enlarging_reproduces_ramps_away_from_the_border() {
        let ramp = Image::from_fn(8, 8, |row, column| [row as f32, column as f32]);
        let large = enlarge(&ramp, 16, 24);
        for row in 2..20 {
            for column in 1..15 {
                let expected = [(row as f32 + 0.5) / 3.0 - 0.5, (column as f32 + 0.5) / 2.0 - 0.5];
                let [value_row, value_column] = large[(row, column)];
                assert!((value_row - expected[0]).abs() < 1e-5 && (value_column - expected[1]).abs() < 1e-5);
            }
        }
        assert_eq!(enlarge(&Image::<f32>::default(), 2, 1).pixels(), [0.0, 0.0]);
    }
}
