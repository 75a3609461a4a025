//! The window's loop: take in news, draw, do what was asked.

use super::act::{Act, keys, turns};
use super::layout::Layout;
use super::model::store::Store;
use super::model::{FitStatus, Model};
use super::pace::Pace;
use super::panel::{self, Memory};
use super::repaint::Repaint;
use super::stage::{Stage, StageStatus};
use super::workspace::Workspace;
use super::{perform, theme};
use egui::{Context, ViewportCommand};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The studio.
pub struct Studio {
    /// What the window knows.
    pub model: Model,
    /// What panels keep between frames.
    pub memory: Memory,
    /// The arrangement of the panels.
    pub layout: Layout,
    /// The same in object mode.
    pub object_layout: Layout,
    theme_in_force: Option<super::model::store::ThemeChoice>,
    title_in_force: String,
    preferences_written: Instant,
    pace: Pace,
    took_snapshot: bool,
    /// When a person last did something.
    touched: Instant,
    /// Events that the next frame takes before its own.
    events_held_back: Vec<egui::Event>,
    /// Seconds the last frames took to lay out and paint, newest last; for `patina bench studio`.
    pub frame_seconds: Vec<f64>,
}

/// What the studio is started with.
#[derive(Clone, Debug, Default)]
pub struct StudioOptions {
    /// A scene or run to open at once.
    pub path: Option<PathBuf>,
    /// Open the built-in demo at once.
    pub demo: bool,
    /// The file in which settings are remembered instead of the user's own; for tests.
    pub settings_file: Option<PathBuf>,
}

/// For how long a person waits for the answer to what they did.
const PERSON_WAITS: Duration = Duration::from_secs(3);
/// Seconds between two writings of what is remembered.
const PREFERENCES_INTERVAL: Duration = Duration::from_secs(10);

impl Studio {
    /// The studio in a window or in a test; `context` is the window's.
    pub fn new(creation: &eframe::CreationContext<'_>, options: &StudioOptions) -> Self {
        let context = creation.egui_ctx.clone();
        let store = match &options.settings_file {
            Some(path) => Store::at(Some(path.clone())),
            None => Store::of_user(),
        };
        let info = creation.wgpu_render_state.as_ref().map(|state| state.adapter.get_info());
        let is_software = info.as_ref().is_some_and(|info| info.device_type == eframe::wgpu::DeviceType::Cpu);
        let pace = Pace::new(is_software);
        let mut model = Model::new(store, pace.wake(context.clone()));
        let mut memory = Memory::default();
        if let (Some(state), Some(info)) = (&creation.wgpu_render_state, info) {
            model.software_adapter = is_software;
            model.adapter = format!("{} ({})", info.name, info.backend);
            memory.stage.stage = Some(Stage::new(state));
            if model.software_adapter {
                context.add_plugin(Repaint::new(state.target_format));
                model.log.note(format!(
                    "No graphics card: {} renders the viewport on the CPU. Everything works; orbiting is slower",
                    info.name
                ));
            }
        } else {
            model.log.note("No 3-D rendering available: the viewport stays empty, everything else works");
        }
        let layout = Layout::from_text(&model.preferences.layout, Workspace::Scene);
        let object_layout = Layout::from_text(&model.preferences.object_layout, Workspace::Object);
        context.set_zoom_factor(model.preferences.zoom);
        if let Some(path) = &options.path {
            model.open(path.clone());
        } else if options.demo {
            model.act(Act::OpenDemo);
        }
        Studio {
            model,
            memory,
            layout,
            object_layout,
            theme_in_force: None,
            title_in_force: String::new(),
            preferences_written: Instant::now(),
            pace,
            took_snapshot: false,
            touched: Instant::now(),
            events_held_back: Vec::new(),
            frame_seconds: Vec::new(),
        }
    }

    /// Takes in news, without drawing.
    fn take_in(&mut self, context: &Context) {
        let was_live = self.model.fit.status.is_live();
        self.model.poll();
        let status = &self.model.fit.status;
        if status.is_live() && !was_live {
            self.pace.restart();
        }
        // A fit that rests has the window to itself.
        let follows = is_at_work(status);
        let follow = self.model.preferences.follow;
        if !follows || self.pace.takes_snapshot(follow, self.stage_status().is_uploading) {
            self.took_snapshot |= self.model.take_snapshot() && follows;
        }
        let dropped: Vec<PathBuf> =
            context.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_path_buf()).collect());
        if !dropped.is_empty() {
            self.model.all_dropped(dropped);
        }
        if self.theme_in_force != Some(self.model.preferences.theme) {
            theme::apply(context, self.model.preferences.theme);
            self.theme_in_force = Some(self.model.preferences.theme);
        }
        let title = self.model.window_title();
        if title != self.title_in_force {
            context.send_viewport_cmd(ViewportCommand::Title(title.clone()));
            self.title_in_force = title;
        }
        if self.preferences_written.elapsed() > PREFERENCES_INTERVAL {
            self.remember();
        }
    }

    fn remember(&mut self) {
        self.preferences_written = Instant::now();
        self.model.preferences.layout = self.layout.to_text();
        self.model.preferences.object_layout = self.object_layout.to_text();
        self.model.write_preferences();
    }

    /// Takes up how large the interface and the window are.
    fn take_up_sizes(&mut self, context: &Context) {
        self.model.preferences.zoom = context.zoom_factor();
        let size = context.content_rect().size();
        if size.x > 100.0 && size.y > 100.0 {
            self.model.preferences.window_size = (size * context.zoom_factor()).into();
        }
    }

    /// Draws everything.
    fn draw(&mut self, ui: &mut egui::Ui) {
        if self.model.workspace == Workspace::Object {
            panel::menu::show(ui, &mut self.model);
            panel::object::toolbar::show(ui, &mut self.model);
            panel::status::show(ui, &mut self.model);
            let (layout, model, memory) = (&mut self.object_layout, &mut self.model, &mut self.memory);
            egui::CentralPanel::no_frame().show(ui, |ui| layout.show(ui, model, memory));
        } else if self.model.project.is_none() {
            panel::menu::show(ui, &mut self.model);
            panel::status::show(ui, &mut self.model);
            egui::CentralPanel::default().show(ui, |ui| panel::welcome::show(ui, &mut self.model, &mut self.memory));
        } else if self.model.switches.alone {
            let frame = egui::Frame::NONE;
            egui::CentralPanel::no_frame().frame(frame).show(ui, |ui| {
                panel::show(super::workspace::Panel::Stage, ui, &mut self.model, &mut self.memory);
            });
        } else {
            panel::menu::show(ui, &mut self.model);
            panel::toolbar::show(ui, &mut self.model);
            panel::status::show(ui, &mut self.model);
            egui::CentralPanel::no_frame().show(ui, |ui| self.layout.show(ui, &mut self.model, &mut self.memory));
        }
        panel::card::show(ui.ctx(), &mut self.model);
        panel::banner::show(ui.ctx(), &mut self.model);
        panel::dialog::show(ui.ctx(), &mut self.model);
        panel::guide::show(ui.ctx(), &mut self.model, &mut self.memory.guide);
        panel::welcome::drop_hint(ui.ctx());
    }

    fn perform_acts(&mut self, context: &Context) {
        for act in std::mem::take(&mut self.model.acts) {
            let layout = match self.model.workspace {
                Workspace::Scene => &mut self.layout,
                Workspace::Object => &mut self.object_layout,
            };
            perform::perform(act, &mut self.model, layout, context);
        }
    }

    fn stage_status(&self) -> StageStatus {
        self.memory.stage.stage.as_ref().map(Stage::status).unwrap_or_default()
    }

    /// Tells the pace what this frame was and lets the window rest for as long as nothing happens.
    fn rest(&mut self, context: &Context) {
        let stage = self.stage_status();
        let took_snapshot = std::mem::take(&mut self.took_snapshot);
        let follows = is_at_work(&self.model.fit.status);
        if self.pace.drawn(took_snapshot, stage.is_uploading, stage.upload_seconds, follows) {
            context.request_repaint();
        }
        let (status, follow) = (&self.model.fit.status, self.model.preferences.follow);
        if let Some(rest) = self.pace.rest(status, follow, self.model.tasks.is_busy()) {
            context.request_repaint_after(rest);
        }
    }
}

/// Whether a fit takes steps that the window should not hold up.
fn is_at_work(status: &FitStatus) -> bool {
    status.is_live() && *status != FitStatus::Paused
}

/// Draws a ring around whatever has the keys, so that it is seen everywhere and not only where a control draws one itself.
fn focus_ring(context: &Context) {
    let Some(focused) = context.memory(|memory| memory.focused()) else { return };
    let Some(response) = context.read_response(focused) else { return };
    let rect = response.rect.intersect(response.interact_rect).expand(2.0);
    if rect.is_positive() {
        let colour = theme::palette(&context.global_style().visuals).accent;
        let layer = egui::LayerId::new(egui::Order::Tooltip, egui::Id::unique("focus ring"));
        let stroke = egui::Stroke::new(2.0, colour);
        context.layer_painter(layer).rect_stroke(rect, 4.0, stroke, egui::StrokeKind::Outside);
    }
}

/// A control that was pressed by the mouse does not keep the keys: Space goes on to pause and not to press it again.
fn release_focus(context: &Context) {
    let released = context.input(|input| input.pointer.any_released());
    if released && !context.text_edit_focused() {
        context.memory_mut(|memory| {
            if let Some(focused) = memory.focused() {
                memory.surrender_focus(focused);
            }
        });
    }
}

impl eframe::App for Studio {
    fn raw_input_hook(&mut self, context: &Context, raw_input: &mut egui::RawInput) {
        let mut events = std::mem::take(&mut self.events_held_back);
        events.append(&mut raw_input.events);
        self.events_held_back = turns::held_back(&mut events);
        raw_input.events = events;
        if !self.events_held_back.is_empty() {
            context.request_repaint();
        }
    }

    fn logic(&mut self, context: &Context, _frame: &mut eframe::Frame) {
        self.take_in(context);
    }

    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        let began = Instant::now();
        self.pace.begin(|| {
            if let Some(state) = frame.wgpu_render_state() {
                // How long the last frame took is all that is wanted of it.
                let _ = state.device.poll(eframe::wgpu::PollType::wait_indefinitely());
            }
        });
        let context = ui.ctx().clone();
        if matches!(self.model.dialog, super::model::Dialog::None) {
            self.model.acts.extend(keys::pressed(&context));
        }
        // An error goes by Escape where no dialog takes the key.
        let is_free = matches!(self.model.dialog, super::model::Dialog::None) && !context.text_edit_focused();
        if is_free && self.model.log.banner().is_some() && context.input(|input| input.key_pressed(egui::Key::Escape)) {
            self.model.log.dismiss();
        }
        self.model.visible_panels = match self.model.workspace {
            Workspace::Scene => self.layout.visible(),
            Workspace::Object => self.object_layout.visible(),
        };
        self.model.peek_photo = context.input(|input| input.modifiers.shift);
        if context.input(|input| !input.events.is_empty() || input.pointer.any_down()) {
            self.touched = Instant::now();
        }
        self.model.nobody_waits = is_at_work(&self.model.fit.status) && self.touched.elapsed() > PERSON_WAITS;
        // What a key asks for is seen in this frame, what is pressed in the next.
        self.perform_acts(&context);
        self.draw(ui);
        focus_ring(&context);
        release_focus(&context);
        self.perform_acts(&context);
        if let Some(panel) = self.model.activate.take() {
            match panel.workspace(self.model.workspace) {
                Workspace::Scene => self.layout.activate(panel),
                Workspace::Object => self.object_layout.activate(panel),
            }
        }
        self.take_up_sizes(&context);
        self.model.follow_day();
        let seconds = context.input(|input| input.time);
        self.model.history.feed(seconds, &self.model.edits);
        self.model.send_changed_settings(&context);
        self.rest(&context);
        self.frame_seconds.push(began.elapsed().as_secs_f64());
        if self.frame_seconds.len() > 4096 {
            self.frame_seconds.drain(..2048);
        }
    }

    fn on_exit(&mut self) {
        // Zoom and size are taken up with every frame: here there is no window any more to ask.
        self.model.tasks.stop_all();
        self.model.fit.stop_and_wait();
        self.model.object.stop_and_wait();
        self.model.preferences.running = None;
        self.model.preferences.layout = self.layout.to_text();
        self.model.preferences.object_layout = self.object_layout.to_text();
        self.model.write_preferences();
    }
}
