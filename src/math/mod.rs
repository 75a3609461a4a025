//! Numbers: random, with derivatives, on the sphere, in sums.
//!
//! Read [`random`] first: every random number of the program is a pure function of its key. Then [`sphere`], the one
//! place where a direction and a place on a latitude-longitude map meet. [`real`] lets the reflection lobe and the
//! path sums run in `f32`, in `f64` for audits, and with derivatives for Hessian-vector products. [`elementary`] holds
//! angles and floors for inner loops, `vector` arithmetic of several numbers at a time, [`parallel`] work on many things at
//! once.
//! What is not here: linear algebra (that is glam's and faer's).

pub mod adam;
pub mod arc;
pub mod clusters;
pub mod distribution;
pub mod elementary;
pub mod frame;
pub mod parallel;
pub mod random;
pub mod real;
pub mod sphere;
pub mod statistics;
pub(crate) mod vector;

/// At most so many of a list, in its order, evenly spread over it and with its first.
pub fn evenly_spread<T: Copy>(list: &[T], most: usize) -> Vec<T> {
    let count = list.len().min(most);
    (0..count).map(|index| list[index * list.len() / count]).collect()
}

/// Luminance of a linear RGB value by the weights of Rec. 709.
pub fn luminance(rgb: glam::Vec3) -> f32 {
    rgb.dot(glam::Vec3::new(0.2126, 0.7152, 0.0722))
}

/// The sum of products of two lists of one length, in so many lanes that processors add at once: in a fixed order, which
/// the number of lanes decides.
#[inline]
pub fn sum_of_products<const LANES: usize>(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0f32; LANES];
    let (a_parts, b_parts) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f32 = a_parts.remainder().iter().zip(b_parts.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_parts.zip(b_parts) {
        for lane in 0..LANES {
            lanes[lane] += a[lane] * b[lane];
        }
    }
    lanes.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_summed_to_the_last_one() {
        for count in [0usize, 5, 16, 45] {
            let numbers: Vec<f32> = (1..=count).map(|number| number as f32).collect();
            let squares = (count * (count + 1) * (2 * count + 1) / 6) as f32;
            assert_eq!(sum_of_products::<16>(&numbers, &numbers), squares, "{count}");
            assert_eq!(sum_of_products::<8>(&numbers, &numbers), squares, "{count}");
        }
    }
}
