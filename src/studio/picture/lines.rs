//! Line segments drawn into the pixels of a panel, so that a hundred thousand of them cost nothing while nothing moves.

use super::overlay::Lines;
use super::view::Frame;
use eframe::egui::{Color32, ColorImage};
use glam::Vec2;

/// Pixels that lines may take in one painting, in all; what is beyond is left out.
const MOST_PIXELS: usize = 1_500_000;

/// Draws the lines over the visible part of a frame, with smooth edges, so many pixels wide.
pub(super) fn draw(image: &mut ColorImage, lines: &[Lines], frame: &Frame, width: f32) {
    let visible = frame.visible();
    let corner = Vec2::new(visible.left as f32, visible.top as f32);
    let size = Vec2::new(frame.picture.0 as f32, frame.picture.1 as f32) * frame.zoom;
    // Pixel centres lie on whole numbers from here on.
    let shift = frame.origin - corner - Vec2::splat(0.5);
    let most = Vec2::new(visible.width as f32, visible.height as f32);
    let mut left = MOST_PIXELS;
    for line in lines {
        // Channels not multiplied by opacity.
        let colour = line.colour.to_srgba_unmultiplied();
        for &(start, end) in line.segments.iter() {
            let point = |point: Vec2| line.space.part(point, frame.picture) * size + shift;
            let Some((start, end)) = clipped(point(start), point(end), most) else { continue };
            let pixels = (end - start).abs().max_element() as usize + 1;
            if pixels > left {
                return;
            }
            left -= pixels;
            segment(image, start, end, colour, width);
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

/// One step a pixel along the longer axis; across it each pixel gets the part of it that the line covers.
fn segment(image: &mut ColorImage, start: Vec2, end: Vec2, colour: [u8; 4], width: f32) {
    let along = end - start;
    let steep = along.y.abs() > along.x.abs();
    let longer = along.abs().max_element();
    let steps = longer.ceil().max(1.0);
    // A slanting line is cut slantwise.
    let half = 0.5 * width * if longer > 0.0 { along.length() / longer } else { 1.0 };
    for step in 0..=steps as usize {
        let point = start + along * (step as f32 / steps);
        let (main, across) = if steep { (point.y, point.x) } else { (point.x, point.y) };
        let (low, high) = (across - half, across + half);
        let main = nearest(main);
        for pixel in nearest(low)..=nearest(high) {
            let share = high.min(pixel as f32 + 0.5) - low.max(pixel as f32 - 0.5);
            let (x, y) = if steep { (pixel, main) } else { (main, pixel) };
            blend(image, x, y, colour, share);
        }
    }
}

/// The nearest whole number of one above -1000, without the call that rounding is on older processors.
fn nearest(place: f32) -> i64 {
    (place + 1000.5) as i64 - 1000
}

fn blend(image: &mut ColorImage, x: i64, y: i64, colour: [u8; 4], share: f32) {
    let [width, height] = image.size;
    if x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < height && share > 0.0 {
        let pixel = &mut image.pixels[y as usize * width + x as usize];
        let part = (share.min(1.0) * f32::from(colour[3]) * (256.0 / 255.0)) as u32;
        let mixed = |under: u8, over: u8| ((u32::from(under) * (256 - part) + u32::from(over) * part) >> 8) as u8;
        *pixel =
            Color32::from_rgb(mixed(pixel.r(), colour[0]), mixed(pixel.g(), colour[1]), mixed(pixel.b(), colour[2]));
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
        draw(&mut image, &[Lines { segments: Arc::new(segments), space, colour: Color32::WHITE }], &frame, 1.5);
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
