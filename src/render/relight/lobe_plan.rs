//! At which shading points of a view lobes are integrated, and how the others interpolate between them.
//!
//! `S0 - S5` and `S5` change slowly over smooth surface: they are taken at the corners of squares of pixels and
//! interpolated, before F0 is multiplied in. Where the corners do not speak for a pixel (another surface, a normal or a
//! width that is not about their mean) it has an integral of its own. What a light sends is not asked, so that the plan
//! serves all of them.

use crate::render::cached::{ShadingPoint, ViewFootprints, VisibilityGrid};
use crate::scene::Camera;
use glam::Vec3;
use rayon::prelude::*;

/// Pixels from corner to corner.
const SPACING: usize = 2;
/// How far a normal may lie from the mean of those at the corners, as a share of the lobe's microfacet width.
const NORMAL_TOLERANCE: f32 = 0.05;
/// How far the logarithm of a width may lie from that mean.
const WIDTH_TOLERANCE: f32 = 0.05;
/// Points with integrals, at most: beyond it tolerances are doubled.
const MOST_POINTS: usize = 60_000;
/// How often they are doubled, at most; then whatever corner there is speaks.
const MOST_DOUBLINGS: usize = 4;
const NO_POINT: u32 = u32::MAX;

/// Four places in a list and their weights, which sum to 1.
type Tap = ([u32; 4], [f32; 4]);

/// Where lobes are integrated, and what each shading point makes of that.
pub struct LobePlan {
    /// Shading points with integrals, those of one point of the grid together.
    pub points: Vec<u32>,
    /// Of each shading point: places in `points`, and weights. Empty without lobes.
    taps: Vec<Tap>,
}

impl LobePlan {
    /// A plan without lobes.
    pub fn empty() -> Self {
        LobePlan { points: Vec::new(), taps: Vec::new() }
    }

    /// The plan of a view.
    pub fn of(footprints: &ViewFootprints, materials: &[[f32; 7]], grid: &VisibilityGrid, camera: &Camera) -> Self {
        let corners = Corners::new(footprints, materials, grid, camera);
        let mut taps = Vec::new();
        for doubling in 0..=MOST_DOUBLINGS {
            let factor = if doubling == MOST_DOUBLINGS { f32::INFINITY } else { (1 << doubling) as f32 };
            let points = footprints.points.par_iter().enumerate().with_min_len(1024);
            taps = points.map(|(index, point)| corners.tap(index as u32, point, factor)).collect();
            // Those at corners are among them.
            let alone = taps.iter().filter(|(_, weights)| weights[0] == 1.0).count();
            if alone <= MOST_POINTS {
                break;
            }
        }
        // Lobes of one point of the grid look into the same surroundings: they come one after another.
        let mut is_used = vec![false; footprints.points.len()];
        taps.iter().flat_map(used).for_each(|point| is_used[point as usize] = true);
        let mut points: Vec<u32> =
            (0..footprints.points.len() as u32).filter(|&point| is_used[point as usize]).collect();
        points.sort_by_key(|&point| footprints.points[point as usize].lobe_point);
        let mut place = vec![0u32; footprints.points.len()];
        points.iter().enumerate().for_each(|(at, &point)| place[point as usize] = at as u32);
        taps.par_iter_mut().for_each(|(index, _)| *index = index.map(|point| place[point as usize]));
        LobePlan { points, taps }
    }

    /// The integrals at a shading point, from those at the points of the plan.
    #[inline]
    pub fn at(&self, index: usize, sums: &[[f32; 6]]) -> [f32; 6] {
        let mut mean = [0.0f32; 6];
        let Some((places, weights)) = self.taps.get(index) else { return mean };
        for (&place, &weight) in places.iter().zip(weights) {
            if weight > 0.0 {
                for (mean, value) in mean.iter_mut().zip(&sums[place as usize]) {
                    *mean += weight * value;
                }
            }
        }
        mean
    }
}

/// The points of a tap that count.
fn used((points, weights): &Tap) -> impl Iterator<Item = u32> {
    let (points, weights) = (*points, *weights);
    (0..4).filter(move |&k| weights[k] > 0.0).map(move |k| points[k])
}

/// What is known at the corners of squares of pixels.
struct Corners<'a> {
    footprints: &'a ViewFootprints,
    materials: &'a [[f32; 7]],
    grid: &'a VisibilityGrid,
    /// The shading point with the largest share of each corner's pixel, or [`NO_POINT`].
    of_corner: Vec<u32>,
    across: usize,
    down: usize,
    width: usize,
    eye: Vec3,
    pixel_angle: f32,
}

impl<'a> Corners<'a> {
    fn new(
        footprints: &'a ViewFootprints,
        materials: &'a [[f32; 7]],
        grid: &'a VisibilityGrid,
        camera: &Camera,
    ) -> Self {
        let (width, height) = (footprints.width, footprints.height);
        let (across, down) = (width.div_ceil(SPACING), height.div_ceil(SPACING));
        let mut of_corner = vec![NO_POINT; across * down];
        for (index, point) in footprints.points.iter().enumerate() {
            let (row, column) = (point.pixel as usize / width, point.pixel as usize % width);
            if row % SPACING == 0 && column % SPACING == 0 {
                let corner = &mut of_corner[row / SPACING * across + column / SPACING];
                if *corner == NO_POINT || footprints.points[*corner as usize].share < point.share {
                    *corner = index as u32;
                }
            }
        }
        let (eye, pixel_angle) = (camera.position_in_world(), camera.pixel_angle_radians());
        Corners { footprints, materials, grid, of_corner, across, down, width, eye, pixel_angle }
    }

    fn position(&self, point: &ShadingPoint) -> Vec3 {
        self.grid.points[point.lobe_point as usize].position
    }

    /// What a shading point interpolates; itself where its corners do not speak for it.
    fn tap(&self, index: u32, point: &ShadingPoint, factor: f32) -> Tap {
        let alone = ([index; 4], [1.0, 0.0, 0.0, 0.0]);
        let (row, column) = (point.pixel as usize / self.width, point.pixel as usize % self.width);
        let (low_row, low_column) = (row / SPACING, column / SPACING);
        let share = |at: usize| (at % SPACING) as f32 / SPACING as f32;
        let (down, right) = (share(row), share(column));
        let position = self.position(point);
        let reach = 3.0 * SPACING as f32 * self.pixel_angle * (position - self.eye).length();
        let mut tap: Tap = ([index; 4], [0.0; 4]);
        let (mut total, mut normal, mut log_width) = (0.0f32, Vec3::ZERO, 0.0f32);
        for k in 0..4 {
            let (corner_row, corner_column) =
                ((low_row + k / 2).min(self.down - 1), (low_column + k % 2).min(self.across - 1));
            let weight = (if k / 2 == 1 { down } else { 1.0 - down }) * if k % 2 == 1 { right } else { 1.0 - right };
            let corner = self.of_corner[corner_row * self.across + corner_column];
            if corner == NO_POINT || weight <= 0.0 {
                continue;
            }
            let other = &self.footprints.points[corner as usize];
            // Of the same piece of surface: it faces the same way and lies in the same plane, nearly.
            let offset = self.position(other) - position;
            let is_near = offset.dot(point.normal).abs() <= 0.25 * offset.length() + 0.1 * reach;
            // And it looks into the same surroundings: shadows end between points of the grid.
            let sees_the_same = other.lobe_point == point.lobe_point;
            if other.normal.dot(point.normal) < 0.8 || !is_near || !sees_the_same {
                continue;
            }
            (tap.0[k], tap.1[k]) = (corner, weight);
            total += weight;
            normal += other.normal * weight;
            log_width += self.materials[corner as usize][6] * weight;
        }
        // Extrapolated, a lobe errs more than between corners.
        if total < 0.999 {
            return alone;
        }
        let own = self.materials[index as usize][6];
        // A piece that is little of its pixel may err more.
        let allowed = factor / point.share.max(0.05).sqrt();
        let angle = 2.0 * (0.5 * (normal.normalize_or_zero() - point.normal).length()).min(1.0).asin();
        let width = (own.exp().powi(2) + point.normal_variance).sqrt();
        if angle > NORMAL_TOLERANCE * width * allowed || (log_width / total - own).abs() > WIDTH_TOLERANCE * allowed {
            return alone;
        }
        tap.1 = tap.1.map(|weight| weight / total);
        tap
    }
}
