//! Turning and resizing an environment without losing energy.
//!
//! The sum over texels of radiance times exact solid angle stays what it was, per channel, to the rounding of `f32`:
//! a sun that holds two thirds of the light in one texel of 10^5 must hold two thirds of it at any size.

use super::environment::Environment;
use crate::image::Image;
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

impl Environment {
    /// The environment turned about +y by an angle in radians, right-handed: what was at +z goes towards +x, so that
    /// the picture moves to the left. Exact when the angle is a whole number of texels; between, each row is
    /// interpolated linearly, which keeps its energy and widens a one-texel sun.
    pub fn rotated_about_up(&self, radians: f32) -> Self {
        let width = self.width();
        // The direction at phi came from phi + angle, see the test with a rotation matrix.
        let shift = (f64::from(radians) / TAU * width as f64).rem_euclid(width as f64);
        let whole = shift.round();
        // An angle given in f32 hits a whole texel only nearly.
        let shift = if (shift - whole).abs() < 1e-6 * width as f64 { whole } else { shift };
        let (first, fraction) = (shift.floor() as usize, shift.fract() as f32);
        let radiance = Image::from_fn(width, self.height(), |row, column| {
            let source = self.radiance[(row, (column + first) % width)];
            if fraction == 0.0 {
                return source;
            }
            source * (1.0 - fraction) + self.radiance[(row, (column + first + 1) % width)] * fraction
        });
        Environment { radiance }
    }

    /// The environment at another size; sides of 0 count as 1.
    ///
    /// Along an axis that shrinks, each texel is the mean over the solid angle it covers. Along an axis that grows,
    /// values are linear between texel centres, scaled within each source texel so that its mean stays its value.
    pub fn resampled(&self, width: usize, height: usize) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        if (width, height) == (self.width(), self.height()) {
            return self.clone();
        }
        // Rows first. In z = (1 - cos theta)/2 equal lengths are equal solid angles.
        let row_edges = |count: usize| edges(count, |place| (0.5 * PI * place).sin().powi(2));
        let (source_rows, target_rows) = (row_edges(self.height()), row_edges(height));
        let mut tall = Image::filled(self.width(), height, DVec3::ZERO);
        for column in 0..self.width() {
            let line: Vec<DVec3> = (0..self.height()).map(|row| self.radiance[(row, column)].as_dvec3()).collect();
            for (row, value) in resampled_line(&line, &source_rows, &target_rows, false).into_iter().enumerate() {
                tall[(row, column)] = value;
            }
        }
        let (source_columns, target_columns) = (edges(self.width(), |place| place), edges(width, |place| place));
        let mut radiance = Vec::with_capacity(width * height);
        for line in tall.pixels().chunks_exact(self.width()) {
            let line = resampled_line(line, &source_columns, &target_columns, true);
            radiance.extend(line.into_iter().map(DVec3::as_vec3).map(|rgb| rgb.max(Vec3::ZERO)));
        }
        Environment { radiance: Image::from_pixels(width, height, radiance) }
    }
}

/// The `count + 1` edges of equal parts of [0, 1], after a growing map of [0, 1] to itself.
fn edges(count: usize, map: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=count).map(|index| map(index as f64 / count as f64)).collect()
}

/// One line of means over source intervals, as means over target intervals of the same total length.
fn resampled_line(values: &[DVec3], source: &[f64], target: &[f64], wraps: bool) -> Vec<DVec3> {
    let grows = target.len() > source.len();
    let mut result = Vec::with_capacity(target.len() - 1);
    let mut index = 0;
    for interval in target.windows(2) {
        let (start, end) = (interval[0], interval[1]);
        let mut sum = DVec3::ZERO;
        while index + 1 < values.len() && source[index + 1] <= start {
            index += 1;
        }
        let mut texel = index;
        loop {
            let (low, high) = (start.max(source[texel]), end.min(source[texel + 1]));
            if high > low {
                sum += match grows {
                    true => Tent::new(values, source, texel, wraps).integral(low, high),
                    false => values[texel] * (high - low),
                };
            }
            if texel + 1 >= values.len() || source[texel + 1] >= end {
                break;
            }
            texel += 1;
        }
        result.push(sum / (end - start));
    }
    result
}

/// Within one source texel: linear from its left edge to its centre, and on to its right edge, with its own mean.
struct Tent {
    start: f64,
    centre: f64,
    end: f64,
    /// Values at start, centre and end.
    knots: [DVec3; 3],
}

impl Tent {
    fn new(values: &[DVec3], edges: &[f64], texel: usize, wraps: bool) -> Self {
        let count = values.len();
        let length = |texel: usize| edges[texel + 1] - edges[texel];
        // The value on the edge shared with a neighbour lies between the two centres, by distance.
        let at_edge = |neighbour: usize, exists: bool| {
            if !exists {
                return values[texel];
            }
            let (own, other) = (length(texel), length(neighbour));
            // Beside a sun a dark texel would keep its mean by going black at its far side: let it rise twofold only.
            ((values[neighbour] * own + values[texel] * other) / (own + other)).min(2.0 * values[texel])
        };
        let left = at_edge((texel + count - 1) % count, wraps || texel > 0);
        let right = at_edge((texel + 1) % count, wraps || texel + 1 < count);
        let mean = (left + 2.0 * values[texel] + right) / 4.0;
        let scale = |channel: usize| if mean[channel] > 0.0 { values[texel][channel] / mean[channel] } else { 0.0 };
        let scale = DVec3::new(scale(0), scale(1), scale(2));
        let (start, end) = (edges[texel], edges[texel + 1]);
        Tent { start, centre: 0.5 * (start + end), end, knots: [left * scale, values[texel] * scale, right * scale] }
    }

    /// The integral over [low, high] within the texel.
    fn integral(&self, low: f64, high: f64) -> DVec3 {
        let piece = |start: f64, end: f64, first: DVec3, last: DVec3| {
            let (low, high) = (low.max(start), high.min(end));
            if high <= low {
                return DVec3::ZERO;
            }
            let middle = (0.5 * (low + high) - start) / (end - start);
            first.lerp(last, middle) * (high - low)
        };
        piece(self.start, self.centre, self.knots[0], self.knots[1])
            + piece(self.centre, self.end, self.knots[1], self.knots[2])
    }
}
