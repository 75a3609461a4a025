//! Directions drawn from the light for all paths of a packet: the table is looked up path by path, the rest is arithmetic.

use super::lanes::Lanes;
use crate::light::EnvironmentSampler;
use crate::math::vector::Vector;
use crate::math::vector::elementary::{angle, sine_and_cosine_of_turns};
use std::f32::consts::TAU;

/// Cells of the light's table, one a path; see [`crate::light::sampler::LightCell`].
#[derive(Default)]
pub(super) struct LightCells {
    rest: [Lanes; 2],
    corners: [Lanes; 4],
    column: Lanes,
    from_pole: [Lanes; 2],
    pole: Lanes,
    columns: f32,
}

/// Directions towards the light.
pub(super) struct Drawn<V> {
    /// Unit direction.
    pub direction: [V; 3],
    /// Density per steradian.
    pub density: V,
    /// Angles, as of [`angles_of_direction`](crate::math::sphere::angles_of_direction), but phi up to a whole turn.
    pub phi: V,
    /// See there.
    pub theta: V,
}

impl LightCells {
    /// Looks up the cells that pairs of random numbers fall into; false where there is no light.
    #[inline(always)]
    pub fn find(&mut self, light: &EnvironmentSampler, numbers: &[Lanes; 2], count: usize) -> bool {
        let Some(tables) = light.tables() else { return false };
        self.columns = tables.columns() as f32;
        for lane in 0..count {
            let cell = tables.cell([numbers[0][lane], numbers[1][lane]]);
            for k in 0..2 {
                self.rest[k][lane] = cell.rest[k];
                self.from_pole[k][lane] = cell.ring.from_pole[k];
            }
            for k in 0..4 {
                self.corners[k][lane] = cell.corners[k];
            }
            self.column[lane] = cell.column as f32;
            self.pole[lane] = cell.ring.pole;
        }
        true
    }

    /// See [`EnvironmentSampler::sample`].
    #[inline(always)]
    pub fn draw<V: Vector>(&self, at: usize) -> Drawn<V> {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let [upper_left, upper_right, lower_left, lower_right] = [
            V::load(&self.corners[0][at..]),
            V::load(&self.corners[1][at..]),
            V::load(&self.corners[2][at..]),
            V::load(&self.corners[3][at..]),
        ];
        let down =
            sample_linear(V::load(&self.rest[1][at..]), upper_left.add(upper_right), lower_left.add(lower_right));
        let left = lower_left.sub(upper_left).mul_add(down, upper_left);
        let right = lower_right.sub(upper_right).mul_add(down, upper_right);
        let across = sample_linear(V::load(&self.rest[0][at..]), left, right);
        let distance = V::load(&self.from_pole[1][at..]).mul_add(down, V::load(&self.from_pole[0][at..]));
        let sine = distance.mul(V::splat(2.0).sub(distance)).max(zero).sqrt();
        let cosine = V::load(&self.pole[at..]).mul(one.sub(distance));
        let turns = V::load(&self.column[at..]).add(across).mul(V::splat(1.0 / self.columns));
        let (sin_phi, cos_phi) = sine_and_cosine_of_turns(turns);
        Drawn {
            direction: [sine.mul(sin_phi), cosine, zero.sub(sine.mul(cos_phi))],
            density: right.sub(left).mul_add(across, left),
            phi: turns.mul(V::splat(TAU)),
            theta: angle(sine, cosine),
        }
    }
}

/// Numbers in [0, 1] with a density linear from `first` to `last`, which are not both 0: see
/// [`crate::light::sampler`].
#[inline(always)]
fn sample_linear<V: Vector>(u: V, first: V, last: V) -> V {
    let squared = first.mul(first);
    let root = last.mul(last).sub(squared).mul_add(u, squared).max(V::splat(0.0)).sqrt();
    u.mul(first.add(last)).div(first.add(root).max(V::splat(1e-30))).min(V::splat(1.0))
}
