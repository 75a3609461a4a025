//! A window of which only what changed is drawn looks as one that is drawn whole.

use super::Repaint;
use crate::studio::stage::{Stage, StageFrame};
use crate::window_tests::adapter::{has_adapter, rendered};
use eframe::egui::{self, Color32, ColorImage, TextureHandle, TextureOptions, pos2, vec2};
use egui_kittest::Harness;

/// A window whose parts change at different times.
struct Changing {
    time: usize,
    picture: Option<TextureHandle>,
    stage: Stage,
}

impl Changing {
    fn new(creation: &eframe::CreationContext<'_>, keeps: bool) -> Self {
        let state = creation.wgpu_render_state.as_ref().unwrap();
        if keeps {
            creation.egui_ctx.add_plugin(Repaint::new(state.target_format));
        }
        Changing { time: 0, picture: None, stage: Stage::new(state) }
    }
}

impl eframe::App for Changing {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let time = self.time;
        let context = ui.ctx().clone();
        context.set_zoom_factor(if time == 7 { 1.3 } else { 1.0 });
        let level = if time >= 4 { 200 } else { 90 };
        let image = ColorImage::filled([4, 4], Color32::from_rgb(level, 40, 90));
        match &mut self.picture {
            Some(picture) if time == 4 => picture.set(image, TextureOptions::NEAREST),
            Some(_) => {}
            none => *none = Some(context.load_texture("picture", image, TextureOptions::NEAREST)),
        }
        egui::CentralPanel::default().show(ui, |ui| {
            ui.heading("What stays");
            ui.label(if time < 2 { "before" } else { "after, with letters that were not there: äöß" });
            if let Some(picture) = &self.picture {
                ui.image((picture.id(), vec2(40.0, 40.0)));
            }
            // Hides what is behind it, and is drawn with every frame.
            let place = egui::Rect::from_min_size(pos2(180.3, 20.6), vec2(70.0, 50.0));
            ui.scope_builder(egui::UiBuilder::new().max_rect(place), |ui| self.stage.show(ui, &StageFrame::default()));
            let place = pos2(100.0 + 9.0 * time as f32, 90.0);
            ui.painter().circle_filled(place, 14.0, Color32::from_rgba_unmultiplied(20, 200, 90, 120));
        });
        if time == 2 {
            let above = context.layer_painter(egui::LayerId::new(egui::Order::Foreground, egui::Id::unique("shade")));
            above.rect_filled(context.content_rect(), 0.0, Color32::from_black_alpha(120));
        }
        if (3..6).contains(&time) {
            egui::Window::new("Above").fixed_pos(pos2(80.0, 40.0)).show(&context, |ui| ui.label("half of it"));
        }
    }
}

#[test]
fn what_is_kept_and_mended_is_what_would_be_drawn() {
    if !has_adapter() {
        return;
    }
    let window = |keeps| {
        let builder = Harness::builder().with_size(vec2(280.0, 170.0)).wgpu();
        builder.build_eframe(move |creation| Changing::new(creation, keeps))
    };
    let (mut kept, mut whole) = (window(true), window(false));
    let mut last = None;
    for time in 0..9 {
        let [one, other] = [&mut kept, &mut whole].map(|harness| {
            harness.state_mut().time = time;
            // Windows of egui take a frame to find their size, and fade in.
            harness.run_steps(20);
            for _ in 0..2 {
                rendered(harness).unwrap();
                harness.step();
            }
            rendered(harness).unwrap()
        });
        let apart = one.pixels().zip(other.pixels()).filter(|(one, other)| {
            // Letters are filtered by the adapter here and by the harness there.
            (0..3).any(|channel| one[channel].abs_diff(other[channel]) > 6)
        });
        assert_eq!(apart.count(), 0, "at time {time}");
        assert_ne!(last.as_ref(), Some(&one), "nothing changed at time {time}");
        last = Some(one);
    }
}
