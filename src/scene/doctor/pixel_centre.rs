//! Where do pixel centres lie in the intrinsics?
//!
//! Some tools put the centre of the upper left pixel at (0, 0), others at (0.5, 0.5); the files do not say which. Half
//! a pixel blurs every map, so it is measured. With masks: rays are shot near the edge of the mask at many places
//! within the pixel, and the place at which mesh and mask disagree least is the centre. Without masks: the mesh's
//! silhouette is found along rows and columns, and the photo's edges beside it say where it should be
//! ([`edge_profile`](super::edge_profile)).

use super::Report;
use super::edge_profile::Profiles;
use super::mask_edges::{self, MaskEdges};
use super::probe::centre_of;
use crate::error::{Finding, Severity};
use crate::math::statistics::quantile;
use crate::math::{evenly_spread, parallel};
use crate::scene::settings::PixelCentre;
use crate::scene::{Scene, View};
use crate::trace::Bvh;
use glam::DVec2;

/// Views that are measured, spread over the scene.
const MEASURED_VIEWS: usize = 10;
/// A measurement further than this from a convention does not speak for it.
const NEAR_PIXELS: f64 = 0.15;
/// A measurement with a larger standard error says nothing: the other convention, half a pixel away, must be four
/// errors off.
const LARGEST_ERROR_PIXELS: f64 = 0.125;
/// Where masks disagree with the mesh at one convention by so many times less than at the others, that decides. A mesh that is
/// a little too fat or too thin disagrees at all of them.
const MANY_TIMES: f64 = 3.0;
/// Fewer edge pixels or crossings decide nothing.
const FEWEST_EDGES: usize = 200;

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
    /// Which of these places the first pixel's centre clearly is at: the one that the measurement is near on every axis, where
    /// that is exact enough, else the one where masks disagree with the mesh many times less.
    fn clear_place(&self, places: &[f64]) -> Option<f64> {
        if self.edge_count < FEWEST_EDGES || self.centre_pixels == [None, None] {
            return None;
        }
        let axes = self.centre_pixels.iter().zip(self.standard_error_pixels);
        let is_near = |place: f64| {
            axes.clone()
                .filter_map(|(centre, error)| Some(((*centre)?, error)))
                .all(|(centre, error)| error < LARGEST_ERROR_PIXELS && (centre - place).abs() < NEAR_PIXELS)
        };
        places.iter().copied().find(|place| is_near(*place)).or_else(|| self.place_of_least_disagreement(places))
    }

    fn place_of_least_disagreement(&self, places: &[f64]) -> Option<f64> {
        let rate = |place: &f64| Some((self.disagreement_at(*place)?, *place));
        let mut rated: Vec<(f64, f64)> = places.iter().map(rate).collect::<Option<_>>()?;
        rated.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [(least, place), (second, _), ..] = rated[..] else { return None };
        (MANY_TIMES * least < second).then_some(place)
    }

    /// Share of edge pixels where mask and mesh disagree if the centre lies there; `None` where that was not tried.
    fn disagreement_at(&self, place: f64) -> Option<f64> {
        let index = (2.0 * place).round();
        self.disagreement?.into_iter().enumerate().find(|(own, _)| *own as f64 == index).map(|(_, share)| share)
    }

    /// The figures as text, in the coordinates of the scene: (0.5, 0.5) is right.
    pub fn in_words(&self) -> String {
        self.figures(PixelCentre::Half, 1.0)
    }

    /// The figures as text, in the coordinates of `convention`, of a picture `scale` times smaller.
    fn figures(&self, convention: PixelCentre, scale: f64) -> String {
        let what = match self.evidence {
            Evidence::Masks => "mask edge pixels",
            Evidence::PhotoEdges => "silhouette crossings",
        };
        let own = place_of(convention);
        let along = |axis: usize| match self.centre_pixels[axis] {
            Some(centre) => {
                format!("{:.2} ± {:.2}", own + (centre - RIGHT) / scale, self.standard_error_pixels[axis] / scale)
            }
            None => "unknown".into(),
        };
        let mut text =
            format!("({}, {}) by {} {what} of {} views", along(0), along(1), self.edge_count, self.view_count);
        let at = |place: f64| Some(100.0 * self.disagreement_at(RIGHT + scale * (place - own))?);
        if let (Some(corner), Some(middle)) = (at(0.0), at(0.5)) {
            text += &format!("; {corner:.1} % of them disagree with the mesh at (0, 0), {middle:.1} % at (0.5, 0.5)");
        }
        text
    }
}

/// Where the first pixel's centre lies in a scene's cameras, when all is right.
const RIGHT: f64 = 0.5;

/// Where a convention puts the first pixel's centre.
fn place_of(convention: PixelCentre) -> f64 {
    RIGHT - convention.shift_pixels()
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

/// Median and its standard error over the views, by their median absolute deviation: what one view says is no more than a
/// voice. A single view gets an error that decides nothing, and none is more exact than its steps.
fn summary(places: &[DVec2]) -> ([f64; 2], [f64; 2]) {
    /// Standard deviations of a normal distribution with a median absolute deviation of one, and of the median of many such
    /// numbers in units of that of their mean.
    const OF_MEDIAN: f64 = 1.4826 * 1.2533;
    let step = f64::from(mask_edges::COARSE_STEP) / 4.0;
    let along = |of: fn(&DVec2) -> f64| {
        let along: Vec<f64> = places.iter().map(of).collect();
        let middle = quantile(&along, 0.5);
        let distances: Vec<f64> = along.iter().map(|place| (place - middle).abs()).collect();
        let deviation = (OF_MEDIAN * quantile(&distances, 0.5)).max(step / 12f64.sqrt());
        let error =
            if along.len() < 2 { f64::from(mask_edges::COARSE_STEP) } else { deviation / (along.len() as f64).sqrt() };
        (middle, error)
    };
    let [x, y] = [along(|place| place.x), along(|place| place.y)];
    ([x.0, y.0], [x.1, y.1])
}

/// The measurement from masks alone.
pub fn measure_by_masks(views: &[&View], bvh: &Bvh) -> Option<CentreMeasurement> {
    let of_views = parallel::map_items(views, |view| MaskEdges::measure(view, bvh));
    let of_views: Vec<MaskEdges> = of_views.into_iter().flatten().collect();
    let edge_count: usize = of_views.iter().map(|edges| edges.count).sum();
    if edge_count < 50 {
        return None;
    }
    let (centre, standard_error_pixels) = summary(&of_views.iter().map(|edges| edges.centre).collect::<Vec<_>>());
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
    let error = if count < 2.0 { [f64::from(mask_edges::COARSE_STEP); 2] } else { variance.map(f64::sqrt) };
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
/// is clear, else `assumed`. The finding holds the figures, in the source's own coordinates. Intrinsics that were made `scale`
/// times larger are off by so many times the distance between conventions.
pub fn decide(scene: &Scene, assumed: PixelCentre, scale: f64) -> (PixelCentre, Finding) {
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
    let conventions = [PixelCentre::Integer, PixelCentre::Half];
    let places = conventions.map(|own| RIGHT + scale * (place_of(own) - place_of(assumed)));
    let clear = measurement.clear_place(&places);
    let clear = conventions.into_iter().zip(places).find(|(_, place)| Some(*place) == clear);
    let figures = measurement.figures(assumed, scale);
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
    let place = measurement.clear_place(&[0.0, RIGHT, 1.0]).filter(|place| *place != RIGHT);
    if let Some(place) = place {
        report.findings.push(
            Finding::new(
                Severity::Warning,
                "pixel-centre-off",
                format!(
                    "the photos are half a pixel off the mesh: pixel centres are at {}, not at (0.5, 0.5)",
                    measurement.in_words()
                ),
            )
            .remedy(if place < RIGHT {
                "give --pixel-centre integer: what the source says of its convention is not so"
            } else {
                "give --pixel-centre half: what was given or the source says of its convention is not so"
            }),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_view_that_is_off_does_not_move_the_others() {
        let mut places = vec![DVec2::new(0.5, 0.52); 7];
        places.push(DVec2::new(-0.7, 0.45));
        let (centre, error) = summary(&places);
        assert_eq!(centre, [0.5, 0.52]);
        assert!(error.iter().all(|error| (0.001..0.02).contains(error)), "{error:?}");
        assert!(summary(&places[..1]).1[0] > LARGEST_ERROR_PIXELS, "a single view decides nothing");
    }

    #[test]
    fn masks_that_disagree_many_times_less_at_one_place_decide() {
        let measurement = CentreMeasurement {
            evidence: Evidence::Masks,
            centre_pixels: [Some(0.85), Some(1.01)],
            standard_error_pixels: [0.15, 0.01],
            edge_count: 3436,
            view_count: 8,
            disagreement: Some([0.4, 0.269, 0.026]),
        };
        assert_eq!(measurement.clear_place(&[0.5, 1.0]), Some(1.0));
        let fat = CentreMeasurement { disagreement: Some([0.4, 0.3, 0.2]), ..measurement };
        assert_eq!(fat.clear_place(&[0.5, 1.0]), None, "a mesh that is too fat");
        let exact =
            CentreMeasurement { centre_pixels: [Some(0.45), Some(0.52)], standard_error_pixels: [0.02; 2], ..fat };
        assert_eq!(exact.clear_place(&[0.5, 1.0]), Some(0.5));
        assert_eq!(measurement.clear_place(&[0.5, 1.5]), None, "what was not tried does not decide");
    }
}
