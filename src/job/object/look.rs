//! What is looked at while an estimation runs: a small re-render, its error, lobes, a sphere.

use crate::image::{GreyImage, Image, RgbImage};
use crate::insight::material_pictures::DIFFERENCES;
use crate::light::Environment;
use crate::measured::coordinates::HalfDifference;
use crate::measured::sphere::{self, EnvironmentLevels};
use crate::object::geometry::Visibility;
use crate::object::nodes::{NodeGrid, NodeTable};
use crate::object::picture::{log_error_map, log_errors, render};
use crate::object::transport::TexelDirections;
use crate::object::{ObjectGeometry, ObjectView};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Points of a curve.
const POINTS: usize = 121;
/// Side of the sphere in pixels.
pub const SPHERE_SIDE: usize = 160;
/// Rows of the light that small pictures are rendered under.
const LIGHT_ROWS: usize = 32;

/// Reflectance along the half angle at one difference angle.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeSlice {
    /// The difference angle in degrees.
    pub difference_degrees: f64,
    /// Half angle in degrees and linear RGB in 1/sr; what lies below the horizon is left out.
    pub points: Vec<(f64, [f64; 3])>,
}

/// A reflectance to look at.
#[derive(Clone, Debug)]
pub struct MaterialLook {
    /// Slices at 5, 45 and 75 degrees, `phi_difference` 90 degrees.
    pub lobes: Vec<LobeSlice>,
    /// A sphere of it, exposed for a display at 0 stops; black beside the sphere.
    pub sphere: Arc<RgbImage>,
}

impl MaterialLook {
    /// The look of a reflectance in 1/sr, the sphere under a light or, without one, under three lamps.
    pub fn of(reflectance: &(dyn Fn(HalfDifference) -> [f64; 3] + Sync), light: Option<&Environment>) -> Self {
        let slice = |degrees: f64| LobeSlice {
            difference_degrees: degrees,
            points: sphere::slice(reflectance, degrees.to_radians(), FRAC_PI_2, POINTS)
                .into_iter()
                .map(|(theta, value)| (theta.to_degrees(), value))
                .collect(),
        };
        MaterialLook {
            lobes: DIFFERENCES.map(slice).to_vec(),
            sphere: Arc::new(sphere_of(reflectance, SPHERE_SIDE, light)),
        }
    }
}

/// A sphere under a light, or under three lamps, exposed for a display at 0 stops.
pub fn sphere_of(
    reflectance: &(dyn Fn(HalfDifference) -> [f64; 3] + Sync),
    side: usize,
    light: Option<&Environment>,
) -> RgbImage {
    let mask = sphere::sphere_mask(side);
    let (picture, factor) = match light {
        Some(light) => {
            let picture = sphere::render_sphere_in(side, reflectance, &EnvironmentLevels::new(light));
            let factor = sphere::display_exposure(&picture, &mask);
            (picture, factor)
        }
        None => {
            let picture = sphere::render_sphere(side, reflectance, &sphere::showing_lamps());
            // A black cloth stays black beside a white one.
            let own = sphere::display_exposure(&picture, &mask);
            let base = sphere::SHOWING_EXPOSURE;
            (picture, own.clamp(0.5 * base, 2.0 * base))
        }
    };
    picture.map(|rgb| *rgb * factor)
}

/// The state of an estimation after a round.
#[derive(Clone, Debug)]
pub struct ObjectLook {
    /// Its re-render.
    pub rerender: Arc<RgbImage>,
    /// Logarithm of re-render over photo, of luminance; NaN beside the object.
    pub log_error: Arc<GreyImage>,
    /// Root mean square of the logarithm of re-render over photo, all channels, as it is.
    pub log_rmse: f64,
    /// The light.
    pub light: Arc<Environment>,
    /// The reflectance.
    pub material: Arc<MaterialLook>,
}

/// Paints looks of a view at a size at which that takes a moment.
pub struct Painter {
    geometry: ObjectGeometry,
    photo: Arc<RgbImage>,
    visibility: Option<Visibility>,
    directions: TexelDirections,
    grid: NodeGrid,
    epsilon: f32,
}

impl Painter {
    /// A painter of a view with at most about `most_pixels` pixels of the object. `shadows` traces shadow rays, once.
    pub fn new(view: &ObjectView, grid: NodeGrid, shadows: bool, most_pixels: usize) -> Self {
        let (geometry, photo) = thinned(view, most_pixels);
        let visibility = geometry.visibility(&geometry.pixels, 2 * LIGHT_ROWS, LIGHT_ROWS).filter(|_| shadows);
        let directions = TexelDirections::of_any_size(2 * LIGHT_ROWS, LIGHT_ROWS);
        let epsilon = epsilon_of(&geometry, &photo);
        Painter { geometry, photo: Arc::new(photo), visibility, directions, grid, epsilon }
    }

    /// The object under lights of any size.
    pub fn relit(&self, table: &NodeTable, lights: &[&Environment]) -> Vec<RgbImage> {
        let resampled: Vec<Environment> =
            lights.iter().map(|light| light.resampled(2 * LIGHT_ROWS, LIGHT_ROWS)).collect();
        let lights: Vec<&Environment> = resampled.iter().collect();
        render(&self.geometry, self.visibility.as_ref(), &self.directions, &self.grid, table, &lights)
    }

    /// The look of a state.
    pub fn paint(&self, light: Environment, table: &NodeTable) -> ObjectLook {
        let rerender = self.relit(table, &[&light]).swap_remove(0);
        let log_error = log_error_map(&self.geometry, &rerender, &self.photo, self.epsilon);
        let (log_rmse, _) = log_errors(&self.geometry, &rerender, &self.photo, self.epsilon);
        let material = MaterialLook::of(&|at| self.grid.value(table, at), None);
        ObjectLook {
            rerender: Arc::new(rerender),
            log_error: Arc::new(log_error),
            log_rmse,
            light: Arc::new(light),
            material: Arc::new(material),
        }
    }
}

/// A re-render of a view with the logarithm of it over the photo.
pub fn with_log_error(view: &ObjectView, rerender: RgbImage) -> (Arc<RgbImage>, Arc<GreyImage>) {
    let photo = &view.photo.radiance;
    let log_error = log_error_map(&view.geometry, &rerender, photo, epsilon_of(&view.geometry, photo));
    (Arc::new(rerender), Arc::new(log_error))
}

/// What is added to radiance before a logarithm: a thousandth of the mean of the object's pixels.
fn epsilon_of(geometry: &ObjectGeometry, photo: &RgbImage) -> f32 {
    let sum: f64 = geometry
        .pixels
        .iter()
        .map(|pixel| f64::from(photo[(pixel.row as usize, pixel.column as usize)].element_sum() / 3.0))
        .sum();
    (1e-3 * sum / geometry.pixels.len().max(1) as f64).max(1e-12) as f32
}

/// Every so-manieth row and column of a view, so that about `most_pixels` pixels of the object are left.
fn thinned(view: &ObjectView, most_pixels: usize) -> (ObjectGeometry, RgbImage) {
    let every = (view.geometry.pixels.len() as f64 / most_pixels.max(1) as f64).sqrt().ceil().max(1.0) as usize;
    let (width, height) = (view.geometry.width / every, view.geometry.height / every);
    let first = every / 2;
    let is_kept = |place: u32, count: usize| place as usize % every == first && (place as usize / every) < count;
    let pixels: Vec<_> = view
        .geometry
        .pixels
        .iter()
        .filter(|pixel| is_kept(pixel.row, height) && is_kept(pixel.column, width))
        .map(|pixel| {
            let (row, column) = (pixel.row / every as u32, pixel.column / every as u32);
            crate::object::geometry::ObjectPixel { row, column, ..*pixel }
        })
        .collect();
    if pixels.is_empty() {
        return (view.geometry.clone(), view.photo.radiance.clone());
    }
    let photo =
        Image::from_fn(width, height, |row, column| view.photo.radiance[(row * every + first, column * every + first)]);
    (ObjectGeometry { width, height, pixels, grazing: Vec::new(), bvh: view.geometry.bvh.clone() }, photo)
}
