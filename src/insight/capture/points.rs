//! Points of the surface, and what each view that sees them says.

use super::pictures::{Compared, Comparison, NO_SURFACE};
use crate::image::Image;
use crate::math::parallel;
use crate::render::Surface;
use glam::{Vec2, Vec3};

/// Points of all views together, at most.
const MOST_POINTS: usize = 5000;
/// Views that must see a point before it is judged.
const FEWEST_VIEWS: usize = 4;
/// Share of the views that see a point that must find it unlike.
const MOST_OF_THEM: f64 = 0.6;
/// Least cosine between a sight and the normal: grazing sights blur over many points.
const LEAST_COSINE: f32 = 0.2;

/// A point of the surface that some view sees.
pub struct Point {
    /// Its place in the world.
    pub position: Vec3,
    /// By view of the comparison that sees it: direction to the camera, and whether it looks unlike there.
    pub sights: Vec<(Vec3, bool)>,
}

impl Point {
    /// Whether enough views see it to judge it.
    pub fn is_judged(&self) -> bool {
        self.sights.len() >= FEWEST_VIEWS
    }

    /// Whether most views that see it find it unlike.
    pub fn is_unlike(&self) -> bool {
        let unlike = self.sights.iter().filter(|(_, unlike)| *unlike).count();
        self.is_judged() && unlike as f64 >= MOST_OF_THEM * self.sights.len() as f64
    }
}

/// Points behind evenly spaced pixels of all views, with what the views say of them; `unlike` are the pixels of each view
/// that the model does not explain.
pub fn points_of(comparison: &Comparison, surface: &Surface, unlike: &[Image<bool>]) -> Vec<Point> {
    let pixels: usize = comparison.views.iter().map(|own| own.camera.width * own.camera.height).sum();
    let step = (pixels as f64 / MOST_POINTS as f64).sqrt().ceil().max(1.0) as usize;
    let places: Vec<(&Compared, usize, usize)> = comparison
        .views
        .iter()
        .flat_map(|own| {
            let rows = (step / 2..own.camera.height).step_by(step);
            rows.flat_map(move |row| (step / 2..own.camera.width).step_by(step).map(move |column| (own, row, column)))
        })
        .filter(|(own, row, column)| own.distance[(*row, *column)] < NO_SURFACE)
        .collect();
    let points = parallel::map_items(&places, |&(own, row, column)| {
        let ray = own.camera.ray_through(centre(row, column));
        let point = surface.point_facing(&surface.closest(&ray)?, -ray.direction);
        let sights = comparison.views.iter().zip(unlike);
        let sights = sights
            .filter_map(|(other, unlike)| {
                let eye = other.camera.position_in_world();
                let direction = (eye - point.position).try_normalize()?;
                if direction.dot(point.geometric_normal) < LEAST_COSINE {
                    return None;
                }
                let (row, column) = pixel_of(other, point.position)?;
                let is_hidden = surface.bvh().is_hidden_from(point.position, point.geometric_normal, eye);
                (!is_hidden).then(|| (direction, unlike[(row, column)]))
            })
            .collect();
        Some(Point { position: point.position, sights })
    });
    points.into_iter().flatten().collect()
}

/// Centre of a pixel.
fn centre(row: usize, column: usize) -> Vec2 {
    Vec2::new(column as f32 + 0.5, row as f32 + 0.5)
}

/// Row and column of the pixel that shows a place; `None` outside the picture.
pub fn pixel_of(own: &Compared, place: Vec3) -> Option<(usize, usize)> {
    own.camera.place_in_picture(place).map(|on_picture| (on_picture.y as usize, on_picture.x as usize))
}
