//! The points of each curve, made of the rows of a fit.

use crate::fit::LossRow;

/// Points of each curve.
#[derive(Default)]
pub(super) struct Series {
    pub(super) all: Vec<[f64; 2]>,
    pub(super) surface: Vec<[f64; 2]>,
    pub(super) held_out: Vec<[f64; 2]>,
    pub(super) consistency: Vec<[f64; 2]>,
    pub(super) borders: Vec<(f64, String)>,
}

impl Series {
    /// Points of the curves that are drawn on the axis of errors.
    fn points(&self, details: bool) -> impl Iterator<Item = &[f64; 2]> {
        let is_held_out = !self.held_out.is_empty();
        let drawn = [(&self.all, details), (&self.surface, details || !is_held_out), (&self.held_out, true)];
        drawn.into_iter().filter(|(_, is_drawn)| *is_drawn).flat_map(|(points, _)| points)
    }

    /// The highest value that is drawn.
    pub(super) fn top(&self, details: bool) -> f64 {
        self.points(details).map(|point| point[1]).fold(f64::NEG_INFINITY, f64::max).max(-300.0)
    }

    /// The lowest value that is drawn.
    pub(super) fn bottom(&self, details: bool) -> f64 {
        self.points(details).map(|point| point[1]).fold(f64::INFINITY, f64::min).clamp(-300.0, self.top(details))
    }

    /// Where the first band begins.
    pub(super) fn begin(&self) -> f64 {
        self.borders.first().map_or(0.0, |(x, _)| *x)
    }

    /// Where the last point lies.
    pub(super) fn end(&self) -> f64 {
        self.points(true).map(|point| point[0]).fold(self.begin(), f64::max)
    }
}

/// Tells curves of one length apart: those of another run differ in time and loss of their first or last step.
pub(super) fn identity(rows: &[LossRow]) -> [u64; 4] {
    let of = |row: Option<&LossRow>| row.map_or([0, 0], |row| [row.seconds.to_bits(), row.loss.to_bits()]);
    let [[first_seconds, first_loss], [last_seconds, last_loss]] = [of(rows.first()), of(rows.last())];
    [first_seconds, first_loss, last_seconds, last_loss]
}

/// Points of the curves. On a logarithmic axis values are powers of ten, and what is not above zero is left out.
pub(super) fn series(rows: &[LossRow], over_seconds: bool, logarithmic: bool, stage: Option<&str>) -> Series {
    let mut lines = Series::default();
    let (mut mean_all, mut mean_surface) = (None, None);
    let mut last_stage = "";
    for row in rows.iter().filter(|row| stage.is_none_or(|stage| row.stage == stage)) {
        let x = if over_seconds { row.seconds } else { row.step as f64 };
        if row.stage != last_stage {
            lines.borders.push((x, row.stage.clone()));
            last_stage = &row.stage;
            // Another resolution, another error: a mean over the border would mean nothing.
            (mean_all, mean_surface) = (None, None);
        }
        let put = |line: &mut Vec<[f64; 2]>, value: f64| match logarithmic {
            true if value > 0.0 => line.push([x, value.log10()]),
            true => {}
            false => line.push([x, value]),
        };
        put(&mut lines.all, smoothed(&mut mean_all, row.image_loss));
        if let Some(rmse) = row.surface_rmse {
            put(&mut lines.surface, smoothed(&mut mean_surface, rmse * rmse));
        }
        if let Some(held_out) = row.held_out_rmse {
            put(&mut lines.held_out, held_out);
        }
        if row.consistency > 0.0 {
            put(&mut lines.consistency, row.consistency);
        }
    }
    lines
}

/// The root of the mean of squared errors up to here, in which each older step counts less.
fn smoothed(mean: &mut Option<f64>, squared: f64) -> f64 {
    let mean = mean.insert(mean.map_or(squared, |mean| mean + 0.15 * (squared - mean)));
    mean.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_stops_at_stage_borders_and_nothing_below_zero_reaches_a_log_axis() {
        let row = |step: usize, stage: &str, image_loss: f64| LossRow {
            step,
            stage: stage.into(),
            seconds: step as f64 * 2.0,
            loss: image_loss,
            image_loss,
            consistency: 0.0,
            surface_rmse: Some(2.0 * image_loss.max(0.0).sqrt()),
            held_out_rmse: (step == 3).then_some(0.5),
        };
        let rows = [row(1, "coarse", 0.04), row(2, "coarse", -0.01), row(3, "fine", 0.25)];
        assert_ne!(identity(&rows), identity(&[row(1, "coarse", 0.04), row(2, "coarse", 0.01), row(3, "fine", 0.5)]));
        let lines = series(&rows, true, true, None);
        assert_eq!(lines.borders.len(), 2);
        assert_eq!(lines.all[0], [2.0, 0.2f64.log10()]);
        assert_eq!(lines.all.last(), Some(&[6.0, 0.5f64.log10()]), "the mean begins anew");
        assert_eq!(lines.surface.last(), Some(&[6.0, 0.0]), "errors of the surface are a curve of their own");
        assert_eq!(lines.top(true), 0.0);
        assert_eq!(lines.top(false), 0.5f64.log10(), "what is not drawn needs no room");
        let below = series(&rows[1..2], true, true, None);
        assert_eq!(below.all.len(), 0, "a step below zero has no logarithm");
        assert_eq!(lines.held_out, [[6.0, 0.5f64.log10()]]);
        assert_eq!(series(&rows, false, false, Some("fine")).all, [[3.0, 0.5]]);
        assert_eq!((lines.begin(), lines.end(), lines.top(true) > lines.bottom(true)), (2.0, 6.0, true));
    }
}
