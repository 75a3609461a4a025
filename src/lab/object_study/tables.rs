//! The tables and the page of a study, out of the lines of `results.csv`.

use super::case::{CasePictures, MEASURES};
use super::inputs::Inputs;
use super::plan::{Case, Figure};
use super::{StudyOptions, fields_of};
use crate::error::Result;
use crate::insight::report::number::escaped;
use crate::lab::study_table::StudyTable;
use crate::object::page::{Shown, gallery, page, stops_of};

/// Most cases that are shown in pictures.
const MOST_SHOWN: usize = 24;

/// Writes `report.html` of these sections.
///
/// # Errors
/// A file that cannot be written.
pub fn write_page(options: &StudyOptions, sections: &[(&str, String)]) -> Result<()> {
    crate::files::write_bytes(&options.output.join("report.html"), page("Study of object mode", sections).as_bytes())
}

/// Writes a table a figure as CSV, Markdown and SVG, and `report.html`, which begins with the sections of `first`;
/// returns the tables as Markdown.
///
/// # Errors
/// Files that cannot be written.
pub fn write(
    options: &StudyOptions,
    inputs: &Inputs,
    cases: &[Case],
    lines: &[String],
    pictures: &[CasePictures],
    first: Vec<(&'static str, String)>,
) -> Result<String> {
    let mut text = String::new();
    let mut sections = first;
    sections.push(("What was done with photos", what_was_done(options, inputs)));
    for (figure, key, title) in Figure::NAMED {
        let mut done: Vec<(&Case, Vec<f64>)> = Vec::new();
        for case in cases.iter().filter(|case| case.figure == figure) {
            let Some(fields) = lines.iter().find_map(|line| fields_of(line, case)) else { continue };
            done.push((case, fields.iter().map(|field| field.parse().unwrap_or(f64::NAN)).collect()));
        }
        if done.is_empty() {
            continue;
        }
        // What a figure does not measure has no column: a case that failed is NaN in all that are left.
        let is_measured =
            |column: &usize| done.iter().any(|(_, values)| values.get(*column).is_some_and(|v| v.is_finite()));
        let columns: Vec<usize> = (0..MEASURES.len()).filter(is_measured).collect();
        let measures: Vec<(&str, &str)> = columns.iter().map(|&column| MEASURES[column]).collect();
        let table_of = |title: &str, rows: &str, name: &dyn Fn(&Case) -> String| {
            let mut table = StudyTable::new(title, rows, &measures);
            for (case, values) in &done {
                let kept: Vec<f64> = columns.iter().map(|&c| values.get(c).copied().unwrap_or(f64::NAN)).collect();
                table.add(&name(case), &kept);
            }
            table.notes.push(format!("Seed {}; a sample is one material under one light.", options.seed));
            table
        };
        let table = table_of(title, "variant", &|case| case.variant());
        table.write(&options.output, key)?;
        text += &table.to_markdown();
        text.push('\n');
        let by_light = table_of(&format!("{title}, light by light"), "light, variant", &|case| {
            format!("{}, {}", case.light, case.variant())
        });
        by_light.write(&options.output, &format!("{key}_by_light"))?;
        let places = [1, 3, 6, 8].iter().filter_map(|own| columns.iter().position(|column| column == own));
        let bars: String = places.filter_map(|place| table.bar_svg(place)).collect();
        let (all, lights) = (escaped(&table.to_markdown()), escaped(&by_light.to_markdown()));
        sections.push((
            title,
            format!("<pre>{all}</pre>{bars}<details><summary>Light by light</summary><pre>{lights}</pre></details>"),
        ));
    }
    let mut shown = String::new();
    for case in pictures.iter().take(MOST_SHOWN) {
        shown += &format!("<h3>{}</h3>", escaped(&case.title));
        // A fitted light is shown at the exposure of the true one, after the same mean: levels are not known.
        let mut beside = Vec::new();
        let mut stops = 0.0;
        for (index, (caption, picture)) in case.pictures.iter().enumerate() {
            if index % 2 == 0 || index == 3 || index == 5 {
                stops = stops_of(picture);
            }
            beside.push(Shown { caption: caption.clone(), picture, stops });
        }
        shown += &gallery(&beside, 160)?;
    }
    if shown.is_empty() {
        shown = "<p class=note>All cases were done in an earlier sitting: no picture was made in this one.</p>".into();
    }
    sections.push(("Pictures", shown));
    write_page(options, &sections)?;
    Ok(text)
}

fn what_was_done(options: &StudyOptions, inputs: &Inputs) -> String {
    let (width, height) = inputs.settings.light_size();
    let fine = &inputs.held_out.1;
    let text = format!(
        "Photos show the measured reflectance itself (MERL via neural fits), asked at every part of a light of {} x {} \
         texels and summed without noise, which is what the path tracer comes to as well; what is fitted is a light of {width} x {height} texels and a model at {} nodes, by {} pixels. Errors of \
         light are over the sphere by solid angle, those of reflectance over all cells of the table (aligned ones over every \
         eleventh), those of pictures \
         over the object; all are root mean squares of natural logarithms. Aligned: after the best factor per channel. \
         The material that is estimated is never among the starts. The neural model was trained on {} materials; rows of \
         materials that are among them say so. Held-out light: {}. Seed {}.",
        fine.width(),
        fine.height(),
        inputs.settings.nodes.iter().product::<usize>(),
        inputs.settings.pixels,
        inputs.trained.account.materials.len(),
        inputs.held_out.0,
        options.seed
    );
    format!("<p>{}</p>", escaped(&text))
}
