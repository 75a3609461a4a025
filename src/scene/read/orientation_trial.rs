//! Photos whose EXIF orientation leaves their sides as they are, so that no camera says whether it applies: both ways are tried
//! on the pixels, and the one that agrees with the cameras is taken and told. What the photos do not tell is not claimed.

use super::mesh_frame_rating::Rater;
use super::orientation::{Turn, Turns};
use super::repeated;
use crate::error::{Finding, Place, Severity};
use crate::math::statistics::quantile;
use crate::scene::doctor::ways::Way;
use std::collections::BTreeMap;

/// What was made of the photos of one orientation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    Turned,
    AsStored,
    Unknown,
}

/// Tries the orientations that are `open`, on the mesh as it stands in `rater`; returns what is to be turned. Photos that tell
/// nothing by themselves go the way of those of their orientation that do, where those all go one way.
pub fn decide(rater: &mut Rater<'_>, names: &[&str], open: &[Option<u8>], findings: &mut Vec<Finding>) -> Turns {
    let ways = rater.ways(open);
    let mut groups: BTreeMap<(u8, Verdict), Vec<usize>> = BTreeMap::new();
    let mut turns = Turns::new();
    for (view, tag) in open.iter().enumerate() {
        let Some(tag) = *tag else { continue };
        let of_tag = || ways.iter().zip(open).filter(|(_, other)| **other == Some(tag)).filter_map(|(way, _)| *way);
        let turning = of_tag().filter(Way::turns).count();
        let verdict = match ways[view] {
            Some(way) if way.turns() => Verdict::Turned,
            Some(_) => Verdict::AsStored,
            None if turning > 0 && turning == of_tag().count() => Verdict::Turned,
            None if turning == 0 && of_tag().count() > 0 => Verdict::AsStored,
            None => Verdict::Unknown,
        };
        if verdict == Verdict::Turned {
            turns.insert(names[view].to_owned(), Turn { mask: ways[view].is_none_or(|way| way.turns_mask) });
        }
        groups.entry((tag, verdict)).or_default().push(view);
    }
    findings.extend(groups.into_iter().map(|((tag, verdict), views)| told(tag, verdict, &views, names, &ways)));
    turns
}

fn told(tag: u8, verdict: Verdict, views: &[usize], names: &[&str], ways: &[Option<Way>]) -> Finding {
    let known: Vec<Way> = views.iter().filter_map(|&view| ways[view]).collect();
    let middle = |of: fn(&Way) -> f64| quantile(&known.iter().map(of).collect::<Vec<_>>(), 0.5);
    let (stored, turned) = (middle(|way| way.as_stored), middle(|way| way.turned));
    let (code, message) = match verdict {
        Verdict::Turned => (
            "photo-turned",
            format!(
                "turned by the EXIF orientation {tag}: photos agree by {turned:.2} so, and by {stored:.2} as stored"
            ),
        ),
        Verdict::AsStored => (
            "photo-as-stored",
            format!(
                "the EXIF orientation {tag} is not applied: photos agree by {stored:.2} as stored, and by {turned:.2} when \
                 they are turned"
            ),
        ),
        Verdict::Unknown => (
            "photo-as-stored",
            format!(
                "the EXIF orientation {tag} is not applied: neither the camera nor what the photos show tells whether it should be"
            ),
        ),
    };
    let names: Vec<&str> = views.iter().map(|&view| names[view]).collect();
    let finding = match repeated::which(&names, ways.len()) {
        None => Finding::new(Severity::Note, code, message).at(Place::View(names[0].to_owned())),
        Some(which) => Finding::new(Severity::Note, code, format!("{message} ({which})")),
    };
    match verdict {
        Verdict::Unknown => finding.remedy(
            "look at the outlines over the photos (check -o FOLDER): where they do not fit, turn the photos in an editor",
        ),
        _ => finding,
    }
}
