//! What a camera sees of the surface, traced once: shading points with the texels they cover.
//!
//! A pixel is sampled at 4 places, or 64 where those and its corners do not agree (at 16, coverage errs by three per cent: a
//! hundredth of a picture's root mean square before a black background); or in its middle alone
//! ([`FootprintSettings::COARSE`]), for a first look. Samples on one smooth piece of surface become
//! one shading point: their mean normal and direction, and one list of texels with weights that sum to 1 (the exact mean
//! of their bilinear lookups). Most pixels have one; edges and silhouettes have several, each with its share. How far the
//! normals of a piece differ is kept as their variance, which makes its lobe wider.
//!
//! Where a pixel covers several texels, 4 places pick from a fine texture in place of averaging it: direct diffuse light is
//! some per cent off there, with 16 places a little less. Two places a texel along each direction bring fits no nearer.

mod pieces;

use self::pieces::{Piece, corners_of_pixels, pieces_of_pixel, uv_at_middle};
use super::points::{NO_POINT, VisibilityGrid};
use crate::math::parallel;
use crate::math::random::mix;
use crate::render::Surface;
use crate::scene::Camera;
use glam::{Vec2, Vec3};
#[cfg(test)]
use std::ops::Range;

/// A piece of surface behind a pixel.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint {
    /// Row-major pixel.
    pub pixel: u32,
    /// Share of the pixel, in (0, 1].
    pub share: f32,
    /// Unit shading normal.
    pub normal: Vec3,
    /// Variance of the normal over the piece, of both axes together, in squared radians.
    pub normal_variance: f32,
    /// Unit direction towards the viewer.
    pub to_viewer: Vec3,
    /// The point of the visibility grid that covers most of it: it serves the lobe.
    pub lobe_point: u32,
    /// Where its texels begin in [`ViewFootprints::texels`].
    pub first_texel: u32,
    /// Number of its texels.
    pub texel_count: u32,
    /// Where its points of the grid begin in [`ViewFootprints::lit`].
    pub first_lit: u32,
    /// Number of its points of the grid.
    pub lit_count: u32,
}

#[cfg(test)]
impl ShadingPoint {
    /// A whole pixel that looks straight at flat surface, with these of the view's texels and points of the grid.
    pub(crate) fn head_on(pixel: u32, texels: Range<u32>, lit: Range<u32>) -> Self {
        ShadingPoint {
            pixel,
            share: 1.0,
            normal: Vec3::Z,
            normal_variance: 0.0,
            to_viewer: Vec3::Z,
            lobe_point: 0,
            first_texel: texels.start,
            texel_count: texels.len() as u32,
            first_lit: lit.start,
            lit_count: lit.len() as u32,
        }
    }
}

/// The shading points of a view.
#[derive(Clone, Debug)]
pub struct ViewFootprints {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The shading points, in the order of their pixels.
    pub points: Vec<ShadingPoint>,
    /// Texels of square maps and their weights, shading point after shading point.
    pub texels: Vec<(u32, f32)>,
    /// Points of the visibility grid and their weights, shading point after shading point: diffuse light is averaged
    /// over the pixel, not taken at its middle, so that shadow edges are as soft as in a photo.
    pub lit: Vec<(u32, f32)>,
    /// Share of each pixel that escapes to the background; NaN where a pixel was left out, empty where only some shading
    /// points were kept.
    pub escaped: Vec<f32>,
}

/// How footprints are traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootprintSettings {
    /// Width and height of the maps in texels.
    pub map_size: usize,
    /// Levels of the maps, each half as wide and high as the one before, whose texels are listed one level after another. A
    /// lookup reads the finest on which it is less than two texels from the next, and where texels are finer than samples
    /// there are more lookups than samples. 1: the maps alone, one lookup a sample.
    pub levels: usize,
    /// Root of the number of samples of a pixel, at first.
    pub coarse_side: usize,
    /// The same where those at first and the corners do not agree.
    pub fine_side: usize,
}

impl FootprintSettings {
    /// One ray a pixel, through its middle.
    pub const COARSE: FootprintSettings = FootprintSettings { map_size: 512, levels: 1, coarse_side: 1, fine_side: 1 };

    /// The level for lookups so many texels of the maps apart. Rounded down: there are several lookups a pixel.
    fn level(&self, texels_apart: f32) -> usize {
        (texels_apart.max(1.0).log2() as usize).min(self.levels.max(1) - 1)
    }
}

impl Default for FootprintSettings {
    fn default() -> Self {
        FootprintSettings { coarse_side: 2, fine_side: 8, ..FootprintSettings::COARSE }
    }
}

impl ViewFootprints {
    /// Traces the footprints of a camera.
    pub fn trace(surface: &Surface, grid: &VisibilityGrid, camera: &Camera, settings: &FootprintSettings) -> Self {
        Self::trace_where(surface, grid, camera, settings, None)
    }

    /// The same but for pixels that are not wanted, by their number and the texture coordinate that their middle shows:
    /// those have no shading points.
    pub fn trace_where(
        surface: &Surface,
        grid: &VisibilityGrid,
        camera: &Camera,
        settings: &FootprintSettings,
        is_wanted: Option<&(dyn Fn(u32, Vec2) -> bool + Sync)>,
    ) -> Self {
        // Corners tell where more places are to be looked at.
        let corners = (settings.fine_side > settings.coarse_side).then(|| corners_of_pixels(surface, camera));
        let rows = parallel::map(camera.height, |row| {
            let mut made = ViewFootprints::empty(camera.width, 1);
            let mut pieces = Vec::new();
            for column in 0..camera.width {
                let pixel = row * camera.width + column;
                let is_left_out = is_wanted.is_some_and(|is_wanted| {
                    uv_at_middle(surface, camera, row, column).is_some_and(|uv| !is_wanted(pixel as u32, uv))
                });
                if is_left_out {
                    made.escaped.push(f32::NAN);
                    continue;
                }
                let around = corners.as_ref().map(|corners| {
                    [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(down, right)| &corners[row + down][column + right])
                });
                let escaped = pieces_of_pixel(surface, camera, row, column, settings, around, &mut pieces);
                made.escaped.push(escaped);
                for piece in &pieces {
                    made.add(grid, piece, pixel as u32);
                }
            }
            made
        });
        let mut all = ViewFootprints::empty(camera.width, camera.height);
        for row in rows {
            let (shift, shift_lit) = (all.texels.len() as u32, all.lit.len() as u32);
            all.points.extend(row.points.iter().map(|point| ShadingPoint {
                first_texel: point.first_texel + shift,
                first_lit: point.first_lit + shift_lit,
                ..*point
            }));
            all.texels.extend(row.texels);
            all.lit.extend(row.lit);
            all.escaped.extend(row.escaped);
        }
        all
    }

    /// The texels of a shading point and their weights.
    #[inline]
    pub fn texels_of(&self, point: &ShadingPoint) -> &[(u32, f32)] {
        &self.texels[point.first_texel as usize..(point.first_texel + point.texel_count) as usize]
    }

    /// The points of the grid that light a shading point, and their weights, which sum to 1.
    #[inline]
    pub fn lit_of(&self, point: &ShadingPoint) -> &[(u32, f32)] {
        &self.lit[point.first_lit as usize..(point.first_lit + point.lit_count) as usize]
    }

    /// Leaves out all shading points but these, which rise, and what is known of whole pixels.
    pub fn keep_points(&mut self, kept: impl Iterator<Item = usize>) {
        *self = self.of_points(kept);
    }

    /// These shading points alone, which rise, without what is known of whole pixels.
    pub fn of_points(&self, kept: impl Iterator<Item = usize>) -> Self {
        let mut made = ViewFootprints::empty(self.width, self.height);
        for index in kept {
            let point = &self.points[index];
            let (first_texel, first_lit) = (made.texels.len() as u32, made.lit.len() as u32);
            made.texels.extend_from_slice(self.texels_of(point));
            made.lit.extend_from_slice(self.lit_of(point));
            made.points.push(ShadingPoint { first_texel, first_lit, ..*point });
        }
        made.points.shrink_to_fit();
        made.texels.shrink_to_fit();
        made.lit.shrink_to_fit();
        made
    }

    /// Leaves out all pixels but one in `step`, scattered evenly.
    pub fn keep_one_in(&mut self, step: usize) {
        let stays = |pixel: usize| mix(pixel as u64).is_multiple_of(step.max(1) as u64);
        let mut escaped = std::mem::take(&mut self.escaped);
        let kept: Vec<usize> =
            (0..self.points.len()).filter(|&index| stays(self.points[index].pixel as usize)).collect();
        self.keep_points(kept.into_iter());
        for (_, share) in escaped.iter_mut().enumerate().filter(|(pixel, _)| !stays(*pixel)) {
            *share = f32::NAN;
        }
        self.escaped = escaped;
    }

    /// Bytes it takes.
    pub fn memory_bytes(&self) -> usize {
        self.points.len() * size_of::<ShadingPoint>()
            + (self.texels.len() + self.lit.len()) * size_of::<(u32, f32)>()
            + self.escaped.len() * size_of::<f32>()
    }

    fn empty(width: usize, height: usize) -> Self {
        ViewFootprints { width, height, points: Vec::new(), texels: Vec::new(), lit: Vec::new(), escaped: Vec::new() }
    }

    fn add(&mut self, grid: &VisibilityGrid, piece: &Piece, pixel: u32) {
        let normal = piece.normal.normalize_or(Vec3::Y);
        let to_viewer = piece.to_viewer.normalize_or(Vec3::Y);
        // A mean of normals may turn away from a mean of directions at the very rim.
        if normal.dot(to_viewer) <= 1e-4 {
            return;
        }
        let (first_texel, first_lit) = (self.texels.len() as u32, self.lit.len() as u32);
        let mut lit: Vec<(u32, f32)> = Vec::with_capacity(16);
        for tap in piece.places.iter().filter_map(|place| grid.tap(place)) {
            lit.extend(tap.index.into_iter().zip(tap.weight).filter(|&(_, weight)| weight > 0.0));
        }
        merge(lit, &mut self.lit);
        let heavier = |best: (u32, f32), next: &(u32, f32)| if next.1 > best.1 { *next } else { best };
        let (lobe_point, _) = self.lit[first_lit as usize..].iter().fold((NO_POINT, 0.0), heavier);
        if lobe_point == NO_POINT {
            return;
        }
        merge(piece.texels.clone(), &mut self.texels);
        self.points.push(ShadingPoint {
            pixel,
            share: piece.share,
            normal,
            normal_variance: piece.normal_variance(),
            to_viewer,
            lobe_point,
            first_texel,
            texel_count: self.texels.len() as u32 - first_texel,
            first_lit,
            lit_count: self.lit.len() as u32 - first_lit,
        });
    }
}

/// Adds a list with equal names joined and weights that sum to 1, in the order of names.
fn merge(mut list: Vec<(u32, f32)>, merged: &mut Vec<(u32, f32)>) {
    let first = merged.len();
    let total: f32 = list.iter().map(|(_, weight)| weight).sum();
    list.sort_unstable_by_key(|&(name, _)| name);
    for (name, weight) in list {
        let weight = weight / total;
        match merged[first..].last_mut() {
            Some(last) if last.0 == name => last.1 += weight,
            _ => merged.push((name, weight)),
        }
    }
}
