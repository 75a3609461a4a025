//! Numbers: random, with derivatives, on the sphere, in sums.
//!
//! Read [`random`] first: every random number of the program is a pure function of its key. Then [`sphere`], the one
//! place where a direction and a place on a latitude-longitude map meet. [`real`] lets the reflection lobe and the
//! path sums run in `f32`, in `f64` for audits, and with derivatives for Hessian-vector products. [`elementary`] holds
//! angles and floors for inner loops, [`vector`] arithmetic of several numbers at a time.
//! What is not here: linear algebra (that is glam's and faer's).

pub mod arc;
pub mod clusters;
pub mod distribution;
pub mod elementary;
pub mod frame;
pub mod random;
pub mod real;
pub mod sphere;
pub mod statistics;
pub mod vector;

/// At most so many of a list, in its order, evenly spread over it and with its first.
pub fn evenly_spread<T: Copy>(list: &[T], most: usize) -> Vec<T> {
    let count = list.len().min(most);
    (0..count).map(|index| list[index * list.len() / count]).collect()
}

/// Luminance of a linear RGB value by the weights of Rec. 709.
pub fn luminance(rgb: glam::Vec3) -> f32 {
    rgb.dot(glam::Vec3::new(0.2126, 0.7152, 0.0722))
}
