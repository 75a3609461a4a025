//! How sure the split of a photo into light and reflectance is.
//!
//! Reflectance times a factor and light over it give the same picture, channel by channel: those three numbers no photo
//! tells ([`Gauge`]). Beyond them, starts that explain the photo about as well with other reflectances show what else
//! the photo leaves open ([`SplitSpread`]).

use super::nodes::{NodeGrid, NodeTable};
use super::prior::{LogLight, shares};
use super::screen::Candidate;

/// Starts whose evidence is within so many nats of the best are listed as good. How far off a result may be is another
/// question: pixels are not as independent as evidence counts them, and wrong starts were hundreds of nats ahead.
const AS_GOOD: f64 = 12.0;

/// The level of a light, per channel, and the range that physics leaves for it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Gauge {
    /// Geometric mean of the radiance over the sphere.
    pub light_mean: [f64; 3],
    /// Largest reflectance over the hemisphere (directional albedo) of those tried: above 1 the split breaks energy.
    pub largest_albedo: [f64; 3],
    /// Reflectance may be multiplied by up to this, and the light divided by it, before energy is made.
    pub largest_factor: [f64; 3],
}

impl Gauge {
    /// The gauge of a light and a reflectance at nodes.
    pub fn of(light: &LogLight, grid: &NodeGrid, table: &NodeTable) -> Self {
        let mut largest_albedo = [0.0f64; 3];
        for degrees in [5.0f32, 30.0, 50.0, 65.0] {
            let albedo = albedo(grid, table, degrees.to_radians());
            (0..3).for_each(|channel| largest_albedo[channel] = largest_albedo[channel].max(albedo[channel]));
        }
        Gauge {
            light_mean: light.mean().map(f64::exp),
            largest_albedo,
            largest_factor: largest_albedo.map(|albedo| 1.0 / albedo.max(1e-12)),
        }
    }
}

/// Share of light from one direction that leaves again, by a fine sum over the hemisphere.
pub fn albedo(grid: &NodeGrid, table: &NodeTable, theta: f32) -> [f64; 3] {
    use super::angles::angles;
    use super::nodes::weights;
    use glam::Vec3;
    let eye = Vec3::new(theta.sin(), 0.0, theta.cos());
    let (rows, columns) = (128, 256);
    let mut sums = [0.0f64; 3];
    for row in 0..rows {
        // Equal steps of the squared sine are equal shares of the cosine-weighted hemisphere.
        let sine = ((row as f32 + 0.5) / rows as f32).sqrt();
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        for column in 0..columns {
            let (phi_sine, phi_cosine) = (std::f32::consts::TAU * (column as f32 + 0.5) / columns as f32).sin_cos();
            let light = Vec3::new(sine * phi_cosine, sine * phi_sine, cosine);
            let (half, difference, azimuth) = angles(Vec3::Z, light, eye);
            let place = grid.place(half, difference, azimuth);
            for (corner, weight) in grid.corners(place.cell).into_iter().zip(weights(place.fraction)) {
                for channel in 0..3 {
                    sums[channel] += f64::from(table.values[corner][channel] * weight);
                }
            }
        }
    }
    sums.map(|sum| sum * std::f64::consts::PI / (rows * columns) as f64)
}

/// How far apart the starts end that were followed: a measure of what the photo leaves open.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SplitSpread {
    /// Names of those that explain the photo about as well, the best first.
    pub starts: Vec<String>,
    /// Root mean square over the sphere of the spread of the logarithm of light, its level per channel taken out;
    /// natural units. `None` where it is not known: fewer than two starts were followed, or the light is given.
    pub light: Option<f64>,
    /// The same of the reflectance at the nodes.
    pub reflectance: Option<f64>,
}

impl SplitSpread {
    /// The spread of the starts that were followed, all of them: one that is ahead of the others does not make the split
    /// sure. The model has no start for most materials, and the best of a library is off as the next ones are.
    pub fn of(candidates: &[Candidate]) -> Self {
        let Some(best) = candidates.first() else { return SplitSpread::default() };
        let good = candidates.iter().filter(|candidate| candidate.evidence <= best.evidence + AS_GOOD);
        let starts = good.map(|candidate| candidate.name.clone()).collect();
        let lights: Vec<&LogLight> = candidates.iter().filter_map(|candidate| candidate.lights.first()).collect();
        let light = lights.first().and_then(|first| {
            let weights = shares(first.width, first.height);
            let log = |light: &&LogLight| light.channels.iter().flatten().map(|&log| f64::from(log)).collect();
            let maps: Vec<Vec<f64>> = lights.iter().map(log).collect();
            spread(&maps, |index| f64::from(weights[index % weights.len()]), weights.len())
        });
        let tables: Vec<Vec<f64>> = candidates
            .iter()
            .map(|candidate| {
                let channel =
                    |c: usize| candidate.table.values.iter().map(move |value| f64::from(value[c] + 1e-5).ln());
                (0..3).flat_map(channel).collect()
            })
            .collect();
        let nodes = best.table.values.len();
        SplitSpread { starts, light, reflectance: spread(&tables, |_| 1.0, nodes) }
    }
}

/// Root of the weighted mean variance between maps whose mean per channel was taken out; `None` of fewer than two.
fn spread(maps: &[Vec<f64>], weight: impl Fn(usize) -> f64, channel: usize) -> Option<f64> {
    if maps.len() < 2 || channel == 0 {
        return None;
    }
    let total: f64 = (0..channel).map(&weight).sum();
    let centred: Vec<Vec<f64>> = maps
        .iter()
        .map(|map| {
            let part = |part: &[f64]| {
                let mean = part.iter().enumerate().map(|(index, value)| weight(index) * value).sum::<f64>() / total;
                part.iter().map(|value| value - mean).collect::<Vec<f64>>()
            };
            map.chunks(channel).flat_map(part).collect()
        })
        .collect();
    let count = centred.len() as f64;
    let length = centred[0].len();
    let variance: f64 = (0..length)
        .map(|index| {
            let mean = centred.iter().map(|map| map[index]).sum::<f64>() / count;
            let squares = centred.iter().map(|map| (map[index] - mean).powi(2)).sum::<f64>();
            weight(index % channel) * squares / (count - 1.0)
        })
        .sum::<f64>()
        / (total * (length / channel) as f64);
    Some(variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lambertian_table_has_its_own_albedo() {
        let grid = NodeGrid::coarse();
        let table = NodeTable::constant(&grid, [0.5, 0.25, 0.1].map(|albedo| albedo / std::f32::consts::PI));
        let light = LogLight::constant(32, 16, [2.0f32.ln(); 3]);
        let gauge = Gauge::of(&light, &grid, &table);
        assert!((gauge.largest_albedo[0] - 0.5).abs() < 1e-4 && (gauge.largest_factor[1] - 4.0).abs() < 1e-3);
        assert!((gauge.light_mean[2] - 2.0).abs() < 1e-5);
    }

    #[test]
    fn a_common_factor_is_no_spread_and_another_shape_is() {
        let candidate = |name: &str, factor: f32, bend: f32| Candidate {
            name: name.into(),
            parameters: Vec::new(),
            lights: vec![LogLight {
                width: 32,
                height: 16,
                channels: [0; 3].map(|_| (0..512).map(|i| factor.ln() + bend * (i % 2) as f32).collect()),
            }],
            table: NodeTable { values: vec![[0.1 / factor; 3]; 8], not_finite: 0 },
            objective: [0.1, 0.0, 0.0],
            evidence: 7.0,
            not_finite: 0,
        };
        let same = SplitSpread::of(&[candidate("a", 1.0, 0.0), candidate("b", 2.0, 0.0)]);
        assert!(same.light.unwrap() < 1e-5 && same.reflectance.unwrap() < 1e-3 && same.starts.len() == 2);
        let other = SplitSpread::of(&[candidate("a", 1.0, 0.0), candidate("b", 1.0, 1.0)]);
        let light = other.light.unwrap();
        assert!((light - 0.5f64.sqrt() * 0.5).abs() < 0.01, "{light}");
        // One start alone says nothing of the spread, and a file says so.
        let alone = SplitSpread::of(&[candidate("a", 1.0, 0.0)]);
        assert_eq!((alone.starts.len(), alone.light, alone.reflectance), (1, None, None));
        let written = serde_json::to_string(&alone).unwrap();
        assert!(written.contains("\"light\":null"), "{written}");
        assert_eq!(serde_json::from_str::<SplitSpread>(&written).unwrap(), alone);
    }
}
