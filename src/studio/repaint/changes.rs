//! Where two frames differ.

use egui::{Rect, pos2};
use std::collections::HashMap;

/// Rectangles beyond which all become one: each is a pass over what it touches.
const MOST_PARTS: usize = 12;

/// Pixels from `min` to before `max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PixelRect {
    min: [u32; 2],
    max: [u32; 2],
}

impl PixelRect {
    /// All of a window.
    pub fn of_size(size: [u32; 2]) -> Self {
        PixelRect { min: [0, 0], max: size }
    }

    /// Every pixel of a window that a rectangle in points touches, and one more, since edges are soft and are rounded.
    pub fn around(rect: Rect, pixels_per_point: f32, size: [u32; 2]) -> Self {
        if !rect.is_positive() {
            return PixelRect { min: [0, 0], max: [0, 0] };
        }
        let low = |value: f32, most: u32| ((value * pixels_per_point).floor() - 1.0).clamp(0.0, most as f32) as u32;
        let high = |value: f32, most: u32| ((value * pixels_per_point).ceil() + 1.0).clamp(0.0, most as f32) as u32;
        PixelRect {
            min: [low(rect.min.x, size[0]), low(rect.min.y, size[1])],
            max: [high(rect.max.x, size[0]), high(rect.max.y, size[1])],
        }
    }

    /// The pixels of a rectangle in points with hard edges, as a viewport and a scissor round them.
    pub fn exactly(rect: Rect, pixels_per_point: f32, size: [u32; 2]) -> Self {
        let rounded = |value: f32, most: u32| (value * pixels_per_point).round().clamp(0.0, most as f32) as u32;
        PixelRect {
            min: [rounded(rect.min.x, size[0]), rounded(rect.min.y, size[1])],
            max: [rounded(rect.max.x, size[0]), rounded(rect.max.y, size[1])],
        }
    }

    /// In points, whose borders become these pixels again when they are rounded.
    pub fn in_points(&self, pixels_per_point: f32) -> Rect {
        let point = |at: [u32; 2]| pos2(at[0] as f32 / pixels_per_point, at[1] as f32 / pixels_per_point);
        Rect::from_min_max(point(self.min), point(self.max))
    }

    fn is_empty(&self) -> bool {
        self.min[0] >= self.max[0] || self.min[1] >= self.max[1]
    }

    /// Whether they have a pixel in common.
    pub fn overlaps(&self, other: &Self) -> bool {
        !self.is_empty()
            && !other.is_empty()
            && (0..2).all(|axis| self.min[axis] < other.max[axis] && other.min[axis] < self.max[axis])
    }

    /// Whether every pixel of the other is one of its own.
    pub fn contains(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.min[axis] <= other.min[axis] && other.max[axis] <= self.max[axis])
    }

    fn union(&self, other: &Self) -> Self {
        PixelRect {
            min: [0, 1].map(|axis| self.min[axis].min(other.min[axis])),
            max: [0, 1].map(|axis| self.max[axis].max(other.max[axis])),
        }
    }
}

/// Something that a frame draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drawn {
    /// Equal where the same is drawn; `None` for what is never the same.
    pub identity: Option<u64>,
    /// All pixels that it may touch.
    pub bounds: PixelRect,
}

/// The rectangles in which a frame may differ from the one before, none overlapping another.
///
/// What is drawn in both, in the same order, changes no pixel by itself; whatever is drawn in one of them alone may change
/// all of its own.
pub(super) fn between(before: &[Drawn], now: &[Drawn]) -> Vec<PixelRect> {
    let mut places: HashMap<u64, Vec<usize>> = HashMap::new();
    for (index, drawn) in before.iter().enumerate().rev() {
        if let Some(identity) = drawn.identity {
            places.entry(identity).or_default().push(index);
        }
    }
    let mut is_kept = vec![false; before.len()];
    let mut next = 0;
    let mut parts = Vec::new();
    for drawn in now {
        let place = drawn.identity.and_then(|identity| {
            let places = places.get_mut(&identity)?;
            while places.last().is_some_and(|&place| place < next) {
                places.pop();
            }
            places.pop()
        });
        match place {
            Some(place) => {
                is_kept[place] = true;
                next = place + 1;
            }
            None => parts.push(drawn.bounds),
        }
    }
    let gone = before.iter().zip(&is_kept).filter(|(_, is_kept)| !**is_kept).map(|(drawn, _)| drawn.bounds);
    parts.extend(gone);
    joined(parts)
}

/// The same pixels, and more, by rectangles that do not overlap.
fn joined(parts: Vec<PixelRect>) -> Vec<PixelRect> {
    let mut apart: Vec<PixelRect> = Vec::new();
    for mut part in parts.into_iter().filter(|part| !part.is_empty()) {
        while let Some(index) = apart.iter().position(|other| other.overlaps(&part)) {
            part = part.union(&apart.swap_remove(index));
        }
        apart.push(part);
    }
    if apart.len() > MOST_PARTS {
        let all = apart.iter().skip(1).fold(apart[0], |all, part| all.union(part));
        apart = vec![all];
    }
    apart
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rect(x: u32, y: u32, width: u32, height: u32) -> PixelRect {
        PixelRect { min: [x, y], max: [x + width, y + height] }
    }

    fn drawn(identity: u64, bounds: PixelRect) -> Drawn {
        Drawn { identity: Some(identity), bounds }
    }

    #[test]
    fn what_comes_between_others_or_goes_changes_its_own_pixels_alone() {
        let background = drawn(1, rect(0, 0, 100, 100));
        let (text, menu) = (drawn(2, rect(10, 10, 20, 5)), drawn(3, rect(60, 60, 10, 10)));
        assert_eq!(between(&[background, menu], &[background, text, menu]), [text.bounds]);
        assert_eq!(between(&[background, text, menu], &[background, menu]), [text.bounds]);
        assert!(between(&[background, text, menu], &[background, text, menu]).is_empty());
        // Which of two lies above is no longer the same.
        assert_eq!(between(&[background, text, menu], &[background, menu, text]).len(), 1);
        let callback = Drawn { identity: None, bounds: rect(0, 50, 10, 10) };
        assert_eq!(between(&[background, callback], &[background, callback]), [callback.bounds]);
    }

    #[test]
    fn points_become_the_same_pixels_again_at_any_scale() {
        for scale in [0.5, 1.0, 1.1, 1.25, 1.7, 2.0, 3.0] {
            for (x, width) in [(0, 1), (13, 7), (811, 629)] {
                let points = rect(x, x / 2, width, width + 1).in_points(scale);
                let rounded =
                    [points.min.x, points.min.y, points.max.x, points.max.y].map(|at| (at * scale).round() as u32);
                assert_eq!(rounded, [x, x / 2, x + width, x / 2 + width + 1], "{scale}");
            }
        }
        let beyond = Rect::from_min_max(pos2(-1e9, f32::NEG_INFINITY), pos2(1e9, f32::INFINITY));
        assert_eq!(PixelRect::around(beyond, 2.0, [30, 20]), PixelRect::of_size([30, 20]));
        assert!(PixelRect::around(Rect::NOTHING, 2.0, [30, 20]).is_empty());
    }

    /// What is seen of shapes that each fill a rectangle, drawn where a pixel is to be drawn.
    fn painted(picture: &mut [u64; 256], shapes: &[Drawn], parts: &[PixelRect]) {
        for (index, pixel) in picture.iter_mut().enumerate() {
            let at = rect(index as u32 % 16, index as u32 / 16, 1, 1);
            if parts.iter().any(|part| part.overlaps(&at)) {
                *pixel = 0;
                for shape in shapes.iter().filter(|shape| shape.bounds.overlaps(&at)) {
                    *pixel = pixel.wrapping_mul(31).wrapping_add(shape.identity.unwrap_or(99));
                }
            }
        }
    }

    proptest! {
        /// Drawing what changed gives the picture that drawing everything gives.
        #[test]
        fn nothing_that_changed_is_missed(frames in prop::collection::vec(
            prop::collection::vec((1u64..6, 0u32..12, 0u32..12), 0..12), 2..6)
        ) {
            let all = [PixelRect::of_size([16, 16])];
            let mut kept = [0; 256];
            let mut before: Vec<Drawn> = Vec::new();
            for frame in frames {
                // What a shape looks like decides where it is: equal ones are equal.
                let now: Vec<Drawn> = frame
                    .iter()
                    .map(|&(kind, x, y)| drawn(kind + 10 * u64::from(x) + 1000 * u64::from(y), rect(x, y, 1 + x % 4, 1 + y % 4)))
                    .collect();
                let parts = between(&before, &now);
                painted(&mut kept, &now, &parts);
                let mut whole = [0; 256];
                painted(&mut whole, &now, &all);
                prop_assert_eq!(kept, whole);
                for (index, part) in parts.iter().enumerate() {
                    prop_assert!(parts[index + 1..].iter().all(|other| !other.overlaps(part)));
                }
                before = now;
            }
        }
    }
}
