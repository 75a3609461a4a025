//! A mesh that stands in another frame than the cameras: noticed by what photos and masks say of it, and put right by a
//! transform that is known from the tools.

use super::mesh_frame_rating::{InPixels, Rater, Rating, Trial, known};
use super::source::{MeshFrame, SourceCamera};
use super::source_mesh::SourceMesh;
use crate::error::{Finding, Severity};
use crate::scene::View;
use glam::{DMat3, DMat4};

/// A frame in which this share of the views looks at the mesh fits, one in which less than the other does fails.
const FITTING_SHARE: f64 = 0.8;
const FAILING_SHARE: f64 = 0.5;
/// Photos that agree by this and masks that overlap by this speak for a frame; where they do by less than the larger, another
/// may do better: a round object agrees with itself when it is turned.
const SOUND_AGREEMENT: f64 = 0.7;
const SOUND_OVERLAP: f64 = 0.8;
const SURE_AGREEMENT: f64 = 0.9;
const SURE_OVERLAP: f64 = 0.9;
/// A frame in which photos agree by less than this is not taken for their agreement.
const LEAST_AGREEMENT: f64 = 0.5;
/// A frame in which masks overlap by less does not bring back a mesh that is out of sight.
const LEAST_OVERLAP: f64 = 0.3;
/// A frame is clearly better than another when agreement or overlap rises by so much, and the agreement by this share of what
/// it lacks.
const LEAST_GAIN: f64 = 0.15;
const LEAST_GAIN_SHARE: f64 = 0.4;
/// Where nothing speaks against the mesh as it is, another frame must make up for this share of what it lacks.
const LEAST_GAIN_SHARE_OF_SOUND: f64 = 0.5;
const LEAST_GAIN_OF_SOUND: f64 = 0.05;
/// What one measure may lose where the other gains.
const MOST_LOSS: f64 = 0.1;
/// A mesh that is seen from the outside as it is, is not moved to where so many more of its back faces are seen.
const MOST_MORE_BACK_FACES: f64 = 0.2;

/// Whether nothing that was measured speaks against the frame, and something for it, by these measures.
fn is_sound(rating: &Rating, least_agreement: f64, least_overlap: f64) -> bool {
    rating.views >= FAILING_SHARE
        && (rating.agreement.is_some() || rating.overlap.is_some())
        && rating.agreement.is_none_or(|agreement| agreement >= least_agreement)
        && rating.overlap.is_none_or(|overlap| overlap >= least_overlap)
}

/// Whether a frame is better than a sound one by more than half of what photos or masks lack there, and loses nothing.
fn is_better_than_sound(other: &Rating, own: &Rating) -> bool {
    let gain = |other: Option<f64>, own: Option<f64>| match (other, own) {
        (Some(new), Some(old)) => (new - old) / (1.0 - old).max(LEAST_GAIN_OF_SOUND / LEAST_GAIN_SHARE_OF_SOUND),
        (None, Some(_)) => f64::NEG_INFINITY,
        (_, None) => 0.0,
    };
    let gains = [gain(other.agreement, own.agreement), gain(other.overlap, own.overlap)];
    gains.iter().any(|gain| *gain > LEAST_GAIN_SHARE_OF_SOUND) && gains.iter().all(|gain| *gain >= 0.0)
}

/// Whether photos or masks say that one frame is clearly better than what there is.
pub(super) fn is_clearly_better(other: &Rating, own: &Rating) -> bool {
    // What was measured and is no more is lost.
    let loses =
        |other: Option<f64>, own: Option<f64>| own.is_some_and(|old| other.is_none_or(|new| new < old - MOST_LOSS));
    let gains = |other: Option<f64>, own: Option<f64>, least: f64, share: f64| {
        let old = own.unwrap_or(0.0).max(0.0);
        other.is_some_and(|new| new >= least && new - old > LEAST_GAIN.max(share * (1.0 - old)))
    };
    let by_agreement = gains(other.agreement, own.agreement, LEAST_AGREEMENT, LEAST_GAIN_SHARE);
    let by_overlap = gains(other.overlap, own.overlap, SOUND_OVERLAP, 0.0);
    by_agreement && !loses(other.overlap, own.overlap) || by_overlap && !loses(other.agreement, own.agreement)
}

/// Whether photos or masks say that lengths are of another unit: of a mesh that is small enough some place suits any photos.
fn is_of_its_units(rating: &Rating) -> bool {
    rating.agreement.is_some_and(|agreement| agreement >= SOUND_AGREEMENT)
        || rating.overlap.is_some_and(|overlap| overlap >= SOUND_OVERLAP)
}

/// Whether a mesh that is out of sight as it is may stand in this frame: what was measured speaks for it, or nothing was and it
/// is not by its size alone that it is seen.
fn is_credible((rating, frame): &(Rating, Trial)) -> bool {
    let is_measured = rating.agreement.is_some() || rating.overlap.is_some();
    rating.agreement.is_none_or(|agreement| agreement >= LEAST_AGREEMENT)
        && rating.overlap.is_none_or(|overlap| overlap >= LEAST_OVERLAP)
        && (is_measured || !frame.changes_units)
}

/// What frames are compared by: photos and masks where they say something, else what is in sight.
fn merit(rating: &Rating) -> f64 {
    rating.agreement.unwrap_or(0.0) + rating.overlap.unwrap_or(0.0) + 1e-3 * rating.views * rating.points
}

/// Rates the mesh as it is, and where that leaves a doubt in every known frame; takes one that is clearly better, and tells.
/// Where photos and masks are silent, the mesh is moved only when next to nothing of it is in sight as it is.
///
/// `cameras` are of the source; `views`, whose cameras are not used, come back as they were.
pub fn put_right(
    mesh: &mut SourceMesh,
    (cameras, views): (&[SourceCamera], Vec<View>),
    in_pixels: &InPixels<'_>,
    own: &[MeshFrame],
    findings: &mut Vec<Finding>,
) -> Vec<View> {
    if mesh.triangles.is_empty() {
        return views;
    }
    let mut rater = Rater::new(mesh, cameras, views, in_pixels);
    let as_it_is = rater.rate(&DMat4::IDENTITY);
    if is_sound(&as_it_is, SURE_AGREEMENT, SURE_OVERLAP) {
        return rater.into_views();
    }
    let is_doubtless = is_sound(&as_it_is, SOUND_AGREEMENT, SOUND_OVERLAP);
    let mut frames = known(own);
    if is_doubtless {
        // In another unit of length, photos and masks would not agree so well.
        frames.retain(|frame| !frame.changes_units);
    }
    let tried = frames.len();
    let rate = |frame: Trial| {
        let in_sight = rater.by_sight(&frame.source_from_mesh).views >= FITTING_SHARE;
        in_sight.then(|| (rater.rate(&frame.source_from_mesh), frame))
    };
    let mut rated: Vec<(Rating, Trial)> = frames.into_iter().filter_map(rate).collect();
    // What the source knows comes first among equals: the sort is stable.
    rated.sort_by(|a, b| merit(&b.0).total_cmp(&merit(&a.0)));
    let is_lost = as_it_is.views < FAILING_SHARE;
    let is_wanted = |own: &&(Rating, Trial)| match is_lost {
        true => is_credible(own),
        false if own.0.back_faces > as_it_is.back_faces + MOST_MORE_BACK_FACES => false,
        false if is_doubtless => is_better_than_sound(&own.0, &as_it_is),
        false => is_clearly_better(&own.0, &as_it_is) && (!own.1.changes_units || is_of_its_units(&own.0)),
    };
    let wanted: Vec<&(Rating, Trial)> = rated.iter().filter(is_wanted).collect();
    match wanted.first() {
        Some((rating, frame)) => {
            let doubt = wanted.get(1).filter(|(other, _)| merit(other) > merit(rating) - MOST_LOSS);
            let doubt = doubt.map_or(String::new(), |(other, frame)| {
                format!("; after {} {other} as well: look at the outlines", frame.name)
            });
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "mesh-frame-changed",
                    format!("the mesh as it is: {as_it_is}; after {}: {rating}. It is moved so{doubt}", frame.name),
                )
                .remedy("export the mesh in the frame of the cameras if the outlines of `patina check -o` do not fit"),
            );
            let linear = DMat3::from_mat4(frame.source_from_mesh);
            let normal_turn = linear.inverse().transpose();
            mesh.positions.iter_mut().for_each(|point| *point = frame.source_from_mesh.transform_point3(*point));
            for normal in &mut mesh.normals {
                *normal = (normal_turn * normal.as_dvec3()).normalize_or_zero().as_vec3();
            }
        }
        None if is_lost => findings.push(
            Finding::new(
                Severity::Warning,
                "mesh-frame-unknown",
                format!(
                    "{:.0} % of the views look at the mesh: it may be in another coordinate system than they are",
                    100.0 * as_it_is.views
                ),
            )
            .remedy("export mesh and cameras from the same project in the same coordinate system"),
        ),
        None if is_doubtless => {}
        None => findings.extend(told_of_trials(&as_it_is, &rated, tried, own)),
    }
    rater.into_views()
}

/// What was tried in vain, where photos or masks do say that something is off.
fn told_of_trials(as_it_is: &Rating, rated: &[(Rating, Trial)], tried: usize, own: &[MeshFrame]) -> Option<Finding> {
    let is_off = as_it_is.agreement.is_some_and(|agreement| agreement < LEAST_AGREEMENT)
        || as_it_is.overlap.is_some_and(|overlap| overlap < SOUND_OVERLAP);
    let names: Vec<&str> = own.iter().map(|frame| frame.name).collect();
    let own = if names.is_empty() { String::new() } else { format!(", {}", names.join(", ")) };
    let best = rated.first().map_or(String::new(), |(rating, frame)| format!("; after {}: {rating}", frame.name));
    let message = format!(
        "the mesh as it is: {as_it_is}{best}. Of {tried} other frames that were tried (axes turned, units of 100 and 1000{own}) \
         none is clearly better"
    );
    is_off.then(|| Finding::new(Severity::Note, "mesh-frames-tried", message))
}

#[cfg(test)]
#[path = "mesh_frame_tests.rs"]
mod tests;
