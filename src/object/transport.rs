//! The image as a linear function of the light, and of the reflectance at nodes.
//!
//! `pixel = sum over texels of f(half, difference) cos dOmega L V`. Each texel is constant over its exact solid angle;
//! near the mirror direction it is split into up to 8 x 8 parts, so that narrow lobes are integrated and not hit or
//! missed. Everything that depends on geometry alone is found once, in [`Transport::new`].

use super::geometry::{ObjectPixel, Visibility};
use super::nodes::{NodeGrid, NodeTable, angles, weights};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::math::sphere;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Pixels a task; sums over chunks are taken in their order.
const CHUNK: usize = 32;
/// Parts a side into which a texel is split at most.
const FINEST: usize = 8;

/// One part of a texel as seen from one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Index of the texel, row-major.
    pub texel: u16,
    /// First node of the cell, see [`NodeGrid::corners`].
    pub cell: u16,
    /// Fractions within the cell, in 1/65535.
    fraction: [u16; 3],
    /// Cosine times solid angle, in sr.
    pub weight: f32,
}

impl Entry {
    /// The weights of the cell's corners, without [`Entry::weight`].
    #[inline]
    pub fn corner_weights(&self) -> [f32; 8] {
        weights(self.fraction.map(|part| f32::from(part) * (1.0 / 65535.0)))
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
                .at(Place::Setting("light-size".into()))
                .remedy("ask for 16 to 128 rows, twice as many columns"));
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
        TexelDirections { width, height, centres, solid_angles, fine }
    }

    /// Number of texels.
    pub fn len(&self) -> usize {
        self.centres.len()
    }

    /// Whether there is none; never so.
    pub fn is_empty(&self) -> bool {
        self.centres.is_empty()
    }

    /// Calls `each` with every part of every texel that lights a pixel: (texel, cosine times solid angle, angles).
    pub fn for_each_part(
        &self,
        pixel: &ObjectPixel,
        is_visible: impl Fn(usize) -> bool,
        mut each: impl FnMut(usize, f32, (f32, f32, f32)),
    ) {
        let texel_angle = std::f32::consts::PI / self.height as f32;
        let (normal, to_eye) = (pixel.normal, pixel.to_eye);
        for (texel, &centre) in self.centres.iter().enumerate() {
            let cosine = normal.dot(centre);
            // A texel whose centre lies just below the horizon may reach above it: split, the parts decide.
            if cosine < -0.5 * texel_angle || !is_visible(texel) {
                continue;
            }
            let sum = centre + to_eye;
            let half_cosine = sum.dot(normal) * (sum.length_squared().max(1e-20)).sqrt().recip();
            // theta_half moves half as fast as the light does.
            let theta_half = half_cosine.clamp(-1.0, 1.0).acos();
            let split = match theta_half / texel_angle {
                reach if reach < 1.0 => 2,
                reach if reach < 2.0 => 1,
                reach if reach < 5.0 || cosine < 0.5 * texel_angle => 0,
                _ => {
                    let row = texel / self.width;
                    each(texel, cosine * self.solid_angles[row], angles(normal, centre, to_eye));
                    continue;
                }
            };
            self.fine[split].for_each(texel / self.width, texel % self.width, |direction, solid_angle| {
                let cosine = normal.dot(direction);
                if cosine > 0.0 {
                    each(texel, cosine * solid_angle, angles(normal, direction, to_eye));
                }
            });
        }
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

/// The linear image model of some pixels under an environment.
#[derive(Clone, Debug)]
pub struct Transport {
    grid: Arc<NodeGrid>,
    directions: Arc<TexelDirections>,
    pixels: usize,
    chunks: Vec<TransportChunk>,
}

#[derive(Clone, Debug)]
struct TransportChunk {
    /// Where the entries of each pixel begin, and the end.
    starts: Vec<u32>,
    entries: Vec<Entry>,
}

impl TransportChunk {
    fn of_pixel(&self, pixel: usize) -> &[Entry] {
        &self.entries[self.starts[pixel] as usize..self.starts[pixel + 1] as usize]
    }

    fn len(&self) -> usize {
        self.starts.len() - 1
    }
}

impl Transport {
    /// Finds the nodes and weights of every pixel and texel. `visibility` names pixels by their index in `pixels`;
    /// without one nothing is shadowed.
    pub fn new(
        grid: Arc<NodeGrid>,
        directions: Arc<TexelDirections>,
        pixels: &[ObjectPixel],
        visibility: Option<&Visibility>,
    ) -> Self {
        let chunks = pixels
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(index, chunk)| {
                let mut starts = vec![0u32];
                let mut entries = Vec::new();
                for (offset, pixel) in chunk.iter().enumerate() {
                    let own = index * CHUNK + offset;
                    let is_visible = |texel: usize| visibility.is_none_or(|bits| bits.is_visible(own, texel));
                    directions.for_each_part(pixel, is_visible, |texel, weight, (half, difference, azimuth)| {
                        let place = grid.place(half, difference, azimuth);
                        let fraction = place.fraction.map(|part| (part * 65535.0 + 0.5) as u16);
                        entries.push(Entry { texel: texel as u16, cell: place.cell, fraction, weight });
                    });
                    starts.push(entries.len() as u32);
                }
                entries.shrink_to_fit();
                TransportChunk { starts, entries }
            })
            .collect();
        Transport { grid, directions, pixels: pixels.len(), chunks }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// The nodes.
    pub fn grid(&self) -> &Arc<NodeGrid> {
        &self.grid
    }

    /// The texels.
    pub fn directions(&self) -> &Arc<TexelDirections> {
        &self.directions
    }

    /// Parts of texels over all pixels.
    pub fn entries(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.entries.len()).sum()
    }

    /// The pixels under a light, one RGB radiance a texel.
    pub fn forward(&self, table: &NodeTable, light: &[Vec3]) -> Vec<Vec3> {
        self.per_pixel(|entries| {
            let mut sum = DVec3::ZERO;
            for entry in entries {
                let value = self.reflectance(table, entry) * light[usize::from(entry.texel)];
                sum += (value * entry.weight).as_dvec3();
            }
            sum.as_vec3()
        })
    }

    /// The transpose of [`Transport::forward`] in the light: from derivatives by the pixels to those by the texels.
    pub fn adjoint_by_light(&self, table: &NodeTable, by_pixels: &[Vec3]) -> Vec<DVec3> {
        self.scattered(self.directions.len(), by_pixels, |entry, by_pixel, sums: &mut [DVec3]| {
            let value = self.reflectance(table, entry) * entry.weight * by_pixel;
            sums[usize::from(entry.texel)] += value.as_dvec3();
        })
    }

    /// The transpose in the reflectance: from derivatives by the pixels to those by the values at the nodes.
    pub fn adjoint_by_nodes(&self, light: &[Vec3], by_pixels: &[Vec3]) -> Vec<[f64; 3]> {
        self.scattered(self.grid.len(), by_pixels, |entry, by_pixel, sums: &mut [DVec3]| {
            let value = light[usize::from(entry.texel)] * entry.weight * by_pixel;
            for (corner, weight) in self.grid.corners(entry.cell).into_iter().zip(entry.corner_weights()) {
                sums[corner] += (value * weight).as_dvec3();
            }
        })
        .into_iter()
        .map(|sum| sum.to_array())
        .collect()
    }

    /// Calls `work` for each pixel's entries, in parallel; results in the order of the pixels.
    pub(super) fn per_pixel<T: Send>(&self, work: impl Fn(&[Entry]) -> T + Sync) -> Vec<T> {
        let parts: Vec<Vec<T>> = self
            .chunks
            .par_iter()
            .map(|chunk| (0..chunk.len()).map(|pixel| work(chunk.of_pixel(pixel))).collect())
            .collect();
        parts.into_iter().flatten().collect()
    }

    #[inline]
    pub(super) fn reflectance(&self, table: &NodeTable, entry: &Entry) -> Vec3 {
        let mut value = Vec3::ZERO;
        for (corner, weight) in self.grid.corners(entry.cell).into_iter().zip(entry.corner_weights()) {
            value += Vec3::from_array(table.values[corner]) * weight;
        }
        value
    }

    fn scattered(
        &self,
        length: usize,
        by_pixels: &[Vec3],
        add: impl Fn(&Entry, Vec3, &mut [DVec3]) + Sync,
    ) -> Vec<DVec3> {
        // A group of chunks shares one table of sums: fewer tables, still a fixed order.
        const GROUP: usize = 8;
        let parts: Vec<Vec<DVec3>> = self
            .chunks
            .par_chunks(GROUP)
            .enumerate()
            .map(|(group, chunks)| {
                let mut sums = vec![DVec3::ZERO; length];
                for (index, chunk) in chunks.iter().enumerate() {
                    let first = (group * GROUP + index) * CHUNK;
                    for pixel in 0..chunk.len() {
                        let by_pixel = by_pixels[first + pixel];
                        if by_pixel != Vec3::ZERO {
                            chunk.of_pixel(pixel).iter().for_each(|entry| add(entry, by_pixel, &mut sums));
                        }
                    }
                }
                sums
            })
            .collect();
        let mut sums = vec![DVec3::ZERO; length];
        for part in parts {
            sums.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        sums
    }
}
