//! The circle that the outline of a mask lies on: where a ball is in its photo, and whether the mask shows one at all.
//!
//! A ball that is taken for one that fills the photo, and does not, has wrong normals everywhere, and light and reflectance
//! take that up in silence. The fit is robust: a hand, a stand or the border of the photo may cut the outline.

use crate::image::Image;
use glam::{DMat3, DVec2, DVec3};

/// Points of an outline at least: fewer fit any circle.
const FEWEST_POINTS: usize = 16;
/// Points lie on the circle within this share of its radius, or a pixel and a half.
const NEAR_SHARE: f64 = 0.03;
const NEAR_PIXELS: f64 = 1.5;
/// Rounds of the robust fit.
const ROUNDS: usize = 20;

/// A circle in a photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineCircle {
    /// Its centre in pixels, x to the right and y down, from the upper left corner.
    pub centre: DVec2,
    /// Its radius in pixels.
    pub radius: f64,
    /// Share of the outline that lies on it.
    pub share: f64,
}

impl OutlineCircle {
    /// The circle that fills the shorter side of a photo.
    pub fn filling(width: usize, height: usize) -> Self {
        let centre = 0.5 * DVec2::new(width as f64, height as f64);
        OutlineCircle { centre, radius: 0.5 * width.min(height) as f64, share: 1.0 }
    }

    /// How far another circle is off, in radii of this one.
    pub fn distance(&self, other: &OutlineCircle) -> f64 {
        let apart = self.centre.distance(other.centre) + (self.radius - other.radius).abs();
        apart / self.radius.max(1e-9)
    }
}

/// Fits a circle to where a mask ends inside the photo; `None` when it hardly does.
pub fn circle_of(mask: &Image<bool>) -> Option<OutlineCircle> {
    let points = outline(mask);
    if points.len() < FEWEST_POINTS {
        return None;
    }
    let mut weights = vec![1.0; points.len()];
    let mut circle = None;
    for _ in 0..ROUNDS {
        let (centre, radius) = weighted_fit(&points, &weights)?;
        let scale = (0.5 * NEAR_SHARE * radius).max(0.5 * NEAR_PIXELS);
        for (weight, point) in weights.iter_mut().zip(&points) {
            // Cauchy's weight: what is far off has no say.
            *weight = 1.0 / (1.0 + ((point.distance(centre) - radius) / scale).powi(2));
        }
        circle = Some((centre, radius));
    }
    let (centre, radius) = circle?;
    let near = (NEAR_SHARE * radius).max(NEAR_PIXELS);
    let on = points.iter().filter(|point| (point.distance(centre) - radius).abs() <= near).count();
    Some(OutlineCircle { centre, radius, share: on as f64 / points.len() as f64 })
}

/// Middles of the sides between pixels inside and outside, in pixels; the border of the photo is no outline.
fn outline(mask: &Image<bool>) -> Vec<DVec2> {
    let mut points = Vec::new();
    for row in 0..mask.height() {
        for column in 0..mask.width() {
            let (x, y) = (column as f64, row as f64);
            if column + 1 < mask.width() && mask[(row, column)] != mask[(row, column + 1)] {
                points.push(DVec2::new(x + 1.0, y + 0.5));
            }
            if row + 1 < mask.height() && mask[(row, column)] != mask[(row + 1, column)] {
                points.push(DVec2::new(x + 0.5, y + 1.0));
            }
        }
    }
    points
}

/// Least squares of `|p|^2 = 2 c.p + (r^2 - |c|^2)` (Kasa 1976), about the middle of the points.
fn weighted_fit(points: &[DVec2], weights: &[f64]) -> Option<(DVec2, f64)> {
    let total: f64 = weights.iter().sum();
    let middle = points.iter().zip(weights).map(|(point, weight)| *point * *weight).sum::<DVec2>() / total;
    let (mut square, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for (point, weight) in points.iter().zip(weights) {
        let own = *point - middle;
        let row = DVec3::new(own.x, own.y, 1.0);
        square += DMat3::from_cols(row * row.x, row * row.y, row * row.z) * *weight;
        right += row * (own.length_squared() * weight);
    }
    if square.determinant().abs() <= 1e-9 * total.powi(3) {
        return None;
    }
    let found = square.inverse() * right;
    let centre = 0.5 * DVec2::new(found.x, found.y);
    let squared = found.z + centre.length_squared();
    (squared.is_finite() && squared > 0.0).then(|| (centre + middle, squared.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(inside: impl Fn(f64, f64) -> bool) -> Image<bool> {
        Image::from_fn(120, 90, |row, column| inside(column as f64 + 0.5, row as f64 + 0.5))
    }

    #[test]
    fn a_ball_is_found_where_it_is_even_when_it_is_cut() {
        let ball = |x: f64, y: f64| (x - 70.0).hypot(y - 40.0) < 30.0;
        for (name, mask) in [
            ("whole", mask(ball)),
            ("on a stand", mask(|x, y| ball(x, y) || (x - 70.0).abs() < 6.0 && y > 60.0)),
            ("cut by the border", mask(|x, y| (x - 70.0).hypot(y - 75.0) < 30.0)),
        ] {
            let found = circle_of(&mask).unwrap();
            let y = if name == "cut by the border" { 75.0 } else { 40.0 };
            assert!(found.centre.distance(DVec2::new(70.0, y)) < 0.4, "{name}: {found:?}");
            assert!((found.radius - 30.0).abs() < 0.4 && found.share > 0.75, "{name}: {found:?}");
        }
        let filling = OutlineCircle::filling(120, 90);
        assert!(filling.distance(&circle_of(&mask(ball)).unwrap()) > 0.3);
    }

    #[test]
    fn what_is_no_circle_lies_on_none() {
        let square = circle_of(&mask(|x, y| (x - 60.0).abs() < 30.0 && (y - 45.0).abs() < 30.0)).unwrap();
        assert!(square.share < 0.7, "{square:?}");
        let ellipse = circle_of(&mask(|x, y| ((x - 60.0) / 45.0).hypot((y - 45.0) / 30.0) < 1.0)).unwrap();
        assert!(ellipse.share < 0.8, "{ellipse:?}");
        assert!(circle_of(&mask(|_, _| true)).is_none() && circle_of(&mask(|x, _| x < 60.0)).is_none());
    }
}
