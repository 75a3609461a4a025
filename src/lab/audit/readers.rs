//! Which pixels read which parameter, and what is special about it.

use super::bench::PixelRecord;
use crate::material::Material;
use crate::material::texels::PyramidWeights;
use crate::math::sphere::BilinearTap;
use crate::render::{ParameterGradient, Parameters};

/// One number that is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// A number of a base texel: 0 to 2 diffuse RGB, 3 to 5 specular RGB, 6 log width.
    Texel {
        /// Row-major index of the texel.
        index: usize,
        /// Which of its numbers.
        number: usize,
    },
    /// A channel of a texel of the environment.
    Light {
        /// Row-major index of the texel.
        index: usize,
        /// Red, green or blue.
        channel: usize,
    },
}

/// The four kinds of parameters.
pub const KINDS: [&str; 4] = ["diffuse", "specular", "roughness", "light"];
/// The places that are looked at on their own.
pub const PLACES: [&str; 6] =
    ["texture seam", "silhouette", "coarse level", "after a bounce", "light pole", "light wrap"];

impl Parameter {
    /// Index of its kind in [`KINDS`].
    pub fn kind(self) -> usize {
        match self {
            Parameter::Texel { number, .. } => number / 3,
            Parameter::Light { .. } => 3,
        }
    }

    /// Its value.
    pub fn value(self, parameters: &Parameters<f64>) -> f64 {
        match self {
            Parameter::Texel { index, number } => parameters.texels.levels[0].texels[index].to_array()[number],
            Parameter::Light { index, channel } => parameters.light[index][channel],
        }
    }

    /// The derivative by it.
    pub fn derivative(self, gradient: &ParameterGradient<f64>) -> f64 {
        match self {
            Parameter::Texel { index, number } => gradient.texels.levels[0].texels[index].d_material.to_array()[number],
            Parameter::Light { index, channel } => gradient.light[index][channel],
        }
    }

    /// Gives it a value and makes the mip chain follow.
    pub fn set(self, value: f64, parameters: &mut Parameters<f64>, weights: &PyramidWeights) {
        match self {
            Parameter::Texel { index, number } => {
                let texel = &mut parameters.texels.levels[0].texels[index];
                let mut numbers = texel.to_array();
                numbers[number] = value;
                *texel = Material::from_array(numbers);
                parameters.texels.rebuild_above(weights, index);
            }
            Parameter::Light { index, channel } => parameters.light[index][channel] = value,
        }
    }

    /// Name with row and column, such as `diffuse R at (12, 40)`.
    pub fn name(self, map_width: usize, light_width: usize) -> String {
        const CHANNELS: [&str; 3] = [" R", " G", " B"];
        let (index, width, channel) = match self {
            Parameter::Texel { index, number } => {
                (index, map_width, if number < 6 { CHANNELS[number % 3] } else { "" })
            }
            Parameter::Light { index, channel } => (index, light_width, CHANNELS[channel]),
        };
        format!("{}{channel} at ({}, {})", KINDS[self.kind()], index / width, index % width)
    }
}

/// For each texel of each level and of the light, the records that read it.
pub struct Readers {
    texels: Vec<Vec<Vec<u32>>>,
    after_bounce: Vec<Vec<bool>>,
    light: Vec<Vec<u32>>,
    silhouette: Vec<bool>,
    seam: Vec<bool>,
    environment_size: (usize, usize),
}

impl Readers {
    /// Lists the readers of every texel. `seam` marks base texels at the border of a chart.
    pub fn new(records: &[PixelRecord], parameters: &Parameters<f32>, weights: &PyramidWeights) -> Self {
        let levels = || parameters.texels.levels.iter();
        let mut readers = Readers {
            texels: levels().map(|level| vec![Vec::new(); level.texels.len()]).collect(),
            after_bounce: levels().map(|level| vec![false; level.texels.len()]).collect(),
            light: vec![Vec::new(); parameters.light.len()],
            silhouette: records.iter().map(|record| record.escaped > 0.0 && record.escaped < 1.0).collect(),
            seam: seam_texels(weights),
            environment_size: parameters.environment_size,
        };
        for (number, record) in records.iter().enumerate() {
            readers.add(number as u32, record);
        }
        readers
    }

    fn add(&mut self, number: u32, record: &PixelRecord) {
        for path in &record.arena.paths {
            if let Some(tap) = &path.background {
                self.add_light(number, tap);
            }
            for (bounce, vertex) in record.arena.vertices_of(path).iter().enumerate() {
                let tap = &vertex.texture;
                for &index in &tap.index {
                    add_once(&mut self.texels[tap.level as usize][index as usize], number);
                    self.after_bounce[tap.level as usize][index as usize] |= bounce > 0;
                }
                if let Some(connection) = &vertex.connection {
                    self.add_light(number, &connection.light);
                }
                if let Some((tap, _)) = vertex.bounce.as_ref().and_then(|bounce| bounce.escape.as_ref()) {
                    self.add_light(number, tap);
                }
            }
        }
    }

    fn add_light(&mut self, number: u32, tap: &BilinearTap) {
        for &index in &tap.index {
            add_once(&mut self.light[index as usize], number);
        }
    }

    /// The records that read a parameter, on any level that follows it; rising.
    pub fn of(&self, parameter: Parameter, weights: &PyramidWeights) -> Vec<u32> {
        match parameter {
            Parameter::Light { index, .. } => self.light[index].clone(),
            Parameter::Texel { index, .. } => {
                let mut all: Vec<u32> = weights
                    .ancestors(index)
                    .flat_map(|(level, texel)| self.texels[level][texel].iter().copied())
                    .collect();
                all.sort_unstable();
                all.dedup();
                all
            }
        }
    }

    /// For each of [`PLACES`], whether a parameter with these readers belongs to it.
    pub fn places(&self, parameter: Parameter, readers: &[u32], weights: &PyramidWeights) -> [bool; 6] {
        match parameter {
            Parameter::Texel { index, .. } => {
                let own = |level: usize, texel: usize| !self.texels[level][texel].is_empty();
                [
                    self.seam[index],
                    readers.iter().any(|&record| self.silhouette[record as usize]),
                    weights.ancestors(index).skip(1).any(|(level, texel)| own(level, texel)),
                    weights.ancestors(index).any(|(level, texel)| self.after_bounce[level][texel]),
                    false,
                    false,
                ]
            }
            Parameter::Light { index, .. } => {
                let (width, height) = self.environment_size;
                let (row, column) = (index / width, index % width);
                [false, false, false, false, row == 0 || row + 1 == height, column == 0 || column + 1 == width]
            }
        }
    }

    /// Taps into each level, counted in (texel, pixel) pairs.
    pub fn reads_per_level(&self) -> Vec<usize> {
        self.texels.iter().map(|level| level.iter().map(Vec::len).sum()).collect()
    }
}

fn add_once(list: &mut Vec<u32>, number: u32) {
    if list.last() != Some(&number) {
        list.push(number);
    }
}

/// Covered base texels with an uncovered one among their eight neighbours, or at the border of the map.
fn seam_texels(weights: &PyramidWeights) -> Vec<bool> {
    let (width, height) = weights.size(0);
    let covered = |row: i64, column: i64| {
        (0..height as i64).contains(&row)
            && (0..width as i64).contains(&column)
            && weights.is_covered(row as usize * width + column as usize)
    };
    (0..width * height)
        .map(|index| {
            let (row, column) = ((index / width) as i64, (index % width) as i64);
            covered(row, column) && (-1..=1).any(|down| (-1..=1).any(|across| !covered(row + down, column + across)))
        })
        .collect()
}
