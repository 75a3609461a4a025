//! The page: which section comes after which, and what each shows.

use super::data::{ReportData, ViewLine};
use super::images::{MOST_VIEWS_SHOWN, ReportImages, ViewPictures, views_to_show};
use super::number::{duration, escaped, fixed, memory, percent, short, whole};
use super::{picture, tables};
use crate::error::Severity;
use crate::export::LossRow;
use crate::image::{GreyImage, Image, RgbImage};
use crate::insight::plot::{self, LinePlot, Scale, Series};
use glam::Vec3;
use rayon::prelude::*;

const STYLE: &str = include_str!("page.css");
/// Bytes of HTML that the pictures of the views, and those of the relit strips, may take together.
const MOST_VIEW_BYTES: usize = 8_000_000;
const MOST_RELIT_BYTES: usize = 3_000_000;
/// Sizes that are tried in this order until the pictures fit: (width in pixels, JPEG quality).
const SIZES: [(usize, u8); 5] = [(640, 86), (480, 84), (360, 80), (240, 75), (160, 60)];
const MOST_RELIT_LIGHTS: usize = 12;
const MOST_RELIT_PICTURES: usize = 6;

/// The whole page.
pub fn html(data: &ReportData, images: &ReportImages) -> String {
    let sections = [
        ("findings", "Findings", tables::findings(data)),
        ("views", "Photographs and fit", views(data, images)),
        ("scores", "Scores", scores(data)),
        ("relit", "Under other lights", relit(images)),
        ("maps", "Maps", maps(images)),
        ("light", "Light", light(images)),
        ("loss", "Loss", loss(&data.loss_history)),
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

fn key_figures(data: &ReportData) -> String {
    let mut figures: Vec<(String, String, String)> = Vec::new();
    let judged = data
        .aggregates
        .iter()
        .find(|line| line.name.starts_with("held-out") && line.score.views > 0)
        .or_else(|| data.aggregates.first());
    if let Some(line) = judged {
        let (raw, aligned) = (&line.score.raw, &line.score.aligned);
        let name = &line.name;
        figures.push((
            "PSNR".into(),
            format!("{} dB", fixed(raw.psnr_srgb_db, 2)),
            format!("{name}; aligned {}", fixed(aligned.psnr_srgb_db, 2)),
        ));
        figures.push((
            "SSIM".into(),
            fixed(raw.ssim_srgb, 3),
            format!("{name}; aligned {}", fixed(aligned.ssim_srgb, 3)),
        ));
        figures.push((
            "RMSE, linear".into(),
            short(raw.rmse_linear),
            format!("{name}; aligned {}", short(aligned.rmse_linear)),
        ));
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
    figures.push(("Warnings".into(), grave.to_string(), format!("{} notes", data.findings.len() - grave)));
    let mut html = String::from("<dl class=figures>");
    for (name, value, note) in figures {
        html += &format!("<div><dt>{}</dt><dd>{value}</dd><dd class=sub>{}</dd></div>", escaped(&name), escaped(&note));
    }
    html + "</dl>"
}

/// Encodes pictures at the first of [`SIZES`] at which `parts` stay below `most_bytes` together, in their order.
fn within<T: Sync>(parts: &[T], most_bytes: usize, encode: impl Fn(&T, usize, u8) -> String + Sync) -> Vec<String> {
    let mut encoded = Vec::new();
    for (width, quality) in SIZES {
        encoded = parts.par_iter().map(|part| encode(part, width, quality)).collect();
        if encoded.iter().map(String::len).sum::<usize>() <= most_bytes {
            break;
        }
    }
    encoded
}

fn views(data: &ReportData, images: &ReportImages) -> String {
    let kinds: [Vec<&ViewPictures>; 2] =
        [true, false].map(|held_out| images.views.iter().filter(|view| view.held_out == held_out).collect());
    let shown = kinds.map(|kind| views_to_show(kind.len()).into_iter().map(|index| kind[index]).collect::<Vec<_>>());
    let differences: Vec<(&ViewPictures, GreyImage)> = shown
        .iter()
        .flatten()
        .map(|view| {
            let (photo, fit) = (picture::shrunk(&view.photo, SIZES[0].0), picture::shrunk(&view.fit, SIZES[0].0));
            (*view, picture::encoded_difference(&photo, &fit, images.exposure_stops))
        })
        .collect();
    if differences.is_empty() {
        return tables::empty(
            "No photograph was compared: the run has no views, or it was stopped before its first picture.",
        );
    }
    // One scale for all error pictures, so that they can be compared with each other.
    let values: Vec<f64> = differences
        .iter()
        .flat_map(|(view, difference)| {
            let mask = view.counted.as_ref().map(|mask| picture::shrunk_mask(mask, SIZES[0].0));
            let counts = move |index: usize| mask.as_ref().is_none_or(|mask| mask.pixels().get(index) == Some(&true));
            let pixels = difference.pixels().iter().enumerate();
            pixels.filter(|(index, _)| counts(*index)).map(|(_, &value)| f64::from(value)).collect::<Vec<f64>>()
        })
        .collect();
    let full_scale = picture::round_full_scale(&values);
    drop(differences);

    let triples = within(&shown.concat(), MOST_VIEW_BYTES, |view, width, quality| {
        triple(view, data, images.exposure_stops, full_scale, width, quality)
    });
    let (held_out, training) = triples.split_at(shown[0].len());
    let mut html = legend(full_scale);
    html += "<h3>Held-out views</h3>";
    html += &if held_out.is_empty() {
        tables::empty(
            "No view was held out, so nothing judges the fit on photographs it has not seen. Hold some out with --held-out.",
        )
    } else {
        strip(held_out, "")
    };
    html += "<h3>Training views</h3>";
    html += &if training.is_empty() {
        tables::empty("Every view was held out, or no picture of a training view was rendered.")
    } else {
        let first = strip(&training[..training.len().min(6)], " two");
        let rest = &training[training.len().min(6)..];
        if rest.is_empty() {
            first
        } else {
            format!("{first}<details><summary>{} more</summary>{}</details>", rest.len(), strip(rest, " two"))
        }
    };
    let left_out = data.views.len().saturating_sub(triples.len());
    if left_out > 0 {
        html += &format!(
            "<p class=note>{left_out} more views are scored below; pictures of at most {MOST_VIEWS_SHOWN} views of each kind are shown, evenly spread.</p>"
        );
    }
    html
}

fn strip(triples: &[String], class: &str) -> String {
    format!("<div class='triples{class}'>{}</div>", triples.concat())
}

fn legend(full_scale: f32) -> String {
    let colours: Vec<String> = picture::RAMP.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
    let [r, g, b] = picture::NOT_COUNTED;
    format!(
        "<div class=legend><span>Left to right: photograph, fit, error. Error: mean over channels of |fit − photo|, sRGB-encoded, 1 is white</span>\
         <span class=scale><span>0</span><i style='background:linear-gradient(90deg,{})'></i><span>{} and more</span></span>\
         <span class=scale><i class=chip style='background:rgb({r},{g},{b})'></i><span>not counted: background, clipped, masked</span></span>\
         <span class=scale><i class=chip style='background:#f0f'></i><span>not finite</span></span></div>",
        colours.join(","),
        short(f64::from(full_scale) as f32 as f64)
    )
}

fn triple(view: &ViewPictures, data: &ReportData, stops: f32, full_scale: f32, width: usize, quality: u8) -> String {
    let (photo, fit) = (picture::shrunk(&view.photo, width), picture::shrunk(&view.fit, width));
    let mask = view.counted.as_ref().map(|mask| picture::shrunk_mask(mask, width));
    let difference = picture::encoded_difference(&photo, &fit, stops);
    let pictures = [
        ("photograph", picture::screen_of_linear(&photo, stops)),
        ("fit", picture::screen_of_linear(&fit, stops)),
        ("error", picture::screen_of_difference(&difference, mask.as_ref(), full_scale)),
    ];
    let mut html = format!("<figure class=triple><figcaption><b>{}</b>", escaped(&view.name));
    if let Some(line) = data.views.iter().find(|line| line.name == view.name) {
        html += &view_numbers(line);
    }
    html += "</figcaption><div>";
    for (kind, screen) in &pictures {
        html += &picture::embedded_jpeg(screen, quality, &format!("{kind} of view {}", view.name));
    }
    html + "</div></figure>"
}

fn view_numbers(line: &ViewLine) -> String {
    format!(
        "<span>{} dB</span><span>SSIM {}</span><span>RMSE {}</span><span>gain {}</span><span>clipped {}</span>",
        fixed(line.raw.psnr_srgb_db, 2),
        fixed(line.raw.ssim_srgb, 3),
        short(line.raw.rmse_linear),
        fixed(line.exposure_gain, 3),
        percent(line.clipped_share)
    )
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

fn relit(images: &ReportImages) -> String {
    if images.relit.iter().all(|strip| strip.pictures.is_empty()) {
        return tables::empty(
            "No picture under another light was made. Make some with `patina relight RUN --env sky.hdr`.",
        );
    }
    let shown = &images.relit[..images.relit.len().min(MOST_RELIT_LIGHTS)];
    let strips = within(shown, MOST_RELIT_BYTES, |strip, width, quality| {
        let pictures = &strip.pictures[..strip.pictures.len().min(MOST_RELIT_PICTURES)];
        let judged = pictures.iter().map(|p| p.truth.as_ref().unwrap_or(&p.picture));
        let stops = picture::stops_of_pictures(judged);
        let mut html = format!(
            "<div class=strip><h3>{} <small>shown at {} stops</small></h3><div class=row>",
            escaped(&strip.light),
            fixed(f64::from(stops), 1)
        );
        if let Some(light) = &strip.environment {
            html += &figure(
                &picture::embedded_jpeg(&light_screen(light, 320), quality, "the light"),
                "the light, tone mapped",
            );
        }
        for relit in pictures {
            let embed = |image: &RgbImage, alt: &str| {
                picture::embedded_jpeg(&picture::screen_of_linear(&picture::shrunk(image, width), stops), quality, alt)
            };
            html += &figure(&embed(&relit.picture, "relit picture"), &escaped(&relit.caption));
            if let Some(truth) = &relit.truth {
                html += &figure(
                    &embed(truth, "true picture"),
                    &format!("{} <span class=tag>truth</span>", escaped(&relit.caption)),
                );
            }
        }
        html + "</div></div>"
    });
    let mut html = strips.concat();
    if images.relit.len() > shown.len() {
        html += &format!("<p class=note>{} more lights are not shown.</p>", images.relit.len() - shown.len());
    }
    html
}

fn figure(image: &str, caption: &str) -> String {
    format!("<figure>{image}<figcaption>{caption}</figcaption></figure>")
}

fn light_screen(light: &RgbImage, width: usize) -> picture::ScreenImage {
    let light = picture::shrunk(light, width);
    picture::screen_of_light(&light, picture::stops_of_light(&light))
}

fn maps(images: &ReportImages) -> String {
    const WIDTH: usize = 640;
    let mut html = String::new();
    let grey_to_rgb = |map: &GreyImage| map.map(|&value| Vec3::splat(value));
    for (kind, maps) in [("fitted", images.maps), ("true", images.truth_maps)] {
        let Some(maps) = maps else {
            html += &tables::empty(match kind {
                "fitted" => "There are no maps: the fit was stopped before it wrote them.",
                _ => "No true maps are known for this scene.",
            });
            continue;
        };
        let size = format!("{} × {}", maps.diffuse.width(), maps.diffuse.height());
        let reflectance = |map: &RgbImage, name: &str| {
            let screen = picture::screen_of_linear(&picture::shrunk(map, WIDTH), 0.0);
            figure(
                &picture::embedded_jpeg(&screen, 86, &format!("{kind} {name} map")),
                &format!("{kind} {name} <small>{size}, sRGB-encoded, {}</small>", mean_text(map)),
            )
        };
        let roughness = picture::shrunk(&grey_to_rgb(&maps.roughness), WIDTH);
        let roughness_screen = picture::screen_of_values(&roughness.map(|value| value.x));
        html += "<div class=row3>";
        html += &reflectance(&maps.diffuse, "diffuse");
        html += &reflectance(&maps.specular, "specular");
        html += &figure(
            &picture::embedded_jpeg(&roughness_screen, 86, &format!("{kind} roughness map")),
            &format!("{kind} roughness r = a² <small>black 0, white 1, no curve, {}</small>", mean_text(&roughness)),
        );
        html += "</div>";
    }
    html += "<h3>How often a texel was seen</h3>";
    match images.times_seen {
        None => html += &tables::empty("The run did not count in how many photographs a texel was seen."),
        Some(seen) => {
            let most = seen.pixels().iter().copied().filter(|value| value.is_finite()).fold(0.0f32, f32::max);
            let small = picture::shrunk(&grey_to_rgb(seen), WIDTH).map(|value| value.x);
            let never = Image::from_fn(small.width(), small.height(), |row, column| small[(row, column)] != 0.0);
            let screen = picture::screen_of_difference(&small, Some(&never), most.max(1.0));
            let colours: Vec<String> = picture::RAMP.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
            html += &format!(
                "<div class=row3>{}<div class='legend column'><span class=scale><span>1</span><i style='background:linear-gradient(90deg,{})'></i><span>{} views</span></span>\
                 <span class=scale><i class=chip style='background:rgb(96,104,112)'></i><span>seen by no view, or no surface: the maps are filled in there, not measured</span></span></div></div>",
                figure(&picture::embedded_jpeg(&screen, 86, "how often a texel was seen"), "times seen"),
                colours.join(","),
                short(f64::from(most))
            );
        }
    }
    html
}

fn mean_text(map: &RgbImage) -> String {
    let finite: Vec<f64> = map
        .pixels()
        .iter()
        .filter(|pixel| pixel.is_finite())
        .map(|pixel| f64::from(pixel.element_sum()) / 3.0)
        .collect();
    format!("mean {}", short(finite.iter().sum::<f64>() / finite.len() as f64))
}

fn light(images: &ReportImages) -> String {
    let Some(fitted) = images.environment else {
        return tables::empty("There is no environment: the fit was stopped before it wrote one.");
    };
    let one = |kind: &str, light: &RgbImage| {
        let stops = picture::stops_of_light(light);
        let brightest =
            light.pixels().iter().copied().map(crate::math::luminance).filter(|v| v.is_finite()).fold(0.0f32, f32::max);
        let screen = picture::screen_of_light(&picture::shrunk(light, 640), stops);
        figure(
            &picture::embedded_png(&screen, &format!("{kind} environment")),
            &format!(
                "{kind} light <small>{} × {}, tone mapped at {} stops, brightest luminance {}</small>",
                light.width(),
                light.height(),
                fixed(f64::from(stops), 1),
                short(f64::from(brightest))
            ),
        )
    };
    let mut html = String::from("<div class=row2>");
    html += &one("fitted", &fitted.radiance);
    match images.truth_environment {
        Some(truth) => html += &one("true", &truth.radiance),
        None => html += "<div></div>",
    }
    html += "</div><p class=note>Up is at the top. The left border looks along −z, a quarter of the width along +x, the middle along +z.</p>";
    if images.truth_environment.is_none() {
        html += &tables::empty("The true light is not known for this scene.");
    }
    html
}

fn loss(rows: &[LossRow]) -> String {
    if rows.is_empty() {
        return tables::empty("No step was taken, so there is no loss.");
    }
    type Along = fn(&LossRow) -> f64;
    let axes: [(&str, Along); 2] = [("steps", |row| row.step as f64), ("seconds", |row| row.seconds)];
    let mut html = String::from("<div class=row2>");
    let mut reasons = Vec::new();
    let line = |name: &str, along: Along, value: fn(&LossRow) -> Option<f64>, marked: bool| {
        let points = rows.iter().filter_map(|row| Some((along(row), value(row)?))).collect();
        Series { name: name.into(), points, marked }
    };
    let has_consistency = rows.iter().any(|row| row.mvcl != 0.0);
    for (quantity, y_scale) in
        [("loss", Scale::Logarithmic), ("held-out RMSE", Scale::Logarithmic), ("consistency (MVCL)", Scale::Linear)]
    {
        for (x_label, along) in axes {
            let series = match quantity {
                "loss" => vec![
                    line("whole loss", along, |row| Some(row.loss), false),
                    line("image part", along, |row| Some(row.image_loss), false),
                ],
                "held-out RMSE" => vec![line("held-out RMSE", along, |row| row.held_out_rmse, true)],
                _ if has_consistency => vec![line("consistency", along, |row| Some(row.mvcl), false)],
                _ => continue,
            };
            let plot = LinePlot {
                x_label: x_label.into(),
                y_label: if quantity == "held-out RMSE" { "held-out RMSE, linear".into() } else { quantity.into() },
                x_scale: Scale::Linear,
                y_scale,
                series,
                marks: stage_starts(rows, along),
            };
            match plot.svg() {
                Some(svg) => html += &svg,
                None if x_label == "steps" => reasons.push(format!(
                    "There is no curve of the {quantity}: it was never measured, or never finite and above zero."
                )),
                None => {}
            }
        }
    }
    html += "</div>";
    for reason in reasons {
        html += &tables::empty(&reason);
    }
    html
}

/// Where a new stage begins, but for the first.
fn stage_starts(rows: &[LossRow], along: fn(&LossRow) -> f64) -> Vec<(f64, String)> {
    rows.windows(2)
        .filter(|pair| pair[0].stage != pair[1].stage)
        .map(|pair| (along(&pair[1]), pair[1].stage.clone()))
        .collect()
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
