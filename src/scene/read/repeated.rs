//! One finding for what many views or files have in common: a page of a hundred lines that differ by a name tells nothing.

use crate::error::{Finding, Place};

/// Names that are told; more are counted.
const SHOWN: usize = 6;

/// The findings with those of one code joined, each where its first stood: the one with the most of it is told whole, of the
/// others the names of view or file. What has no place, where the message itself says of what it speaks, stays as it is.
pub fn joined(findings: Vec<Finding>) -> Vec<Finding> {
    let mut groups: Vec<Vec<Finding>> = Vec::with_capacity(findings.len());
    for finding in findings {
        let has_name = !name_of(&finding.target).is_empty();
        match groups.iter().position(|group| has_name && is_same(&group[0], &finding)) {
            Some(place) => groups[place].push(finding),
            None => groups.push(vec![finding]),
        }
    }
    groups.into_iter().filter_map(one_of).collect()
}

/// One finding of several that are the same but for their place and how much there is of it.
fn one_of(mut group: Vec<Finding>) -> Option<Finding> {
    let (worst, varies) = worst_of(&group)?;
    let mut told = group.remove(worst);
    if !group.is_empty() {
        let names: Vec<String> = group.iter().take(SHOWN).map(|other| name_of(&other.target)).collect();
        let more = if group.len() > SHOWN { format!(" and {} more", group.len() - SHOWN) } else { String::new() };
        let likewise = if varies { "less, or as much, in" } else { "likewise in" };
        told.message = format!("{}; {likewise} {} more: {}{more}", told.message, group.len(), names.join(", "));
    }
    Some(told)
}

/// The place of the finding with the most in it, the first of equals, and whether others have less; `None` of none.
pub fn worst_of<'a>(findings: impl IntoIterator<Item = &'a Finding>) -> Option<(usize, bool)> {
    let extents: Vec<f64> = findings.into_iter().map(|finding| finding.extent).collect();
    let worst = (0..extents.len()).max_by(|&a, &b| extents[a].total_cmp(&extents[b]).then(b.cmp(&a)))?;
    Some((worst, extents.iter().any(|extent| *extent < extents[worst])))
}

fn is_same(one: &Finding, other: &Finding) -> bool {
    let key = |finding: &Finding| (finding.code, finding.severity);
    key(one) == key(other) && one.remedy == other.remedy && !name_of(&one.target).is_empty()
}

/// The view, or the file and the line where there is one, without what else lies within it.
fn name_of(place: &Place) -> String {
    match place {
        Place::View(view) | Place::Pixel { view, .. } => view.clone(),
        Place::Line(path, line) => {
            format!("{} line {line}", path.file_name().unwrap_or_default().to_string_lossy())
        }
        Place::File(path) | Place::Byte(path, _) => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        _ => String::new(),
    }
}

/// Which of `all` photos these are, as a message says it; `None` for a single one, whose place says it.
pub fn which(names: &[&str], all: usize) -> Option<String> {
    let count = names.len();
    match count {
        _ if count == all && count > 1 => Some(format!("all {count} photos")),
        1 => None,
        _ if count <= SHOWN => Some(format!("{count} of {all} photos: {}", names.join(", "))),
        _ => Some(format!("{count} of {all} photos: {} and others", names[..SHOWN].join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Severity;

    #[test]
    fn findings_of_one_code_are_one_with_the_names_of_all() {
        let negative = |view: usize| {
            let place = Place::Pixel { view: format!("{view:03}"), row: 1, column: 2 };
            let pixels = if view == 7 { 900 } else { view };
            Finding::new(Severity::Note, "photo-negative", format!("{pixels} pixels are negative"))
                .at(place)
                .extent(pixels as f64)
        };
        let depth = |file: &str| Finding::new(Severity::Note, "depth", "not used").at(Place::Line(file.into(), 12));
        let bare = |name: &str| Finding::new(Severity::Warning, "held-out-unknown", format!("no view {name}"));
        let mut findings: Vec<Finding> = (0..9).map(negative).collect();
        findings.extend([depth("a/x.txt"), bare("p"), bare("q"), depth("a/y.txt")]);
        let messages: Vec<String> = joined(findings).iter().map(Finding::to_string).collect();
        assert_eq!(
            messages,
            [
                "note [photo-negative] view 007, pixel row 1 column 2: 900 pixels are negative; less, or as much, in 8 more: \
                 000, 001, 002, 003, 004, 005 and 2 more",
                "note [depth] a/x.txt, line 12: not used; likewise in 1 more: y.txt line 12",
                "warning [held-out-unknown]: no view p",
                "warning [held-out-unknown]: no view q",
            ]
        );
    }
}
