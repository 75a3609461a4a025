//! Line segments drawn into the pixels of a panel, so that a hundred thousand of them cost nothing while nothing moves.

use super::overlay::Lines;
use super::view::Frame;
use eframe::egui::{Color32, ColorImage};
use glam::Vec2;

/// Pixels that lines may take in one painting, in all; what is beyond is left out.
const MOST_PIXELS: usize = 3_000_000;

/// Draws the lines over the visible part of a frame, with smooth edges, so many pixels wide.
pub(super) fn draw(image: &mut ColorImage, lines: &[Lines], frame: &Frame, width: u32) {
    let visible = frame.visible();
    let corner = Vec2::new(visible.left as f32, visible.top as f32);
    let size = Vec2::new(frame.picture.0 as f32, frame.picture.1 as f32) * frame.zoom;
    // Pixel centres lie on whole numbers from here on.
    let shift = frame.origin - corner - Vec2::splat(0.5);
    let most = Vec2::new(visible.width as f32, visible.height as f32);
    let mut left = MOST_PIXELS;
    for line in lines {
        for &(start, end) in line.segments.iter() {
            let point = |point: Vec2| line.space.part(point, frame.picture) * size + shift;
            let Some((start, end)) = clipped(point(start), point(end), most) else { continue };
            let pixels = (end - start).abs().max_element() as usize + 1;
            if pixels > left {
                return;
            }
            left -= pixels;
            segment(image, start, end, line.colour, width);
        }
    }
}

/// The part of a segment within one pixel around `0..most` (Liang and Barsky 1984); `None` when there is none.
fn clipped(start: Vec2, end: Vec2, most: Vec2) -> Option<(Vec2, Vec2)> {
    let along = end - start;
    if !start.is_finite() || !along.is_finite() {
        return None;
    }
    let (mut enters, mut leaves) = (0.0f32, 1.0f32);
    for axis in 0..2 {
        let (low, high) = (-1.0 - start[axis], most[axis] + 1.0 - start[axis]);
        if along[axis] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (low / along[axis], high / along[axis]);
        enters = enters.max(a.min(b));
        leaves = leaves.min(a.max(b));
    }
    (enters <= leaves).then(|| (start + along * enters, start + along * leaves))
}

/// One pixel a step along the longer axis, shared between the two pixels nearest across it.
fn segment(image: &mut ColorImage, start: Vec2, end: Vec2, colour: Color32, width: u32) {
    let along = end - start;
    let steep = along.y.abs() > along.x.abs();
    let steps = along.abs().max_element().ceil().max(1.0);
    for step in 0..=steps as usize {
        let point = start + along * (step as f32 / steps);
        let (main, across) = if steep { (point.y, point.x) } else { (point.x, point.y) };
        let across = across - (width as f32 - 1.0) / 2.0;
        let base = across.floor();
        let fraction = across - base;
        for offset in 0..=width {
            let share = match offset {
                0 => 1.0 - fraction,
                _ if offset == width => fraction,
                _ => 1.0,
            };
            let (main, across) = (main.round() as i64, base as i64 + i64::from(offset));
            let (x, y) = if steep { (across, main) } else { (main, across) };
            blend(image, x, y, colour, share);
        }
    }
}

fn blend(image: &mut ColorImage, x: i64, y: i64, colour: Color32, share: f32) {
    let [width, height] = image.size;
    if x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < height && share > 0.0 {
        let pixel = &mut image.pixels[y as usize * width + x as usize];
        let opacity = share * f32::from(colour.a()) / 255.0;
        *pixel = pixel.lerp_to_gamma(colour.to_opaque(), opacity);
    }
}

#[cfg(test)]
mod tests {
    use super::super::overlay::LineSpace;
    use super::super::view::PictureView;
    use super::*;
    use std::sync::Arc;

    fn drawn(segments: Vec<(Vec2, Vec2)>, space: LineSpace) -> ColorImage {
        let frame = PictureView::default().frame((10, 10), (100, 100));
        let mut image = ColorImage::filled([100, 100], Color32::BLACK);
        draw(&mut image, &[Lines { segments: Arc::new(segments), space, colour: Color32::WHITE }], &frame, 1);
        image
    }

    #[test]
    fn a_line_lies_where_its_coordinates_say() {
        // Across the middle of the row of texels 2: rows 25 and 24 share it.
        let texels = drawn(vec![(Vec2::new(0.0, 2.5), Vec2::new(10.0, 2.5))], LineSpace::Texels);
        let texture = drawn(vec![(Vec2::new(0.0, 0.75), Vec2::new(1.0, 0.75))], LineSpace::Texture);
        assert_eq!(texels.pixels, texture.pixels);
        for y in 0..100 {
            let lit = texels.pixels[y * 100 + 50].r() > 60;
            assert_eq!(lit, y == 24 || y == 25, "row {y}");
        }
    }

    #[test]
    fn far_long_and_broken_lines_do_no_harm() {
        let hard = [0.0, 1e30, -1e30, f32::MAX, f32::NAN, f32::INFINITY, 5.0];
        let points: Vec<Vec2> = hard.iter().flat_map(|&x| hard.map(|y| Vec2::new(x, y))).collect();
        let segments = points.iter().flat_map(|&start| points.iter().map(move |&end| (start, end))).collect();
        drawn(segments, LineSpace::Texels);
        let many = vec![(Vec2::new(-5.0, -5.0), Vec2::new(15.0, 15.0)); 100_000];
        let began = std::time::Instant::now();
        let image = drawn(many, LineSpace::Texels);
        println!("a hundred thousand lines: {:.1} ms", 1e3 * began.elapsed().as_secs_f64());
        assert!(image.pixels[50 * 100 + 50].r() > 200);
        let outside = drawn(vec![(Vec2::new(20.0, 0.0), Vec2::new(20.0, 10.0))], LineSpace::Texels);
        assert!(outside.pixels.iter().all(|&pixel| pixel == Color32::BLACK));
    }
}
