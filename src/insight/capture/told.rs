//! From figures to findings: thresholds, names, remedies.

use super::ViewCapture;
use super::points::Point;
use super::sides::Sides;
use super::space::MissingPart;
use crate::error::{Finding, Place, Severity};
use crate::math::statistics::quantile;
use glam::Vec3;

/// A figure is told when it is more than so many standard errors from nothing.
const ERRORS: f64 = 4.0;
/// Least shift of a photo that is told, in its pixels.
const LEAST_SHIFT_PIXELS: f64 = 0.25;
/// Least share of the difference between photo and model that a shift explains when it is told. Of cameras turned by one
/// or two pixels it explained 0.7 and more; of a mirror under a poor fit, whose reflections move, less than 0.4.
const LEAST_EXPLAINED: f64 = 0.5;
/// A shift that explains less is told all the same when it is so many times the median of all views, and so many errors
/// large: of photos of a real place the model misses more than one turned camera adds.
const OUTLIER: f64 = 6.0;
/// Least departure of a gain that is told.
const LEAST_GAIN: f64 = 0.05;
/// Least share of doubtful mask pixels that is told, over all views.
const LEAST_DOUBTFUL: f64 = 0.005;
/// Least share of unlike points of the surface that is told.
const LEAST_UNLIKE: f64 = 0.02;
/// An arc without cameras beyond this is one-sided, in degrees.
const WIDEST_GAP_DEGREES: f64 = 225.0;
/// Names in a message.
const NAMES: usize = 4;

/// What is judged.
pub struct Figures<'a> {
    /// By view.
    pub views: &'a [ViewCapture],
    /// Doubtful and judged pixels of each view's mask.
    pub masks: &'a [Option<(usize, usize)>],
    /// Points of the surface.
    pub points: &'a [Point],
    /// A part that the mesh lacks.
    pub missing: Option<&'a MissingPart>,
    /// Where cameras stand.
    pub sides: Option<Sides>,
    /// Whether the fit had a gain for each view.
    pub gains_are_fitted: bool,
}

/// All that is worth telling, warnings first.
pub fn findings(figures: &Figures) -> Vec<Finding> {
    let mut all: Vec<Finding> = [
        cameras(figures.views),
        exposure(figures.views, figures.gains_are_fitted),
        masks(figures.views, figures.masks),
        missing(figures),
        unlike(figures),
        sides(figures.sides),
    ]
    .into_iter()
    .flatten()
    .collect();
    all.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    all
}

/// The names of the worst views with a figure each; `worst` comes sorted.
fn list(worst: &[(&str, String)]) -> String {
    let shown: Vec<String> = worst.iter().take(NAMES).map(|(name, figure)| format!("{name} {figure}")).collect();
    let rest = worst.len().saturating_sub(NAMES);
    let and = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    shown.join(", ") + &and
}

fn view(name: &str) -> Place {
    Place::View(name.into())
}

/// Shift and roll of a view in pixels, where they are told; `usual` is the median shift of all views.
fn turned_by(own: &ViewCapture, usual: f64) -> Option<f64> {
    let shift = own.shift_x_pixels.hypot(own.shift_y_pixels);
    let is_cause = own.shift_explains >= LEAST_EXPLAINED;
    let is_shifted = is_cause && shift > LEAST_SHIFT_PIXELS && shift > ERRORS * own.shift_error_pixels;
    let stands_out = shift > 2.0 * LEAST_SHIFT_PIXELS && shift > OUTLIER * usual.max(own.shift_error_pixels);
    let is_rolled = is_cause
        && own.roll_corner_pixels > LEAST_SHIFT_PIXELS
        && own.roll_degrees.abs() > ERRORS * own.roll_error_degrees;
    match (is_shifted || stands_out, is_rolled) {
        (false, false) => None,
        (true, false) => Some(shift),
        (false, true) => Some(own.roll_corner_pixels),
        (true, true) => Some(shift.max(own.roll_corner_pixels)),
    }
}

fn cameras(views: &[ViewCapture]) -> Option<Finding> {
    let lengths: Vec<f64> = views.iter().map(|own| own.shift_x_pixels.hypot(own.shift_y_pixels)).collect();
    let usual = quantile(&lengths.into_iter().filter(|length| length.is_finite()).collect::<Vec<_>>(), 0.5);
    let mut turned: Vec<(&ViewCapture, f64)> =
        views.iter().filter_map(|own| turned_by(own, usual).map(|pixels| (own, pixels))).collect();
    turned.sort_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.name.cmp(&b.0.name)));
    let worst: Vec<(&str, String)> = turned
        .iter()
        .map(|(own, pixels)| {
            let errors = own.shift_error_pixels;
            (own.name.as_str(), format!("{pixels:.2} ± {errors:.2}"))
        })
        .collect();
    let (first, _) = turned.first()?;
    let message =
        format!("{} of {} photos lie off the model's pictures, in pixels: {}", turned.len(), views.len(), list(&worst));
    Some(Finding::new(Severity::Warning, "camera-turned", message).at(view(&first.name)).remedy(
        "refine the cameras against the mesh (bundle adjustment), or leave these photos out: --exclude NAME; maps are \
         blurred by as much",
    ))
}

fn exposure(views: &[ViewCapture], gains_are_fitted: bool) -> Option<Finding> {
    let mut off: Vec<&ViewCapture> = views
        .iter()
        .filter(|own| own.gain.ln().abs() > LEAST_GAIN.ln_1p() && own.gain.ln().abs() > ERRORS * own.gain_error)
        .collect();
    off.sort_by(|a, b| b.gain.ln().abs().total_cmp(&a.gain.ln().abs()).then_with(|| a.name.cmp(&b.name)));
    let first = off.first()?;
    let worst: Vec<(&str, String)> =
        off.iter().map(|own| (own.name.as_str(), format!("{:+.0} %", 100.0 * (own.gain - 1.0)))).collect();
    let message = format!(
        "{} of {} photos are brighter or darker than the model's pictures: {}",
        off.len(),
        views.len(),
        list(&worst)
    );
    Some(Finding::new(Severity::Warning, "exposure-varies", message).at(view(&first.name)).remedy(
        match gains_are_fitted {
            false => "fit a gain for each photo: --exposure; or develop all photos with one exposure",
            true => "the gains that were fitted do not explain it: fit for more steps, or leave these photos out: --exclude NAME",
        },
    ))
}

fn masks(views: &[ViewCapture], masks: &[Option<(usize, usize)>]) -> Option<Finding> {
    let (doubtful, judged) =
        masks.iter().flatten().fold((0, 0), |(doubtful, judged), own| (doubtful + own.0, judged + own.1));
    let share = doubtful as f64 / judged.max(1) as f64;
    let mut worst: Vec<&ViewCapture> = views.iter().filter(|own| own.doubtful_mask_share > LEAST_DOUBTFUL).collect();
    worst.sort_by(|a, b| b.doubtful_mask_share.total_cmp(&a.doubtful_mask_share).then_with(|| a.name.cmp(&b.name)));
    let first = worst.first()?;
    let names: Vec<(&str, String)> =
        worst.iter().map(|own| (own.name.as_str(), format!("{:.1} %", 100.0 * own.doubtful_mask_share))).collect();
    let message = format!(
        "masks contradict the mesh away from its outline in {:.1} % of the pixels; the most in {}",
        100.0 * share,
        list(&names)
    );
    (share > LEAST_DOUBTFUL).then(|| {
        Finding::new(Severity::Warning, "mask-doubtful", message)
            .at(view(&first.name))
            .remedy("look at the masks of these photos and mend or drop them: without a mask the mesh decides")
    })
}

fn text_of(place: Vec3) -> String {
    format!("({:.2}, {:.2}, {:.2})", place.x, place.y, place.z)
}

fn missing(figures: &Figures) -> Option<Finding> {
    let part = figures.missing?;
    let mut shown: Vec<(&str, f64)> =
        figures.views.iter().zip(&part.share_of_view).map(|(own, share)| (own.name.as_str(), *share)).collect();
    shown.retain(|(_, share)| *share > 0.0);
    shown.sort_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(b.0)));
    let (first, _) = shown.first()?;
    let names: Vec<(&str, String)> =
        shown.iter().map(|(name, share)| (*name, format!("{:.1} %", 100.0 * share))).collect();
    let side = f64::from(part.cell_length) * (part.cells as f64).cbrt();
    let message = format!(
        "{} photos agree on something around {} where the mesh has nothing, some {side:.2} wide: of their pixels, {}",
        shown.len(),
        text_of(part.centre),
        list(&names)
    );
    Some(Finding::new(Severity::Warning, "mesh-missing-part", message).at(view(first)).remedy(
        "give a mesh that has the part, or mask it in the photos: around it, maps and light take up what it hides",
    ))
}

fn unlike(figures: &Figures) -> Option<Finding> {
    let judged = figures.points.iter().filter(|point| point.is_judged()).count();
    let unlike: Vec<&Point> = figures.points.iter().filter(|point| point.is_unlike()).collect();
    let share = unlike.len() as f64 / judged.max(1) as f64;
    let mut worst: Vec<&ViewCapture> = figures.views.iter().filter(|own| own.unlike_share > 0.0).collect();
    worst.sort_by(|a, b| b.unlike_share.total_cmp(&a.unlike_share).then_with(|| a.name.cmp(&b.name)));
    let first = worst.first()?;
    let names: Vec<(&str, String)> =
        worst.iter().map(|own| (own.name.as_str(), format!("{:.1} %", 100.0 * own.unlike_share))).collect();
    let middle = unlike.iter().map(|point| point.position).sum::<Vec3>() / unlike.len().max(1) as f32;
    let message = format!(
        "{:.1} % of the surface looks unlike the photos in most views that see it, around {}; the most in {}",
        100.0 * share,
        text_of(middle),
        list(&names)
    );
    (share > LEAST_UNLIKE).then(|| {
        Finding::new(Severity::Warning, "mesh-unlike-photos", message).at(view(&first.name)).remedy(
            "compare photo and model there: the mesh is off, something stood in front of it, or its material is none \
             that the model has",
        )
    })
}

fn sides(sides: Option<Sides>) -> Option<Finding> {
    let sides = sides.filter(|sides| sides.gap_degrees > WIDEST_GAP_DEGREES)?;
    let message = format!(
        "all photos were taken from within {:.0} degrees around the scene; {:.0} % of the mesh is seen by none",
        360.0 - sides.gap_degrees,
        100.0 * sides.unseen_share
    );
    Some(Finding::new(Severity::Warning, "one-sided", message).remedy(
        "photograph from further round: gloss is known only where highlights were seen, and unseen maps are filled in",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sound(name: &str) -> ViewCapture {
        ViewCapture {
            name: name.into(),
            shift_x_pixels: 0.2,
            shift_y_pixels: 0.0,
            shift_error_pixels: 0.01,
            roll_degrees: 0.01,
            roll_error_degrees: 0.01,
            roll_corner_pixels: 0.1,
            shift_explains: 0.9,
            gain: 1.04,
            gain_error: 0.001,
            doubtful_mask_share: f64::NAN,
            unlike_share: 0.0,
        }
    }

    fn told(views: &[ViewCapture]) -> Vec<Finding> {
        let masks = vec![None; views.len()];
        let figures =
            Figures { views, masks: &masks, points: &[], missing: None, sides: None, gains_are_fitted: false };
        findings(&figures)
    }

    #[test]
    fn what_is_small_uncertain_or_unknown_is_not_told() {
        let unknown = ViewCapture { shift_x_pixels: f64::NAN, gain: f64::NAN, shift_explains: f64::NAN, ..sound("c") };
        let uncertain =
            ViewCapture { shift_x_pixels: 1.0, shift_error_pixels: 0.3, gain: 1.3, gain_error: 0.1, ..sound("b") };
        let another_cause = ViewCapture { shift_x_pixels: 1.0, shift_explains: 0.2, ..sound("d") };
        assert!(told(&[sound("a"), uncertain, unknown, another_cause]).is_empty());
        assert!(told(&[]).is_empty());
    }

    #[test]
    fn one_camera_far_off_among_sound_ones_is_told_whatever_else_the_model_misses() {
        let mut views: Vec<ViewCapture> = (0..7).map(|index| sound(&format!("v{index}"))).collect();
        views.iter_mut().for_each(|own| own.shift_explains = 0.02);
        views[3].shift_y_pixels = 1.5;
        let found = told(&views);
        assert!(found.len() == 1 && found[0].message.contains("1 of 7") && found[0].message.contains("v3 1.51"));
    }

    #[test]
    fn the_worst_views_come_first_by_name_and_figure() {
        let mut views: Vec<ViewCapture> = (0..7).map(|index| sound(&format!("v{index}"))).collect();
        views.iter_mut().enumerate().skip(1).for_each(|(index, own)| own.shift_x_pixels = 0.3 * index as f64);
        views[4].gain = 0.7;
        let found = told(&views);
        assert_eq!(found.iter().map(|own| own.code).collect::<Vec<_>>(), ["camera-turned", "exposure-varies"]);
        assert_eq!(found[0].target, Place::View("v6".into()));
        assert!(found[0].message.contains("6 of 7") && found[0].message.contains("v6 1.80 ± 0.01, v5 1.50"));
        assert!(found[0].message.ends_with("and 2 more"), "{}", found[0].message);
        assert!(found[1].message.contains("v4 -30 %") && found[1].remedy.contains("--exposure"));
        assert!(found.iter().all(|own| !own.remedy.is_empty() && own.severity == Severity::Warning));
        views[3].roll_corner_pixels = 3.0;
        views[3].roll_degrees = 2.0;
        assert!(told(&views)[0].message.contains("v3 3.00"), "a roll counts by how far it moves the corners");
    }
}
