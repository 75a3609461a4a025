//! Between the materials of the library: the map with one place a material, and the material at any other place.
//!
//! The code of a place is a mean of its neighbours' codes, nearer ones weighing more (Shepard 1968), so it stays in the
//! ball that codes are kept in and is that of a material where one lies. The map shows two directions of sixteen: what
//! lies between two materials on it is a way from one to the other, not the only material that could lie there.

use super::embedding::Embedding;
use super::model::FlowModel;
use crate::measured::Category;
use crate::measured::model::ReflectanceModel;

/// Materials that a place takes its code from.
const NEIGHBOURS: usize = 4;

/// A material on the map.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialPlace {
    /// Name of the material.
    pub name: String,
    /// Its kind.
    pub category: Category,
    /// Mean of its three channels along the two main directions.
    pub at: [f64; 2],
    /// Mean of its channels' purity.
    pub purity: f64,
}

/// All materials on the map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialMap {
    /// One place a material, in the order of the library.
    pub places: Vec<MaterialPlace>,
    /// Share of the variance of all codes along each of the two directions.
    pub explained: [f64; 2],
}

/// A material and the share it has in one between materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Name of the material.
    pub name: String,
    /// Its share; the shares of all parts sum to 1.
    pub share: f64,
}

impl MaterialMap {
    /// The map of an embedding, the three codes of a material as one.
    pub fn of(embedding: &Embedding) -> Self {
        let of_material = |points: &[super::embedding::MapPoint]| {
            let first = points.first()?;
            let mean = |pick: fn(&super::embedding::MapPoint) -> f64| {
                points.iter().map(pick).sum::<f64>() / points.len() as f64
            };
            Some(MaterialPlace {
                name: first.material.clone(),
                category: first.category,
                at: [mean(|point| point.x), mean(|point| point.y)],
                purity: mean(|point| point.purity),
            })
        };
        let places = embedding.points.chunks(3).filter_map(of_material).collect();
        MaterialMap { places, explained: embedding.explained }
    }

    /// Index of the material nearest to a place; `None` without materials.
    pub fn nearest(&self, at: [f64; 2]) -> Option<usize> {
        let distance = |index: &usize| squared_distance(self.places[*index].at, at);
        (0..self.places.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// The materials around a place with their shares, the largest first: the nearest four, by the inverse of the
    /// squared distance; one alone where the place is its own.
    pub fn parts_at(&self, at: [f64; 2]) -> Vec<Part> {
        let mut near: Vec<(f64, &MaterialPlace)> =
            self.places.iter().map(|place| (squared_distance(place.at, at), place)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(NEIGHBOURS);
        if let Some((distance, place)) = near.first()
            && (*distance < 1e-12 || near.len() == 1)
        {
            return vec![Part { name: place.name.clone(), share: 1.0 }];
        }
        let total: f64 = near.iter().map(|(distance, _)| 1.0 / distance).sum();
        near.iter().map(|(distance, place)| Part { name: place.name.clone(), share: 1.0 / distance / total }).collect()
    }
}

fn squared_distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}

impl FlowModel {
    /// Parameters between materials of the library: codes and logarithms of colours in these shares. `None` when there
    /// are no parts or one is not in the library.
    pub fn of_parts(&self, parts: &[Part]) -> Option<Vec<f64>> {
        let mut mixed = vec![0.0; self.parameter_count()];
        for part in parts {
            let own = self.of_material(&part.name)?;
            mixed.iter_mut().zip(own).for_each(|(sum, value)| *sum += part.share * value);
        }
        (!parts.is_empty()).then_some(mixed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn a_place_takes_after_its_neighbours_and_a_material_is_itself() {
        let trained = Arc::new(crate::neural::shipped().unwrap());
        let map = MaterialMap::of(&Embedding::of(&trained, 5));
        assert_eq!(map.places.len(), trained.account.materials.len());
        let model = FlowModel::new(trained, 1);
        let first = &map.places[7];
        let own = map.parts_at(first.at);
        assert_eq!(own, [Part { name: first.name.clone(), share: 1.0 }]);
        assert_eq!(map.nearest(first.at), Some(7));
        assert_eq!(model.of_parts(&own), model.of_material(&first.name));

        let other = &map.places[20];
        let between = [0, 1].map(|axis| 0.5 * (first.at[axis] + other.at[axis]));
        let parts = map.parts_at(between);
        assert!((parts.iter().map(|part| part.share).sum::<f64>() - 1.0).abs() < 1e-12 && parts.len() == NEIGHBOURS);
        assert!(parts.windows(2).all(|pair| pair[0].share >= pair[1].share));
        let mixed = model.of_parts(&parts).unwrap();
        let code = &mixed[..model.code_parameters() / 3];
        assert!(code.iter().map(|value| value * value).sum::<f64>() <= 1.0 + 1e-6, "within the ball");
        assert!(model.of_parts(&[Part { name: "unheard-of".into(), share: 1.0 }]).is_none());
        assert!(model.of_parts(&[]).is_none() && MaterialMap::default().nearest([0.0; 2]).is_none());
    }
}
