//! The table of photos: error, exposure, clipping; sort, choose, leave out.

use super::{act_button_named, empty};
use crate::fit::ViewUse;
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::picture::ThumbnailCache;
use crate::studio::theme;
use egui::{Align, Layout, RichText, ScrollArea, Sense, Ui, vec2};

/// Size of the table's letters: many rows are to be seen at once.
const TEXT_POINTS: f32 = 11.5;
/// An error so many times that of the photo in the middle is marked.
const CONSPICUOUS: f32 = 1.4;
/// Room for a photo's small picture in its row, in points.
const THUMBNAIL: egui::Vec2 = vec2(30.0, 20.0);
/// Points between two columns.
const GAP: f32 = 6.0;

/// What the panel keeps.
pub struct ViewsMemory {
    thumbnails: ThumbnailCache,
    sorted_by: Column,
    descending: bool,
    last_chosen: usize,
}

impl Default for ViewsMemory {
    fn default() -> Self {
        ViewsMemory {
            thumbnails: ThumbnailCache::default(),
            sorted_by: Column::Name,
            descending: false,
            last_chosen: usize::MAX,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Column {
    Name,
    Error,
    Exposure,
    Clipped,
    Role,
}

impl Column {
    const ALL: [(Column, &'static str, f32, &'static str); 5] = [
        (Column::Name, "Photo", 84.0, "Name of the photo's file"),
        (
            Column::Error,
            "RMSE",
            56.0,
            "Root mean squared error of linear radiance over unclipped surface, as last known",
        ),
        (Column::Exposure, "Exp. (EV)", 52.0, "Estimated exposure of the photo, in EV"),
        (Column::Clipped, "Clipped", 52.0, "Share of the surface pixels that are clipped and not used"),
        (Column::Role, "Use", 58.0, "Train, Test (held out) or Excluded"),
    ];

    fn width(self) -> f32 {
        Column::ALL.iter().find(|(column, ..)| *column == self).map_or(0.0, |(_, _, width, _)| *width)
    }

    /// Words begin at the left of a column, numbers end at its right.
    fn layout(self) -> Layout {
        match self {
            Column::Name | Column::Role => Layout::left_to_right(Align::Center),
            Column::Error | Column::Exposure | Column::Clipped => Layout::right_to_left(Align::Center),
        }
    }
}

/// A row of the table.
#[derive(Clone, Debug)]
struct Row {
    index: usize,
    name: String,
    error: Option<f32>,
    stops: f32,
    clipped: Option<f32>,
    role: ViewUse,
}

/// What a photo is used for.
pub(super) fn role(is_excluded: bool, is_held_out: bool) -> ViewUse {
    match (is_excluded, is_held_out) {
        (true, _) => ViewUse::LeftOut,
        (false, true) => ViewUse::HeldOut,
        (false, false) => ViewUse::Training,
    }
}

/// The same in a word.
pub(super) fn role_words(role: ViewUse) -> &'static str {
    match role {
        ViewUse::Training => "Train",
        ViewUse::HeldOut => "Test",
        ViewUse::LeftOut => "Excluded",
    }
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut ViewsMemory) {
    let rows = rows(model);
    if rows.is_empty() {
        return empty(ui, "No photos", "Open a scene; a run whose scene has moved shows its maps only");
    }
    let rows = sorted(rows, memory);
    controls(ui, model);
    // A panel may be narrower than the table.
    ScrollArea::horizontal().auto_shrink(false).show(ui, |ui| table(ui, model, memory, &rows));
}

fn table(ui: &mut Ui, model: &mut Model, memory: &mut ViewsMemory, rows: &[Row]) {
    header(ui, memory);
    let chosen = model.project.as_ref().map_or(0, |project| project.chosen_view);
    let scroll = memory.last_chosen != chosen;
    memory.last_chosen = chosen;
    let errors: Vec<f64> = rows.iter().filter_map(|row| row.error).map(f64::from).collect();
    let usual = crate::math::statistics::quantile(&errors, 0.5) as f32;
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        for row in rows {
            line(ui, model, row, row.index == chosen, (usual, scroll), &mut memory.thumbnails);
        }
    });
}

fn rows(model: &Model) -> Vec<Row> {
    let Some(project) = &model.project else { return Vec::new() };
    let Some(scene) = &project.scene else { return Vec::new() };
    let gains = model.fit.snapshot.as_ref().map(|snapshot| snapshot.log_gains.clone()).unwrap_or_default();
    let report = model.fit.report.as_ref();
    let row = |(index, view): (usize, &crate::scene::View)| {
        let reported = report.and_then(|report| report.views.iter().find(|line| line.name == view.name));
        let stops = match gains.get(index) {
            Some(gain) => gain / std::f32::consts::LN_2,
            None => reported.map_or(0.0, |line| line.exposure_gain.log2() as f32),
        };
        let left_out = model.edits.fit.exclude.contains(&view.name);
        Row {
            index,
            name: view.name.clone(),
            error: project.view_errors.get(index).copied().flatten(),
            stops: if stops.is_finite() { stops } else { 0.0 },
            clipped: project.clipped_shares.get(index).copied(),
            role: role(left_out, view.held_out),
        }
    };
    scene.views.iter().enumerate().map(row).collect()
}

fn sorted(mut rows: Vec<Row>, memory: &ViewsMemory) -> Vec<Row> {
    let unknown_last = |error: Option<f32>| error.unwrap_or(if memory.descending { -1.0 } else { f32::MAX });
    rows.sort_by(|a, b| match memory.sorted_by {
        Column::Name => a.name.cmp(&b.name),
        Column::Error => unknown_last(a.error).total_cmp(&unknown_last(b.error)),
        Column::Exposure => a.stops.total_cmp(&b.stops),
        Column::Clipped => a.clipped.unwrap_or(-1.0).total_cmp(&b.clipped.unwrap_or(-1.0)),
        Column::Role => role_words(a.role).cmp(role_words(b.role)),
    });
    if memory.descending {
        rows.reverse();
    }
    rows
}

fn controls(ui: &mut Ui, model: &mut Model) {
    ui.horizontal_wrapped(|ui| {
        act_button_named(ui, model, Act::PreviousView, "Previous");
        act_button_named(ui, model, Act::NextView, "Next");
        act_button_named(ui, model, Act::LookThrough, "Camera view");
        let name = model.project.as_ref().and_then(|project| project.chosen_name()).unwrap_or_default().to_owned();
        let out = model.edits.fit.exclude.contains(&name);
        act_button_named(ui, model, Act::LeaveOut, if out { "Include" } else { "Exclude" });
    });
    ui.add_space(4.0);
}

fn header(ui: &mut Ui, memory: &mut ViewsMemory) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = GAP;
        ui.add_space(THUMBNAIL.x);
        for (column, title, width, help) in Column::ALL {
            let own = memory.sorted_by == column;
            let text = match (own, memory.descending) {
                (true, true) => format!("{title} -"),
                (true, false) => format!("{title} +"),
                _ => title.to_owned(),
            };
            let button = egui::Button::new(RichText::new(text).size(TEXT_POINTS)).frame(false).small();
            let response = ui.allocate_ui_with_layout(vec2(width, 18.0), column.layout(), |ui| {
                ui.set_min_width(width);
                ui.add(button)
            });
            let response = response.inner;
            if response.on_hover_text(format!("{help}\nClick to sort, click again to reverse")).clicked() {
                memory.descending =
                    if own { !memory.descending } else { column == Column::Error || column == Column::Clipped };
                memory.sorted_by = column;
            }
        }
    });
    ui.separator();
}

fn line(
    ui: &mut Ui,
    model: &mut Model,
    row: &Row,
    chosen: bool,
    (usual, scroll): (f32, bool),
    thumbnails: &mut ThumbnailCache,
) {
    let colours = theme::palette(ui.visuals());
    let width: f32 = THUMBNAIL.x + GAP + Column::ALL.iter().map(|(_, _, width, _)| width + GAP).sum::<f32>();
    let (rect, response) = ui.allocate_exact_size(vec2(width.max(ui.available_width()), 20.0), Sense::click());
    response.widget_info(|| {
        egui::WidgetInfo::selected(egui::Role::RadioButton, true, chosen, format!("photo {}", row.name))
    });
    if chosen {
        ui.painter().rect_filled(rect, 3.0, ui.visuals().selection.bg_fill);
    } else if response.hovered() {
        ui.painter().rect_filled(rect, 3.0, ui.visuals().widgets.hovered.weak_bg_fill);
    }
    let mut inner = ui.new_child(egui::UiBuilder::new().max_rect(rect).layout(Layout::left_to_right(Align::Center)));
    inner.spacing_mut().item_spacing.x = GAP;
    // A small picture is made once it is seen: there may be a thousand photos.
    let small = model.project.as_ref().and_then(|project| project.thumbnails.get(row.index));
    let texture = small.filter(|_| ui.is_rect_visible(rect)).and_then(|small| {
        thumbnails.keep(&row.name, small);
        thumbnails.texture(ui.ctx(), &row.name, &model.edits.display).cloned()
    });
    let (place, _) = inner.allocate_exact_size(THUMBNAIL, Sense::hover());
    if let Some(texture) = &texture {
        let size = texture.size_vec2();
        let own = egui::Rect::from_center_size(place.center(), size * (place.size() / size).min_elem());
        egui::Image::new((texture.id(), own.size())).paint_at(&inner, own);
    }
    let dim = row.role == ViewUse::LeftOut;
    let mut cell = |column: Column, text: String, colour: Option<egui::Color32>| {
        let text = RichText::new(text).size(TEXT_POINTS);
        let text = match colour {
            Some(colour) => text.color(colour),
            None if dim => text.weak(),
            None => text,
        };
        inner.allocate_ui_with_layout(vec2(column.width(), 20.0), column.layout(), |ui| {
            ui.set_min_width(column.width());
            ui.add(egui::Label::new(text).truncate().selectable(false));
        });
    };
    cell(Column::Name, row.name.clone(), None);
    let bad = row.error.is_some_and(|error| error > CONSPICUOUS * usual && error > 0.01);
    let text = row.error.map_or_else(|| "-".into(), |error| format!("{error:.4}"));
    cell(Column::Error, text, bad.then_some(colours.warning));
    cell(Column::Exposure, if row.stops == 0.0 { "0".into() } else { format!("{:+.2}", row.stops) }, None);
    let much = row.clipped.is_some_and(|share| share > 0.05);
    // Until the surface is there, nothing tells a bright sky from the object.
    let text = row.clipped.map_or_else(|| "-".into(), |share| format!("{:.1} %", 100.0 * share));
    cell(Column::Clipped, text, much.then_some(colours.warning));
    cell(Column::Role, role_words(row.role).into(), None);
    if chosen && scroll {
        response.scroll_to_me(None);
    }
    if let Some(project) = model.project.as_mut().filter(|_| response.clicked()) {
        project.chosen_view = row.index;
    }
    if response.double_clicked() && !model.switches.looking_through {
        model.act(Act::LookThrough);
    }
    let texture = texture.map(|texture| (texture.id(), texture.size_vec2()));
    response.on_hover_ui(|ui| {
        if let Some(texture) = texture {
            ui.image(texture);
        }
        ui.label(format!("{}\nClick to choose, double-click for its camera view", row.name));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_without_a_known_error_come_last_in_both_orders() {
        let row = |index: usize, error: Option<f32>| Row {
            index,
            name: index.to_string(),
            error,
            stops: 0.0,
            clipped: None,
            role: ViewUse::Training,
        };
        let rows = vec![row(0, Some(0.1)), row(1, None), row(2, Some(0.3))];
        let order = |descending| {
            let memory = ViewsMemory { sorted_by: Column::Error, descending, last_chosen: 0, ..ViewsMemory::default() };
            sorted(rows.clone(), &memory).iter().map(|row| row.index).collect::<Vec<_>>()
        };
        assert_eq!(order(false), [0, 2, 1]);
        assert_eq!(order(true), [2, 0, 1]);
    }
}
