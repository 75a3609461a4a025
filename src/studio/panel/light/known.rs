//! What each texel of the light is known by, as a picture with a legend: highlights, background, diffuse light and
//! shadows, or belief alone. Only the solver tells it.

use super::place_words;
use crate::image::RgbImage;
use crate::image::display::{DisplaySettings, bytes_of_colour};
use crate::job::solver_told::{mean_shares, scale_words};
use crate::studio::model::Model;
use crate::studio::panel::empty;
use crate::studio::picture::{self, Overlay, PictureView, Source};
use egui::{Color32, RichText, Sense, Ui, vec2};
use glam::Vec3;
use std::sync::Arc;

/// Kinds of evidence with their colour in the picture, linear, and what they are.
const KINDS: [(&str, Vec3, &str); 4] = [
    ("Highlights", Vec3::X, "Specular reflections: resolve directions"),
    ("Background", Vec3::Y, "Seen directly, beside the surface"),
    ("Diffuse shading and shadows", Vec3::Z, "Integrated by diffuse surfaces: resolves directions only by shadows"),
    ("Prior", Vec3::ZERO, "No photo constrains it: a smooth sky is assumed"),
];

/// What the picture keeps.
#[derive(Default)]
pub struct KnownMemory {
    view: PictureView,
    means: Option<(Arc<RgbImage>, [f64; 4])>,
}

/// Draws picture and legend, or why there is none.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut KnownMemory) {
    let shares = model.project.as_ref().and_then(|project| project.known.told().light_evidence.clone());
    let Some(shares) = shares else {
        return empty(ui, "Not available", model.why_light_is_untold());
    };
    if memory.means.as_ref().is_none_or(|(own, _)| !Arc::ptr_eq(own, &shares)) {
        memory.means = Some((Arc::clone(&shares), mean_shares(&shares)));
    }
    let means = memory.means.as_ref().map(|(_, means)| *means).unwrap_or_default();
    ui.horizontal_wrapped(|ui| {
        for ((name, colour, help), mean) in KINDS.into_iter().zip(means) {
            swatch(ui, colour);
            ui.label(format!("{name} {:.0} %", 100.0 * mean)).on_hover_text(format!("{help}\nMean over the sphere"));
        }
    });
    if let Some(deviation) = model.project.as_ref().and_then(|project| project.known.told().light_scale_deviation) {
        ui.label(format!("Scale ambiguity of environment and reflectance: {}", scale_words(deviation))).on_hover_text(
            "Light twice as bright over surfaces half as bright gives diffuse surfaces the same pictures. Highlights, \
             background and interreflection tell the two apart.",
        );
    }
    let source = Source::from(Arc::clone(&shares));
    let overlay = Overlay { badge: "up", ..Overlay::default() };
    let height = (ui.available_width() / 2.0).min(ui.available_height()).max(60.0);
    ui.allocate_ui(vec2(ui.available_width(), height), |ui| {
        // Shares are no light: neither exposure nor curve.
        let display = DisplaySettings::default();
        let response = picture::show(ui, "Evidence for the environment", &source, &display, &mut memory.view, &overlay);
        let Some(place) = response.hovered else { return };
        let share = response.value.map_or(Vec3::ZERO, picture::Value::rgb);
        let [azimuth, elevation] = place_words(place, (shares.width(), shares.height()));
        let named = [
            ("highlights", share.x),
            ("background", share.y),
            ("diffuse", share.z),
            ("prior", 1.0 - share.element_sum()),
            azimuth,
            elevation,
        ];
        model.hovered_value = picture::describe(place, None, &named);
    });
    ui.label(RichText::new("Share of each texel's precision; dark texels follow the prior alone").small().weak());
}

fn swatch(ui: &mut Ui, colour: Vec3) {
    let (rect, _) = ui.allocate_exact_size(vec2(12.0, 12.0), Sense::hover());
    let [red, green, blue] = bytes_of_colour(colour);
    ui.painter().rect_filled(rect, 2.0, Color32::from_rgb(red, green, blue));
    ui.painter().rect_stroke(rect, 2.0, ui.visuals().widgets.noninteractive.bg_stroke, egui::StrokeKind::Inside);
}
