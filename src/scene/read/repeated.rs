//! One finding for what many views or files have in common: a page of a hundred lines that differ by a name tells nothing.

use crate::error::{Finding, Place};

/// Names that are told; more are counted.
const SHOWN: usize = 6;

/// The findings with those of one code joined, each at the place of its first: the first is told whole, of the others the names
/// of view or file. What has no place, where the message itself says of what it speaks, stays as it is.
pub fn joined(findings: Vec<Finding>) -> Vec<Finding> {
    let mut groups: Vec<(Finding, Vec<String>)> = Vec::with_capacity(findings.len());
    for finding in findings {
        let name = name_of(&finding.target);
        match groups.iter().position(|(first, _)| is_same(first, &finding)) {
            Some(place) if !name.is_empty() => groups[place].1.push(name),
            _ => groups.push((finding, Vec::new())),
        }
    }
    let told = groups.into_iter().map(|(mut first, others)| {
        if !others.is_empty() {
            let shown = others.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
            let more = if others.len() > SHOWN { format!(" and {} more", others.len() - SHOWN) } else { String::new() };
            first.message = format!("{}; likewise in {} more: {shown}{more}", first.message, others.len());
        }
        first
    });
    told.collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Severity;

    #[test]
    fn findings_of_one_code_are_one_with_the_names_of_all() {
        let negative = |view: usize| {
            Finding::new(Severity::Note, "photo-negative", format!("{view} pixels are negative")).at(Place::Pixel {
                view: format!("{view:03}"),
                row: 1,
                column: 2,
            })
        };
        let depth = |file: &str| Finding::new(Severity::Note, "depth", "not used").at(Place::Line(file.into(), 12));
        let bare = |name: &str| Finding::new(Severity::Warning, "held-out-unknown", format!("no view {name}"));
        let mut findings: Vec<Finding> = (0..9).map(negative).collect();
        findings.extend([depth("a/x.txt"), bare("p"), bare("q"), depth("a/y.txt")]);
        let messages: Vec<String> = joined(findings).iter().map(Finding::to_string).collect();
        assert_eq!(
            messages,
            [
                "note [photo-negative] view 000, pixel row 1 column 2: 0 pixels are negative; likewise in 8 more: 001, 002, \
                 003, 004, 005, 006 and 2 more",
                "note [depth] a/x.txt, line 12: not used; likewise in 1 more: y.txt line 12",
                "warning [held-out-unknown]: no view p",
                "warning [held-out-unknown]: no view q",
            ]
        );
    }
}
