//! Values under rows of screen pixels: a picture, a layer of numbers or a mask, read at the resolution of the screen.

use super::levels::Levels;
use super::source::{Source, Value};
use super::view::Frame;
use crate::image::Image;
use crate::image::area::{Footprint, Pyramid, Texel, mean_under};
use glam::Vec3;

/// The texels under the pixels of one picture: the level that is read, and what of it lies under each row and column.
pub(super) struct Reading<'a, T> {
    level: &'a Image<T>,
    rows: Vec<Footprint>,
    columns: Vec<Footprint>,
}

impl<'a, T: Texel> Reading<'a, T> {
    pub(super) fn new(base: &'a Image<T>, pyramid: &'a Pyramid<T>, frame: &Frame) -> Self {
        // A picture at another resolution lies over the same frame.
        let texels_per_pixel = [
            base.width() as f64 / (f64::from(frame.zoom) * frame.picture.0.max(1) as f64),
            base.height() as f64 / (f64::from(frame.zoom) * frame.picture.1.max(1) as f64),
        ];
        let visible = frame.visible();
        let level = pyramid.level(base, pyramid.level_for(texels_per_pixel[0].max(texels_per_pixel[1])));
        let along = |start: usize, length: usize, origin: f32, texels: usize, level_texels: usize, step: f64| {
            if texels == 0 {
                return Vec::new();
            }
            let level_scale = level_texels as f64 / texels as f64;
            let footprint = |pixel: usize| {
                let from = (pixel as f64 - f64::from(origin)) * step;
                match step > 1.0 + 1e-4 {
                    true => Footprint::new(from * level_scale, (from + step) * level_scale, level_texels),
                    false => {
                        let texel = (from + 0.5 * step).clamp(0.0, (texels - 1) as f64) * level_scale;
                        Footprint { first: (texel as usize).min(level_texels - 1), weights: vec![1.0] }
                    }
                }
            };
            (start..start + length).map(footprint).collect()
        };
        let (origin, [step_x, step_y]) = (frame.origin, texels_per_pixel);
        Reading {
            level,
            rows: along(visible.top, visible.height, origin.y, base.height(), level.height(), step_y),
            columns: along(visible.left, visible.width, origin.x, base.width(), level.width(), step_x),
        }
    }

    /// The values under one row of screen pixels.
    pub(super) fn row(&self, y: usize) -> Vec<T> {
        let Some(row) = self.rows.get(y) else { return Vec::new() };
        if let [_] = row.weights[..] {
            let width = self.level.width();
            let texels = &self.level.pixels()[row.first * width..][..width];
            let one_row = |column: &Footprint| match column.weights[..] {
                [_] => texels[column.first],
                _ => mean_under(row, column, |_, column| texels[column]),
            };
            return self.columns.iter().map(one_row).collect();
        }
        self.columns.iter().map(|column| mean_under(row, column, |row, column| self.level[(row, column)])).collect()
    }
}

/// A source ready to be read at screen pixels.
pub(super) enum Layer<'a> {
    Colour(Reading<'a, Vec3>),
    Numbers(Reading<'a, f32>, &'a Source),
    Empty,
}

impl<'a> Layer<'a> {
    pub(super) fn new(source: &'a Source, levels: &'a Levels, frame: &Frame) -> Self {
        match (source, levels) {
            (Source::Colour(image), Levels::Colour(pyramid)) => {
                Layer::Colour(Reading::new(image.as_ref(), pyramid, frame))
            }
            (Source::Numbers { image, .. }, Levels::Numbers(pyramid)) => {
                Layer::Numbers(Reading::new(image.as_ref(), pyramid, frame), source)
            }
            _ => Layer::Empty,
        }
    }

    pub(super) fn row(&self, y: usize) -> Row<'a> {
        match self {
            Layer::Colour(reading) => Row::Colour(reading.row(y)),
            Layer::Numbers(reading, source) => Row::Numbers(reading.row(y), source),
            Layer::Empty => Row::Empty,
        }
    }
}

/// The values under one row of screen pixels.
pub(super) enum Row<'a> {
    Colour(Vec<Vec3>),
    Numbers(Vec<f32>, &'a Source),
    Empty,
}

impl Row<'_> {
    #[inline]
    pub(super) fn at(&self, x: usize) -> Value {
        match self {
            Row::Colour(values) => Value::Colour(values.get(x).copied().unwrap_or(Vec3::NAN)),
            Row::Numbers(values, _) => Value::Number(values.get(x).copied().unwrap_or(f32::NAN)),
            Row::Empty => Value::Number(f32::NAN),
        }
    }
}

/// A mask read at the centres of screen pixels.
pub(super) struct Mask<'a> {
    mask: &'a Image<bool>,
    rows: Vec<usize>,
    columns: Vec<usize>,
}

impl<'a> Mask<'a> {
    pub(super) fn new(mask: &'a Image<bool>, frame: &Frame) -> Self {
        let visible = frame.visible();
        let along = |start: usize, length: usize, origin: f32, texels: usize, mask_texels: usize| {
            let step = mask_texels as f32 / (frame.zoom * texels.max(1) as f32);
            let texel = |pixel: usize| ((pixel as f32 + 0.5 - origin) * step).max(0.0) as usize;
            (start..start + length).map(|pixel| texel(pixel).min(mask_texels - 1)).collect()
        };
        Mask {
            mask,
            rows: along(visible.top, visible.height, frame.origin.y, frame.picture.1, mask.height()),
            columns: along(visible.left, visible.width, frame.origin.x, frame.picture.0, mask.width()),
        }
    }

    pub(super) fn at(&self, y: usize, x: usize) -> bool {
        self.mask[(self.rows[y], self.columns[x])]
    }
}
