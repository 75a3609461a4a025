//! The window of the bench: the studio, with orders taken in before a frame and a mark set on every frame.

use crate::studio::app::Studio;
use crate::studio::model::{FitStatus, LightName};
use crate::studio::stage::eye::OrbitEye;
use crate::studio::stage::{Layer, Stage};
use eframe::{egui, egui_wgpu, wgpu};
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Frames that are kept, at most.
const MOST_FRAMES: usize = 20_000;

/// Something to be done with the studio before a frame.
pub type Order = Box<dyn FnOnce(&mut Studio, &egui::Context) + Send>;

/// What a frame showed. Taken before its panels were drawn: what acts change is shown by the frame after.
#[derive(Clone, Debug)]
pub struct Glance {
    /// The number of the frame.
    pub frame: u64,
    /// When its drawing began.
    pub began: Instant,
    /// When the adapter was done with it; `None` until then.
    pub presented: Option<Instant>,
    /// Seconds for which the window's thread was at it and heard nobody, until it began to hand the drawing on; `None` before.
    pub busy_seconds: Option<f64>,
    /// The state of the fit.
    pub status: FitStatus,
    /// The light of the stage.
    pub light: LightName,
    /// What is drawn on the surface.
    pub layer: Layer,
    /// Exposure in stops.
    pub exposure_stops: f32,
    /// The chosen photo.
    pub view: usize,
    /// The eye.
    pub eye: OrbitEye,
    /// How often the stage drew its scene, this frame included.
    pub scenes_drawn: u64,
    /// Whether a newer light is being made ready.
    pub is_light_uploading: bool,
}

/// The mouse turns the eye while this is set: about a place on the stage, in points.
#[derive(Clone, Copy, Debug)]
pub struct Orbiting {
    /// The middle of its circle.
    pub centre: egui::Pos2,
    /// The radius of its circle.
    pub radius: f32,
}

/// What window and person share.
#[derive(Default)]
pub struct Shared {
    state: Mutex<State>,
    news: Condvar,
}

#[derive(Default)]
struct State {
    orders: Vec<Order>,
    events: Vec<egui::Event>,
    orbiting: Option<(Orbiting, f32)>,
    glances: VecDeque<Glance>,
    frames: u64,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Every part is whole at any time.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Hands an order to the next frame.
    pub fn order(&self, order: Order) {
        self.lock().orders.push(order);
    }

    /// Hands events to the next frame, as the system would.
    pub fn push(&self, events: impl IntoIterator<Item = egui::Event>) {
        self.lock().events.extend(events);
    }

    /// Lets the mouse go round, or stop.
    pub fn set_orbiting(&self, orbiting: Option<Orbiting>) {
        self.lock().orbiting = orbiting.map(|orbiting| (orbiting, 0.0));
    }

    /// Number of frames so far.
    pub fn frames(&self) -> u64 {
        self.lock().frames
    }

    /// The newest glance.
    pub fn newest(&self) -> Option<Glance> {
        self.lock().glances.back().cloned()
    }

    /// Glances of the frames after the one of this number.
    pub fn since(&self, frame: u64) -> Vec<Glance> {
        self.lock().glances.iter().filter(|glance| glance.frame > frame).cloned().collect()
    }

    /// The first frame after the one of this number that is presented and shows what is looked for.
    pub fn shown(&self, after: u64, answer: impl Fn(&Glance) -> bool) -> Option<Glance> {
        let state = self.lock();
        let newer = state.glances.iter().filter(|glance| glance.frame > after);
        newer.filter(|glance| glance.presented.is_some()).find(|glance| answer(glance)).cloned()
    }

    /// Waits for a frame, a moment at most.
    pub fn wait_for_news(&self, most: std::time::Duration) {
        let state = self.lock();
        let _ = self.news.wait_timeout(state, most).unwrap_or_else(PoisonError::into_inner);
    }

    fn presented(&self, frame: u64, at: Instant) {
        if let Some(glance) = self.lock().glances.iter_mut().rev().find(|glance| glance.frame == frame) {
            glance.presented = Some(at);
        }
        self.news.notify_all();
    }

    fn done(&self, frame: u64, began: Option<Instant>) {
        if let Some(glance) = self.lock().glances.iter_mut().rev().find(|glance| glance.frame == frame) {
            glance.busy_seconds = began.map(|began| began.elapsed().as_secs_f64());
        }
    }

    fn drawn(&self, frame: u64, scenes_drawn: u64, is_light_uploading: bool) {
        if let Some(glance) = self.lock().glances.iter_mut().rev().find(|glance| glance.frame == frame) {
            glance.scenes_drawn = scenes_drawn;
            glance.is_light_uploading = is_light_uploading;
        }
    }
}

/// The window.
pub struct Driven {
    studio: Studio,
    shared: Arc<Shared>,
    /// When the frame at hand began to take in news.
    began: Option<Instant>,
}

impl Driven {
    /// A window around a studio.
    pub fn new(studio: Studio, shared: Arc<Shared>) -> Self {
        Driven { studio, shared, began: None }
    }

    /// Notes what this frame shows; returns its number.
    fn glance(&self, began: Instant) -> u64 {
        let model = &self.studio.model;
        let mut state = self.shared.lock();
        state.frames += 1;
        let frame = state.frames;
        let before = state.glances.back().map_or(0, |glance| glance.scenes_drawn);
        state.glances.push_back(Glance {
            frame,
            began,
            presented: None,
            busy_seconds: None,
            status: model.fit.status.clone(),
            light: model.edits.relight.first.clone(),
            layer: model.edits.layer,
            exposure_stops: model.edits.display.exposure_stops,
            view: model.project.as_ref().map_or(0, |project| project.chosen_view),
            eye: model.eye,
            scenes_drawn: before,
            is_light_uploading: false,
        });
        if state.glances.len() > MOST_FRAMES {
            state.glances.drain(..MOST_FRAMES / 2);
        }
        frame
    }
}

impl eframe::App for Driven {
    fn raw_input_hook(&mut self, context: &egui::Context, raw_input: &mut egui::RawInput) {
        // Not from the news of a frame that was never drawn, as of a window that is hidden.
        self.began = Some(Instant::now());
        let mut state = self.shared.lock();
        raw_input.events.append(&mut state.events);
        if let Some((orbiting, angle)) = &mut state.orbiting {
            *angle += 0.12;
            let place = orbiting.centre + orbiting.radius * egui::vec2(angle.cos(), 0.5 * angle.sin());
            raw_input.events.push(egui::Event::PointerMoved(place));
        }
        drop(state);
        self.studio.raw_input_hook(context, raw_input);
    }

    fn logic(&mut self, context: &egui::Context, frame: &mut eframe::Frame) {
        let orders = std::mem::take(&mut self.shared.lock().orders);
        for order in orders {
            order(&mut self.studio, context);
        }
        self.studio.logic(context, frame);
    }

    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        let number = self.glance(Instant::now());
        self.studio.ui(ui, frame);
        let began = self.began;
        if frame.wgpu_render_state().is_some() {
            let (shared, stage) = (Arc::clone(&self.shared), self.studio.memory.stage.stage.clone());
            let mark = FrameMark { shared, stage, number, began };
            // Somewhere on the screen: it draws nothing.
            let corner = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(2.0, 2.0));
            ui.painter().add(egui_wgpu::Callback::new_paint_callback(corner, mark));
        } else {
            self.shared.done(number, began);
            self.shared.presented(number, Instant::now());
        }
        if self.shared.lock().orbiting.is_some() {
            // The next movement of the mouse is there already.
            ui.ctx().request_repaint();
        }
        self.shared.news.notify_all();
    }

    fn on_exit(&mut self) {
        self.studio.on_exit();
    }
}

/// Tells when the adapter is done with a frame.
struct FrameMark {
    shared: Arc<Shared>,
    stage: Option<Stage>,
    number: u64,
    /// When the frame began to take in news.
    began: Option<Instant>,
}

impl egui_wgpu::CallbackTrait for FrameMark {
    fn finish_prepare(
        &self,
        _device: &wgpu::Device,
        _queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        _resources: &mut egui_wgpu::CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        if let Some(stage) = &self.stage {
            let status = stage.status();
            self.shared.drawn(self.number, status.scenes_drawn, status.is_light_uploading);
        }
        let (shared, number) = (Arc::clone(&self.shared), self.number);
        encoder.on_submitted_work_done(move || shared.presented(number, Instant::now()));
        Vec::new()
    }

    fn paint(
        &self,
        _info: egui::PaintCallbackInfo,
        _pass: &mut wgpu::RenderPass<'static>,
        _resources: &egui_wgpu::CallbackResources,
    ) {
        // What was drawn is uploaded, and there is a picture to draw into: one waits for it where the adapter is behind.
        self.shared.done(self.number, self.began);
    }
}
