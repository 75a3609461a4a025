//! Triangles on the texel grid: which texels a chart touches, which two charts share, what lies nearest.
//!
//! Rows of an [`Image`] run downwards and v runs upwards; inside this folder rows are counted from v = 0, and only the
//! public functions turn them over.

use crate::image::Image;
use crate::math::parallel;
use crate::scene::Mesh;
use glam::DVec2;
use rayon::prelude::*;

/// Texels by which a triangle has to reach into a texel to touch it: more than what `f32` coordinates lose.
pub(crate) const TOUCH_MARGIN: f64 = 2e-3;
/// Texels by which a centre has to lie inside a triangle to belong to it when overlaps are counted.
const INSIDE_MARGIN: f64 = 2e-3;

/// Corners of a triangle in texels, y up from v = 0.
pub(crate) fn corners_in_texels(mesh: &Mesh, triangle: usize, width: usize, height: usize) -> [DVec2; 3] {
    let size = DVec2::new(width as f64, height as f64);
    mesh.triangles[triangle].map(|vertex| mesh.uvs[vertex as usize].as_dvec2() * size)
}

/// Calls `span(row, first column, last column + 1)` for every row of texels in which a triangle reaches at least
/// `margin` into some texel. A triangle always touches at least one texel.
pub(crate) fn touched_spans(corners: [DVec2; 3], margin: f64, mut span: impl FnMut(i64, i64, i64)) {
    let range = |low: f64, high: f64| {
        let (first, end) = ((low + margin).floor() as i64, (high - margin).ceil() as i64);
        if first < end {
            (first, end)
        } else {
            ((0.5 * (low + high)).floor() as i64, (0.5 * (low + high)).floor() as i64 + 1)
        }
    };
    let [a, b, c] = corners;
    let (first_row, end_row) = range(a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y));
    for row in first_row..end_row {
        let (bottom, top) = (row as f64, row as f64 + 1.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut reach = |x: f64| (low, high) = (low.min(x), high.max(x));
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if (bottom..=top).contains(&from.y) {
                reach(from.x);
            }
            for level in [bottom, top] {
                if (from.y < level) != (to.y < level) {
                    let share = (level - from.y) / (to.y - from.y);
                    reach(from.x + share * (to.x - from.x));
                }
            }
        }
        if low <= high {
            let (first, end) = range(low, high);
            span(row, first, end);
        }
    }
}

/// Texels that a triangle touches: every texel whose square reaches into the surface, so that even a triangle smaller
/// than a texel has one. `false` everywhere for a mesh without UVs. Row 0 is at the top, v = 1.
pub fn covered_texels(mesh: &Mesh, width: usize, height: usize) -> Image<bool> {
    chart_texels(mesh, None, width, height).map(|&chart| chart != 0)
}

/// The chart (plus one) that touches each texel, 0 where none does; without `charts` every triangle counts as one.
pub(crate) fn chart_texels(mesh: &Mesh, charts: Option<&[u32]>, width: usize, height: usize) -> Image<u32> {
    let mut texels = Image::filled(width, height, 0);
    if mesh.uvs.is_empty() || width == 0 || height == 0 {
        return texels;
    }
    for triangle in 0..mesh.triangles.len() {
        let mark = charts.map_or(1, |charts| charts[triangle] + 1);
        touched_spans(corners_in_texels(mesh, triangle, width, height), TOUCH_MARGIN, |row, first, end| {
            if (0..height as i64).contains(&row) {
                let row = height - 1 - row as usize;
                for column in first.max(0)..end.min(width as i64) {
                    texels[(row, column as usize)] = mark;
                }
            }
        });
    }
    texels
}

/// Texels of a `resolution x resolution` map whose centre lies inside two triangles or more. UVs outside [0, 1] are
/// not counted. 0 for a mesh without UVs.
pub fn overlaps(mesh: &Mesh, resolution: usize) -> usize {
    if mesh.uvs.is_empty() {
        return 0;
    }
    let mut counts = vec![0u8; resolution * resolution];
    for triangle in 0..mesh.triangles.len() {
        let mut corners = corners_in_texels(mesh, triangle, resolution, resolution);
        if (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]) < 0.0 {
            corners.swap(1, 2);
        }
        let inward = |from: usize| {
            let (start, end) = (corners[from], corners[(from + 1) % 3]);
            (start, (end - start).normalize_or_zero())
        };
        let sides = [inward(0), inward(1), inward(2)];
        touched_spans(corners, 0.0, |row, first, end| {
            if !(0..resolution as i64).contains(&row) {
                return;
            }
            for column in first.max(0)..end.min(resolution as i64) {
                let centre = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                if sides.iter().all(|&(start, along)| along.perp_dot(centre - start) > INSIDE_MARGIN) {
                    let count = &mut counts[row as usize * resolution + column as usize];
                    *count = count.saturating_add(1);
                }
            }
        });
    }
    counts.into_iter().filter(|&count| count > 1).count()
}

/// Index in row-major order of the covered texel nearest to each texel: itself where it is covered. Ties go to the
/// smaller column, then the smaller row. Every texel keeps its own index when none is covered.
///
/// Exact Euclidean distances by lower envelopes of parabolas (Felzenszwalb and Huttenlocher 2012, "Distance Transforms
/// of Sampled Functions").
pub fn nearest_covered(covered: &Image<bool>) -> Image<u32> {
    let (width, height) = (covered.width(), covered.height());
    let own = Image::from_fn(width, height, |row, column| (row * width + column) as u32);
    if !covered.pixels().contains(&true) {
        return own;
    }
    // Within each column: the nearest covered row, stored by columns.
    let columns = parallel::map(width, |column| {
        let mut nearest = vec![-1i32; height];
        let mut last = -1i32;
        for row in 0..height {
            if covered[(row, column)] {
                last = row as i32;
            }
            nearest[row] = last;
        }
        let mut following = -1i32;
        for row in (0..height).rev() {
            if covered[(row, column)] {
                following = row as i32;
            }
            let above = nearest[row];
            if above < 0 || (following >= 0 && following - (row as i32) < row as i32 - above) {
                nearest[row] = following;
            }
        }
        nearest
    });
    // Across columns: the lower envelope of the parabolas (x - column)^2 + distance within the column^2.
    let mut nearest = own;
    parallel::each_chunk(nearest.pixels_mut(), width, &|row, line| {
        let mut hull: Vec<(usize, i64, f64)> = Vec::with_capacity(width);
        for (column, rows) in columns.iter().enumerate() {
            if rows[row] < 0 {
                continue;
            }
            let height = (i64::from(rows[row]) - row as i64).pow(2) + (column as i64).pow(2);
            let mut start = f64::NEG_INFINITY;
            while let Some(&(other, other_height, other_start)) = hull.last() {
                start = (height - other_height) as f64 / (2.0 * (column as f64 - other as f64));
                if start > other_start {
                    break;
                }
                hull.pop();
                start = f64::NEG_INFINITY;
            }
            hull.push((column, height, start));
        }
        let mut at = 0;
        for (column, texel) in line.iter_mut().enumerate() {
            while at + 1 < hull.len() && hull[at + 1].2 < column as f64 {
                at += 1;
            }
            let from = hull[at].0;
            *texel = (columns[from][row] as usize * width + from) as u32;
        }
    });
    nearest
}

/// Fills every texel that is not covered with the value of the nearest covered one.
pub fn dilate<T: Clone>(map: &Image<T>, nearest: &Image<u32>) -> Image<T> {
    nearest.map(|&index| map.pixels()[index as usize].clone())
}

/// Fewest empty texels between two charts, counted along the grid with diagonal steps; `None` when there are fewer than
/// two charts. `texels` is the chart (plus one) of each texel.
pub(crate) fn narrowest_gutter(texels: &Image<u32>) -> Option<usize> {
    let (width, height) = (texels.width() as i64, texels.height() as i64);
    let mut label = texels.pixels().to_vec();
    // Only texels at the rim of a chart have anything to do.
    let is_inside = |texel: usize| {
        let (row, column) = (texel as i64 / width, texel as i64 % width);
        let same = |first: usize| label[first..first + 3].iter().all(|&other| other == label[texel]);
        (1..height - 1).contains(&row)
            && (1..width - 1).contains(&column)
            && [texel - width as usize, texel, texel + width as usize].into_iter().all(|middle| same(middle - 1))
    };
    let is_at_rim = |&texel: &u32| label[texel as usize] != 0 && !is_inside(texel as usize);
    let mut front: Vec<u32> = (0..label.len() as u32).into_par_iter().filter(is_at_rim).collect();
    let mut distance: Vec<u32> = label.iter().map(|&chart| if chart == 0 { u32::MAX } else { 0 }).collect();
    let mut narrowest: Option<u32> = None;
    let mut steps = 0;
    // Every chart grows by a texel a round; where two meet, the rounds so far are the gutter between them.
    while !front.is_empty() && narrowest.is_none_or(|gutter| 2 * steps <= gutter) {
        let mut following = Vec::new();
        for &texel in &front {
            let (row, column) = (i64::from(texel) / width, i64::from(texel) % width);
            for (down, right) in [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)] {
                let (row, column) = (row + down, column + right);
                if !(0..height).contains(&row) || !(0..width).contains(&column) {
                    continue;
                }
                let other = (row * width + column) as usize;
                if label[other] == 0 {
                    label[other] = label[texel as usize];
                    distance[other] = steps + 1;
                    following.push(other as u32);
                } else if label[other] != label[texel as usize] {
                    let gutter = distance[other] + distance[texel as usize];
                    narrowest = Some(narrowest.map_or(gutter, |least| least.min(gutter)));
                }
            }
        }
        front = following;
        steps += 1;
    }
    narrowest.map(|gutter| gutter as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec2, Vec3};

    #[test]
    fn the_nearest_covered_texel_is_the_one_a_search_finds() {
        let covered = Image::from_fn(23, 17, |row, column| (row * 31 + column * 17 + row * column) % 29 == 0);
        let nearest = nearest_covered(&covered);
        for row in 0..17usize {
            for column in 0..23usize {
                let squared = |index: usize| (index / 23).abs_diff(row).pow(2) + (index % 23).abs_diff(column).pow(2);
                let best = (0..23 * 17).filter(|&i| covered.pixels()[i]).map(squared).min().unwrap();
                assert_eq!(squared(nearest[(row, column)] as usize), best, "row {row} column {column}");
            }
        }
        let none = nearest_covered(&Image::filled(3, 2, false));
        assert_eq!(none.pixels(), &[0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn gutters_are_counted_in_empty_texels() {
        let strip = |text: &str| {
            let pixels = text.bytes().map(|b| u32::from(b - b'0')).collect::<Vec<_>>();
            narrowest_gutter(&Image::from_pixels(text.len(), 1, pixels))
        };
        assert_eq!(strip("1100002"), Some(4));
        assert_eq!(strip("110002"), Some(3));
        assert_eq!(strip("100000203"), Some(1));
        assert_eq!(strip("12"), Some(0));
        assert_eq!(strip("1011"), None);
    }

    #[test]
    fn a_triangle_smaller_than_a_texel_covers_one_and_v_points_up() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            uvs: vec![Vec2::new(0.13, 0.8801), Vec2::new(0.1301, 0.8801), Vec2::new(0.13, 0.8802)],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let covered = covered_texels(&mesh, 8, 8);
        assert_eq!(covered.pixels().iter().filter(|&&c| c).count(), 1);
        assert!(covered[(0, 1)]);
    }
}
