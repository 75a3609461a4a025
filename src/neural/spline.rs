//! Maps of [0, 1] onto itself whose derivative is piecewise linear: the transform of one coordinate in a coupling.
//!
//! Source: Mueller, McWilliams, Rousselle, Gross and Novak 2019, "Neural Importance Sampling", section 4.2
//! (piecewise-quadratic coupling transforms). Two things differ. Bins and heights have floors, so that no bin is empty
//! and no density zero. A periodic spline has the same height at both ends: read as a density on a circle, it has no
//! seam. Sums along the bins are in `f64`.

/// No bin is narrower; of the paper's code nothing of the kind is known, a bin of no width divides by zero there.
pub const MIN_WIDTH: f64 = 1e-4;
/// No density at a knot is lower than ten to the minus this, unless a shape says otherwise.
pub const FLOOR_DIGITS: u8 = 4;
/// Raw numbers are held within this many units of zero: `exp(40)` is dynamic range enough.
const RAW_BOUND: f32 = 20.0;
/// The largest number below one, where the last bin ends.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON;

/// How many bins, and whether the ends meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplineShape {
    /// Bins in [0, 1].
    pub bins: usize,
    /// Whether the density at 1 is that at 0.
    pub periodic: bool,
    /// No density at a knot is lower than ten to the minus this.
    pub floor_digits: u8,
}

impl SplineShape {
    /// Raw numbers that make one spline: a width for each bin, then a height for each knot.
    pub fn raw_count(self) -> usize {
        2 * self.bins + if self.periodic { 0 } else { 1 }
    }

    /// The least density at a knot.
    fn floor(self) -> f64 {
        0.1f64.powi(i32::from(self.floor_digits))
    }
}

/// One spline: knots, density at the knots, and the integral of the density up to each knot.
#[derive(Clone, Debug)]
pub struct Spline {
    shape: SplineShape,
    /// Softmax of the raw widths.
    share: Vec<f64>,
    width: Vec<f64>,
    knot: Vec<f64>,
    /// Exponential of the raw heights, over their trapezoid area.
    scaled: Vec<f64>,
    height: Vec<f64>,
    integral: Vec<f64>,
}

/// A number a spline can be made of: not NaN, within bounds.
fn clean(raw: f32) -> f64 {
    if raw.is_nan() { 0.0 } else { f64::from(raw.clamp(-RAW_BOUND, RAW_BOUND)) }
}

impl Spline {
    /// The identity.
    pub fn new(shape: SplineShape) -> Self {
        let bins = shape.bins;
        let mut spline = Spline {
            shape,
            share: vec![0.0; bins],
            width: vec![0.0; bins],
            knot: vec![0.0; bins + 1],
            scaled: vec![0.0; bins + 1],
            height: vec![0.0; bins + 1],
            integral: vec![0.0; bins + 1],
        };
        spline.set(&vec![0.0; shape.raw_count()]);
        spline
    }

    /// Makes it the spline of `raw`, [`SplineShape::raw_count`] numbers. Any numbers will do, infinite ones and NaN too.
    pub fn set(&mut self, raw: &[f32]) {
        let bins = self.shape.bins;
        let (widths, heights) = raw.split_at(bins);
        let largest = widths.iter().map(|&raw| clean(raw)).fold(f64::NEG_INFINITY, f64::max);
        let mut sum = 0.0;
        for (share, &raw) in self.share.iter_mut().zip(widths) {
            *share = (clean(raw) - largest).exp();
            sum += *share;
        }
        let spread = 1.0 - bins as f64 * MIN_WIDTH;
        for bin in 0..bins {
            self.share[bin] /= sum;
            self.width[bin] = MIN_WIDTH + spread * self.share[bin];
            self.knot[bin + 1] = self.knot[bin] + self.width[bin];
        }
        let largest = heights.iter().map(|&raw| clean(raw)).fold(f64::NEG_INFINITY, f64::max);
        for (scaled, &raw) in self.scaled.iter_mut().zip(heights) {
            *scaled = (clean(raw) - largest).exp();
        }
        if self.shape.periodic {
            self.scaled[bins] = self.scaled[0];
        }
        let area: f64 = (0..bins).map(|bin| 0.5 * (self.scaled[bin] + self.scaled[bin + 1]) * self.width[bin]).sum();
        let floor = self.shape.floor();
        for knot in 0..=bins {
            self.scaled[knot] /= area;
            self.height[knot] = floor + (1.0 - floor) * self.scaled[knot];
        }
        for bin in 0..bins {
            let mean = 0.5 * (self.height[bin] + self.height[bin + 1]);
            self.integral[bin + 1] = self.integral[bin] + mean * self.width[bin];
        }
    }

    /// The bin that holds `x` by the ends of the bins in `ends`.
    fn bin(ends: &[f64], x: f64) -> usize {
        ends[1..ends.len() - 1].partition_point(|&end| end <= x)
    }

    /// Density and integral of the density at `x`; outside [0, 1) the nearest point within counts.
    pub fn at(&self, x: f64) -> (f64, f64) {
        let x = inside(x);
        let bin = Self::bin(&self.knot, x);
        let t = ((x - self.knot[bin]) / self.width[bin]).clamp(0.0, 1.0);
        let (low, rise) = (self.height[bin], self.height[bin + 1] - self.height[bin]);
        let integral = self.integral[bin] + self.width[bin] * t * (low + 0.5 * rise * t);
        (low + rise * t, inside(integral))
    }

    /// The point up to which the density integrates to `y`, and the density there.
    ///
    /// The root of the quadratic is `2 C / (B + sqrt(B^2 + 4 A C))`, which holds for equal heights (A = 0) too.
    pub fn inverse(&self, y: f64) -> (f64, f64) {
        let y = inside(y);
        let bin = Self::bin(&self.integral, y);
        let (low, rise) = (self.height[bin], self.height[bin + 1] - self.height[bin]);
        let (a, b, c) = (0.5 * rise * self.width[bin], low * self.width[bin], (y - self.integral[bin]).max(0.0));
        let t = (2.0 * c / (b + (b * b + 4.0 * a * c).max(0.0).sqrt())).clamp(0.0, 1.0);
        (inside(self.knot[bin] + t * self.width[bin]), low + rise * t)
    }
}

/// The nearest number in [0, 1); NaN counts as a half.
fn inside(x: f64) -> f64 {
    if x.is_nan() { 0.5 } else { x.clamp(0.0, BELOW_ONE) }
}

/// Sums of adjoints of one spline over the points it was asked for.
#[derive(Clone, Debug)]
pub struct SplineAdjoint {
    height: Vec<f64>,
    width: Vec<f64>,
    knot: Vec<f64>,
    integral: Vec<f64>,
}

impl SplineAdjoint {
    /// All zero.
    pub fn new(shape: SplineShape) -> Self {
        let ends = vec![0.0; shape.bins + 1];
        SplineAdjoint { height: ends.clone(), width: vec![0.0; shape.bins], knot: ends.clone(), integral: ends }
    }

    /// Adds the adjoints of density and integral at `x`; returns the adjoint of `x`.
    pub fn add(&mut self, spline: &Spline, x: f64, d_density: f64, d_integral: f64) -> f64 {
        let x = inside(x);
        let bin = Spline::bin(&spline.knot, x);
        let width = spline.width[bin];
        let t = ((x - spline.knot[bin]) / width).clamp(0.0, 1.0);
        let (low, rise) = (spline.height[bin], spline.height[bin + 1] - spline.height[bin]);
        self.height[bin] += d_density * (1.0 - t) + d_integral * width * (t - 0.5 * t * t);
        self.height[bin + 1] += d_density * t + d_integral * width * 0.5 * t * t;
        let d_t = d_density * rise + d_integral * width * (low + rise * t);
        self.width[bin] += d_integral * (low * t + 0.5 * rise * t * t) - d_t * t / width;
        self.knot[bin] -= d_t / width;
        self.integral[bin] += d_integral;
        d_t / width
    }

    /// Adds the adjoint of the raw numbers to `d_raw` and clears the sums.
    pub fn finish(&mut self, spline: &Spline, raw: &[f32], d_raw: &mut [f32]) {
        let bins = spline.shape.bins;
        // A knot and an integral are sums over the bins before them.
        let (mut of_knots, mut of_integrals) = (0.0, 0.0);
        for bin in (0..bins).rev() {
            of_knots += self.knot[bin + 1];
            of_integrals += self.integral[bin + 1];
            self.width[bin] += of_knots + of_integrals * 0.5 * (spline.height[bin] + spline.height[bin + 1]);
            self.height[bin] += of_integrals * 0.5 * spline.width[bin];
            self.height[bin + 1] += of_integrals * 0.5 * spline.width[bin];
        }
        // Heights are exponentials over their area: the area takes back what all of them gain together.
        let mut gain = 0.0;
        let floor = spline.shape.floor();
        for knot in 0..=bins {
            self.height[knot] *= 1.0 - floor;
            gain += self.height[knot] * spline.scaled[knot];
        }
        for bin in 0..bins {
            let half = 0.5 * spline.width[bin];
            self.height[bin] -= gain * half;
            self.height[bin + 1] -= gain * half;
            self.width[bin] -= gain * 0.5 * (spline.scaled[bin] + spline.scaled[bin + 1]);
        }
        if spline.shape.periodic {
            self.height[0] += self.height[bins];
        }
        let spread = 1.0 - bins as f64 * MIN_WIDTH;
        let mean: f64 = (0..bins).map(|bin| self.width[bin] * spline.share[bin]).sum();
        for bin in 0..bins {
            if raw[bin].abs() < RAW_BOUND {
                d_raw[bin] += (spread * spline.share[bin] * (self.width[bin] - mean)) as f32;
            }
        }
        for knot in 0..raw.len() - bins {
            if raw[bins + knot].abs() < RAW_BOUND {
                d_raw[bins + knot] += (self.height[knot] * spline.scaled[knot]) as f32;
            }
        }
        for sums in [&mut self.height, &mut self.width, &mut self.knot, &mut self.integral] {
            sums.fill(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    const SHAPES: [SplineShape; 3] = [
        SplineShape { bins: 6, periodic: false, floor_digits: 8 },
        SplineShape { bins: 8, periodic: false, floor_digits: FLOOR_DIGITS },
        SplineShape { bins: 5, periodic: true, floor_digits: FLOOR_DIGITS },
    ];

    fn raw(shape: SplineShape, random: &mut SequentialRandom, range: f32) -> Vec<f32> {
        (0..shape.raw_count()).map(|_| range * (2.0 * random.next_number() - 1.0)).collect()
    }

    #[test]
    fn the_inverse_undoes_the_integral_and_the_density_is_its_slope() {
        let mut random = SequentialRandom::new(1);
        for shape in SHAPES {
            for range in [0.0, 1.0, 5.0, 40.0] {
                let mut spline = Spline::new(shape);
                spline.set(&raw(shape, &mut random, range));
                assert!((spline.integral[shape.bins] - 1.0).abs() < 1e-12);
                assert!((spline.knot[shape.bins] - 1.0).abs() < 1e-12);
                for _ in 0..200 {
                    let x = f64::from(random.next_number());
                    let (density, y) = spline.at(x);
                    let (back, again) = spline.inverse(y);
                    // Where the density is near its floor, rounding of y moves x by more.
                    assert!((back - x).abs() < 1e-12 / density + 1e-14, "{x} came back as {back}");
                    assert!((again - density).abs() < 1e-6 * density);
                    let step = 1e-8;
                    let slope = (spline.at(x + step).1 - spline.at(x - step).1) / (2.0 * step);
                    if range < 10.0 && x > step && x < 1.0 - step {
                        assert!((slope - density).abs() < 1e-4 * (1.0 + density), "{slope} against {density}");
                    }
                }
            }
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let mut random = SequentialRandom::new(2);
        for shape in SHAPES {
            let raw = raw(shape, &mut random, 1.5);
            let points: Vec<(f64, f64, f64)> = (0..20)
                .map(|_| {
                    let mut number = || f64::from(random.next_number());
                    (number(), number() - 0.5, number() - 0.5)
                })
                .collect();
            let objective = |raw: &[f32]| -> f64 {
                let mut spline = Spline::new(shape);
                spline.set(raw);
                points.iter().map(|&(x, a, b)| a * spline.at(x).0 + b * spline.at(x).1).sum()
            };
            let mut spline = Spline::new(shape);
            spline.set(&raw);
            let mut adjoint = SplineAdjoint::new(shape);
            let mut d_raw = vec![0.0; raw.len()];
            for &(x, a, b) in &points {
                let d_x = adjoint.add(&spline, x, a, b);
                let value = |x: f64| a * spline.at(x).0 + b * spline.at(x).1;
                let difference = (value(x + 1e-7) - value(x - 1e-7)) / 2e-7;
                assert!((difference - d_x).abs() < 1e-5);
            }
            adjoint.finish(&spline, &raw, &mut d_raw);
            for index in 0..raw.len() {
                let (mut up, mut down) = (raw.clone(), raw.clone());
                up[index] += 5e-3;
                down[index] -= 5e-3;
                let difference = (objective(&up) - objective(&down)) / f64::from(up[index] - down[index]);
                assert!((difference - f64::from(d_raw[index])).abs() < 3e-3, "{index}: {difference} {}", d_raw[index]);
            }
        }
    }

    #[test]
    fn bins_of_no_width_and_numbers_that_are_none_make_a_spline_all_the_same() {
        for shape in SHAPES {
            for fill in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38] {
                let mut raw = vec![fill; shape.raw_count()];
                // A width, and a height that would be next to nothing.
                raw[0] = -1e30;
                raw[shape.bins] = -1e30;
                let mut spline = Spline::new(shape);
                spline.set(&raw);
                assert!(spline.width.iter().all(|&width| width >= MIN_WIDTH * 0.999));
                for step in 0..=1000 {
                    let (density, y) = spline.at(f64::from(step) / 1000.0);
                    assert!(
                        density >= 0.999 * 0.1f64.powi(i32::from(shape.floor_digits))
                            && density.is_finite()
                            && (0.0..1.0).contains(&y)
                    );
                }
            }
            let mut spline = Spline::new(shape);
            spline.set(&vec![0.3; shape.raw_count()]);
            if shape.periodic {
                assert_eq!(spline.at(0.0).0, spline.height[shape.bins]);
            }
        }
    }
}
