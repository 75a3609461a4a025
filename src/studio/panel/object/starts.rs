//! Which starts explain the photo as well, what it leaves open, and what was noticed.

use crate::studio::model::Model;
use crate::studio::model::log::Message;
use crate::studio::panel::{empty, heading, messages};
use crate::studio::theme;
use egui::{Grid, RichText, ScrollArea, Ui};

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model) {
    let findings: Vec<Message> = model.object.findings.iter().map(Message::from).collect();
    let Some(outcome) = model.object.outcome.clone() else {
        return empty(ui, "No result yet", "Lists which initializations explain the photo, and what it leaves open");
    };
    let colours = theme::palette(ui.visuals());
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let (spread, gauge) = (&outcome.spread, &outcome.gauge);
        heading(ui, "Ambiguity");
        let of = |what: &str, spread: Option<f64>| {
            spread.map(|spread| format!("{spread:.2} in the logarithm of the {what}"))
        };
        let both = [of("environment", spread.light), of("reflectance", spread.reflectance)];
        let both = both.into_iter().flatten().collect::<Vec<_>>().join(" and by ");
        ui.label(match (spread.starts.len(), both.is_empty()) {
            (0, _) => "The initializations were not optimized to the end".into(),
            (_, true) => "One initialization was optimized".into(),
            (count, false) => {
                format!("Initializations differ by {both}; {count} of them explain the photo about equally well")
            }
        });
        let [red, green, blue] = gauge.largest_factor;
        ui.label(
            RichText::new(format!(
                "Scale ambiguity: reflectance may be multiplied by up to {red:.1} (red), {green:.1} (green), \
             {blue:.1} (blue), and the environment divided by it"
            ))
            .weak(),
        );
        if !outcome.starts.is_empty() {
            heading(ui, "Initializations");
            Grid::new("starts").striped(true).num_columns(4).spacing([18.0, 4.0]).show(ui, |ui| {
                for title in ["Initialization", "Δ log-evidence (nats)", "Objective", ""] {
                    ui.label(RichText::new(title).weak());
                }
                ui.end_row();
                for start in &outcome.starts {
                    ui.label(&start.name);
                    ui.label(format!("{:.1}", start.nats_behind)).on_hover_text(
                        "Difference of the log-evidence to the best initialization, marginalized over the environment",
                    );
                    ui.label(format!("{:.4}", start.objective)).on_hover_text("At low resolution");
                    ui.label(match start.is_as_good {
                        true => RichText::new("as good").color(colours.good),
                        false => RichText::new(""),
                    });
                    ui.end_row();
                }
            });
        }
        heading(ui, "Issues");
        if findings.is_empty() {
            ui.label(RichText::new("No issues").weak());
        }
        for (index, message) in findings.iter().enumerate() {
            ui.push_id(index, |ui| messages::line(ui, model, message));
        }
    });
}
