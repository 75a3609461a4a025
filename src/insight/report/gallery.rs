//! The pictures of the page: views, relit strips, maps and light.

use super::data::{ReportData, ViewLine};
use super::images::{MOST_VIEWS_SHOWN, ReportImages, ViewPictures, views_to_show};
use super::number::{escaped, fixed, percent, short, significant};
use super::{picture, tables};
use crate::image::{GreyImage, RgbImage};
use crate::math::parallel;
use glam::Vec3;

/// Bytes of HTML that the pictures of the views, and those of the relit strips, may take together.
const MOST_VIEW_BYTES: usize = 8_000_000;
const MOST_RELIT_BYTES: usize = 3_000_000;
/// Sizes that are tried in this order until the pictures fit: (width in pixels, JPEG quality).
const SIZES: [(usize, u8); 5] = [(640, 86), (480, 84), (360, 80), (240, 75), (160, 60)];
const MOST_RELIT_LIGHTS: usize = 12;
const MOST_RELIT_PICTURES: usize = 6;

/// Width of a map on the page in pixels.
pub(super) const MAP_WIDTH: usize = 640;

/// Encodes pictures at the first of [`SIZES`] at which `parts` stay below `most_bytes` together, in their order.
///
/// A few parts are tried first, and a size at which they foretell far too many bytes is left out: encoding all of
/// them at each size is what takes the time.
fn within<T: Sync>(parts: &[T], most_bytes: usize, encode: impl Fn(&T, usize, u8) -> String + Sync) -> Vec<String> {
    let every = parts.len().div_ceil(4).max(1);
    let mut encoded = Vec::new();
    for (index, (width, quality)) in SIZES.into_iter().enumerate() {
        if index + 1 < SIZES.len() && parts.len() > 8 {
            let sample: Vec<&T> = parts.iter().step_by(every).collect();
            let lengths = parallel::map_items(&sample, |part| encode(part, width, quality).len());
            let bytes: usize = lengths.into_iter().sum();
            if bytes / sample.len() * parts.len() > most_bytes + most_bytes / 4 {
                continue;
            }
        }
        encoded = parallel::map_items(parts, |part| encode(part, width, quality));
        if encoded.iter().map(String::len).sum::<usize>() <= most_bytes {
            break;
        }
    }
    encoded
}

/// Photographs, fits and errors: held-out views first.
pub fn views(data: &ReportData, images: &ReportImages) -> String {
    let kinds: [Vec<&ViewPictures>; 2] =
        [true, false].map(|held_out| images.views.iter().filter(|view| view.held_out == held_out).collect());
    let shown = kinds.map(|kind| views_to_show(kind.len()).into_iter().map(|index| kind[index]).collect::<Vec<_>>());
    let shown_views = shown.concat();
    if shown_views.is_empty() {
        return tables::empty(
            "No photograph was compared: the run has no views, or it was stopped before its first picture.",
        );
    }
    // One scale for all error pictures, so that they can be compared with each other.
    let values: Vec<Vec<f64>> =
        parallel::map_items(&shown_views, |view| counted_differences(view, images.exposure_stops));
    let full_scale = picture::round_full_scale(&values.concat());

    let triples = within(&shown_views, MOST_VIEW_BYTES, |view, width, quality| {
        // Training views are shown two in a row: half the size is as sharp.
        let width = if view.held_out { width } else { (width / 2).max(160) };
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

/// Differences over the pixels of a view that count, of a small picture: enough to choose a scale.
fn counted_differences(view: &ViewPictures, stops: f32) -> Vec<f64> {
    let width = SIZES[3].0;
    let difference =
        picture::encoded_difference(&picture::shrunk(&view.photo, width), &picture::shrunk(&view.fit, width), stops);
    let mask = view.counted.as_ref().map(|mask| picture::shrunk_mask(mask, width));
    let counts = |index: usize| mask.as_ref().is_none_or(|mask| mask.pixels().get(index) == Some(&true));
    let values = difference.pixels().iter().enumerate();
    values.filter(|(index, _)| counts(*index)).map(|(_, &value)| f64::from(value)).collect()
}

fn strip(triples: &[String], class: &str) -> String {
    format!("<div class='triples{class}'>{}</div>", triples.concat())
}

fn legend(full_scale: f32) -> String {
    format!(
        "<p class=note>Left to right: photograph, fit, error. The error is the mean over channels of |fit − photo| of \
         sRGB-encoded values, where 1 is white.</p><div class=legend>{}{}{}</div>",
        ramp("0", &format!("{} and more", short(f64::from(full_scale)))),
        chip(picture::NOT_COUNTED, "not counted: background, clipped, masked"),
        chip(picture::NOT_FINITE, "not finite")
    )
}

/// The false colours with the values at their ends.
fn ramp(low: &str, high: &str) -> String {
    let colours: Vec<String> = picture::RAMP.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
    format!(
        "<span class=scale><span>{low}</span><i style='background:linear-gradient(90deg,{})'></i><span>{high}</span></span>",
        colours.join(",")
    )
}

pub(super) fn chip([r, g, b]: [u8; 3], meaning: &str) -> String {
    format!("<span class=scale><i class=chip style='background:rgb({r},{g},{b})'></i><span>{meaning}</span></span>")
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
        fixed(line.raw.ssim_srgb, 4),
        significant(line.raw.rmse_linear),
        fixed(line.exposure_gain, 3),
        percent(line.clipped_share)
    )
}

/// Pictures under other lights.
pub fn relit(images: &ReportImages) -> String {
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
        let sky = strip.environment.as_ref().map(light_image).unwrap_or_default();
        let mut html = format!(
            "<div class=strip><div class=sky>{sky}</div><h3>{} <small>pictures shown at {} stops{}</small></h3></div><div class=row>",
            escaped(&strip.light),
            fixed(f64::from(stops), 1),
            if sky.is_empty() { "" } else { ", the light tone mapped" }
        );
        for relit in pictures {
            let embed = |image: &RgbImage, alt: &str| {
                picture::embedded_jpeg(&picture::screen_of_linear(&picture::shrunk(image, width), stops), quality, alt)
            };
            let caption = escaped(&relit.caption);
            html += "<div>";
            html += &figure(&embed(&relit.picture, "relit picture"), &caption);
            if let Some(truth) = &relit.truth {
                html += &figure(&embed(truth, "true picture"), &format!("{caption} <span class=tag>truth</span>"));
            }
            html += "</div>";
        }
        html + "</div>"
    });
    let mut html = strips.concat();
    if images.relit.len() > shown.len() {
        html += &format!("<p class=note>{} more lights are not shown.</p>", images.relit.len() - shown.len());
    }
    html
}

pub(super) fn figure(image: &str, caption: &str) -> String {
    format!("<figure>{image}<figcaption>{caption}</figcaption></figure>")
}

/// A light as a small picture at its own exposure.
fn light_image(light: &RgbImage) -> String {
    let small = picture::shrunk(light, 256);
    picture::embedded_png(&picture::screen_of_light(&small, picture::stops_of_light(&small)), "the light, tone mapped")
}

/// The maps, fitted and true, and where they are measured.
pub fn maps(images: &ReportImages) -> String {
    let mut html = String::new();
    for (kind, maps) in [("fitted", images.maps), ("true", images.truth_maps)] {
        let Some(maps) = maps else {
            if kind == "fitted" {
                html += &tables::empty("There are no maps: the fit was stopped before it wrote them.");
            } else {
                html += &seen_legend(images.times_seen);
                html += &tables::empty("No true maps are known for this scene.");
            }
            continue;
        };
        let size = format!("{} × {}", maps.diffuse.width(), maps.diffuse.height());
        let reflectance = |map: &RgbImage, name: &str| {
            let screen = picture::screen_of_linear(&picture::shrunk(map, MAP_WIDTH), 0.0);
            figure(
                &picture::embedded_jpeg(&screen, 86, &format!("{kind} {name} map")),
                &format!("{kind} {name} <small>{size}, sRGB-encoded, {}</small>", mean_text(map)),
            )
        };
        let roughness = picture::shrunk(&grey_to_rgb(&maps.roughness), MAP_WIDTH);
        let roughness_screen = picture::screen_of_values(&roughness.map(|value| value.x));
        html += "<div class=row4>";
        html += &reflectance(&maps.diffuse, "diffuse");
        html += &reflectance(&maps.specular, "specular");
        html += &figure(
            &picture::embedded_jpeg(&roughness_screen, 86, &format!("{kind} roughness map")),
            &format!("{kind} roughness r = a² <small>black 0, white 1, no curve, {}</small>", mean_text(&roughness)),
        );
        html += &if kind == "fitted" { times_seen(images.times_seen) } else { seen_legend(images.times_seen) };
        html += "</div>";
    }
    html
}

/// In how many photographs a texel was seen, in false colour.
fn times_seen(seen: Option<&GreyImage>) -> String {
    let Some(seen) = seen else {
        return tables::empty("The run did not count in how many photographs a texel was seen.");
    };
    let small = picture::shrunk(&grey_to_rgb(seen), MAP_WIDTH).map(|value| value.x);
    let ever = small.map(|&count| count != 0.0);
    let screen = picture::screen_of_difference(&small, Some(&ever), most_seen(seen));
    let image = picture::embedded_jpeg(&screen, 86, "how often a texel was seen");
    figure(
        &image,
        &format!("times seen <small>black 1, bright {}, grey never</small>", short(f64::from(most_seen(seen)))),
    )
}

fn seen_legend(seen: Option<&GreyImage>) -> String {
    seen.map_or_else(String::new, |seen| {
        format!(
            "<div class='legend column'>{}{}</div>",
            ramp("1", &format!("{} views", short(f64::from(most_seen(seen))))),
            chip(picture::NOT_COUNTED, "no surface, or seen by no view: filled in, not measured")
        )
    })
}

fn most_seen(seen: &GreyImage) -> f32 {
    seen.pixels().iter().copied().filter(|count| count.is_finite()).fold(1.0, f32::max)
}

fn grey_to_rgb(map: &GreyImage) -> RgbImage {
    map.map(|&value| Vec3::splat(value))
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

/// The light, fitted and true.
pub fn light(images: &ReportImages) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_shrink_until_they_fit_and_keep_their_order() {
        let bytes_of = |part: &usize, width: usize, _: u8| format!("{part}:{}", "x".repeat(width * part));
        let encoded = within(&[1, 2, 3], 3000, bytes_of);
        assert!(encoded.iter().map(String::len).sum::<usize>() <= 3000);
        assert_eq!(encoded[2].len(), "3:".len() + 3 * SIZES[1].0, "the first size that fits is taken");
        assert!(encoded[0].starts_with("1:") && encoded[2].starts_with("3:"));
        // Nothing fits: the smallest is better than none.
        assert_eq!(within(&[1], 0, bytes_of)[0].len(), "1:".len() + SIZES[4].0);
    }
}
