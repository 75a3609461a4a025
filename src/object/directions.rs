//! The directions of an environment's texels, and which parts of them light a pixel.
//!
//! Near the mirror direction a texel is split into up to 8 x 8 parts, so that narrow lobes are integrated and not hit or
//! missed. Parts are handed out by the batch: their angles are found side by side, in vector registers.

use super::angles::angles;
use super::geometry::ObjectPixel;
use super::settings::MOST_ROWS;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::math::sphere;
use glam::Vec3;
use std::f64::consts::{PI, TAU};

/// Parts a side into which a texel is split at most.
const FINEST: usize = 8;
/// Parts of a batch at most.
pub const BATCH: usize = 64;

/// Parts of texels that light one pixel, side by side.
pub struct PartBatch {
    count: usize,
    texel: [u32; BATCH],
    weight: [f32; BATCH],
    direction: [[f32; BATCH]; 3],
    /// theta_half of each, in radians; what lies beyond the last part is of no meaning.
    pub half: [f32; BATCH],
    /// theta_difference of each, in radians.
    pub difference: [f32; BATCH],
    /// phi_difference of each, in [0, pi).
    pub azimuth: [f32; BATCH],
}

impl PartBatch {
    fn new() -> Self {
        let none = [0.0; BATCH];
        PartBatch {
            count: 0,
            texel: [0; BATCH],
            weight: none,
            direction: [none; 3],
            half: none,
            difference: none,
            azimuth: none,
        }
    }

    /// Number of parts.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Index of the texel a part belongs to.
    pub fn texel(&self, part: usize) -> usize {
        self.texel[part] as usize
    }

    /// Cosine times solid angle of a part, in sr.
    pub fn weight(&self, part: usize) -> f32 {
        self.weight[part]
    }

    /// Finds the angles of all places, also of those beyond the last part: a loop of fixed length.
    #[inline(never)]
    fn find_angles(&mut self, normal: Vec3, to_eye: Vec3) {
        let [x, y, z] = &self.direction;
        for part in 0..BATCH {
            let to_light = Vec3::new(x[part], y[part], z[part]);
            let (half, difference, azimuth) = angles(normal, to_light, to_eye);
            self.half[part] = half;
            self.difference[part] = difference;
            self.azimuth[part] = azimuth;
        }
    }
}

/// A batch that fills, and what is done with it when it is full.
struct Collector<'a, F: FnMut(&PartBatch)> {
    batch: PartBatch,
    pixel: &'a ObjectPixel,
    each: F,
}

impl<F: FnMut(&PartBatch)> Collector<'_, F> {
    #[inline]
    fn push(&mut self, texel: usize, weight: f32, direction: Vec3) {
        let batch = &mut self.batch;
        let at = batch.count;
        batch.texel[at] = texel as u32;
        batch.weight[at] = weight;
        (0..3).for_each(|axis| batch.direction[axis][at] = direction[axis]);
        batch.count += 1;
        if batch.count == BATCH {
            self.hand_out();
        }
    }

    fn hand_out(&mut self) {
        if self.batch.count > 0 {
            self.batch.find_angles(self.pixel.normal, self.pixel.to_eye);
            (self.each)(&self.batch);
            self.batch.count = 0;
        }
    }
}

/// Directions of an environment's texels and of their parts.
#[derive(Clone, Debug)]
pub struct TexelDirections {
    /// Width in texels.
    pub width: usize,
    /// Height in texels.
    pub height: usize,
    centres: Vec<Vec3>,
    solid_angles: Vec<f32>,
    /// Cosines of theta_half below which a texel is split less: at 1, 2 and 5 times the height of a texel.
    split_cosines: [f32; 3],
    /// Per split of 2, 4 and 8: sine and cosine of theta and solid angle of each fine row, sine and cosine of phi.
    fine: Vec<FineAngles>,
}

#[derive(Clone, Debug)]
struct FineAngles {
    split: usize,
    rows: Vec<(f32, f32, f32)>,
    columns: Vec<(f32, f32)>,
}

impl TexelDirections {
    /// The directions of a `width x height` environment.
    ///
    /// # Errors
    /// `InvalidSetting` below 4 x 2 texels or above 65 536 in all.
    pub fn new(width: usize, height: usize) -> Result<Self> {
        if width < 4 || height < 2 || width * height > 1 << 16 {
            let message = format!("an environment of {width} x {height} texels cannot be fitted");
            return Err(Error::new(ErrorKind::InvalidSetting, message)
                .at(Place::Setting("light-height".into()))
                .remedy(format!("ask for 8 to {MOST_ROWS} rows, twice as many columns")));
        }
        Ok(Self::of_any_size(width, height))
    }

    /// The same for pictures that are only rendered: any size of at least one texel, since nothing is stored.
    pub fn of_any_size(width: usize, height: usize) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        let texels = 0..width * height;
        let centres =
            texels.map(|texel| sphere::direction_of_texel(texel / width, texel % width, width, height)).collect();
        let solid_angles = (0..height).map(|row| sphere::solid_angle_of_texel(row, width, height) as f32).collect();
        let fine = [2, 4, FINEST].map(|split| FineAngles::new(split, width, height)).to_vec();
        let texel_angle = PI / height as f64;
        let split_cosines = [1.0, 2.0, 5.0].map(|reach: f64| (reach * texel_angle).min(PI).cos() as f32);
        TexelDirections { width, height, centres, solid_angles, split_cosines, fine }
    }

    /// Number of texels.
    pub fn len(&self) -> usize {
        self.centres.len()
    }

    /// Whether there is none; never so.
    pub fn is_empty(&self) -> bool {
        self.centres.is_empty()
    }

    /// Calls `each` with every part of every texel that lights a pixel, batch by batch, in the order of the texels.
    pub fn for_each_batch(
        &self,
        pixel: &ObjectPixel,
        is_visible: impl Fn(usize) -> bool,
        each: impl FnMut(&PartBatch),
    ) {
        let texel_angle = std::f32::consts::PI / self.height as f32;
        let (normal, to_eye) = (pixel.normal, pixel.to_eye);
        let mut collector = Collector { batch: PartBatch::new(), pixel, each };
        for (texel, &centre) in self.centres.iter().enumerate() {
            let cosine = normal.dot(centre);
            // A texel whose centre lies just below the horizon may reach above it: split, the parts decide.
            if cosine < -0.5 * texel_angle || !is_visible(texel) {
                continue;
            }
            let sum = centre + to_eye;
            let half_cosine = sum.dot(normal) * (sum.length_squared().max(1e-20)).sqrt().recip();
            // theta_half moves half as fast as the light does.
            let split = match half_cosine {
                near if near > self.split_cosines[0] => 2,
                near if near > self.split_cosines[1] => 1,
                near if near > self.split_cosines[2] || cosine < 0.5 * texel_angle => 0,
                _ => {
                    collector.push(texel, cosine * self.solid_angles[texel / self.width], centre);
                    continue;
                }
            };
            self.fine[split].for_each(texel / self.width, texel % self.width, |direction, solid_angle| {
                let cosine = normal.dot(direction);
                if cosine > 0.0 {
                    collector.push(texel, cosine * solid_angle, direction);
                }
            });
        }
        collector.hand_out();
    }
}

impl FineAngles {
    fn new(split: usize, width: usize, height: usize) -> Self {
        let (columns, rows) = (split * width, split * height);
        let row = |row: usize| {
            let (sine, cosine) = (PI * (row as f64 + 0.5) / rows as f64).sin_cos();
            (sine as f32, cosine as f32, sphere::solid_angle_of_texel(row, columns, rows) as f32)
        };
        let column = |column: usize| {
            let (sine, cosine) = (TAU * (column as f64 + 0.5) / columns as f64).sin_cos();
            (sine as f32, cosine as f32)
        };
        FineAngles { split, rows: (0..rows).map(row).collect(), columns: (0..columns).map(column).collect() }
    }

    #[inline]
    fn for_each(&self, row: usize, column: usize, mut each: impl FnMut(Vec3, f32)) {
        for &(sine, cosine, solid_angle) in &self.rows[row * self.split..(row + 1) * self.split] {
            for &(phi_sine, phi_cosine) in &self.columns[column * self.split..(column + 1) * self.split] {
                each(Vec3::new(sine * phi_sine, cosine, -sine * phi_cosine), solid_angle);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_in_the_order_of_texels_and_cover_the_hemisphere() {
        let directions = TexelDirections::new(64, 32).unwrap();
        let normal = Vec3::new(0.36, 0.48, 0.8);
        let pixel =
            ObjectPixel { row: 0, column: 0, normal, to_eye: Vec3::Z, origin: normal, geometric_normal: normal };
        let (mut last, mut sum, mut parts) = (0, 0.0, 0);
        directions.for_each_batch(
            &pixel,
            |_| true,
            |batch| {
                for part in 0..batch.len() {
                    assert!(batch.texel(part) >= last);
                    last = batch.texel(part);
                    sum += f64::from(batch.weight(part));
                    let (half, _, azimuth) = (batch.half[part], batch.difference[part], batch.azimuth[part]);
                    assert!((0.0..=1.58).contains(&half) && (0.0..std::f32::consts::PI).contains(&azimuth));
                }
                parts += batch.len();
            },
        );
        // The integral of the cosine over the hemisphere is pi.
        assert!((sum - PI).abs() < 2e-3, "{sum}");
        assert!(parts > 1024, "{parts}");
    }
}
