//! The maps on the atlas, with chart borders and the linked cursor.

use super::{act_switch, empty};
use crate::image::value_scale::ValueScale;
use crate::insight::cursor::surface_point_of_uv;
use crate::material::MaterialMaps;
use crate::studio::act::Act;
use crate::studio::model::known::Told;
use crate::studio::model::{Cursor, Model, Project};
use crate::studio::picture::{self, LineSpace, Lines, Mark, Overlay, PictureView, Place, Source};
use crate::studio::theme;
use crate::studio::workspace::Panel;
use egui::Ui;
use glam::Vec2;
use std::sync::Arc;

/// Which map is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Map {
    #[default]
    Diffuse,
    Specular,
    Roughness,
    TimesSeen,
    PhotoError,
    Disagreement,
    Told(Told),
}

impl Map {
    const ALL: [(Map, &'static str, &'static str); 11] = [
        (Map::Diffuse, "Diffuse", "Diffuse reflectance, linear RGB"),
        (Map::Specular, "Specular", "Specular reflectance F0, linear RGB"),
        (
            Map::Roughness,
            "Roughness",
            "Perceptual roughness, as glTF, Blender and Unreal take it: the square root of the microfacet width",
        ),
        (Map::TimesSeen, "View count", "How many photos see a texel; hatched: none"),
        (Map::PhotoError, "Residual", "Root mean square residual over the photos that see a texel"),
        (Map::Disagreement, "Inconsistency", "Variance over photos of the gradient by diffuse, in [0, 1]"),
        (
            Map::Told(Told::Diffuse),
            "Std. dev. (diffuse)",
            "Posterior standard deviation of diffuse, mean of the channels",
        ),
        (
            Map::Told(Told::Specular),
            "Std. dev. (specular)",
            "Posterior standard deviation of specular, mean of the channels",
        ),
        (
            Map::Told(Told::Roughness),
            "Std. dev. (roughness)",
            "Posterior standard deviation of r, the square of the microfacet width",
        ),
        (
            Map::Told(Told::LobeSharing),
            "Lobe cluster size",
            "How many texels share a texel's lobe; hatched: filled from neighbours",
        ),
        (
            Map::Told(Told::Choice),
            "Lobe model",
            "What the held-out views selected: 1 no lobe, 2 a shared lobe, 3 lobes of their own; hatched: no held-out view",
        ),
    ];
}

/// What the panel keeps.
#[derive(Default)]
pub struct MapsMemory {
    map: Map,
    view: PictureView,
    /// The map that is shown, behind a pointer that stays while the maps do.
    copied: Option<(Arc<MaterialMaps>, Map, Source)>,
    /// Texels no photo sees become NaN, which is shown hatched.
    seen: Option<(usize, Arc<crate::image::GreyImage>)>,
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut MapsMemory) {
    if model.project.as_ref().is_none_or(|project| project.maps.is_none() && project.times_seen.is_none()) {
        return empty(ui, "No maps yet", "They appear with the first steps of the fit");
    }
    ui.horizontal_wrapped(|ui| {
        for (map, name, help) in Map::ALL {
            let there = model.project.as_ref().is_some_and(|project| is_there(project, map));
            let button = egui::Button::selectable(memory.map == map, name);
            let response = ui.add_enabled(there, button).on_hover_text(help);
            let why = match map {
                Map::TimesSeen => "Compute it first: View › Compute residuals; a finished run includes it",
                Map::Told(_) => model.why_untold(),
                _ => "Compute it first: View › Compute residuals",
            };
            if response.on_disabled_hover_text(why).clicked() {
                memory.map = map;
            }
        }
        let on = model.switches.chart_borders;
        act_switch(ui, model, Act::ChartBorders, "UV seams", on);
        if ui
            .button("Fit view")
            .on_hover_text("Show the whole map\nWheel zooms, drag pans; enlarged texels show their values")
            .clicked()
        {
            memory.view.fit();
        }
    });
    if !model.project.as_ref().is_some_and(|project| is_there(project, memory.map)) {
        memory.map = Map::Diffuse;
    }
    let Some((source, size)) = model.project.as_ref().and_then(|project| source(project, memory)) else {
        return empty(ui, "No maps yet", "They appear with the first steps of the fit");
    };
    let colours = theme::palette(ui.visuals());
    let borders = model.project.as_ref().and_then(|project| project.chart_borders.clone());
    let lines: Vec<Lines> = borders
        .filter(|_| model.switches.chart_borders)
        .map(|segments| Lines { segments, space: LineSpace::Texture, colour: colours.accent })
        .into_iter()
        .collect();
    let marks: Vec<Mark> = model.cursor.iter().map(|cursor| mark(cursor, size, colours.accent)).collect();
    go_to_texel(model, memory);
    let badge = format!("{} x {}", size.0, size.1);
    let overlay = Overlay { lines: &lines, marks: &marks, badge: &badge, ..Overlay::default() };
    // Maps are reflectances: exposure is for light.
    let display = crate::image::display::DisplaySettings { exposure_stops: 0.0, ..model.edits.display };
    let response = picture::show(ui, "Map", &source, &display, &mut memory.view, &overlay);
    if let Some(place) = response.hovered {
        let uv = Vec2::new(place.column / size.0 as f32, 1.0 - place.row / size.1 as f32);
        let cursor = cursor_at(model, uv);
        if response.clicked.is_some() {
            model.cursor = cursor.map(|cursor| Cursor { pinned: true, ..cursor });
        } else {
            model.move_cursor(cursor);
        }
        model.hovered_value = picture::describe(place, response.value, &[]);
    }
}

fn is_there(project: &Project, map: Map) -> bool {
    match map {
        Map::Diffuse | Map::Specular | Map::Roughness => project.maps.is_some(),
        Map::TimesSeen => project.times_seen.is_some(),
        Map::PhotoError => project.photo_error.is_some(),
        Map::Disagreement => project.disagreement.is_some(),
        Map::Told(what) => project.known.has(what),
    }
}

/// The picture of a map and its size in texels.
fn source(project: &Project, memory: &mut MapsMemory) -> Option<(Source, (usize, usize))> {
    let source = match memory.map {
        Map::Diffuse | Map::Specular | Map::Roughness => {
            let maps = project.maps.as_ref()?;
            let known = memory.copied.as_ref().filter(|(own, map, _)| Arc::ptr_eq(own, maps) && *map == memory.map);
            let source = match known {
                Some((.., source)) => source.clone(),
                None => match memory.map {
                    Map::Diffuse => Source::from(Arc::new(maps.diffuse.clone())),
                    Map::Specular => Source::from(Arc::new(maps.specular.clone())),
                    _ => {
                        // Stored as the square of the width.
                        let perceptual = maps.roughness.map(|roughness| roughness.max(0.0).sqrt().sqrt());
                        Source::numbers(Arc::new(perceptual), ValueScale::linear(0.0, 1.0))
                    }
                },
            };
            memory.copied = Some((Arc::clone(maps), memory.map, source.clone()));
            source
        }
        Map::TimesSeen => {
            let times = project.times_seen.as_ref()?;
            let key = Arc::as_ptr(times) as usize;
            if memory.seen.as_ref().is_none_or(|(own, _)| *own != key) {
                let texels = times.map(|&times| if times > 0.0 { times } else { f32::NAN });
                memory.seen = Some((key, Arc::new(texels)));
            }
            let most = project.view_count().max(1) as f32;
            Source::numbers(Arc::clone(&memory.seen.as_ref()?.1), ValueScale::linear(0.0, most))
        }
        Map::PhotoError => {
            let [low, high] = project.photo_error_range;
            Source::numbers(Arc::clone(project.photo_error.as_ref()?), ValueScale::linear(low, high))
        }
        Map::Disagreement => {
            let [low, high] = project.disagreement_range;
            Source::numbers(Arc::clone(project.disagreement.as_ref()?), ValueScale::linear(low, high))
        }
        Map::Told(what) => {
            let layer = project.known.layer(what)?;
            let [low, high] = layer.range;
            let scale = ValueScale { low, high, logarithmic: layer.is_by_factors() };
            Source::numbers(Arc::clone(&layer.texels), scale)
        }
    };
    let size = source.size();
    Some((source, size))
}

fn mark(cursor: &Cursor, size: (usize, usize), colour: egui::Color32) -> Mark {
    let place = Place { row: (1.0 - cursor.uv.y) * size.1 as f32, column: cursor.uv.x * size.0 as f32 };
    Mark { place, label: String::new(), colour }
}

/// The surface at a texture coordinate.
fn cursor_at(model: &Model, uv: Vec2) -> Option<Cursor> {
    let project = model.project.as_ref()?;
    let point = surface_point_of_uv(project.surface.as_ref()?, project.uv_index.as_ref()?, uv)?;
    let (position, normal) = (point.position, point.shading_normal);
    Some(Cursor { over: Panel::Maps, position, normal, uv, pinned: false })
}

/// Follows a finding to its texel.
fn go_to_texel(model: &mut Model, memory: &mut MapsMemory) {
    let Some(crate::error::Place::Texel { map, row, column }) = &model.go_to else { return };
    let found = match map.as_str() {
        "diffuse" => Map::Diffuse,
        "specular" => Map::Specular,
        "roughness" => Map::Roughness,
        _ => return,
    };
    memory.map = found;
    memory.view.set_zoom(16.0);
    memory.view.centre_on(Place { row: *row as f32 + 0.5, column: *column as f32 + 0.5 });
    model.go_to = None;
}
