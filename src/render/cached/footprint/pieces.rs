//! The pieces of surface behind a pixel: samples that lie on one smooth part are summed.

use super::FootprintSettings;
use crate::material::TextureTap;
use crate::math::parallel;
use crate::render::Surface;
use crate::render::surface::SurfacePoint;
use crate::scene::Camera;
use glam::{Mat2, Vec2, Vec3};

/// Samples whose normals have at least this cosine are one piece of surface.
const ONE_PIECE: f32 = 0.97;

/// Lookups of the maps along each side of a pixel, at most.
const MOST_LOOKUPS: f32 = 8.0;

/// The texels of a lookup on a level of square maps, and their weights.
fn texels_at(uv: Vec2, level: usize, map_size: usize) -> impl Iterator<Item = (u32, f32)> {
    let first: u32 = (0..level).map(|finer| (map_size >> finer).pow(2) as u32).sum();
    let side = map_size >> level;
    let tap = TextureTap::at(uv, level as u32, side, side);
    tap.index.map(|texel| first + texel).into_iter().zip(tap.weight).filter(|&(_, weight)| weight > 0.0)
}

/// Samples of a pixel on one piece of surface, summed.
pub(super) struct Piece {
    pub(super) samples: usize,
    pub(super) share: f32,
    pub(super) normal: Vec3,
    pub(super) to_viewer: Vec3,
    pub(super) texels: Vec<(u32, f32)>,
    pub(super) places: Vec<SurfacePoint>,
    pub(super) first: SurfacePoint,
    pub(super) reach: f32,
}

/// Place of a sample in its pixel, in [0, 1]^2: the points of Hammersley. However an edge lies, about its share of them
/// falls on each side; on a square grid of 8 x 8 an edge along a row is off by up to a sixteenth of the pixel.
fn place_in_pixel(sample: usize, total: usize) -> Vec2 {
    let half = 0.5 / total as f32;
    let mirrored = (sample as u32).reverse_bits() as f32 * (0.5f32).powi(32);
    Vec2::new(sample as f32 / total as f32, mirrored) + half
}

/// What a ray through a place of the picture meets.
pub(super) enum Seen {
    Background,
    Back,
    Front { point: SurfacePoint, reach: f32 },
}

/// Neighbours on one piece are not much farther apart than this multiple of a pixel's footprint.
const REACH_PIXELS: f32 = 4.0;

fn look(surface: &Surface, camera: &Camera, place: Vec2) -> (Seen, Vec3) {
    let ray = camera.ray_through(place);
    let Some(hit) = surface.closest(&ray) else { return (Seen::Background, ray.direction) };
    let point = surface.point(&hit);
    // Backs are black, as along a path.
    if point.geometric_normal.dot(ray.direction) >= 0.0 || point.shading_normal.dot(ray.direction) >= 0.0 {
        return (Seen::Back, ray.direction);
    }
    let cosine = point.geometric_normal.dot(-ray.direction).max(0.05);
    let reach = REACH_PIXELS * camera.pixel_angle_radians() * hit.t / cosine;
    (Seen::Front { point, reach }, ray.direction)
}

/// What lies at the corners of the pixels, row after row of `width + 1`. An edge that cuts off a corner passes by all
/// places of a pixel's first samples; a ray at each corner, shared by four pixels, finds it.
pub(super) fn corners_of_pixels(surface: &Surface, camera: &Camera) -> Vec<Vec<Seen>> {
    parallel::map(camera.height + 1, |row| {
        (0..=camera.width).map(|column| look(surface, camera, Vec2::new(column as f32, row as f32)).0).collect()
    })
}

/// Texture coordinate of the front of a surface that the middle of a pixel shows.
pub(super) fn uv_at_middle(surface: &Surface, camera: &Camera, row: usize, column: usize) -> Option<Vec2> {
    match look(surface, camera, Vec2::new(column as f32 + 0.5, row as f32 + 0.5)).0 {
        Seen::Front { point, .. } => Some(point.uv),
        Seen::Background | Seen::Back => None,
    }
}

impl Piece {
    /// Variance of the normals, of both axes together, in squared radians. Places spread evenly have a little less
    /// variance than what lies between them.
    pub(super) fn normal_variance(&self) -> f32 {
        let count = self.samples as f32;
        if self.samples < 2 {
            return 0.0;
        }
        let mean = self.normal / count;
        (1.0 - mean.length_squared()).max(0.0) * count * count / (count * count - 1.0)
    }

    /// Takes texels from evenly over the pixel that the piece covers, as far as its samples tell where it lies on the maps:
    /// a few rays pick from texels that are finer than pixels, and lookups cost less than rays.
    fn cover_texels(&mut self, settings: &FootprintSettings) {
        let Some([middle, across, along]) = self.pixel_on_maps() else { return };
        let [columns, rows] = [across, along].map(|side| side.length() * settings.map_size as f32);
        if columns.max(rows) <= settings.coarse_side as f32 {
            return;
        }
        let level = settings.level(columns.max(rows) / MOST_LOOKUPS);
        let [columns, rows] = [columns, rows].map(|texels| texels.ceil().clamp(2.0, MOST_LOOKUPS) as usize);
        self.texels.clear();
        for row in 0..rows {
            let from_middle = along * ((row as f32 + 0.5) / rows as f32 - 0.5);
            for column in 0..columns {
                let uv = middle + from_middle + across * ((column as f32 + 0.5) / columns as f32 - 0.5);
                self.texels.extend(texels_at(uv, level, settings.map_size));
            }
        }
    }

    /// The texture coordinate of the middle of the pixel that the piece covers, and by how much it changes across and along
    /// the pixel: a plane through its samples, by least squares. `None` where they do not span one.
    fn pixel_on_maps(&self) -> Option<[Vec2; 3]> {
        let count = self.places.len() as f32;
        let samples = self.places.iter().enumerate();
        let from_middle = samples.map(|(sample, place)| (place_in_pixel(sample, self.places.len()) - 0.5, place.uv));
        let mean_uv = self.places.iter().map(|place| place.uv).sum::<Vec2>() / count;
        let mean_place = from_middle.clone().map(|(place, _)| place).sum::<Vec2>() / count;
        let (mut squares, mut by_uv) = (Mat2::ZERO, Mat2::ZERO);
        for (place, uv) in from_middle {
            let place = place - mean_place;
            squares += Mat2::from_cols(place * place.x, place * place.y);
            by_uv += Mat2::from_cols((uv - mean_uv) * place.x, (uv - mean_uv) * place.y);
        }
        let slopes = by_uv * squares.try_inverse()?;
        Some([mean_uv - slopes * mean_place, slopes.x_axis, slopes.y_axis])
    }

    fn has(&self, point: &SurfacePoint, reach: f32) -> bool {
        let reach = self.reach.max(reach);
        self.first.shading_normal.dot(point.shading_normal) > ONE_PIECE
            && (self.first.position - point.position).length() < reach
            // Nor are they far apart on the atlas.
            && (self.first.uv - point.uv).length()
                < 2.0 * reach * point.uv_per_length.max(self.first.uv_per_length) + 1e-6
    }
}

/// Fills `pieces` and returns the share of the pixel that escapes. Without `corners` no more than the first places are
/// looked at.
pub(super) fn pieces_of_pixel(
    surface: &Surface,
    camera: &Camera,
    row: usize,
    column: usize,
    settings: &FootprintSettings,
    corners: Option<[&Seen; 4]>,
    pieces: &mut Vec<Piece>,
) -> f32 {
    let mut side = settings.coarse_side.max(1);
    loop {
        pieces.clear();
        let mut escaped = 0usize;
        let total = side * side;
        for sample in 0..total {
            let place = Vec2::new(column as f32, row as f32) + place_in_pixel(sample, total);
            let (point, reach, direction) = match look(surface, camera, place) {
                (Seen::Front { point, reach }, direction) => (point, reach, direction),
                (Seen::Background, _) => {
                    escaped += 1;
                    continue;
                }
                (Seen::Back, _) => continue,
            };
            let index = match pieces.iter().position(|piece| piece.has(&point, reach)) {
                Some(index) => index,
                None => {
                    pieces.push(Piece {
                        samples: 0,
                        share: 0.0,
                        normal: Vec3::ZERO,
                        to_viewer: Vec3::ZERO,
                        texels: Vec::with_capacity(16),
                        places: Vec::with_capacity(4),
                        first: point,
                        reach,
                    });
                    pieces.len() - 1
                }
            };
            let piece = &mut pieces[index];
            piece.samples += 1;
            piece.normal += point.shading_normal;
            piece.to_viewer -= direction;
            piece.places.push(point);
            let texels_apart = point.uv_per_length * settings.map_size as f32 * reach / (REACH_PIXELS * side as f32);
            piece.texels.extend(texels_at(point.uv, settings.level(texels_apart), settings.map_size));
        }
        for piece in pieces.iter_mut() {
            piece.share = piece.samples as f32 / total as f32;
        }
        let agree = match (corners, pieces.as_slice()) {
            (None, _) => true,
            (Some(corners), [piece]) if piece.samples == total => {
                corners.iter().all(|corner| matches!(corner, Seen::Front { point, reach } if piece.has(point, *reach)))
            }
            (Some(corners), []) if escaped == total => corners.iter().all(|corner| matches!(corner, Seen::Background)),
            _ => false,
        };
        if agree || side >= settings.fine_side {
            if let [piece] = pieces.as_mut_slice()
                && piece.samples == total
                && settings.levels > 1
            {
                piece.cover_texels(settings);
            }
            return escaped as f32 / total as f32;
        }
        side = settings.fine_side;
    }
}
