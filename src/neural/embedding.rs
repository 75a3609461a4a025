//! The codes on a map of two dimensions, and whether neighbours are of a kind.

use super::weights::Trained;
use crate::measured::Category;

/// One material and channel on the map.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct MapPoint {
    /// Name of the material.
    pub material: String,
    /// 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// Kind of the material.
    pub category: Category,
    /// First principal component.
    pub x: f64,
    /// Second principal component.
    pub y: f64,
    /// Share of its nearest neighbours, other materials, that are of its kind.
    pub purity: f64,
}

/// The map of all codes.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedding {
    /// A point for each code.
    pub points: Vec<MapPoint>,
    /// Share of the variance along each of the two directions.
    pub explained: [f64; 2],
    /// Mean of the points' purity.
    pub purity: f64,
    /// What the purity would be were the codes dealt at random.
    pub chance: f64,
}

/// Rows of numbers on their two main directions (Pearson 1901), by power iteration; signs are such that the largest
/// coordinate of a direction is positive.
fn principal(rows: &[Vec<f64>]) -> (Vec<[f64; 2]>, [f64; 2]) {
    let width = rows.first().map_or(0, Vec::len);
    let count = rows.len().max(1) as f64;
    let mean: Vec<f64> = (0..width).map(|i| rows.iter().map(|row| row[i]).sum::<f64>() / count).collect();
    let mut covariance = vec![0.0; width * width];
    for row in rows {
        for i in 0..width {
            for j in 0..width {
                covariance[i * width + j] += (row[i] - mean[i]) * (row[j] - mean[j]) / count;
            }
        }
    }
    let trace: f64 = (0..width).map(|i| covariance[i * width + i]).sum();
    let mut directions = Vec::new();
    let mut explained = [0.0; 2];
    for share in &mut explained {
        let mut direction: Vec<f64> = (0..width).map(|i| 1.0 + 0.1 * i as f64).collect();
        let mut length = 0.0;
        for _ in 0..2000 {
            let next: Vec<f64> =
                (0..width).map(|i| (0..width).map(|j| covariance[i * width + j] * direction[j]).sum()).collect();
            length = next.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length <= 1e-300 {
                break;
            }
            direction = next.iter().map(|x| x / length).collect();
        }
        *share = if trace > 0.0 { length / trace } else { 0.0 };
        let largest = direction.iter().copied().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        direction.iter_mut().for_each(|x| *x *= if largest < 0.0 { -1.0 } else { 1.0 });
        for i in 0..width {
            for j in 0..width {
                covariance[i * width + j] -= length * direction[i] * direction[j];
            }
        }
        directions.push(direction);
    }
    let along = |row: &Vec<f64>, direction: &Vec<f64>| -> f64 {
        row.iter().zip(&mean).zip(direction).map(|((x, mean), d)| (x - mean) * d).sum()
    };
    (rows.iter().map(|row| [along(row, &directions[0]), along(row, &directions[1])]).collect(), explained)
}

impl Embedding {
    /// The map of a trained flow's codes; purity is that of the `neighbours` nearest codes of other materials in all
    /// dimensions, not on the map.
    pub fn of(trained: &Trained, neighbours: usize) -> Self {
        let length = trained.account.architecture.code.max(1);
        let rows: Vec<Vec<f64>> =
            trained.codes.chunks_exact(length).map(|code| code.iter().map(|&x| f64::from(x)).collect()).collect();
        let (places, explained) = principal(&rows);
        let kinds: Vec<Category> = trained.account.materials.iter().map(|name| Category::of(name)).collect();
        let mut points = Vec::new();
        for (index, row) in rows.iter().enumerate() {
            let mut others: Vec<(f64, Category)> = rows
                .iter()
                .enumerate()
                .filter(|(other, _)| other / 3 != index / 3)
                .map(|(other, code)| (row.iter().zip(code).map(|(a, b)| (a - b).powi(2)).sum(), kinds[other / 3]))
                .collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0));
            let near = &others[..neighbours.clamp(1, others.len().max(1)).min(others.len())];
            let alike = near.iter().filter(|(_, kind)| *kind == kinds[index / 3]).count();
            points.push(MapPoint {
                material: trained.account.materials[index / 3].clone(),
                channel: index % 3,
                category: kinds[index / 3],
                x: places[index][0],
                y: places[index][1],
                purity: alike as f64 / near.len().max(1) as f64,
            });
        }
        let count = kinds.len().max(2) as f64;
        let chance = kinds
            .iter()
            .map(|kind| (kinds.iter().filter(|other| *other == kind).count() as f64 - 1.0) / (count - 1.0) / count)
            .sum();
        let purity = points.iter().map(|point| point.purity).sum::<f64>() / points.len().max(1) as f64;
        Embedding { points, explained, purity, chance }
    }

    /// The map as a table.
    pub fn csv(&self) -> String {
        let mut text = String::from("material,channel,category,x,y,purity\n");
        for point in &self.points {
            let channel = ["red", "green", "blue"][point.channel % 3];
            text.push_str(&format!(
                "{},{channel},{},{:.6},{:.6},{:.3}\n",
                point.material,
                point.category.label(),
                point.x,
                point.y,
                point.purity
            ));
        }
        text
    }

    /// The map as a picture: a dot for each code, coloured by kind, its name under the pointer.
    pub fn svg(&self) -> String {
        const COLOURS: [&str; 9] =
            ["#4e79a7", "#f28e2b", "#e15759", "#76b7b2", "#59a14f", "#edc948", "#b07aa1", "#9c755f", "#888888"];
        let colour = |kind: Category| {
            COLOURS[Category::ALL.iter().position(|own| *own == kind).unwrap_or(8).min(COLOURS.len() - 1)]
        };
        let range = |pick: fn(&MapPoint) -> f64| {
            let values = self.points.iter().map(pick);
            let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
            (low, (high - low).max(1e-9))
        };
        let ((left, width), (bottom, height)) = (range(|point| point.x), range(|point| point.y));
        let mut text = String::from(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 900 700\" font-family=\"sans-serif\" \
             font-size=\"12\"><rect width=\"900\" height=\"700\" fill=\"white\"/>\n",
        );
        for point in &self.points {
            let x = 30.0 + (point.x - left) / width * 720.0;
            let y = 670.0 - (point.y - bottom) / height * 640.0;
            text.push_str(&format!(
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{}\" fill-opacity=\"0.75\"><title>{} {}</title></circle>\n",
                colour(point.category),
                point.material,
                ["red", "green", "blue"][point.channel % 3]
            ));
        }
        for (row, kind) in Category::ALL.into_iter().enumerate() {
            let y = 40 + 20 * row;
            text.push_str(&format!(
                "<circle cx=\"790\" cy=\"{y}\" r=\"5\" fill=\"{}\"/><text x=\"802\" y=\"{}\">{}</text>\n",
                colour(kind),
                y + 4,
                kind.label()
            ));
        }
        text.push_str("</svg>\n");
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_main_directions_of_a_flat_cloud_are_found() {
        let rows: Vec<Vec<f64>> = (0..200)
            .map(|index| {
                let (u, v) = ((f64::from(index) * 0.618).fract() - 0.5, (f64::from(index) * 0.377).fract() - 0.5);
                vec![3.0 * u, 1.0 + v, 3.0 * u, 0.0]
            })
            .collect();
        let (places, explained) = principal(&rows);
        assert!(explained[0] > 0.9 && (explained[0] + explained[1] - 1.0).abs() < 1e-6, "{explained:?}");
        let u = (7.0f64 * 0.618).fract() - 0.5;
        assert!((places[7][0].abs() - 3.0 * 2f64.sqrt() * u.abs()).abs() < 0.1);
    }

    #[test]
    fn codes_that_ship_lie_with_their_kind_more_often_than_by_chance() {
        let map = Embedding::of(&crate::neural::shipped().unwrap(), 5);
        assert_eq!(map.points.len(), 3 * 88);
        assert!(map.purity > 1.5 * map.chance && map.purity < 1.0, "{} by chance {}", map.purity, map.chance);
        assert!(map.explained[0] >= map.explained[1] && map.explained[1] > 0.0, "{:?}", map.explained);
    }
}
