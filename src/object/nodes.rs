//! The points of half and difference space at which a reflectance is tabulated for one fit.
//!
//! A model with a network behind it costs thousands of multiplications a value, and an image asks for millions of
//! values; between a few thousand nodes that lie close where highlights are, the value is linear.

use super::directions::{BATCH, PartBatch};
use crate::measured::coordinates::HalfDifference;
use crate::measured::model::ReflectanceModel;
use glam::{Vec3, Vec3A};
use std::f32::consts::{FRAC_PI_2, PI};

/// A node whose directions would lie below the surface stands for the one above it at this share of the way.
const SHARE_OF_HORIZON: f64 = 0.985;

/// A grid over half and difference angles, fine near the mirror direction.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeGrid {
    counts: [usize; 3],
    points: Vec<HalfDifference>,
}

/// Where a pair of directions lies in the grid: the first node of its cell, and how far to the next along each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodePlace {
    /// Index of the cell's first node.
    pub cell: u16,
    /// Fractions along the half, the difference and the azimuth axis, in [0, 1].
    pub fraction: [f32; 3],
}

impl NodeGrid {
    /// A grid of so many nodes along theta_half, theta_difference and phi_difference; at least 3, 3 and 2, and at most
    /// 65 536 in all (counts are lowered until they fit).
    pub fn new(counts: [usize; 3]) -> Self {
        let mut counts = [counts[0].max(3), counts[1].max(3), counts[2].max(2)];
        while counts.iter().product::<usize>() > 1 << 16 {
            counts = counts.map(|count| (count * 15 / 16).max(3));
        }
        let mut points = Vec::with_capacity(counts.iter().product());
        for half in 0..counts[0] {
            for difference in 0..counts[1] {
                for azimuth in 0..counts[2] {
                    let theta_half = f64::from(half_angle(half as f32 / (counts[0] - 1) as f32));
                    let theta_difference = f64::from(difference_angle(difference as f32 / (counts[1] - 1) as f32));
                    let phi_difference = std::f64::consts::PI * azimuth as f64 / counts[2] as f64;
                    points.push(above_surface(HalfDifference { theta_half, theta_difference, phi_difference }));
                }
            }
        }
        NodeGrid { counts, points }
    }

    /// The grid of a careful fit: 17 280 nodes.
    pub fn fine() -> Self {
        Self::new([48, 24, 15])
    }

    /// A grid for quick looks: 3 360 nodes.
    pub fn coarse() -> Self {
        Self::new([28, 15, 8])
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is none; never so.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Where each node lies.
    pub fn points(&self) -> &[HalfDifference] {
        &self.points
    }

    /// The cell of three angles in radians.
    #[inline]
    pub fn place(&self, theta_half: f32, theta_difference: f32, phi_difference: f32) -> NodePlace {
        let counts = self.counts.map(|count| count as i32);
        let (cell, fraction) = place_of(counts, theta_half, theta_difference, phi_difference);
        NodePlace { cell: cell as u16, fraction }
    }

    /// The cells of a batch of parts; what lies beyond its last part is of no meaning.
    #[inline(never)]
    pub fn places(&self, batch: &PartBatch) -> NodePlaces {
        let counts = self.counts.map(|count| count as i32);
        let mut places = NodePlaces { cell: [0; BATCH], fraction: [[0.0; BATCH]; 3] };
        for part in 0..BATCH {
            let (cell, fraction) = place_of(counts, batch.half[part], batch.difference[part], batch.azimuth[part]);
            places.cell[part] = cell;
            (0..3).for_each(|axis| places.fraction[axis][part] = fraction[axis]);
        }
        places
    }

    /// The eight nodes of a cell, in the order of [`weights`].
    #[inline]
    pub fn corners(&self, cell: u16) -> [usize; 8] {
        let cell = usize::from(cell);
        let [_, differences, azimuths] = self.counts;
        // The azimuth is periodic: reciprocity makes phi and phi + pi one.
        let next = if cell % azimuths + 1 == azimuths { cell + 1 - azimuths } else { cell + 1 };
        let (down, across) = (differences * azimuths, azimuths);
        [cell, next, cell + across, next + across, cell + down, next + down, cell + down + across, next + down + across]
    }

    /// The value of a table between its nodes, in 1/sr.
    pub fn value(&self, table: &NodeTable, at: HalfDifference) -> [f64; 3] {
        let place = self.place(at.theta_half as f32, at.theta_difference as f32, at.phi_difference as f32);
        let mut sum = [0.0; 3];
        for (corner, weight) in self.corners(place.cell).into_iter().zip(weights(place.fraction)) {
            (0..3).for_each(|channel| sum[channel] += f64::from(table.values[corner][channel] * weight));
        }
        sum
    }

    /// The values of a model at all nodes. What is negative or not finite becomes 0, the latter counted.
    pub fn tabulate(&self, model: &dyn ReflectanceModel, parameters: &[f64]) -> NodeTable {
        let mut values = vec![[0.0; 3]; self.len()];
        model.evaluate(parameters, &self.points, &mut values);
        let mut not_finite = 0;
        let values = values
            .into_iter()
            .map(|value| {
                value.map(|channel| {
                    let is_finite = channel.is_finite() && channel < 1e12;
                    not_finite += usize::from(!is_finite);
                    if is_finite { channel.max(0.0) as f32 } else { 0.0 }
                })
            })
            .collect();
        NodeTable { values, not_finite }
    }

    /// The gradient by a model's parameters, of the gradient by the node values.
    ///
    /// The model is asked once: one with a net behind it goes back through it once, not chunk by chunk.
    pub fn pull_back(&self, model: &dyn ReflectanceModel, parameters: &[f64], adjoint: &[[f64; 3]]) -> Vec<f64> {
        let touched = |channels: &[f64; 3]| channels.iter().any(|value| *value != 0.0);
        let (points, adjoint): (Vec<HalfDifference>, Vec<[f64; 3]>) =
            self.points.iter().zip(adjoint).filter(|(_, channels)| touched(channels)).unzip();
        let mut gradient = vec![0.0; parameters.len()];
        if !points.is_empty() {
            model.pull_back(parameters, &points, &adjoint, &mut gradient);
        }
        gradient
    }
}

/// Cell and fractions of three angles in a grid of so many nodes along each axis: written without a branch, for loops over
/// batches.
#[inline(always)]
fn place_of(counts: [i32; 3], theta_half: f32, theta_difference: f32, phi_difference: f32) -> (i32, [f32; 3]) {
    let along = |place: f32, last: i32| {
        let place = place.clamp(0.0, 1.0) * last as f32;
        let cell = (place as i32).min(last - 1);
        (cell, place - cell as f32)
    };
    let (half, half_fraction) = along(half_coordinate(theta_half), counts[0] - 1);
    let (difference, difference_fraction) = along(difference_coordinate(theta_difference), counts[1] - 1);
    let around = phi_difference * (counts[2] as f32 / PI);
    let azimuth = (around as i32).clamp(0, counts[2] - 1);
    let cell = (half * counts[1] + difference) * counts[2] + azimuth;
    (cell, [half_fraction, difference_fraction, (around - azimuth as f32).clamp(0.0, 1.0)])
}

/// Where the parts of a batch lie in a grid.
pub struct NodePlaces {
    cell: [i32; BATCH],
    fraction: [[f32; BATCH]; 3],
}

impl NodePlaces {
    /// The place of one part.
    #[inline]
    pub fn of(&self, part: usize) -> NodePlace {
        NodePlace { cell: self.cell[part] as u16, fraction: [0, 1, 2].map(|axis| self.fraction[axis][part]) }
    }
}

/// Values of a reflectance at the nodes of a grid, in 1/sr.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeTable {
    /// One RGB value a node.
    pub values: Vec<[f32; 3]>,
    /// How many values of the model were not finite and count as 0.
    pub not_finite: usize,
}

impl NodeTable {
    /// A reflectance of one value at all nodes.
    pub fn constant(grid: &NodeGrid, value: [f32; 3]) -> Self {
        NodeTable { values: vec![value; grid.len()], not_finite: 0 }
    }

    /// The table times a factor per channel.
    pub fn scaled(&self, factor: [f64; 3]) -> Self {
        let scale = |value: &[f32; 3]| [0, 1, 2].map(|c| (f64::from(value[c]) * factor[c]) as f32);
        NodeTable { values: self.values.iter().map(scale).collect(), not_finite: self.not_finite }
    }
}

/// A table laid out for reading between its nodes: a whole register a node.
#[derive(Clone, Debug)]
pub struct NodeReader {
    values: Vec<Vec3A>,
}

impl NodeReader {
    /// Lays a table out.
    pub fn new(table: &NodeTable) -> Self {
        NodeReader { values: table.values.iter().map(|value| Vec3A::from_array(*value)).collect() }
    }

    /// The sum of eight nodes by their weights, in 1/sr.
    #[inline]
    pub fn between(&self, corners: [usize; 8], weights: [f32; 8]) -> Vec3 {
        let mut sum = Vec3A::ZERO;
        for (corner, weight) in corners.into_iter().zip(weights) {
            sum += self.values[corner] * weight;
        }
        sum.into()
    }
}

/// The trilinear weights of a cell's eight corners.
#[inline]
pub fn weights(fraction: [f32; 3]) -> [f32; 8] {
    let [half, difference, azimuth] = fraction;
    let (low, high) = ((1.0 - half) * (1.0 - difference), (1.0 - half) * difference);
    let (low_far, high_far) = (half * (1.0 - difference), half * difference);
    let rest = 1.0 - azimuth;
    [
        low * rest,
        low * azimuth,
        high * rest,
        high * azimuth,
        low_far * rest,
        low_far * azimuth,
        high_far * rest,
        high_far * azimuth,
    ]
}

/// theta_half at a place in [0, 1] along its axis: squared, as the tables of MERL are.
fn half_angle(place: f32) -> f32 {
    FRAC_PI_2 * place * place
}

#[inline(always)]
fn half_coordinate(angle: f32) -> f32 {
    (angle.max(0.0) / FRAC_PI_2).sqrt()
}

/// theta_difference at a place in [0, 1]: closer towards grazing, where Fresnel's term rises.
fn difference_angle(place: f32) -> f32 {
    FRAC_PI_2 * (1.0 - (1.0 - place) * (1.0 - 0.35 * place))
}

#[inline(always)]
fn difference_coordinate(angle: f32) -> f32 {
    // The inverse of `difference_angle`: 1 - a = (1 - p)(1 - 0.35 p), a quadratic in p.
    let remaining = 1.0 - (angle / FRAC_PI_2).clamp(0.0, 1.0);
    (1.35 - (1.35f32 * 1.35 - 1.4 * (1.0 - remaining)).max(0.0).sqrt()) / 0.7
}

/// Lowers theta_difference until both directions lie above the surface.
fn above_surface(point: HalfDifference) -> HalfDifference {
    let steep = point.theta_half.tan() * point.phi_difference.cos().abs();
    let limit = if steep > 1e-12 { (1.0 / steep).atan() } else { std::f64::consts::FRAC_PI_2 };
    HalfDifference { theta_difference: point.theta_difference.min(SHARE_OF_HORIZON * limit), ..point }
}

#[cfg(test)]
mod tests;
