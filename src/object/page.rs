//! The page of an estimation: `report.html`, one file that works offline.

use super::joint::Estimate;
use super::progress::{ObjectiveRow, StepKind};
use super::split::{Gauge, SplitSpread};
use crate::error::Result;
use crate::image::{Image, RgbImage, file, resize};
use crate::insight::plot::{self, LinePlot, Scale, Series};
use crate::insight::report::number::{duration, escaped, fixed, significant};
use base64::Engine;

/// A picture with its caption, exposed by stops.
pub struct Shown<'a> {
    /// The caption.
    pub caption: String,
    /// Linear radiance.
    pub picture: &'a RgbImage,
    /// Exposure.
    pub stops: f32,
}

const STYLE: &str = "body{max-width:1100px;margin:auto;padding:24px;font:15px/1.5 system-ui,sans-serif;\
    color:#23272b;background:#fcfcfa}h1{font-weight:600}h2{font-size:20px;margin-top:32px}\
    .row{display:flex;flex-wrap:wrap;gap:14px}figure{margin:0}figcaption{font-size:13px;color:#646b72}\
    img{display:block;image-rendering:pixelated;border-radius:3px}table{border-collapse:collapse;font-size:14px}\
    td,th{padding:4px 12px;text-align:right;border-bottom:1px solid #e3e3de}td:first-child,th:first-child{text-align:left}\
    .note{color:#646b72;font-size:13.5px}@media(prefers-color-scheme:dark){body{background:#17191c;color:#e4e6e8}}\
    svg{max-width:680px}";

/// A page of sections, each a heading and a body of HTML.
pub fn page(title: &str, sections: &[(&str, String)]) -> String {
    let mut html = format!(
        "<!doctype html><html lang=en><head><meta charset=utf-8><title>{0} · Patina</title>\
         <style>{STYLE}{1}</style></head><body><h1>{0}</h1>",
        escaped(title),
        plot::STYLE
    );
    for (heading, body) in sections {
        html += &format!("<section><h2>{}</h2>{body}</section>", escaped(heading));
    }
    html + "</body></html>\n"
}

/// Pictures beside each other; small ones are enlarged to `least_width` pixels.
pub fn gallery(pictures: &[Shown], least_width: usize) -> Result<String> {
    let mut html = String::from("<div class=row>");
    for shown in pictures {
        let bytes = file::encode_png_srgb8(&enlarged(shown, least_width))?;
        let data = base64::engine::general_purpose::STANDARD.encode(bytes);
        let caption = escaped(&shown.caption);
        html += &format!(
            "<figure><img alt='{caption}' src='data:image/png;base64,{data}'><figcaption>{caption}</figcaption></figure>"
        );
    }
    Ok(html + "</div>")
}

/// The picture as bytes, each pixel repeated until it is wide enough to see.
pub fn enlarged(shown: &Shown, least_width: usize) -> Image<[u8; 3]> {
    let picture = shown.picture;
    let factor = least_width.div_ceil(picture.width().max(1)).max(1);
    let shrink = picture.width() / (4 * least_width).max(1);
    let small = if shrink > 1 { resize::shrink(picture, shrink) } else { picture.clone() };
    let bytes = file::srgb8_from_linear(&small, shown.stops);
    let (width, height) = (bytes.width() * factor, bytes.height() * factor);
    Image::from_fn(width, height, |row, column| bytes[(row / factor, column / factor)])
}

/// Stops that bring the 90th percentile of a picture's brightest channel to 0.7; black pixels are left out.
pub fn stops_of(picture: &RgbImage) -> f32 {
    let mut values: Vec<f32> =
        picture.pixels().iter().map(|pixel| pixel.max_element()).filter(|value| *value > 0.0).collect();
    values.sort_by(f32::total_cmp);
    match values.get(values.len() * 9 / 10) {
        Some(value) => (0.7 / value).log2().clamp(-40.0, 40.0),
        None => 0.0,
    }
}

/// A table; the first column is text.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let cells = |tag: &str, cells: &mut dyn Iterator<Item = String>| -> String {
        cells.map(|cell| format!("<{tag}>{cell}</{tag}>")).collect()
    };
    let mut html = format!("<table><tr>{}</tr>", cells("th", &mut head.iter().map(|cell| escaped(cell))));
    for row in rows {
        html += &format!("<tr>{}</tr>", cells("td", &mut row.iter().map(|cell| escaped(cell))));
    }
    html + "</table>"
}

/// The objective over the steps.
pub fn curve(rows: &[ObjectiveRow]) -> String {
    let series = |name: &str, term: &dyn Fn(&ObjectiveRow) -> f64| Series {
        name: name.into(),
        points: rows.iter().filter(|row| row.kind != StepKind::Start).map(|row| (row.seconds, term(row))).collect(),
        marked: true,
    };
    let plot = LinePlot {
        x_label: "seconds".into(),
        y_label: "objective".into(),
        x_scale: Scale::Linear,
        y_scale: Scale::Logarithmic,
        series: vec![
            series("all terms", &ObjectiveRow::total),
            series("picture", &|row| row.data),
            series("light prior", &|row| row.light_prior),
            series("code prior", &|row| row.code_prior),
        ],
        marks: Vec::new(),
    };
    plot.svg().unwrap_or_else(|| "<p class=note>No step was done.</p>".into())
}

/// What was found, in figures.
pub fn facts(estimate: &Estimate, model: &str, gauge: &Gauge, spread: &SplitSpread) -> String {
    let three = |values: [f64; 3]| values.map(significant).join(" · ");
    let known = |spread: Option<f64>| spread.map_or("not known".into(), |spread| fixed(spread, 3));
    let mut rows = vec![
        ("model", model.to_string()),
        ("began as", estimate.start.clone()),
        ("log error of the picture (RMS, natural)", fixed(estimate.picture_log_rmse, 4)),
        ("time", duration(estimate.seconds)),
        ("geometric mean of the light, R · G · B", three(gauge.light_mean)),
        ("largest directional albedo, R · G · B", three(gauge.largest_albedo)),
        ("starts that explain the photo as well", spread.starts.join(", ")),
        ("spread of the starts followed in the light (RMS, natural)", known(spread.light)),
        ("the same in the reflectance", known(spread.reflectance)),
    ];
    if let Some(seen) = &estimate.light_seen {
        rows.push(("directions the photos tell next to nothing of", format!("{:.0} %", 100.0 * seen.unseen_share)));
    }
    if let Some(bands) = &estimate.light_bands {
        let shares = bands.degrees.iter().zip(&bands.known);
        let shares: Vec<String> =
            shares.map(|(degrees, known)| format!("{degrees:.0}°: {:.0} %", 100.0 * known)).collect();
        rows.push(("the light", bands.sentence()));
        rows.push(("what the photos tell of it after a blur", shares.join(" · ")));
    }
    let rows: Vec<Vec<String>> = rows.into_iter().map(|(name, value)| vec![name.to_string(), value]).collect();
    table(&["", ""], &rows)
        + "<p class=note>No photo tells the level of the light: reflectance times a factor and light over it, channel by \
           channel, give the same picture.</p>"
}
