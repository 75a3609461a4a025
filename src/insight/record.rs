//! The record of one point of the surface: what each photograph says there, and what the maps and the light say.
//!
//! A row compares the pixel of a photo that holds the point with the same pixel of a traced picture: both are means
//! over the pixel, so a point beside an edge is compared like with like. Rows come from views that see the point by
//! [`seen_at`]; a pixel's own state says whether it is evidence.

use super::cursor::seen_at;
use crate::light::environment::brightest_direction;
use crate::material::texels::texel_of_uv;
use crate::math::parallel;
use crate::render::picture::PictureSettings;
use crate::render::progressive::PictureTracer;
use crate::render::surface::SurfacePoint;
use crate::render::{Parameters, PathArena, Surface};
use crate::scene::{PixelState, Scene};
use glam::{Vec2, Vec3};

/// How a record is made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordSettings {
    /// How the pixels are traced; `samples` a pixel, `groups` is not read.
    pub picture: PictureSettings,
    /// Factor of each view's model radiance, as a fit with exposure gains found it; 1 where the list ends.
    pub gains: Vec<f32>,
    /// Views that the user left out of the fit; false where the list ends.
    pub excluded: Vec<bool>,
}

/// What one view says of the point.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ViewRow {
    /// Index of the view.
    pub view: usize,
    /// Its name.
    pub name: String,
    /// Where the point falls on the picture, in pixels.
    pub place: Vec2,
    /// Linear radiance of the photo's pixel.
    pub photo: Vec3,
    /// What the pixel is evidence for.
    #[serde(skip)]
    pub state: PixelState,
    /// Linear radiance of the traced pixel, times the view's gain.
    pub model: Vec3,
    /// `model - photo`.
    pub residual: Vec3,
    /// Angle between the shading normal and the direction to the camera, in degrees: 0 from above, 90 grazing.
    pub angle_degrees: f32,
    /// Texels of the map along a side of the pixel's footprint (square root of its area in texels).
    pub footprint_texels: f32,
    /// Kept out of the fit, to judge it.
    pub held_out: bool,
    /// Left out by the user.
    pub is_excluded: bool,
}

/// What is known of one point of the surface.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TexelRecord {
    /// Position in the world.
    pub position: Vec3,
    /// Unit shading normal in the world.
    pub normal: Vec3,
    /// Texture coordinate, v up.
    pub uv: Vec2,
    /// Index of the triangle.
    pub triangle: u32,
    /// Row and column of the texel that holds the point.
    pub texel: (usize, usize),
    /// Diffuse reflectance at the point, bilinear.
    pub diffuse: Vec3,
    /// Specular reflectance F0.
    pub specular: Vec3,
    /// Roughness `r = a^2`.
    pub roughness: f32,
    /// The least [`ViewRow::footprint_texels`]: above 1, no photo resolves a texel here. NaN without rows.
    pub footprint_texels: f32,
    /// The views that see the point, in their order.
    pub rows: Vec<ViewRow>,
    /// The most grazing angle of view in degrees: near it the specular rise shows. NaN without rows.
    pub grazing_degrees: f32,
    /// The largest angle between two directions of view, in degrees: small, and shine cannot be told from colour. NaN
    /// without rows.
    pub view_spread_degrees: f32,
    /// The least angle in degrees between the normal and the half vector towards the brightest texel of the light: how
    /// near any view comes to the middle of the highlight. NaN without rows, or where that light is below the horizon.
    pub highlight_degrees: f32,
    /// Share in [0, 1] of the rows whose pixel is clipped. NaN without rows.
    pub clipped_share: f32,
}

/// Makes the record of a point; the same settings give the same bits.
pub fn texel_record(
    scene: &Scene,
    surface: &Surface,
    parameters: &Parameters<f32>,
    point: &SurfacePoint,
    settings: &RecordSettings,
) -> TexelRecord {
    let tracer = PictureTracer::new(surface, parameters, settings.picture);
    let base = &parameters.texels.levels[0];
    let (width, height) = (base.width, base.height);
    let map_side = ((width * height) as f32).sqrt();
    let row_of = |view: usize| {
        let place = seen_at(scene, surface, view, point)?;
        let own = &scene.views[view];
        let (row, column) = (place.y as usize, place.x as usize);
        let samples = settings.picture.samples;
        let (pixel, mut arena) = (row * own.camera.width + column, PathArena::default());
        let (traced, _) = tracer.pixel(&own.camera, view as u32, pixel, samples, 0, &mut arena);
        let photo = own.photo.radiance(row, column);
        let model = traced * settings.gains.get(view).copied().unwrap_or(1.0);
        let to_camera = own.camera.position_in_world() - point.position;
        let cosine = point.geometric_normal.dot(to_camera.normalize_or_zero()).max(0.05);
        let pixel_in_world = own.camera.pixel_angle_radians() * to_camera.length() / cosine.sqrt();
        Some(ViewRow {
            view,
            name: own.name.clone(),
            place,
            photo,
            state: own.states[(row, column)],
            model,
            residual: model - photo,
            angle_degrees: angle_degrees(point.shading_normal, to_camera),
            footprint_texels: pixel_in_world * point.uv_per_length * map_side,
            held_out: own.held_out,
            is_excluded: settings.excluded.get(view).copied().unwrap_or(false),
        })
    };
    let rows: Vec<ViewRow> = parallel::map(scene.views.len(), row_of).into_iter().flatten().collect();

    let directions: Vec<Vec3> = rows
        .iter()
        .map(|row| (scene.views[row.view].camera.position_in_world() - point.position).normalize_or_zero())
        .collect();
    let spread = directions
        .iter()
        .enumerate()
        .flat_map(|(index, &first)| directions[index..].iter().map(move |&second| angle_degrees(first, second)));
    let light_size = parameters.environment_size;
    let light = parameters.light.iter().map(|&radiance| Vec3::from_array(radiance));
    let highlight = brightest_direction(light, light_size.0, light_size.1)
        .filter(|light| light.dot(point.shading_normal) > 0.0)
        .map_or(f32::NAN, |light| {
            least(directions.iter().map(|&view| angle_degrees(point.shading_normal, view + light)))
        });
    let clipped = rows.iter().filter(|row| row.state.is_clipped()).count();
    let material = parameters.texels.fetch(&parameters.texels.tap(point.uv, 0));
    TexelRecord {
        position: point.position,
        normal: point.shading_normal,
        uv: point.uv,
        triangle: point.triangle,
        texel: texel_of_uv(point.uv, width, height),
        diffuse: Vec3::from_array(material.diffuse),
        specular: Vec3::from_array(material.specular),
        roughness: (2.0 * material.log_width).exp(),
        footprint_texels: least(rows.iter().map(|row| row.footprint_texels)),
        grazing_degrees: largest(rows.iter().map(|row| row.angle_degrees)),
        view_spread_degrees: largest(spread),
        highlight_degrees: highlight,
        // 0 / 0 without rows.
        clipped_share: clipped as f32 / rows.len() as f32,
        rows,
    }
}

fn angle_degrees(a: Vec3, b: Vec3) -> f32 {
    // By the tangent: the cosine loses small angles to rounding.
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

/// The least value; NaN without any.
fn least(values: impl Iterator<Item = f32>) -> f32 {
    values.fold(f32::NAN, f32::min)
}

/// The largest value; NaN without any.
fn largest(values: impl Iterator<Item = f32>) -> f32 {
    values.fold(f32::NAN, f32::max)
}
