//! What blocks of surface believe of each other: neighbours are mostly made of the same stuff.
//!
//! A block that is eliminated by itself tells of the light only what changes within it: of a matt surface that is hardly
//! more than the edges of shadows, and reflectance explains those too. What tells the sun's side from the other, and light
//! from shadow, is that the same stuff lies on both sides. So the reflectance of a block is not eliminated with the rest,
//! but together with those of all others, with two beliefs: differences between neighbours are small, with heavy tails
//! (Cauchy), since materials change at few places; and all lie somewhere around their median.
//!
//! With `g` the row over the light that goes along with a block's reflectance, `y` its right side, `r` the length of the
//! reflectance's column, and `K = R^2 + W` (`W` the precision of the beliefs), what is left of all blocks is
//! `G (I - R K^-1 R) G'`, the Schur complement, whose middle has eigenvalues in [0, 1].

use super::eliminate::KeptUnknown;
use super::normal_equations::NormalEquations;
use super::plan::Block;
use crate::math::statistics::median;
use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, Side};
use glam::Vec3;

/// Neighbours of a block.
const NEIGHBOURS: usize = 6;
/// By how much logarithms of neighbours' reflectances differ where it is one material (one standard deviation); its square
/// grows with their distance, as that of a random walk.
const DIFFER: f64 = 0.15;
/// By how much logarithms of reflectances differ from that of their median: hardly a belief, since what lies flat may be one
/// dark material and what stands on it one bright one.
const SPREAD: f64 = 3.0;
/// Share of the median below which all is equally dark.
const DARK: f64 = 0.1;
/// The median is at least this: black photos have none.
const LEAST_MEDIAN: f64 = 1e-3;

/// Pairs of neighbouring blocks, as places in a list, and their distance over the usual one.
pub fn neighbours(blocks: &[&Block]) -> Vec<(usize, usize, f64)> {
    let mut pairs: Vec<(usize, usize, f32)> = Vec::new();
    for (a, own) in blocks.iter().enumerate() {
        let mut near: Vec<(f32, usize)> = blocks
            .iter()
            .enumerate()
            .filter(|(b, _)| *b != a)
            .map(|(b, other)| (own.centre.distance_squared(other.centre), b))
            .collect();
        near.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        pairs.extend(near.into_iter().take(NEIGHBOURS).map(|(square, b)| (a.min(b), a.max(b), square.sqrt())));
    }
    pairs.sort_by_key(|pair| (pair.0, pair.1));
    pairs.dedup_by_key(|pair| (pair.0, pair.1));
    let mut distances: Vec<f32> = pairs.iter().map(|pair| pair.2).collect();
    let usual = median(&mut distances).max(f64::MIN_POSITIVE);
    pairs.into_iter().map(|(a, b, distance)| (a, b, f64::from(distance) / usual)).collect()
}

/// Adds what all blocks together say of the light in one channel. `independence` is the share of the rows' evidence that
/// counts beside what is believed.
pub fn add_coupled(
    equations: &mut NormalEquations,
    kept: &[KeptUnknown],
    pairs: &[(usize, usize, f64)],
    independence: f64,
) {
    let (blocks, count) = (kept.len(), equations.count);
    let (mut precision, pull) = beliefs(kept, pairs);
    for (index, own) in kept.iter().enumerate() {
        precision[index * blocks + index] += independence * own.length * own.length;
    }
    // Without blocks, or with numbers that are not finite, nothing is said.
    let Ok(factor) = MatRef::from_row_major_slice(&precision, blocks, blocks).llt(Side::Lower) else { return };
    let length = |row: usize, column: usize| if row == column { kept[row].length } else { 0.0 };
    let solved = factor.solve(&Mat::from_fn(blocks, blocks, length));
    let middle = Mat::from_fn(blocks, blocks, |row, column| {
        f64::from(u8::from(row == column)) - independence * kept[row].length * solved[(row, column)]
    });
    let pulled = factor.solve(&Mat::from_fn(blocks, 1, |row, _| pull[row]));
    let rows = Mat::from_fn(count, blocks, |row, column| f64::from(kept[column].row[row]));
    let half = &rows * &middle;
    let whole = &half * rows.transpose();
    let right = &half * &Mat::from_fn(blocks, 1, |row, _| kept[row].side)
        - &rows * &Mat::from_fn(blocks, 1, |row, _| kept[row].length * pulled[(row, 0)]);
    for row in 0..count {
        equations.right[row] += right[(row, 0)];
        for column in 0..=row {
            equations.matrix[row * count + column] += whole[(row, column)];
        }
    }
}

/// What is believed of the reflectances: precision matrix, row after row, and its product with how far each is to move.
fn beliefs(kept: &[KeptUnknown], pairs: &[(usize, usize, f64)]) -> (Vec<f64>, Vec<f64>) {
    let blocks = kept.len();
    let mut values: Vec<f32> = kept.iter().map(|own| own.value as f32).collect();
    let median = median(&mut values).max(LEAST_MEDIAN);
    // By logarithms: what all have in common is left to the light and the surface, and nothing is pulled towards black.
    let held: Vec<f64> = kept.iter().map(|own| own.value.max(DARK * median)).collect();
    let (mut precision, mut pull) = (vec![0.0f64; blocks * blocks], vec![0.0f64; blocks]);
    for (index, own) in held.iter().enumerate() {
        let weight = (SPREAD * own).powi(-2);
        precision[index * blocks + index] += weight;
        pull[index] -= weight * own * (own / median).ln();
    }
    for &(a, b, distance) in pairs {
        let difference = (held[a] / held[b]).ln();
        let weight = 1.0 / (DIFFER * DIFFER * distance + difference * difference);
        for (own, other) in [(a, b), (b, a)] {
            precision[own * blocks + own] += weight / (held[own] * held[own]);
            precision[own * blocks + other] -= weight / (held[own] * held[other]);
        }
        pull[a] -= weight * difference / held[a];
        pull[b] += weight * difference / held[b];
    }
    (precision, pull)
}

#[cfg(test)]
mod tests {
    use super::super::eliminate::BlockRows;
    use super::*;
    use crate::math::random::SequentialRandom;

    fn block(x: f32) -> Block {
        Block { centre: Vec3::new(x, 0.0, 0.0), ..Block::default() }
    }

    #[test]
    fn neighbours_are_the_nearest_and_each_pair_is_named_once() {
        let row: Vec<Block> = (0..20).map(|index| block(index as f32)).collect();
        let pairs = neighbours(&row.iter().collect::<Vec<_>>());
        assert!(pairs.iter().all(|(a, b, _)| a < b && b - a <= NEIGHBOURS));
        assert!((0..19).all(|a| pairs.iter().filter(|pair| (pair.0, pair.1) == (a, a + 1)).count() == 1));
        // Distances are in units of their median.
        let mut distances: Vec<f32> = pairs.iter().map(|pair| pair.2 as f32).collect();
        assert!((median(&mut distances) - 1.0).abs() < 1e-6);
        assert!(neighbours(&[&block(0.0)]).is_empty() && neighbours(&[]).is_empty());
        let same = [block(1.0), block(1.0)];
        assert!(neighbours(&same.iter().collect::<Vec<_>>())[0].2.is_finite());
    }

    /// Rows of some blocks under three unknowns of the light, and the dense normal equations of everything together.
    #[test]
    fn coupled_blocks_give_the_light_of_the_dense_joint_system() {
        let mut random = SequentialRandom::new(5);
        let (light, blocks, observations, independence) = (3, 4, 12, 0.3);
        let size = light + 2 * blocks;
        let mut dense = vec![vec![0.0f64; size + 1]; size];
        let mut equations = NormalEquations::new(light);
        let mut kept = Vec::new();
        for block in 0..blocks {
            let mut rows = BlockRows::default();
            rows.reset(light, observations, 2);
            for i in 0..observations {
                let own: Vec<f32> = (0..light).map(|_| random.next_number()).collect();
                let (other, reflectance, right) =
                    (f64::from(random.next_number()), f64::from(random.next_number()), f64::from(random.next_number()));
                rows.set_row(i, own.iter().copied(), own.iter().map(|_| 0.0));
                rows.set_unknown(i, 0, other);
                rows.set_unknown(i, 1, reflectance);
                rows.right[i] = right;
                let mut row = vec![0.0; size];
                (0..light).for_each(|k| row[k] = f64::from(own[k]));
                (row[light + block], row[light + blocks + block]) = (other, reflectance);
                for a in 0..size {
                    for b in 0..size {
                        dense[a][b] += independence * row[a] * row[b];
                    }
                    dense[a][size] += independence * row[a] * right;
                }
            }
            rows.eliminate();
            rows.kept.value = 0.2 + 0.1 * block as f64;
            equations.add(&rows);
            kept.push(rows.kept.clone());
        }
        equations.flush();
        let pairs = [(0, 1, 1.0), (1, 2, 0.7), (0, 3, 2.0)];
        let (precision, pull) = beliefs(&kept, &pairs);
        for a in 0..blocks {
            for b in 0..blocks {
                dense[light + blocks + a][light + blocks + b] += precision[a * blocks + b];
            }
            dense[light + blocks + a][size] += pull[a];
        }
        add_coupled(&mut equations, &kept, &pairs, independence);
        let whole = Mat::from_fn(size, size, |row, column| dense[row][column]);
        let joint = whole.as_ref().llt(Side::Lower).unwrap().solve(&Mat::from_fn(size, 1, |row, _| dense[row][size]));
        let own = |row: usize, column: usize| equations.matrix[row.max(column) * light + row.min(column)];
        let alone = Mat::from_fn(light, light, own);
        let found =
            alone.as_ref().llt(Side::Lower).unwrap().solve(&Mat::from_fn(light, 1, |row, _| equations.right[row]));
        for k in 0..light {
            let (found, joint) = (found[(k, 0)], joint[(k, 0)]);
            assert!((found - joint).abs() < 1e-4 * (1.0 + joint.abs()), "{k}: {found} {joint}");
        }
    }

    #[test]
    fn without_blocks_nothing_is_said() {
        let mut equations = NormalEquations::new(2);
        add_coupled(&mut equations, &[], &[], 0.05);
        assert!(equations.matrix.iter().chain(&equations.right).all(|value| *value == 0.0));
    }
}
