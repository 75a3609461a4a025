//! Where the lobes of a view are integrated, and how its shading points interpolate between these places.
//!
//! `S0 - S5` and `S5` change slowly over smooth surface, and what hides the light is known at points of the grid alone. So
//! they are taken at the points of the grid that the view shows, at even steps of the logarithm of the width, and interpolated
//! in both, before F0 is multiplied in. Where these points do not speak for a shading point (a normal that is not their mean,
//! surface that turns by much of a lobe from one to the next, a grazing view) it has an integral of its own; so do all of a
//! view that shows about as many points of the grid as shading points. What a light sends is not asked, so that the plan
//! serves all of them.

mod frozen;

use crate::math::parallel;
use crate::render::cached::lobe_frozen::FrozenLobes;
use crate::render::cached::lobe_place::{LobePlace, LobeSums};
use crate::render::cached::lobe_sum::lobe_sums;
use crate::render::cached::{CachedTransport, LightPlanes, PointLight, SeenRows, ShadingPoint, ViewFootprints};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// How far a normal may lie from the mean of those at the points of the grid, as a share of the lobe's microfacet width.
const NORMAL_TOLERANCE: f32 = 0.05;
/// How far the half vector of a point of the grid may lie from a shading point's, as a share of that width.
const SPREAD_TOLERANCE: f32 = 0.5;
/// Least cosine between a normal and the viewer: beyond it lobes change too fast.
const LEAST_COSINE: f32 = 0.1;
/// Step between the logarithms of widths. Half way between two a lobe's peak errs by 2 %.
const LOG_WIDTH_STEP: f32 = 0.2;
/// Steps from the narrowest width to 1.
const STEPS: usize = 25;
/// Shading points with integrals of their own, at most: beyond it tolerances are doubled.
const MOST_ALONE: usize = 60_000;
/// How often they are doubled, at most; then the points of the grid speak for all that is not seen at a grazing angle.
const MOST_DOUBLINGS: usize = 4;
/// Groups whose lobes are integrated one after another.
const GROUPS_AT_ONCE: usize = 16;
const NO_PLACE: u32 = u32::MAX;

/// A point of the grid as the view shows it.
struct Place {
    grid_point: u32,
    to_viewer: Vec3,
    /// The first and the last step of widths.
    steps: [u8; 2],
    /// Where its sums begin.
    first_sum: usize,
}

/// All lobes that look into the surroundings of one point of the grid: these are turned to what it sees but once.
struct Group {
    /// Its place, or [`NO_PLACE`].
    place: u32,
    /// Its shading points with integrals of their own.
    alone: Range<usize>,
}

/// Where lobes are integrated.
#[derive(Default)]
pub struct LobePlan {
    places: Vec<Place>,
    groups: Vec<Group>,
    /// Number of their sums.
    sums: usize,
    /// Of each point of the grid: its place, or [`NO_PLACE`].
    of_grid: Vec<u32>,
    /// Of each shading point: the width that the view sees.
    widths: Vec<f32>,
    /// Shading points with integrals of their own, those of one point of the grid together.
    alone: Vec<u32>,
    is_alone: Vec<bool>,
    /// Of every [`GROUPS_AT_ONCE`] groups their lobes as rows, as far as there is memory for them.
    frozen: Vec<FrozenLobes>,
}

/// Microfacet width of a step.
fn width_of(step: usize) -> f32 {
    ((step as f32 - STEPS as f32) * LOG_WIDTH_STEP).exp()
}

/// The step before a width, and how far the next one is weighed.
#[inline]
fn tap(width: f32) -> (u8, f32) {
    let at = (width.ln() / LOG_WIDTH_STEP + STEPS as f32).clamp(0.0, STEPS as f32);
    let low = (at as usize).min(STEPS - 1);
    (low as u8, at - low as f32)
}

impl LobePlan {
    /// The plan of a view from `eye`, whose shading points see lobes of these widths.
    pub fn of(footprints: &ViewFootprints, widths: Vec<f32>, transport: &CachedTransport, eye: Vec3) -> Self {
        let points = &footprints.points;
        let mut is_alone = Vec::new();
        for doubling in 0..=MOST_DOUBLINGS {
            let factor = if doubling == MOST_DOUBLINGS { f32::INFINITY } else { (1 << doubling) as f32 };
            is_alone = parallel::map_small(points.len(), |index| {
                !is_spoken_for(footprints, transport, eye, &points[index], widths[index], factor)
            });
            if is_alone.iter().filter(|&&is_alone| is_alone).count() <= MOST_ALONE {
                break;
            }
        }
        // The first and the last step that is asked for at each point of the grid.
        let nothing = [u8::MAX, 0];
        let mut steps = vec![nothing; transport.grid.points.len()];
        let mut spoken_for = 0;
        for (index, point) in points.iter().enumerate().filter(|&(index, _)| !is_alone[index]) {
            let (low, _) = tap(widths[index]);
            spoken_for += 1;
            for &(grid_point, _) in footprints.lit_of(point) {
                let [first, last] = &mut steps[grid_point as usize];
                (*first, *last) = ((*first).min(low), (*last).max(low + 1));
            }
        }
        if 2 * steps.iter().filter(|steps| **steps != nothing).count() > spoken_for && points.len() <= MOST_ALONE {
            is_alone.fill(true);
            steps.fill(nothing);
        }
        let (mut places, mut sums, mut of_grid) = (Vec::new(), 0, vec![NO_PLACE; steps.len()]);
        for (grid_point, steps) in steps.into_iter().enumerate().filter(|(_, steps)| *steps != nothing) {
            of_grid[grid_point] = places.len() as u32;
            let to_viewer = (eye - transport.grid.points[grid_point].position).normalize_or(Vec3::Y);
            places.push(Place { grid_point: grid_point as u32, to_viewer, steps, first_sum: sums });
            sums += usize::from(steps[1] - steps[0]) + 1;
        }
        // Lobes of one point of the grid look into the same surroundings: they come one after another.
        let mut alone: Vec<u32> = (0..points.len() as u32).filter(|&index| is_alone[index as usize]).collect();
        let lobe_point = |index: u32| points[index as usize].lobe_point;
        alone.sort_by_key(|&index| lobe_point(index));
        let mut groups = Vec::with_capacity(places.len());
        let mut end = 0;
        for (grid_point, &place) in (0..).zip(&of_grid) {
            let begin = end;
            end += alone[begin..].iter().take_while(|&&index| lobe_point(index) == grid_point).count();
            if place != NO_PLACE || end > begin {
                groups.push(Group { place, alone: begin..end });
            }
        }
        LobePlan { places, groups, sums, of_grid, widths, alone, is_alone, frozen: Vec::new() }
    }

    /// Lobes that are integrated.
    pub fn lobes(&self) -> usize {
        self.sums + self.alone.len()
    }

    /// The integrals at all shading points of the view under a light, among surface that sends this; none without lobes.
    pub fn integrals(
        &self,
        footprints: &ViewFootprints,
        transport: &CachedTransport,
        (light, at): (&LightPlanes, &PointLight),
    ) -> Vec<LobeSums> {
        let (basis, joined_basis) = (&transport.basis, &transport.joined_basis);
        let first_joined = (0..=STEPS).take_while(|&step| width_of(step) < transport.joined_from()).count();
        let of_place = |seen: &mut SeenRows, own: &Place| {
            let shares = transport.seen_from(own.grid_point, light, at, &mut seen.fine);
            let normal = transport.grid.points[own.grid_point as usize].shading_normal;
            let [first, last] = own.steps.map(usize::from);
            let widths: [f32; STEPS + 1] = std::array::from_fn(|index| width_of(first + index));
            let (mut sums, count) = ([LobeSums::default(); STEPS + 1], last - first + 1);
            // Lobes for which pairs of hats are narrow enough are summed over these.
            let fine = first_joined.clamp(first, last + 1) - first;
            let (to_viewer, normal_variance, model) = (own.to_viewer, 0.0, transport.settings.lobe);
            let place = LobePlace { normal, to_viewer, shares, seen: &seen.fine, normal_variance, model };
            lobe_sums(basis, &place, &widths[..fine], &mut sums[..fine]);
            if fine < count {
                let place = LobePlace { normal, to_viewer, shares, seen: seen.joined(basis), normal_variance, model };
                lobe_sums(joined_basis, &place, &widths[fine..count], &mut sums[fine..count]);
            }
            sums.into_iter().take(count)
        };
        let of_groups = |chunk: usize, groups: &[Group]| -> (Vec<LobeSums>, Vec<LobeSums>) {
            if let Some(rows) = self.frozen.get(chunk) {
                return self.frozen_sums((rows, groups), (footprints, transport), (light, at));
            }
            let (mut seen, mut of_places, mut of_alone) = (SeenRows::default(), Vec::new(), Vec::new());
            for group in groups {
                if group.place != NO_PLACE {
                    of_places.extend(of_place(&mut seen, &self.places[group.place as usize]));
                }
                for &index in &self.alone[group.alone.clone()] {
                    let point = ShadingPoint { normal_variance: 0.0, ..footprints.points[index as usize] };
                    let width = self.widths[index as usize];
                    of_alone.push(transport.lobe_at(&point, (light, at), &mut seen, width, false));
                }
            }
            (of_places, of_alone)
        };
        let parts = parallel::map_chunks(&self.groups, GROUPS_AT_ONCE, of_groups);
        let (sums, of_alone): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let (sums, of_alone) = (sums.concat(), of_alone.concat());
        let between = |index: usize| match self.is_alone[index] {
            true => LobeSums::default(),
            false => self.between(footprints.lit_of(&footprints.points[index]), self.widths[index], &sums),
        };
        let mut made: Vec<LobeSums> = (0..self.widths.len()).into_par_iter().with_min_len(1024).map(between).collect();
        self.alone.iter().zip(of_alone).for_each(|(&index, own)| made[index as usize] = own);
        made
    }

    /// The integrals at a shading point from those at the points of the grid around it.
    fn between(&self, around: &[(u32, f32)], width: f32, sums: &[LobeSums]) -> LobeSums {
        let (step, share) = tap(width);
        let mut mean = LobeSums::default();
        for &(grid_point, weight) in around {
            let place = &self.places[self.of_grid[grid_point as usize] as usize];
            let at = place.first_sum + usize::from(step - place.steps[0]);
            for c in 0..3 {
                mean.base[c] += weight * (sums[at].base[c] * (1.0 - share) + sums[at + 1].base[c] * share);
                mean.grazing[c] += weight * (sums[at].grazing[c] * (1.0 - share) + sums[at + 1].grazing[c] * share);
            }
        }
        mean
    }
}

/// Whether the points of the grid around a shading point speak for its lobe.
fn is_spoken_for(
    footprints: &ViewFootprints,
    transport: &CachedTransport,
    eye: Vec3,
    point: &ShadingPoint,
    width: f32,
    factor: f32,
) -> bool {
    // A piece that is little of its pixel may err more.
    let allowed = width * factor / point.share.max(0.05).sqrt();
    let mut normal = Vec3::ZERO;
    for &(grid_point, weight) in footprints.lit_of(point) {
        let on_grid = &transport.grid.points[grid_point as usize];
        let to_viewer = (eye - on_grid.position).normalize_or(Vec3::Y);
        if to_viewer.dot(on_grid.shading_normal) < LEAST_COSINE {
            return false;
        }
        let turned = (on_grid.shading_normal - point.normal).length() + 0.5 * (to_viewer - point.to_viewer).length();
        if turned > SPREAD_TOLERANCE * allowed {
            return false;
        }
        normal += on_grid.shading_normal * weight;
    }
    let angle = 2.0 * (0.5 * (normal.normalize_or_zero() - point.normal).length()).min(1.0).asin();
    angle <= NORMAL_TOLERANCE * allowed
}
