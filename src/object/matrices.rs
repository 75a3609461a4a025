//! The transport with one of its two factors put in: a matrix on the light, or a sparse matrix on the nodes.
//!
//! While one of light and reflectance is held, a step on the other asks for hundreds of products. These matrices make
//! each of them a walk through memory in order.

use super::nodes::{NodeReader, NodeTable};
use super::transport::Transport;
use crate::math::{parallel, sum_of_products};
use glam::{Vec3, Vec3A};

/// Pixels a task; sums over chunks are taken in their order.
const CHUNK: usize = 32;

/// The image of some pixels as a matrix on the light, for a reflectance that is held.
#[derive(Clone, Debug)]
pub struct LightMatrix {
    texels: usize,
    pixels: usize,
    chunks: Vec<LightChunk>,
}

#[derive(Clone, Debug, Default)]
struct LightChunk {
    /// Index into `runs` at which each pixel begins, and the end.
    starts: Vec<u32>,
    /// First texel, number of texels.
    runs: Vec<(u16, u16)>,
    /// Per run: its texels' red, then green, then blue values.
    values: Vec<f32>,
}

impl LightMatrix {
    /// Puts a reflectance into the transport.
    pub fn new(transport: &Transport, table: &NodeTable) -> Self {
        let table = NodeReader::new(table);
        let rows = transport.per_pixel(|entries| {
            let mut texels: Vec<(u16, Vec3)> = Vec::with_capacity(entries.len());
            for entry in entries {
                let value = transport.reflectance(&table, entry) * entry.weight;
                // The parts of a texel follow each other.
                match texels.last_mut() {
                    Some((texel, sum)) if *texel == entry.texel => *sum += value,
                    _ => texels.push((entry.texel, value)),
                }
            }
            texels
        });
        let chunks = parallel::map_chunks(&rows, CHUNK, |_, rows| LightChunk::of_rows(rows));
        LightMatrix { texels: transport.directions().len(), pixels: rows.len(), chunks }
    }

    /// Number of texels.
    pub fn texels(&self) -> usize {
        self.texels
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// One channel as a dense matrix, a row a pixel: for small ones.
    pub fn dense(&self, channel: usize) -> Vec<f32> {
        let mut rows = vec![0.0; self.pixels * self.texels];
        for (chunk, rows) in self.chunks.iter().zip(rows.chunks_mut(CHUNK * self.texels)) {
            let mut at = 0;
            for (bounds, row) in chunk.starts.windows(2).zip(rows.chunks_mut(self.texels)) {
                for &(first, length) in &chunk.runs[bounds[0] as usize..bounds[1] as usize] {
                    let (first, length) = (usize::from(first), usize::from(length));
                    let values = &chunk.values[at + channel * length..at + (channel + 1) * length];
                    row[first..first + length].copy_from_slice(values);
                    at += 3 * length;
                }
            }
        }
        rows
    }

    /// The pixels of a light given channel by channel.
    pub fn forward(&self, light: &[Vec<f32>; 3]) -> Vec<[f32; 3]> {
        parallel::map_items(&self.chunks, |chunk| chunk.forward(light)).concat()
    }

    /// The transpose of [`LightMatrix::forward`], channel by channel.
    pub fn adjoint(&self, by_pixels: &[[f32; 3]]) -> [Vec<f32>; 3] {
        self.transposed(by_pixels, false)
    }

    /// Sums of squared matrix entries times a weight a pixel: the diagonal of the weighted normal matrix.
    pub fn squared_adjoint(&self, weights: &[[f32; 3]]) -> [Vec<f32>; 3] {
        self.transposed(weights, true)
    }

    fn transposed(&self, by_pixels: &[[f32; 3]], squared: bool) -> [Vec<f32>; 3] {
        const GROUP: usize = 4;
        let parts: Vec<[Vec<f32>; 3]> = parallel::map_chunks(&self.chunks, GROUP, |group, chunks| {
            let mut sums = [0; 3].map(|_| vec![0.0f32; self.texels]);
            for (chunk, by_pixels) in chunks.iter().zip(by_pixels.chunks(CHUNK).skip(group * GROUP)) {
                chunk.add_transposed(by_pixels, squared, &mut sums);
            }
            sums
        });
        let mut sums = [0; 3].map(|_| vec![0.0f64; self.texels]);
        for part in parts {
            for (sums, part) in sums.iter_mut().zip(part) {
                sums.iter_mut().zip(part).for_each(|(sum, value)| *sum += f64::from(value));
            }
        }
        sums.map(|channel| channel.into_iter().map(|sum| sum as f32).collect())
    }
}

impl LightChunk {
    fn of_rows(rows: &[Vec<(u16, Vec3)>]) -> Self {
        let mut chunk = LightChunk { starts: vec![0], ..Default::default() };
        for row in rows {
            let mut begin = 0;
            while begin < row.len() {
                let mut end = begin + 1;
                while end < row.len()
                    && usize::from(row[end].0) == usize::from(row[end - 1].0) + 1
                    && end - begin < 60_000
                {
                    end += 1;
                }
                chunk.runs.push((row[begin].0, (end - begin) as u16));
                for channel in 0..3 {
                    chunk.values.extend(row[begin..end].iter().map(|(_, value)| value[channel]));
                }
                begin = end;
            }
            chunk.starts.push(chunk.runs.len() as u32);
        }
        chunk
    }

    fn forward(&self, light: &[Vec<f32>; 3]) -> Vec<[f32; 3]> {
        let mut at = 0;
        let mut pixels = Vec::with_capacity(self.starts.len() - 1);
        for bounds in self.starts.windows(2) {
            let mut sums = [0.0f64; 3];
            for &(first, length) in &self.runs[bounds[0] as usize..bounds[1] as usize] {
                let (first, length) = (usize::from(first), usize::from(length));
                for channel in 0..3 {
                    let values = &self.values[at..at + length];
                    sums[channel] += f64::from(sum_of_products::<8>(values, &light[channel][first..first + length]));
                    at += length;
                }
            }
            pixels.push(sums.map(|sum| sum as f32));
        }
        pixels
    }

    fn add_transposed(&self, by_pixels: &[[f32; 3]], squared: bool, sums: &mut [Vec<f32>; 3]) {
        let mut at = 0;
        for (bounds, by_pixel) in self.starts.windows(2).zip(by_pixels) {
            for &(first, length) in &self.runs[bounds[0] as usize..bounds[1] as usize] {
                let (first, length) = (usize::from(first), usize::from(length));
                for channel in 0..3 {
                    let values = &self.values[at..at + length];
                    let sums = &mut sums[channel][first..first + length];
                    let factor = by_pixel[channel];
                    match squared {
                        false => sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value * factor),
                        true => sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value * value * factor),
                    }
                    at += length;
                }
            }
        }
    }
}

/// The image of some pixels as a sparse matrix on the values at nodes, for a light that is held.
#[derive(Clone, Debug)]
pub struct NodeMatrix {
    nodes: usize,
    chunks: Vec<NodeChunk>,
}

#[derive(Clone, Debug)]
struct NodeChunk {
    starts: Vec<u32>,
    columns: Vec<u16>,
    values: Vec<[f32; 3]>,
}

impl NodeMatrix {
    /// Puts a light into the transport, one RGB radiance a texel.
    pub fn new(transport: &Transport, light: &[Vec3]) -> Self {
        let grid = transport.grid();
        let rows = transport.per_pixel(|entries| {
            let mut sums = vec![Vec3A::ZERO; grid.len()];
            for entry in entries {
                let value = Vec3A::from(light[usize::from(entry.texel)]) * entry.weight;
                for (corner, weight) in grid.corners(entry.cell).into_iter().zip(entry.corner_weights()) {
                    sums[corner] += value * weight;
                }
            }
            let touched = sums.into_iter().enumerate().filter(|(_, value)| *value != Vec3A::ZERO);
            touched.map(|(node, value)| (node as u16, value.to_array())).collect::<Vec<_>>()
        });
        let chunks = parallel::map_chunks(&rows, CHUNK, |_, rows| {
            let mut starts = vec![0u32];
            for row in rows {
                starts.push(starts[starts.len() - 1] + row.len() as u32);
            }
            let columns = rows.iter().flatten().map(|(node, _)| *node).collect();
            let values = rows.iter().flatten().map(|(_, value)| *value).collect();
            NodeChunk { starts, columns, values }
        });
        NodeMatrix { nodes: grid.len(), chunks }
    }

    /// The pixels of a reflectance.
    pub fn forward(&self, table: &NodeTable) -> Vec<[f32; 3]> {
        let parts: Vec<Vec<[f32; 3]>> = parallel::map_items(&self.chunks, |chunk| {
            let pixel = |bounds: &[u32]| {
                let range = bounds[0] as usize..bounds[1] as usize;
                let mut sums = [0.0f64; 3];
                for (column, value) in chunk.columns[range.clone()].iter().zip(&chunk.values[range]) {
                    let node = table.values[usize::from(*column)];
                    for channel in 0..3 {
                        sums[channel] += f64::from(value[channel] * node[channel]);
                    }
                }
                sums.map(|sum| sum as f32)
            };
            chunk.starts.windows(2).map(pixel).collect()
        });
        parts.concat()
    }

    /// The transpose of [`NodeMatrix::forward`]: derivatives by the values at nodes.
    pub fn adjoint(&self, by_pixels: &[[f32; 3]]) -> Vec<[f64; 3]> {
        const GROUP: usize = 8;
        let parts: Vec<Vec<[f32; 3]>> = parallel::map_chunks(&self.chunks, GROUP, |group, chunks| {
            let mut sums = vec![[0.0f32; 3]; self.nodes];
            for (chunk, by_pixels) in chunks.iter().zip(by_pixels.chunks(CHUNK).skip(group * GROUP)) {
                for (bounds, by_pixel) in chunk.starts.windows(2).zip(by_pixels) {
                    let range = bounds[0] as usize..bounds[1] as usize;
                    for (column, value) in chunk.columns[range.clone()].iter().zip(&chunk.values[range]) {
                        let sum = &mut sums[usize::from(*column)];
                        for channel in 0..3 {
                            sum[channel] += value[channel] * by_pixel[channel];
                        }
                    }
                }
            }
            sums
        });
        let mut sums = vec![[0.0f64; 3]; self.nodes];
        for part in parts {
            for (sum, value) in sums.iter_mut().zip(part) {
                for channel in 0..3 {
                    sum[channel] += f64::from(value[channel]);
                }
            }
        }
        sums
    }
}
