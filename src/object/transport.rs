//! The image as a linear function of the light, and of the reflectance at nodes.
//!
//! `pixel = sum over texels of f(half, difference) cos dOmega L V`. Each texel is constant over its exact solid angle;
//! [`directions`](super::directions) splits those near the mirror direction. Everything that depends on geometry alone is
//! found once, in [`Transport::new`].

pub use super::directions::TexelDirections;
use super::geometry::{ObjectPixel, Visibility};
use super::nodes::{NodeGrid, NodeReader, NodeTable, weights};
use crate::math::parallel;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Pixels a task; sums over chunks are taken in their order.
const CHUNK: usize = 32;

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
        let chunks = parallel::map_chunks(pixels, CHUNK, |index, chunk| {
            let mut starts = vec![0u32];
            let mut entries = Vec::new();
            for (offset, pixel) in chunk.iter().enumerate() {
                let own = index * CHUNK + offset;
                let is_visible = |texel: usize| visibility.is_none_or(|bits| bits.is_visible(own, texel));
                directions.for_each_batch(pixel, is_visible, |batch| {
                    let places = grid.places(batch);
                    entries.extend((0..batch.len()).map(|part| {
                        let place = places.of(part);
                        let fraction = place.fraction.map(|part| (part * 65535.0 + 0.5) as u16);
                        Entry {
                            texel: batch.texel(part) as u16,
                            cell: place.cell,
                            fraction,
                            weight: batch.weight(part),
                        }
                    }));
                });
                starts.push(entries.len() as u32);
            }
            entries.shrink_to_fit();
            TransportChunk { starts, entries }
        });
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
        let table = NodeReader::new(table);
        self.per_pixel(|entries| {
            let mut sum = DVec3::ZERO;
            for entry in entries {
                let value = self.reflectance(&table, entry) * light[usize::from(entry.texel)];
                sum += (value * entry.weight).as_dvec3();
            }
            sum.as_vec3()
        })
    }

    /// The transpose of [`Transport::forward`] in the light: from derivatives by the pixels to those by the texels.
    pub fn adjoint_by_light(&self, table: &NodeTable, by_pixels: &[Vec3]) -> Vec<DVec3> {
        let table = NodeReader::new(table);
        self.scattered(self.directions.len(), by_pixels, |entry, by_pixel, sums: &mut [DVec3]| {
            let value = self.reflectance(&table, entry) * entry.weight * by_pixel;
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
        let parts: Vec<Vec<T>> = parallel::map_items(&self.chunks, |chunk| {
            (0..chunk.len()).map(|pixel| work(chunk.of_pixel(pixel))).collect()
        });
        parts.into_iter().flatten().collect()
    }

    #[inline]
    pub(super) fn reflectance(&self, table: &NodeReader, entry: &Entry) -> Vec3 {
        table.between(self.grid.corners(entry.cell), entry.corner_weights())
    }

    fn scattered(
        &self,
        length: usize,
        by_pixels: &[Vec3],
        add: impl Fn(&Entry, Vec3, &mut [DVec3]) + Sync,
    ) -> Vec<DVec3> {
        // A group of chunks shares one table of sums: fewer tables, still a fixed order.
        const GROUP: usize = 8;
        let parts: Vec<Vec<DVec3>> = parallel::map_chunks(&self.chunks, GROUP, |group, chunks| {
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
        });
        let mut sums = vec![DVec3::ZERO; length];
        for part in parts {
            sums.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        sums
    }
}
