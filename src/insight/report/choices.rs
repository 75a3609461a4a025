//! What the scene needs: which freedoms of the model views that took no part bear out, what each bought in error and
//! what it cost in time.

use super::choice_table::ChoiceTable;
use super::gallery::{MAP_WIDTH, chip, figure};
use super::number::{escaped, fixed, percent, significant, whole};
use super::picture::{NOT_COUNTED, RAMP, embedded_png};
use super::tables;
use crate::image::{GreyImage, Image};

/// Colours of the map, by its codes: nobody judges, no lobe, one a region, lobes of their own.
const COLOURS: [[u8; 3]; 4] = [NOT_COUNTED, RAMP[1], RAMP[4], RAMP[6]];

/// The section of the page: table and map.
pub(super) fn section(table: Option<&ChoiceTable>, map: Option<&GreyImage>) -> String {
    let Some(table) = table.filter(|table| !table.lines.is_empty()) else {
        return tables::empty(
            "No view judged the model's freedoms: that is done when the solver makes its maps, by at least two views.",
        );
    };
    let number = |value: Option<f64>| value.map_or("–".into(), significant);
    let signed = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:+.5}"));
    let rows: Vec<Vec<String>> = table
        .lines
        .iter()
        .map(|row| {
            let gain = match (row.gain, row.gain_error) {
                (Some(gain), Some(error)) => {
                    let text = format!("{gain:+.4} ± {error:.4}");
                    if gain > error { text } else { format!("<b>{text}</b>") }
                }
                _ => "–".into(),
            };
            vec![
                escaped(&row.name),
                if row.compared_with.is_empty() { "–".into() } else { escaped(&row.compared_with) },
                row.share.map_or("–".into(), percent),
                gain,
                number(row.rmse),
                signed(row.rmse_change),
                row.seconds.map_or("–".into(), |seconds| fixed(seconds, 2)),
            ]
        })
        .collect();
    let head = [
        "freedom",
        "compared with",
        "share<small>of texels</small>",
        "gain<small>nats a pixel</small>",
        "RMSE<small>linear</small>",
        "<small>change</small>",
        "time<small>s</small>",
    ];
    let who = if table.are_withheld { "training views, withheld from this check only" } else { "held-out views" };
    format!(
        "<p class=note>{} pixels of {} {who} judge, under the light that was found; none of them took part. Per region \
         of the maps the simplest model within one standard error of the best is the choice. Gains are over all \
         judging pixels, with standard errors over views; bold: not larger than its error, so nothing bears the freedom \
         out. Maps are as the solver made them, whatever is chosen here. The check took {} s.</p>{}{}",
        whole(table.pixels),
        whole(table.views as u64),
        fixed(table.seconds, 2),
        tables::table("scores text2", &head, &rows),
        map.map_or_else(String::new, map_of_choices)
    )
}

fn map_of_choices(map: &GreyImage) -> String {
    // One texel in so many: codes have no mean.
    let step = map.width().div_ceil(MAP_WIDTH).max(1);
    let screen = Image::from_fn(map.width() / step, map.height() / step, |row, column| {
        COLOURS[(map[(row * step, column * step)].clamp(0.0, 3.0)) as usize]
    });
    let names = ["less than two views judge", "no lobe", "one lobe a region", "lobes as the evidence shares them"];
    let legend: Vec<String> = COLOURS.iter().zip(names).map(|(&colour, name)| chip(colour, name)).collect();
    format!(
        "<div class=row4>{}<div class='legend column'>{}</div></div>",
        figure(&embedded_png(&screen, "what judging views chose"), "chosen for each texel"),
        legend.concat()
    )
}

#[cfg(test)]
mod tests {
    use super::super::choice_table::ChoiceRow;
    use super::*;

    #[test]
    fn the_section_shows_every_line_and_marks_what_is_not_borne_out() {
        assert!(section(None, None).contains("No view judged"));
        let row = |name: &str, gain: f64| ChoiceRow {
            name: name.into(),
            gain: Some(gain),
            gain_error: Some(0.5),
            share: Some(0.25),
            ..ChoiceRow::default()
        };
        let table = ChoiceTable { lines: vec![row("a < b", 0.25), row("c", 0.75)], views: 3, ..ChoiceTable::default() };
        let map = Image::from_pixels(2, 2, vec![0.0, 1.0, 2.0, f32::NAN]);
        let html = section(Some(&table), Some(&map));
        assert!(html.contains("a &lt; b") && html.contains("<b>+0.2500 ± 0.5000</b>"), "{html}");
        assert!(html.contains("<td>+0.7500 ± 0.5000</td>") && html.contains("data:image/png"), "{html}");
    }
}
