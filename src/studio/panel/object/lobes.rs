//! A reflectance to look at: slices of its lobes as curves, and a sphere of it.

use crate::image::display::DisplaySettings;
use crate::job::object::MaterialLook;
use crate::studio::picture::{self, Overlay, PictureView, Source};
use crate::studio::theme;
use egui::{Ui, vec2};
use egui_plot::{GridMark, HoverPosition, Line, Plot, PlotPoints, uniform_grid_spacer};
use std::sync::Arc;

/// Values below this are not drawn: black has no place on a logarithmic axis.
const LEAST: f64 = 1e-6;

/// What a panel with lobes keeps.
#[derive(Default)]
pub struct LobesMemory {
    slice: usize,
    view: PictureView,
}

/// Draws curves and sphere. `name` tells the panels apart; `behind` is drawn faintly for comparison.
pub fn show(
    ui: &mut Ui,
    name: &str,
    look: &MaterialLook,
    behind: Option<&MaterialLook>,
    display: &DisplaySettings,
    memory: &mut LobesMemory,
) {
    let side = (ui.available_height() * 0.42).min(ui.available_width()).clamp(60.0, 260.0);
    ui.vertical_centered(|ui| {
        ui.allocate_ui(vec2(side, side), |ui| {
            let source = Source::from(Arc::clone(&look.sphere));
            let overlay = Overlay { without_numbers: true, ..Overlay::default() };
            picture::show(ui, &format!("Sphere of the {name}"), &source, display, &mut memory.view, &overlay);
        });
    });
    memory.slice = memory.slice.min(look.lobes.len().saturating_sub(1));
    ui.horizontal_wrapped(|ui| {
        ui.label("Difference angle").on_hover_text("θd: half the angle between light and view direction");
        for (index, slice) in look.lobes.iter().enumerate() {
            ui.selectable_value(&mut memory.slice, index, format!("{:.0}°", slice.difference_degrees));
        }
    });
    curves(ui, name, look, behind, memory.slice);
}

fn curves(ui: &mut Ui, name: &str, look: &MaterialLook, behind: Option<&MaterialLook>, slice: usize) {
    let colours = theme::palette(ui.visuals()).channels;
    let line = |look: &MaterialLook, channel: usize| {
        let points = look.lobes.get(slice).map_or(&[][..], |slice| &slice.points);
        let drawn = points.iter().filter(|(_, value)| value[channel] > LEAST);
        PlotPoints::from(drawn.map(|(theta, value)| [*theta, value[channel].log10()]).collect::<Vec<_>>())
    };
    Plot::new(format!("lobes of the {name}"))
        .set_margin_fraction(vec2(0.02, 0.08))
        .x_axis_label("θh, half angle (degrees)")
        .x_grid_spacer(uniform_grid_spacer(|_| [10.0, 30.0, 90.0]))
        .y_axis_label("reflectance, 1/sr")
        .y_axis_formatter(|mark: GridMark, _: &_| number(10f64.powf(mark.value)))
        .label_formatter(|hover: &HoverPosition<'_>| {
            let HoverPosition::NearDataPoint { plot_name, position, .. } = hover else { return None };
            Some(format!("{plot_name}\n{:.1}°: {} /sr", position.x, number(10f64.powf(position.y))))
        })
        .allow_scroll(false)
        .show(ui, |plot| {
            for (channel, (word, colour)) in ["red", "green", "blue"].into_iter().zip(colours).enumerate() {
                if let Some(other) = behind {
                    let faint = Line::new(format!("{word}, estimated"), line(other, channel));
                    plot.line(faint.color(colour.gamma_multiply(0.4)).width(1.0));
                }
                plot.line(Line::new(word, line(look, channel)).color(colour).width(2.0));
            }
        });
}

/// A number with few digits, however small.
fn number(value: f64) -> String {
    if (1e-2..1e3).contains(&value) { format!("{value:.2}") } else { format!("{value:.0e}") }
}
