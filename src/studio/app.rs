//! The window's loop: take in news, draw, do what was asked.

use super::act::{Act, keys};
use super::layout::Layout;
use super::model::store::{Follow, Store};
use super::model::tasks::Wake;
use super::model::{FitStatus, Model};
use super::panel::{self, Memory};
use super::stage::Stage;
use super::{perform, theme};
use egui::{Context, ViewportCommand};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The studio.
pub struct Studio {
    /// What the window knows.
    pub model: Model,
    /// What panels keep between frames.
    pub memory: Memory,
    /// The arrangement of the panels.
    pub layout: Layout,
    theme_in_force: Option<super::model::store::ThemeChoice>,
    title_in_force: String,
    preferences_written: Instant,
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
        let waker = context.clone();
        // Threads may call as often as they like: a frame within a tenth of a second is soon enough.
        let wake: Wake = Arc::new(move || waker.request_repaint_after(Duration::from_millis(100)));
        let mut model = Model::new(store, wake);
        let mut memory = Memory::default();
        if let Some(state) = &creation.wgpu_render_state {
            let info = state.adapter.get_info();
            model.software_adapter = info.device_type == eframe::wgpu::DeviceType::Cpu;
            model.adapter = format!("{} ({})", info.name, info.backend);
            memory.stage.stage = Some(Stage::new(state));
            if model.software_adapter {
                model.log.note(format!(
                    "No graphics card is used: {} draws the stage on the processor. Everything works; turning the scene is slower",
                    info.name
                ));
            }
        } else {
            model.log.note("Nothing can draw in 3-D here: the stage stays empty, everything else works");
        }
        let layout = Layout::from_text(&model.preferences.layout);
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
            theme_in_force: None,
            title_in_force: String::new(),
            preferences_written: Instant::now(),
            frame_seconds: Vec::new(),
        }
    }

    /// Takes in news, without drawing.
    fn take_in(&mut self, context: &Context) {
        self.model.poll();
        let dropped: Vec<PathBuf> =
            context.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_path_buf()).collect());
        for path in dropped {
            self.model.dropped(path);
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
            self.remember(context);
        }
    }

    fn remember(&mut self, context: &Context) {
        self.preferences_written = Instant::now();
        self.model.preferences.layout = self.layout.to_text();
        self.model.preferences.zoom = context.zoom_factor();
        let size = context.content_rect().size();
        if size.x > 100.0 && size.y > 100.0 {
            self.model.preferences.window_size = (size * context.zoom_factor()).into();
        }
        self.model.write_preferences();
    }

    /// Draws everything.
    fn draw(&mut self, ui: &mut egui::Ui) {
        if self.model.project.is_none() {
            panel::menu::show(ui, &mut self.model);
            panel::status::show(ui, &mut self.model);
            egui::CentralPanel::default().show(ui, |ui| panel::welcome::show(ui, &mut self.model, &mut self.memory));
        } else if self.model.switches.alone {
            let frame = egui::Frame::NONE;
            egui::CentralPanel::no_frame().frame(frame).show(ui, |ui| {
                panel::show(super::layout::Panel::Stage, ui, &mut self.model, &mut self.memory);
            });
        } else {
            panel::menu::show(ui, &mut self.model);
            panel::toolbar::show(ui, &mut self.model);
            panel::status::show(ui, &mut self.model);
            egui::CentralPanel::no_frame().show(ui, |ui| self.layout.show(ui, &mut self.model, &mut self.memory));
        }
        panel::banner::show(ui.ctx(), &mut self.model);
        panel::dialog::show(ui.ctx(), &mut self.model);
        panel::welcome::drop_hint(ui.ctx());
    }

    /// How long the window may rest when nothing happens.
    fn rest(&self, context: &Context) {
        let works = |status: &FitStatus| status.is_live() && *status != FitStatus::Paused;
        let interval = match (&self.model.fit.status, self.model.preferences.follow) {
            (status, Follow::Live) if works(status) => 0.25,
            (status, _) if works(status) => 1.0,
            _ if self.model.tasks.is_busy() => 0.2,
            _ => return,
        };
        // On the processor every frame is taken from the fit.
        let factor = if self.model.software_adapter { 2.0 } else { 1.0 };
        context.request_repaint_after(Duration::from_secs_f64(interval * factor));
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
    fn logic(&mut self, context: &Context, _frame: &mut eframe::Frame) {
        self.take_in(context);
    }

    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let began = Instant::now();
        let context = ui.ctx().clone();
        if matches!(self.model.dialog, super::model::Dialog::None) {
            self.model.acts.extend(keys::pressed(&context));
        }
        self.model.peek_photo = context.input(|input| input.modifiers.shift);
        self.draw(ui);
        release_focus(&context);
        for act in std::mem::take(&mut self.model.acts) {
            perform::perform(act, &mut self.model, &mut self.layout, &context);
        }
        if let Some(panel) = self.model.activate.take() {
            self.layout.activate(panel);
        }
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
        self.model.tasks.stop_all();
        self.model.fit.stop_and_wait();
        self.model.preferences.running = None;
        self.model.preferences.layout = self.layout.to_text();
        self.model.write_preferences();
    }
}
