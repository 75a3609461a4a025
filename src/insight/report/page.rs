//! The page: which section comes after which, and what each shows.

use super::data::ReportData;
use super::images::ReportImages;
use super::number::{duration, escaped, fixed, memory, percent, significant, whole};
use super::{choices, curves, gallery, tables};
use crate::error::Severity;
use crate::insight::plot;

const STYLE: &str = include_str!("page.css");

/// The whole page.
pub fn html(data: &ReportData, images: &ReportImages) -> String {
    let sections = [
        ("findings", "Findings", tables::findings(data)),
        ("views", "Photographs and fit", gallery::views(data, images)),
        ("scores", "Scores", scores(data)),
        ("capture", "Capture", tables::capture(data)),
        ("viewer", "From any side", viewer(images)),
        ("relit", "Under other lights", gallery::relit(images)),
        ("maps", "Maps", gallery::maps(images)),
        ("light", "Light", gallery::light(images)),
        ("choices", "What the scene needs", choices::section(data.choices.as_ref(), images.choices)),
        ("loss", "Loss", curves::loss(&data.loss_history) + &objective(data)),
        ("run", "Run", run(data)),
    ];
    let title = if data.title.is_empty() { "Untitled scene" } else { &data.title };
    let mut html = format!(
        "<!doctype html><html lang=en><head><meta charset=utf-8><meta name=viewport \
         content='width=device-width, initial-scale=1'><meta name=color-scheme content='light dark'>\
         <title>{} · Patina</title><style>{STYLE}{}</style></head><body><header><p class=kind>{}</p><h1>{}</h1>{}<nav>",
        escaped(title),
        plot::STYLE,
        escaped(if data.program.is_empty() { "Patina" } else { &data.program }),
        escaped(title),
        key_figures(data)
    );
    for (id, name, _) in &sections {
        html += &format!("<a href='#{id}'>{name}</a>");
    }
    html += "</nav></header><main>";
    for (id, name, body) in &sections {
        html += &format!("<section id={id}><h2>{name}</h2>{body}</section>");
    }
    html + "</main></body></html>\n"
}

/// The objective of the last descent, term by term.
fn objective(data: &ReportData) -> String {
    let Some([begin, _]) = data.objective.first() else { return String::new() };
    // Densities have no zero: all is told as what it fell by.
    let rows: Vec<Vec<String>> = data
        .objective
        .iter()
        .enumerate()
        .map(|(number, [before, after])| {
            let fell = |before: f64, after: f64| format!("{:+.0}", after - before);
            vec![
                (number + 1).to_string(),
                format!("{:.0}", before.total() - begin.total()),
                fell(before.pixels, after.pixels),
                fell(before.neighbours, after.neighbours),
                fell(before.dielectrics, after.dielectrics),
                fell(before.total(), after.total()),
            ]
        })
        .collect();
    let head =
        ["step", "objective<small>nats, from the first</small>", "pixels", "neighbours", "dielectrics", "<b>all</b>"];
    format!(
        "<h3>Objective of the last descent</h3><p class=note>The negative logarithm of how likely photos and beliefs are. Each \
         step makes it less, by the noise and gains learned before it; learning them anew changes what it is from step to \
         step.</p>{}",
        tables::table("scores", &head, &rows)
    )
}

/// A page inside the page, which can do nothing but draw.
fn viewer(images: &ReportImages) -> String {
    match &images.viewer {
        None => tables::empty("No 3D view is in this report: patina export RUN -o DIR --to web makes a page of one."),
        Some(page) => format!(
            "<iframe class=viewer sandbox=allow-scripts title='3D view' loading=lazy srcdoc=\"{}\"></iframe>",
            escaped(page)
        ),
    }
}

fn key_figures(data: &ReportData) -> String {
    let mut figures: Vec<(String, String, String)> = Vec::new();
    let judged = data
        .aggregates
        .iter()
        .find(|line| line.name.starts_with("held-out") && line.score.views > 0)
        .or_else(|| data.aggregates.first());
    if let Some(line) = judged {
        let (raw, aligned) = (&line.score.raw, &line.score.aligned);
        let kind = line.name.trim_end_matches(" views");
        let mut judged = |name: &str, value: String, aligned: String| {
            figures.push((format!("{name}, {kind}"), value, format!("aligned {aligned}")));
        };
        judged("PSNR", format!("{} dB", fixed(raw.psnr_srgb_db, 2)), format!("{} dB", fixed(aligned.psnr_srgb_db, 2)));
        judged("SSIM", fixed(raw.ssim_srgb, 4), fixed(aligned.ssim_srgb, 4));
        judged("RMSE", significant(raw.rmse_linear), significant(aligned.rmse_linear));
    }
    let total: f64 = data.timings.iter().map(|stage| stage.seconds).filter(|seconds| seconds.is_finite()).sum();
    if !data.timings.is_empty() {
        figures.push(("Time".into(), duration(total), format!("{} stages", data.timings.len())));
    }
    if let Some(bytes) = data.peak_memory_bytes {
        figures.push(("Peak memory".into(), memory(bytes), "resident".into()));
    }
    let charted = data.texels.seen + data.texels.unseen;
    if charted > 0 {
        let share = data.texels.seen as f64 / charted as f64;
        figures.push(("Texels seen".into(), percent(share), format!("of {}", whole(charted))));
    }
    let grave = data.findings.iter().filter(|finding| finding.severity > Severity::Note).count();
    let notes = data.findings.len() - grave;
    figures.push((
        "Warnings".into(),
        grave.to_string(),
        format!("{} {}", notes, if notes == 1 { "note" } else { "notes" }),
    ));
    let mut html = String::from("<dl class=figures>");
    for (name, value, note) in figures {
        html += &format!("<div><dt>{}</dt><dd>{value}</dd><dd class=sub>{}</dd></div>", escaped(&name), escaped(&note));
    }
    html + "</dl>"
}

fn scores(data: &ReportData) -> String {
    let statement = |name: &str, text: &str| {
        let text = if text.is_empty() { "not stated by the run" } else { text };
        format!("<p><b>{name}.</b> {}</p>", escaped(text))
    };
    format!(
        "<p class=note>Object pixels only; clipped pixels are left out. RMSE on linear radiance, PSNR and SSIM on \
         sRGB-encoded values. Aligned: after the factor per channel that brings the pictures nearest.</p>{}\
         <div class=statements>{}{}</div><h3>Against the truth</h3>{}<h3>View by view</h3>{}",
        tables::aggregates(data),
        statement("Scale", &data.gauge_statement),
        statement("Evidence", &data.evidence_statement),
        tables::truth(data.truth.as_ref()),
        tables::views(data)
    )
}

fn run(data: &ReportData) -> String {
    let peak = match data.peak_memory_bytes {
        Some(bytes) => format!("<p>{} resident at the peak.</p>", memory(bytes)),
        None => tables::empty("This system does not tell the peak memory of a process."),
    };
    format!(
        "<div class=columns><div><h3>Scene</h3>{}<h3>Texels</h3>{}</div><div><h3>Time</h3>{}<h3>Memory</h3>{peak}<h3>Numbers that were not finite</h3>{}</div>\
         <div><h3>Settings</h3>{}</div></div>",
        tables::facts(data),
        texels(data),
        tables::timings(data),
        tables::non_finite(data),
        tables::settings(data)
    )
}

fn texels(data: &ReportData) -> String {
    let charted = data.texels.seen + data.texels.unseen;
    if charted == 0 {
        return tables::empty("The run did not count the texels of its atlas.");
    }
    format!(
        "<p>{} of {} texels on charts are seen by a photograph; the other {} are filled in from their neighbours.</p>",
        whole(data.texels.seen),
        whole(charted),
        whole(data.texels.unseen)
    )
}
