//! A chart as the texels it touches, in four quarter turns.

use super::raster::touched_spans;
use glam::{DMat2, DVec2};

/// Turn of a chart into its box of least area, and the size of that box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Boxed {
    /// Rotation to apply.
    pub rotation: DMat2,
    /// Lower corner after rotation.
    pub low: DVec2,
    /// Size after rotation, wider than high.
    pub size: DVec2,
}

/// The box of least area around points: one of its sides lies on the convex hull.
pub(crate) fn least_box(points: &[DVec2]) -> Boxed {
    let hull = convex_hull(points);
    let mut best: Option<(f64, Boxed)> = None;
    for index in 0..hull.len() {
        let along = (hull[(index + 1) % hull.len()] - hull[index]).normalize_or(DVec2::X);
        let rotation = DMat2::from_cols(DVec2::new(along.x, -along.y), DVec2::new(along.y, along.x));
        let boxed = bounds(&hull, rotation);
        let area = boxed.size.x * boxed.size.y;
        // Equal boxes keep the first side, so that rounding does not choose.
        if best.is_none_or(|(least, _)| area < least * (1.0 - 1e-9)) {
            best = Some((area, boxed));
        }
    }
    let boxed = best.map_or_else(|| bounds(points, DMat2::IDENTITY), |(_, boxed)| boxed);
    if boxed.size.x >= boxed.size.y {
        return boxed;
    }
    bounds(&hull, DMat2::from_cols(DVec2::Y, DVec2::NEG_X) * boxed.rotation)
}

/// The box around points after a rotation.
pub(crate) fn bounds(points: &[DVec2], rotation: DMat2) -> Boxed {
    let turned = points.iter().map(|&point| rotation * point);
    let (low, high) = turned.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    Boxed { rotation, low, size: high - low }
}

/// Convex hull, counter-clockwise (Andrew 1979, monotone chain).
fn convex_hull(points: &[DVec2]) -> Vec<DVec2> {
    let mut sorted = points.to_vec();
    sorted.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(point - a) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter().copied());
    hull.extend(chain(&mut sorted.iter().rev().copied()));
    if hull.is_empty() { sorted } else { hull }
}

/// Touched texels of a chart as runs, row by row from below.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    pub width: usize,
    pub height: usize,
    /// Runs (first, end) of each row.
    pub rows: Vec<Vec<(u32, u32)>>,
    /// Longest run of each row.
    pub longest: Vec<u32>,
    /// Rows in the order in which a collision is most likely to show.
    pub order: Vec<u32>,
}

impl Shape {
    /// Rasterises the inside of loops, given in texels with the lower corner of their box at the origin: the texels
    /// that an edge touches, and those whose centre lies inside by the even-odd rule. Every texel that the chart touches
    /// is one or the other.
    pub fn new(width: usize, height: usize, loops: &[Vec<DVec2>]) -> Self {
        let mut rows = vec![Vec::new(); height];
        let mut crossings = vec![Vec::new(); height];
        for points in loops {
            for (index, &from) in points.iter().enumerate() {
                let to = points[(index + 1) % points.len()];
                touched_spans([from, to, to], 0.0, |row, first, end| {
                    let row = row.clamp(0, height as i64 - 1) as usize;
                    let (first, end) = (first.clamp(0, width as i64 - 1), end.clamp(1, width as i64));
                    rows[row].push((first as u32, end as u32));
                });
                let centre_rows = |y: f64| (y - 0.5).ceil().clamp(0.0, height as f64) as usize;
                let crossed = centre_rows(from.y.min(to.y))..centre_rows(from.y.max(to.y));
                for (row, crossings) in crossings.iter_mut().enumerate().take(crossed.end).skip(crossed.start) {
                    let share = (row as f64 + 0.5 - from.y) / (to.y - from.y);
                    crossings.push(from.x + share * (to.x - from.x));
                }
            }
        }
        for (runs, crossings) in rows.iter_mut().zip(&mut crossings) {
            crossings.sort_unstable_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let [first, end] = [pair[0], pair[1]].map(|x| (x - 0.5).ceil().clamp(0.0, width as f64) as u32);
                if first < end {
                    runs.push((first, end));
                }
            }
            join_runs(runs);
        }
        Self::from_rows(width, rows)
    }

    fn from_rows(width: usize, rows: Vec<Vec<(u32, u32)>>) -> Self {
        let longest: Vec<u32> =
            rows.iter().map(|runs| runs.iter().map(|&(first, end)| end - first).max().unwrap_or(0)).collect();
        // The longest run first, then rows spread evenly: neighbouring rows collide alike.
        let height = rows.len();
        let bits = usize::BITS - height.leading_zeros();
        let mut order: Vec<u32> = (0..1u32 << bits)
            .map(|index| index.reverse_bits() >> (u32::BITS - bits.max(1)))
            .filter(|&row| (row as usize) < height)
            .collect();
        if let Some(widest) = (0..height).max_by_key(|&row| (longest[row], height - row)) {
            order.retain(|&row| row as usize != widest);
            order.insert(0, widest as u32);
        }
        Shape { width, height, rows, longest, order }
    }

    /// Turned by a quarter, counter-clockwise: (x, y) -> (height - y, x).
    pub fn quarter_turn(&self) -> Self {
        let mut rows = vec![Vec::new(); self.width];
        for (row, runs) in self.rows.iter().enumerate().rev() {
            let column = (self.height - 1 - row) as u32;
            for &(first, end) in runs {
                for turned in &mut rows[first as usize..end as usize] {
                    let turned: &mut Vec<(u32, u32)> = turned;
                    match turned.last_mut() {
                        Some(last) if last.1 == column => last.1 += 1,
                        _ => turned.push((column, column + 1)),
                    }
                }
            }
        }
        Self::from_rows(self.height, rows)
    }
}

fn join_runs(runs: &mut Vec<(u32, u32)>) {
    runs.sort_unstable();
    let mut joined: Vec<(u32, u32)> = Vec::with_capacity(runs.len().min(8));
    for &(first, end) in runs.iter() {
        match joined.last_mut() {
            Some(last) if last.1 >= first => last.1 = last.1.max(end),
            _ => joined.push((first, end)),
        }
    }
    *runs = joined;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_of_a_turned_rectangle_is_the_rectangle() {
        let turn = DVec2::from_angle(0.4);
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 5.0), (0.0, 5.0), (1.0, 1.0)];
        let points: Vec<DVec2> = corners.iter().map(|&(x, y)| turn.rotate(DVec2::new(x, y))).collect();
        let boxed = least_box(&points);
        assert!((boxed.size - DVec2::new(5.0, 2.0)).length() < 1e-9, "{:?}", boxed.size);
    }

    #[test]
    fn four_quarter_turns_are_none() {
        let shape = Shape::new(7, 4, &[vec![DVec2::ZERO, DVec2::new(6.5, 0.2), DVec2::new(2.0, 3.7)]]);
        let once = shape.quarter_turn();
        assert_eq!((once.width, once.height), (4, 7));
        assert_eq!(once.quarter_turn().quarter_turn().quarter_turn().rows, shape.rows);
        // The lower right corner goes to the upper right.
        assert_eq!(once.rows[6].last().map(|run| run.1), Some(4));
    }
}
