//! Views in groups by the vectors that explain what each sees, whatever their order (Lloyd 1982).

use glam::DVec3;

/// Rounds in which views may change their group.
const ROUNDS: usize = 32;
/// A group has at least this share of the views, and two of them.
const LEAST_SHARE: f64 = 0.125;

/// The group of each view, of `count`; groups are numbered in the order of their first views. `None` where one would be left
/// with too few.
pub fn of(vectors: &[DVec3], count: usize) -> Option<Vec<usize>> {
    if vectors.len() < 2 * count {
        return None;
    }
    // Begun at the vector farthest from all, then at those farthest from the centres so far.
    let mean = vectors.iter().sum::<DVec3>() / vectors.len() as f64;
    let farthest = |from: &[DVec3]| {
        let distance =
            |own: &DVec3| from.iter().map(|centre| own.distance_squared(*centre)).fold(f64::INFINITY, f64::min);
        // The first of equals.
        vectors.iter().rev().max_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
    };
    let mut centres = vec![farthest(&[mean])?];
    while centres.len() < count {
        centres.push(farthest(&centres)?);
    }
    let nearest = |own: &DVec3, centres: &[DVec3]| {
        (0..count)
            .min_by(|&a, &b| own.distance_squared(centres[a]).total_cmp(&own.distance_squared(centres[b])))
            .unwrap_or(0)
    };
    let mut groups = Vec::new();
    for _ in 0..ROUNDS {
        let next: Vec<usize> = vectors.iter().map(|own| nearest(own, &centres)).collect();
        if next == groups {
            break;
        }
        groups = next;
        for (group, centre) in centres.iter_mut().enumerate() {
            let members = || vectors.iter().zip(&groups).filter(|(_, own)| **own == group).map(|(vector, _)| *vector);
            *centre = members().sum::<DVec3>() / members().count().max(1) as f64;
        }
    }
    let least = ((LEAST_SHARE * vectors.len() as f64) as usize).max(2);
    if (0..count).any(|group| groups.iter().filter(|own| **own == group).count() < least) {
        return None;
    }
    let mut order: Vec<usize> = Vec::new();
    for &group in &groups {
        if !order.contains(&group) {
            order.push(group);
        }
    }
    Some(groups.iter().map(|group| order.iter().position(|own| own == group).unwrap_or(0)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_of_two_and_three_lights_are_told_apart_in_any_order() {
        let lights = [DVec3::X, DVec3::new(-0.5, 0.8, 0.0), DVec3::new(-0.5, -0.8, 0.3)];
        for count in [2, 3] {
            let own: Vec<usize> = (0..15).map(|view| view * 7 % 5 % count).collect();
            let vectors: Vec<DVec3> = own
                .iter()
                .enumerate()
                .map(|(view, &light)| lights[light] + 0.1 * DVec3::splat((view as f64).sin()))
                .collect();
            let found = of(&vectors, count).unwrap();
            for a in 0..15 {
                for b in 0..15 {
                    assert_eq!(found[a] == found[b], own[a] == own[b], "{own:?} {found:?}");
                }
            }
            assert_eq!(found[0], 0);
        }
    }

    #[test]
    fn a_stray_view_is_no_group() {
        let mut vectors = vec![DVec3::ZERO; 12];
        vectors[5] = DVec3::X;
        assert_eq!(of(&vectors, 2), None);
        assert_eq!(of(&vectors[..3], 2), None);
        assert_eq!(of(&[DVec3::X; 8], 2), None, "all alike");
    }
}
