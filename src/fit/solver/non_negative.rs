//! Least squares with coefficients that are at least zero.

/// Minimises `x' N x / 2 - b' x` over `x >= 0` by coordinate descent, starting from `x`. `matrix` is dense, symmetric
/// and positive semi-definite, row after row.
///
/// Stops when no coefficient moves by more than `tolerance` times the largest one, or after `sweeps` sweeps; returns
/// the number of sweeps. A coefficient with a zero on the diagonal stays where it is.
pub fn solve_non_negative(matrix: &[f64], right: &[f64], x: &mut [f64], sweeps: usize, tolerance: f64) -> usize {
    let count = right.len();
    // The gradient N x - b is kept up to date, one row for each move.
    let mut gradient: Vec<f64> = (0..count)
        .map(|row| {
            let own = &matrix[row * count..(row + 1) * count];
            own.iter().zip(x.iter()).map(|(a, b)| a * b).sum::<f64>() - right[row]
        })
        .collect();
    for sweep in 1..=sweeps {
        let mut largest_move = 0.0f64;
        for index in 0..count {
            let diagonal = matrix[index * count + index];
            if diagonal <= 0.0 {
                continue;
            }
            let moved = (x[index] - gradient[index] / diagonal).max(0.0);
            let step = moved - x[index];
            if step != 0.0 {
                x[index] = moved;
                largest_move = largest_move.max(step.abs());
                for (value, entry) in gradient.iter_mut().zip(&matrix[index * count..(index + 1) * count]) {
                    *value += step * entry;
                }
            }
        }
        let largest = x.iter().fold(0.0f64, |a, &b| a.max(b));
        if largest_move <= tolerance * largest {
            return sweep;
        }
    }
    sweeps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    #[test]
    fn the_conditions_of_the_optimum_hold() {
        let mut random = SequentialRandom::new(6);
        let (rows, count) = (60, 20);
        let a: Vec<f64> = (0..rows * count).map(|_| f64::from(random.next_number())).collect();
        let y: Vec<f64> = (0..rows).map(|_| f64::from(random.next_number()) - 0.2).collect();
        let mut matrix = vec![0.0; count * count];
        let mut right = vec![0.0; count];
        for row in 0..rows {
            for i in 0..count {
                for k in 0..count {
                    matrix[i * count + k] += a[row * count + i] * a[row * count + k];
                }
                right[i] += a[row * count + i] * y[row];
            }
        }
        let mut x = vec![0.5; count];
        let sweeps = solve_non_negative(&matrix, &right, &mut x, 20_000, 1e-12);
        assert!(sweeps < 20_000);
        let mut at_bound = 0;
        for i in 0..count {
            let gradient: f64 = (0..count).map(|k| matrix[i * count + k] * x[k]).sum::<f64>() - right[i];
            if x[i] > 0.0 {
                assert!(gradient.abs() < 1e-7, "{i}: {gradient}");
            } else {
                assert!(gradient > -1e-9, "{i}: {gradient}");
                at_bound += 1;
            }
        }
        assert!(at_bound > 0 && at_bound < count, "the test sees both kinds");
    }
}
