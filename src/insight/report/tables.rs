//! The tables of the page.

use super::data::{ReportData, TruthErrors};
use super::number::{duration, escaped, fixed, percent, significant, whole};
use crate::error::Severity;
use crate::insight::capture::ViewCapture;
use crate::insight::scores::{AggregateScore, PictureScore};
use crate::insight::truth::ErrorPair;

/// A sentence that says why a section is empty.
pub fn empty(reason: &str) -> String {
    format!("<p class=empty>{}</p>", escaped(reason))
}

/// A table; the first column is text, the others are numbers. Cells are HTML.
pub fn table(class: &str, head: &[&str], rows: &[Vec<String>]) -> String {
    let mut html = format!("<div class=scroll><table class='{class}'><thead><tr>");
    for cell in head {
        html += &format!("<th>{cell}</th>");
    }
    html += "</tr></thead><tbody>";
    for row in rows {
        html += "<tr>";
        for cell in row {
            html += &format!("<td>{cell}</td>");
        }
        html += "</tr>";
    }
    html + "</tbody></table></div>"
}

/// What was noticed, the gravest first.
pub fn findings(data: &ReportData) -> String {
    if data.findings.is_empty() {
        return empty("Nothing was noticed: neither the pre-flight check nor the fit had a warning.");
    }
    let mut sorted: Vec<_> = data.findings.iter().collect();
    sorted.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    let mut html = String::from("<ul class=findings>");
    for finding in sorted {
        let severity = match finding.severity {
            Severity::Fatal => "fatal",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        html +=
            &format!("<li class={severity}><span class=badge>{severity}</span><div><p>{}", escaped(&finding.message));
        if !finding.place.is_empty() {
            html += &format!(" <span class=place>{}</span>", escaped(&finding.place));
        }
        html += "</p>";
        if !finding.remedy.is_empty() {
            html += &format!("<p class=remedy>What to do: {}</p>", escaped(&finding.remedy));
        }
        html += &format!("</div><code>{}</code></li>", escaped(&finding.code));
    }
    html + "</ul>"
}

fn score_cells(raw: &PictureScore, aligned: &PictureScore) -> Vec<String> {
    vec![
        significant(raw.rmse_linear),
        significant(aligned.rmse_linear),
        fixed(raw.psnr_srgb_db, 2),
        fixed(aligned.psnr_srgb_db, 2),
        fixed(raw.ssim_srgb, 4),
        fixed(aligned.ssim_srgb, 4),
    ]
}

const SCORE_HEAD: [&str; 6] = [
    "RMSE<small>linear</small>",
    "<small>aligned</small>",
    "PSNR<small>dB, sRGB</small>",
    "<small>aligned</small>",
    "SSIM<small>sRGB</small>",
    "<small>aligned</small>",
];

fn scale_text(scale: [f64; 3]) -> String {
    scale.map(|factor| fixed(factor, 3)).join(" · ")
}

fn aggregate_row(name: &str, score: &AggregateScore) -> Vec<String> {
    let mut row = vec![escaped(name), whole(score.views as u64)];
    row.extend(score_cells(&score.raw, &score.aligned));
    row.push(scale_text(score.scale));
    row
}

/// Scores of many views together.
pub fn aggregates(data: &ReportData) -> String {
    let mut rows: Vec<Vec<String>> =
        data.aggregates.iter().map(|line| aggregate_row(&line.name, &line.score)).collect();
    if let Some(relit) = data.truth.as_ref().and_then(|truth| truth.relit.as_ref()) {
        rows.push(aggregate_row("relit pictures against the truth", relit));
    }
    if rows.is_empty() {
        return empty("No view was scored: the run was stopped before its first comparison, or it has no views.");
    }
    let mut head = vec!["", "views"];
    head.extend(SCORE_HEAD);
    head.push("factor R · G · B");
    table("scores", &head, &rows)
}

/// Errors against the truth.
pub fn truth(truth: Option<&TruthErrors>) -> String {
    let Some(truth) = truth else {
        return empty(
            "No truth is known for this scene: these are photographs, so maps and light cannot be judged directly.",
        );
    };
    let pair = |name: &str, measure: &str, pair: &ErrorPair| {
        vec![name.into(), measure.into(), significant(pair.raw), significant(pair.aligned), scale_text(pair.scale)]
    };
    let mut rows = Vec::new();
    if let Some(maps) = &truth.maps {
        let texels = format!("RMSE over {} texels", whole(maps.texels));
        rows.push(pair("diffuse", &texels, &maps.diffuse));
        rows.push(pair("specular", &texels, &maps.specular));
        rows.push(pair("roughness r = a²", &texels, &maps.roughness));
    }
    if let Some(held) = &truth.intervals {
        let share = |value: f64| format!("{} %", fixed(100.0 * value, 0));
        let mut row = |name: &str, measure: &str, value: f64| {
            rows.push(vec![name.into(), measure.into(), share(value), String::new(), String::new()]);
        };
        row("diffuse", "stated 90 % intervals hold the truth, after its factor", held.diffuse);
        row("specular", "stated 90 % intervals hold the truth", held.specular);
        row("roughness r = a²", "stated 90 % intervals hold the truth", held.roughness);
    }
    if let Some(light) = &truth.environment {
        rows.push(pair("environment", "relative L2, by solid angle", &light.relative_l2));
        rows.push(pair("environment", "RMSE of natural logarithms", &light.log_rmse));
        let angle = light
            .brightest_angle_degrees
            .map_or("– <small>black map</small>".into(), |angle| format!("{}°", fixed(angle, 1)));
        rows.push(vec![
            "environment".into(),
            "angle between the brightest texels".into(),
            angle,
            String::new(),
            String::new(),
        ]);
    }
    if rows.is_empty() {
        return empty(
            "A truth is known, but nothing could be compared with it: the maps are on another atlas. Compare layers with `patina render --aov`.",
        );
    }
    table("scores text2", &["", "measure", "raw", "aligned", "factor R · G · B"], &rows)
}

/// Scores of every view, held-out ones first.
pub fn views(data: &ReportData) -> String {
    if data.views.is_empty() {
        return empty("No view was scored.");
    }
    let mut sorted: Vec<_> = data.views.iter().collect();
    sorted.sort_by_key(|view| (view.left_out, !view.held_out));
    let rows: Vec<Vec<String>> = sorted
        .into_iter()
        .map(|view| {
            let kind = match (view.left_out, view.held_out) {
                (true, _) => " <span class=tag>left out</span>",
                (false, true) => " <span class=tag>held out</span>",
                (false, false) => "",
            };
            let mut row = vec![format!("{}{kind}", escaped(&view.name))];
            row.extend(score_cells(&view.raw, &view.aligned));
            row.push(fixed(view.exposure_gain, 3));
            row.push(percent(view.clipped_share));
            row.push(whole(view.pixels));
            row.push(if view.non_finite_pixels == 0 {
                "0".into()
            } else {
                format!("<b>{}</b>", whole(view.non_finite_pixels))
            });
            row
        })
        .collect();
    let mut head = vec!["view"];
    head.extend(SCORE_HEAD);
    head.extend(["gain", "clipped", "pixels", "not finite"]);
    let open = if rows.len() <= 16 { " open" } else { "" };
    format!("<details{open}><summary>Each view ({})</summary>{}</details>", rows.len(), table("scores", &head, &rows))
}

/// How each photo lies against the model's picture of it.
pub fn capture(data: &ReportData) -> String {
    if data.capture.is_empty() {
        return empty("The photographs were not compared with the fitted model one by one.");
    }
    let with_error = |value: f64, error: f64, digits: usize| match value.is_finite() {
        true => format!("{} <small>± {}</small>", fixed(value, digits), fixed(error, digits)),
        false => "–".into(),
    };
    let share = |value: f64| if value.is_finite() { percent(value) } else { "–".into() };
    let row = |own: &ViewCapture| {
        vec![
            escaped(&own.name),
            with_error(own.shift_x_pixels, own.shift_error_pixels, 2),
            with_error(own.shift_y_pixels, own.shift_error_pixels, 2),
            with_error(own.roll_degrees, own.roll_error_degrees, 2),
            with_error(own.gain, own.gain * own.gain_error, 3),
            share(own.doubtful_mask_share),
            share(own.unlike_share),
        ]
    };
    let rows: Vec<Vec<String>> = data.capture.iter().map(row).collect();
    let head = [
        "view",
        "right<small>pixels</small>",
        "down<small>pixels</small>",
        "roll<small>degrees</small>",
        "gain",
        "mask in doubt",
        "unlike the model",
    ];
    let note = "<p class=note>How each photo lies against the fitted model's picture of it, with one standard error; the \
                gain is what no fitted exposure explains. Maps are fitted to the same photos: where cameras are off, \
                shifts are relative to what all of them show.</p>";
    let open = if rows.len() <= 16 { " open" } else { "" };
    format!(
        "{note}<details{open}><summary>Each view ({})</summary>{}</details>",
        rows.len(),
        table("scores", &head, &rows)
    )
}

/// Settings, the changed ones first and marked.
pub fn settings(data: &ReportData) -> String {
    if data.settings.is_empty() {
        return empty("The run did not say its settings.");
    }
    let changed = data.settings.iter().filter(|line| !line.is_default).count();
    let mut sorted: Vec<_> = data.settings.iter().collect();
    sorted.sort_by_key(|line| line.is_default);
    let mut html =
        format!("<p class=note>{changed} of {} changed; these come first.</p><dl class=pairs>", data.settings.len());
    for line in sorted {
        let class = if line.is_default { "" } else { " class=changed" };
        html += &format!("<div{class}><dt>{}</dt><dd>{}</dd></div>", escaped(&line.name), escaped(&line.value));
    }
    html + "</dl>"
}

/// Facts of the scene.
pub fn facts(data: &ReportData) -> String {
    if data.scene_facts.is_empty() {
        return empty("The run did not describe its scene.");
    }
    let mut html = String::from("<dl class=pairs>");
    for fact in &data.scene_facts {
        html += &format!("<div><dt>{}</dt><dd>{}</dd></div>", escaped(&fact.name), escaped(&fact.value));
    }
    html + "</dl>"
}

/// Time of each stage as bars.
pub fn timings(data: &ReportData) -> String {
    if data.timings.is_empty() {
        return empty("No stage was timed.");
    }
    let total: f64 = data.timings.iter().map(|stage| stage.seconds).filter(|seconds| seconds.is_finite()).sum();
    let mut html = String::from("<dl class=pairs>");
    for stage in &data.timings {
        let share = if total > 0.0 && stage.seconds.is_finite() {
            (100.0 * stage.seconds / total).clamp(0.0, 100.0)
        } else {
            0.0
        };
        html += &format!(
            "<div class=timed style='--share:{share:.1}%'><dt>{}</dt><dd>{}</dd></div>",
            escaped(&stage.stage),
            duration(stage.seconds)
        );
    }
    html + &format!("<div class=total><dt>together</dt><dd>{}</dd></div></dl>", duration(total))
}

/// Numbers that were not finite.
pub fn non_finite(data: &ReportData) -> String {
    if data.non_finite.iter().all(|line| line.count == 0) {
        return empty("Every number stayed finite.");
    }
    let mut html = String::from("<dl class=pairs>");
    for line in data.non_finite.iter().filter(|line| line.count > 0) {
        html += &format!("<div class=changed><dt>{}</dt><dd>{}</dd></div>", escaped(&line.name), whole(line.count));
    }
    html + "</dl>"
}
