//! When a curve of errors falls to a level.

/// The first time at which a curve of `(seconds, error)`, in the order of time, is at or below `level`: between two
/// points along a straight line of the logarithms. `None` when it never is. A curve that begins below gives the time of
/// its first point, which is an upper bound.
pub fn time_to_reach(curve: &[(f64, f64)], level: f64) -> Option<f64> {
    let first = curve.iter().position(|(_, error)| *error <= level)?;
    let (seconds, error) = curve[first];
    let Some(&(before, above)) = first.checked_sub(1).and_then(|index| curve.get(index)) else { return Some(seconds) };
    let share = (above.ln() - level.ln()) / (above.ln() - error.ln());
    let time = (before.ln() + share * (seconds.ln() - before.ln())).exp();
    Some(if time.is_finite() { time.clamp(before, seconds) } else { seconds })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_between_points_lie_on_a_line_of_logarithms() {
        let curve = [(1.0, 8.0), (4.0, 2.0), (16.0, 2.0)];
        assert!((time_to_reach(&curve, 4.0).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(time_to_reach(&curve, 9.0), Some(1.0));
        assert_eq!(time_to_reach(&curve, 2.0), Some(4.0));
        assert_eq!(time_to_reach(&curve, 1.0), None);
        assert_eq!(time_to_reach(&[(1.0, f64::NAN), (2.0, 0.0)], 1.0), Some(2.0));
        assert_eq!(time_to_reach(&[], 1.0), None);
    }
}
