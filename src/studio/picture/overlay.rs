//! What lies over a picture: a second picture to compare with, a mask, lines, marks, a badge.

use super::source::{Place, Source};
use crate::image::Image;
use eframe::egui::Color32;
use glam::Vec2;
use std::sync::Arc;

/// What lies over a picture. The default is nothing.
#[derive(Clone, Debug, Default)]
pub struct Overlay<'a> {
    /// A second picture of the same frame, at any resolution.
    pub comparison: Option<Comparison>,
    /// Hatches the texels that are true; of the same frame, at any resolution.
    pub mask: Option<Arc<Image<bool>>>,
    /// Line segments, such as chart borders.
    pub lines: &'a [Lines],
    /// Marked places, such as the cursor of another panel.
    pub marks: &'a [Mark],
    /// Words in the upper left corner.
    pub badge: &'a str,
    /// Leaves out the grid and the numbers on enlarged texels.
    pub without_numbers: bool,
    /// Dragging with the primary button is left to the caller; the middle button still moves the picture.
    pub own_drag: bool,
}

/// A second picture of the same frame.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The second picture.
    pub other: Source,
    /// How the two are shown.
    pub mode: Compare,
    /// What the first and the second are called.
    pub names: [String; 2],
}

/// How two pictures are shown in one place.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Compare {
    /// The first left of a divider, the second right of it; the number is the divider's place in [0, 1] across the
    /// part of the picture that is visible.
    Wipe(f32),
    /// The second alone when true, else the first.
    Flip(bool),
    /// The second over the first with this opacity, in [0, 1].
    Blend(f32),
    /// First minus second.
    Difference {
        /// Luminance: green where the first is larger, red where the second is. Otherwise the absolute difference of
        /// each channel.
        signed: bool,
        /// The difference is multiplied by two to this power, on top of the exposure.
        gain_stops: f32,
    },
}

/// Line segments over a picture.
#[derive(Clone, Debug)]
pub struct Lines {
    /// Start and end of each.
    pub segments: Arc<Vec<(Vec2, Vec2)>>,
    /// What the numbers mean.
    pub space: LineSpace,
    /// Colour.
    pub colour: Color32,
}

/// What coordinates of lines mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineSpace {
    /// (column, row) in texels from the upper left corner.
    Texels,
    /// Texture coordinates (u, v) in [0, 1], v up.
    Texture,
}

impl LineSpace {
    /// The place in parts of width and height from the upper left corner.
    pub(super) fn part(self, point: Vec2, picture: (usize, usize)) -> Vec2 {
        match self {
            LineSpace::Texels => point / Vec2::new(picture.0.max(1) as f32, picture.1.max(1) as f32),
            LineSpace::Texture => Vec2::new(point.x, 1.0 - point.y),
        }
    }
}

/// A marked place.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Where.
    pub place: Place,
    /// Words beside it; may be empty.
    pub label: String,
    /// Colour of the cross.
    pub colour: Color32,
}
