//! The tables of a study of object mode, out of the lines of its results file.

use super::asked::Figure;
use super::case::MEASURES;
use super::{VERSION, representation};
use crate::error::Result;
use crate::lab::study::{CaseLine, Results};
use crate::lab::study_table::StudyTable;
use std::path::Path;

/// Writes the tables of every part as Markdown, CSV and SVG; returns them as Markdown.
///
/// # Errors
/// Files that cannot be written.
pub fn write(results: &Results, folder: &Path) -> Result<String> {
    let lines = results.valid(VERSION);
    let mut text = String::new();
    for (part, done, planned) in results.shares(VERSION) {
        let share = format!("{done} of {planned} cases are done.");
        let own: Vec<&CaseLine> = lines.iter().copied().filter(|line| line.part() == part).collect();
        let stem = part.replace(' ', "-");
        let (figure, size) = part.split_once(' ').map_or((part.as_str(), ""), |(figure, size)| (figure, size));
        text += &match figure {
            _ if own.is_empty() => format!("## {part}\n\n{share}\n"),
            representation::PART => representation::write(&own, &share, folder, &stem)?,
            _ => photo_tables(figure, size, &own, &share, folder, &stem)?,
        };
        text.push('\n');
    }
    Ok(text)
}

/// The tables of a figure whose cases are photos: over all, by halves and by lights.
fn photo_tables(
    figure: &str,
    size: &str,
    lines: &[&CaseLine],
    share: &str,
    folder: &Path,
    stem: &str,
) -> Result<String> {
    let known = Figure::NAMED.iter().find(|(_, key, _)| *key == figure);
    let title = known.map_or_else(|| figure.to_string(), |(_, _, title)| title.to_string());
    let title = if size.is_empty() { title } else { format!("{title} ({size}: small photos and lights)") };
    // What a figure does not measure has no column: a case that failed is NaN in all that are left.
    let measured: Vec<&(&str, &str, &str)> =
        MEASURES.iter().filter(|(key, ..)| lines.iter().any(|line| line.figure(key).is_finite())).collect();
    let columns: Vec<(&str, &str)> = measured.iter().map(|(_, name, unit)| (*name, *unit)).collect();
    let table_of = |title: &str, rows: &str, name: &dyn Fn(&[&str; 6]) -> String| {
        let mut table = StudyTable::new(title, rows, &columns)
            .with_caption("Median over cases (one material under one light, one seed), in brackets the quartiles.");
        for line in lines {
            let Ok(words) = <[&str; 6]>::try_from(line.case.splitn(6, '/').collect::<Vec<_>>()) else { continue };
            let values: Vec<f64> = measured.iter().map(|(key, ..)| line.figure(key)).collect();
            table.add(&name(&words), &values);
        }
        table.notes.push(share.into());
        table
    };
    let table = table_of(&title, "variant", &|words| words[4].into());
    let by_half =
        table_of(&format!("{title}, half by half"), "half, variant", &|words| format!("{}, {}", words[1], words[4]));
    let by_light =
        table_of(&format!("{title}, light by light"), "light, variant", &|words| format!("{}, {}", words[3], words[4]));
    table.write(folder, stem)?;
    by_half.write(folder, &format!("{stem}_by_half"))?;
    by_light.write(folder, &format!("{stem}_by_light"))?;
    let mut text = table.to_markdown();
    text += "\nPhotos show the measured reflectance itself (MERL via neural fits), asked at every part of a light that is \
             finer than the one that is fitted. Errors of light are over the sphere by solid angle, those of reflectance \
             over the cells of the table, those of pictures over the object, all root mean squares of natural logarithms. \
             Aligned, and after a blur: after the best factor per channel. The material that is estimated is never among \
             the starts.\n\n";
    Ok(text + &by_half.to_markdown())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_says_what_share_of_its_cases_is_done() {
        let folder = tempfile::tempdir().unwrap();
        let mut results = Results::read(&folder.path().join("ibrdf.jsonl")).unwrap();
        results.plan(&[("fig5".to_string(), 40), ("fig4 quick".to_string(), 9)].into()).unwrap();
        for (half, light, error) in [("judging", "lebombo", 0.5), ("mixed", "meadow", 0.7)] {
            results
                .append(CaseLine {
                    case: format!("fig5/{half}/nickel/{light}/ibrdf + deep (clean)/seed 1"),
                    version: VERSION,
                    seed: 1,
                    inputs: Default::default(),
                    figures: [("light_15_degrees".to_string(), Some(error))].into(),
                    failed: None,
                    seconds: 1.0,
                })
                .unwrap();
        }
        let text = write(&results, folder.path()).unwrap();
        assert!(text.contains("2 of 40 cases are done") && text.contains("0 of 9 cases are done"), "{text}");
        assert!(text.contains("| ibrdf + deep (clean) | 0.6 (") && text.contains("| judging, ibrdf"), "{text}");
        assert!(!text.contains("single lamps"), "what was not measured has no column: {text}");
        let by_light = std::fs::read_to_string(folder.path().join("fig5_by_light.md")).unwrap();
        assert!(by_light.contains("| lebombo, ibrdf + deep (clean) | 0.5 |"), "{by_light}");
    }
}
