//! Where do pixel centres lie in the intrinsics?
//!
//! Some tools put the centre of the upper left pixel at (0, 0), others at (0.5, 0.5); the files do not say which. Half
//! a pixel blurs every map, so it is measured. With masks: rays are shot near the edge of the mask at many places
//! within the pixel, and the place at which mesh and mask disagree least is the centre. Without masks: the mesh's
//! silhouette is found along rows and columns, and the photo's edges beside it say where it should be
//! ([`edge_profile`](super::edge_profile)).

use super::Report;
use super::edge_profile::Profiles;
use super::probe::{centre_of, hit_at};
use crate::error::{Finding, Severity};
use crate::math::statistics::Moments;
use crate::math::{evenly_spread, parallel};
use crate::scene::settings::PixelCentre;
use crate::scene::{PixelState, Scene, View};
use crate::trace::Bvh;
use glam::{DVec2, Vec2};

/// Views that are measured, spread over the scene.
const MEASURED_VIEWS: usize = 10;
/// Pixels beside the mask's edge that are measured in each view.
const EDGE_PIXELS_PER_VIEW: usize = 600;
/// Places tried along each axis: -0.25, 0, ... 1.25 within and around the pixel.
const COARSE_COUNT: usize = 7;
const COARSE_FIRST: f32 = -0.25;
const COARSE_STEP: f32 = 0.25;
/// A measurement further than this from a convention does not speak for it.
const NEAR_PIXELS: f64 = 0.15;
/// A measurement with a larger standard error says nothing: the other convention, half a pixel away, must be four
/// errors off.
const LARGEST_ERROR_PIXELS: f64 = 0.125;

/// What a measurement is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Evidence {
    /// Edges of masks.
    Masks,
    /// Edges in the photos beside the mesh's silhouette.
    PhotoEdges,
}

/// Where pixel centres were found to lie.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CentreMeasurement {
    /// What it is made from.
    pub evidence: Evidence,
    /// The centre of the upper left pixel on the picture plane of the scene's cameras, in pixels along x and y: (0.5,
    /// 0.5) is right. `None` along an axis that has too few edges.
    pub centre_pixels: [Option<f64>; 2],
    /// Standard error of that by the scatter over the views, in pixels along x and y.
    pub standard_error_pixels: [f64; 2],
    /// Edge pixels (masks) or silhouette crossings (photo edges) measured.
    pub edge_count: usize,
    /// Views measured.
    pub view_count: usize,
    /// Masks only: share of edge pixels where mask and mesh disagree if the centre lies at (0, 0), (0.5, 0.5), (1, 1).
    pub disagreement: Option<[f64; 3]>,
}

impl CentreMeasurement {
    /// Whether the measurement is exact enough to choose by and lies at `place` on every measured axis.
    fn clearly_at(&self, place: f64) -> bool {
        let mut measured = self
            .centre_pixels
            .iter()
            .zip(self.standard_error_pixels)
            .filter_map(|(centre, error)| Some(((*centre)?, error)));
        self.edge_count >= 200
            && self.centre_pixels != [None, None]
            && measured.all(|(centre, error)| error < LARGEST_ERROR_PIXELS && (centre - place).abs() < NEAR_PIXELS)
    }

    /// The figures as text; `shift` is subtracted from the places, to speak of the source's own coordinates.
    fn figures(&self, shift: f64) -> String {
        let what = match self.evidence {
            Evidence::Masks => "mask edge pixels",
            Evidence::PhotoEdges => "silhouette crossings",
        };
        let along = |axis: usize| match self.centre_pixels[axis] {
            Some(centre) => format!("{:.2} ± {:.2}", centre - shift, self.standard_error_pixels[axis]),
            None => "unknown".into(),
        };
        let mut text =
            format!("({}, {}) by {} {what} of {} views", along(0), along(1), self.edge_count, self.view_count);
        if let Some(shares) = self.disagreement {
            let at = |place: f64| 100.0 * shares[(2.0 * (place + shift)).round().clamp(0.0, 2.0) as usize];
            text +=
                &format!("; {:.1} % of them disagree with the mesh at (0, 0), {:.1} % at (0.5, 0.5)", at(0.0), at(0.5));
        }
        text
    }
}

/// Measures the pixel centres of a scene; by masks where there are any, else by the photos' edges. `None` when too
/// little of a silhouette is in the pictures.
pub fn measure(scene: &Scene, bvh: &Bvh) -> Option<CentreMeasurement> {
    let valid: Vec<&View> = scene.views.iter().filter(|view| view.camera.validate(1e-3).is_ok()).collect();
    let masked: Vec<&View> = valid.iter().copied().filter(|view| view.has_mask()).collect();
    measure_by_masks(&spread(&masked), bvh).or_else(|| measure_by_photo_edges(&spread(&valid), bvh))
}

fn spread<'a>(views: &[&'a View]) -> Vec<&'a View> {
    evenly_spread(views, MEASURED_VIEWS)
}

/// Mean and standard error over the views. A single view gets an error that decides nothing.
fn summary(places: impl Iterator<Item = DVec2> + Clone) -> ([f64; 2], [f64; 2]) {
    let [x, y]: [Moments; 2] = [places.clone().map(|place| place.x).collect(), places.map(|place| place.y).collect()];
    let error = |moments: &Moments| {
        if moments.count < 2 { f64::from(COARSE_STEP) } else { (moments.variance() / moments.count as f64).sqrt() }
    };
    ([x.mean, y.mean], [error(&x), error(&y)])
}

/// The measurement from masks alone.
pub fn measure_by_masks(views: &[&View], bvh: &Bvh) -> Option<CentreMeasurement> {
    let of_views = parallel::map_items(views, |view| MaskEdges::measure(view, bvh));
    let of_views: Vec<MaskEdges> = of_views.into_iter().flatten().collect();
    let edge_count: usize = of_views.iter().map(|edges| edges.count).sum();
    if edge_count < 50 {
        return None;
    }
    let (centre, standard_error_pixels) = summary(of_views.iter().map(|edges| edges.centre));
    let share = |index: usize| {
        of_views.iter().map(|edges| edges.disagreements[index]).sum::<usize>() as f64 / edge_count as f64
    };
    Some(CentreMeasurement {
        evidence: Evidence::Masks,
        centre_pixels: centre.map(Some),
        standard_error_pixels,
        edge_count,
        view_count: of_views.len(),
        disagreement: Some([share(0), share(1), share(2)]),
    })
}

/// What the mask's edge of one view says.
struct MaskEdges {
    count: usize,
    centre: DVec2,
    /// Disagreeing edge pixels with the centre at (0, 0), (0.5, 0.5) and (1, 1).
    disagreements: [usize; 3],
}

impl MaskEdges {
    fn measure(view: &View, bvh: &Bvh) -> Option<Self> {
        let pixels = mask_edge_pixels(view);
        if pixels.len() < 50 {
            return None;
        }
        let step = pixels.len().div_ceil(EDGE_PIXELS_PER_VIEW);
        let pixels: Vec<_> = pixels.into_iter().step_by(step).collect();
        let disagreements_at = |place: Vec2| {
            pixels
                .iter()
                .filter(|(row, column, object)| {
                    let hit = hit_at(&view.camera, bvh, Vec2::new(*column as f32, *row as f32) + place);
                    hit.is_some() != *object
                })
                .count()
        };
        let coarse = |index: usize| COARSE_FIRST + COARSE_STEP * index as f32;
        let mut best = (usize::MAX, Vec2::ZERO);
        let mut disagreements = [0; 3];
        for (row, column) in (0..COARSE_COUNT).flat_map(|row| (0..COARSE_COUNT).map(move |column| (row, column))) {
            let place = Vec2::new(coarse(column), coarse(row));
            let count = disagreements_at(place);
            if count < best.0 {
                best = (count, place);
            }
            if row == column && row % 2 == 1 {
                disagreements[row / 2] = count;
            }
        }
        // Refine; of several places that are equally good, the mean is taken.
        let (mut sum, mut ties, mut least) = (DVec2::ZERO, 0usize, usize::MAX);
        for (y, x) in (-3..=3).flat_map(|y| (-3..=3).map(move |x| (y, x))) {
            let place = best.1 + Vec2::new(x as f32, y as f32) * (COARSE_STEP / 4.0);
            let count = disagreements_at(place);
            if count < least {
                (sum, ties, least) = (DVec2::ZERO, 0, count);
            }
            if count == least {
                sum += place.as_dvec2();
                ties += 1;
            }
        }
        // A mask that follows the mesh nowhere says nothing.
        (least * 5 < pixels.len() * 2).then(|| MaskEdges {
            count: pixels.len(),
            centre: sum / ties as f64,
            disagreements,
        })
    }
}

/// Pixels on either side of the mask's edge: (row, column, is object).
fn mask_edge_pixels(view: &View) -> Vec<(usize, usize, bool)> {
    let states = &view.states;
    let mut pixels = Vec::new();
    for row in 1..states.height().saturating_sub(1) {
        for column in 1..states.width().saturating_sub(1) {
            let state = states[(row, column)];
            let neighbours = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)];
            let differs = neighbours
                .iter()
                .any(|&place| states[place] != PixelState::Ignored && states[place].is_surface() != state.is_surface());
            if state != PixelState::Ignored && differs {
                pixels.push((row, column, state.is_surface()));
            }
        }
    }
    pixels
}

/// The measurement from the photos' edges alone. The profiles of all views are added up; the error is by leaving out
/// one view at a time (jackknife).
pub fn measure_by_photo_edges(views: &[&View], bvh: &Bvh) -> Option<CentreMeasurement> {
    let of_views: Vec<Profiles> = parallel::map_items(views, |view| Profiles::of_view(view, bvh));
    let sum_without = |left_out: usize| {
        let mut sum = Profiles::EMPTY;
        of_views.iter().enumerate().filter(|(index, _)| *index != left_out).for_each(|(_, profiles)| sum.add(profiles));
        sum
    };
    let all = sum_without(usize::MAX);
    let offsets = all.offsets();
    if offsets == [None, None] {
        return None;
    }
    let count = of_views.len() as f64;
    let mut variance = [0.0; 2];
    for left_out in 0..of_views.len() {
        let others = sum_without(left_out).offsets();
        for axis in 0..2 {
            // A measurement that hangs on one view is none.
            let departure = others[axis].zip(offsets[axis]).map_or(1.0, |(other, all)| other - all);
            variance[axis] += departure * departure * (count - 1.0) / count;
        }
    }
    let error = if count < 2.0 { [f64::from(COARSE_STEP); 2] } else { variance.map(f64::sqrt) };
    // An edge of the photo that lies right of the mesh's says that the mesh is drawn too far left: pixel centres are
    // at smaller coordinates than the scene has them.
    Some(CentreMeasurement {
        evidence: Evidence::PhotoEdges,
        centre_pixels: offsets.map(|offset| Some(f64::from(centre_of(0, 0).x) - offset?)),
        standard_error_pixels: error,
        edge_count: all.count(),
        view_count: of_views.len(),
        disagreement: None,
    })
}

/// Chooses the convention of a scene that was read under the convention `assumed`: the measured one where the evidence
/// is clear, else `assumed`. The finding holds the figures, in the source's own coordinates.
pub fn decide(scene: &Scene, assumed: PixelCentre) -> (PixelCentre, Finding) {
    let measurement =
        Bvh::build(&scene.mesh.positions, &scene.mesh.triangles).ok().and_then(|bvh| measure(scene, &bvh));
    let name = |convention| if convention == PixelCentre::Integer { "(0, 0)" } else { "(0.5, 0.5)" };
    let Some(measurement) = measurement else {
        let message =
            format!("no silhouette tells where pixel centres lie: {} is assumed for the upper left one", name(assumed));
        return (
            assumed,
            Finding::new(Severity::Note, "pixel-centre-assumed", message)
                .remedy("give --pixel-centre integer or half if you know better"),
        );
    };
    let shift = assumed.shift_pixels();
    let clear = [(PixelCentre::Integer, 0.0), (PixelCentre::Half, 0.5)]
        .into_iter()
        .find(|(_, place)| measurement.clearly_at(place + shift));
    let figures = measurement.figures(shift);
    match clear {
        Some((convention, _)) => (
            convention,
            Finding::new(
                Severity::Note,
                "pixel-centre-measured",
                format!("the source puts the centre of the upper left pixel at {}: measured {figures}", name(convention)),
            ),
        ),
        None => (
            assumed,
            Finding::new(
                Severity::Note,
                "pixel-centre-assumed",
                format!("the source is assumed to put the centre of the upper left pixel at {}; measured {figures}, which does not decide", name(assumed)),
            )
            .remedy("give --pixel-centre integer or half if you know better"),
        ),
    }
}

/// Measures the pixel centres and warns when they are clearly off.
pub fn check(scene: &Scene, bvh: &Bvh, report: &mut Report) {
    report.pixel_centre = measure(scene, bvh);
    let Some(measurement) = report.pixel_centre else { return };
    if measurement.clearly_at(0.0) || measurement.clearly_at(1.0) {
        report.findings.push(
            Finding::new(
                Severity::Warning,
                "pixel-centre-off",
                format!(
                    "the photos are half a pixel off the mesh: pixel centres are at {}, not at (0.5, 0.5)",
                    measurement.figures(0.0)
                ),
            )
            .remedy(if measurement.clearly_at(0.0) {
                "give --pixel-centre integer: what the source says of its convention is not so"
            } else {
                "give --pixel-centre half: what was given or the source says of its convention is not so"
            }),
        );
    }
}
