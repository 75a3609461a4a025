//! Somebody in front of the window: a thread of its own that presses keys, drags the mouse, and looks at frames.

use super::driven::{Glance, Orbiting, Shared};
use crate::error::{Error, ErrorKind, Result};
use crate::studio::app::Studio;
use crate::studio::model::FitStatus;
use eframe::{egui, wgpu};
use egui::{Context, Event, Key, Modifiers, PointerButton, Pos2};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// How often one looks whether the adapter is done.
const GLANCE_INTERVAL: Duration = Duration::from_micros(300);
/// How often one looks at the studio while waiting for work of many seconds.
const LOOK_INTERVAL: Duration = Duration::from_millis(250);
/// How long the window may take to answer at all.
const PATIENCE: Duration = Duration::from_secs(60);

/// Somebody in front of the window.
pub struct Person {
    context: Context,
    /// What window and person share.
    pub shared: Arc<Shared>,
    device: Option<wgpu::Device>,
}

impl Person {
    /// Somebody before the window of this context.
    pub fn new(context: Context, shared: Arc<Shared>, device: Option<wgpu::Device>) -> Self {
        Person { context, shared, device }
    }

    /// Closes the window.
    pub fn close(&self) {
        self.context.send_viewport_cmd(egui::ViewportCommand::Close);
        self.context.request_repaint();
    }

    /// Does something with the studio before the next frame, and brings what came of it.
    ///
    /// # Errors
    /// `Internal` when the window does not answer.
    pub fn ask<T: Send + 'static>(&self, order: impl FnOnce(&mut Studio, &Context) -> T + Send + 'static) -> Result<T> {
        let (sender, receiver) = channel();
        self.shared.order(Box::new(move |studio, context| {
            let _ = sender.send(order(studio, context));
        }));
        self.context.request_repaint();
        receiver
            .recv_timeout(PATIENCE)
            .map_err(|_| Error::new(ErrorKind::Internal, "the window of the bench does not answer"))
    }

    /// Waits until the studio is as looked for. What ends in an error there ends here.
    ///
    /// # Errors
    /// `Internal` after `patience_seconds`, and when a fit failed.
    pub fn wait_until(
        &self,
        what: &str,
        patience_seconds: f64,
        reached: impl Fn(&Studio) -> bool + Clone + Send + 'static,
    ) -> Result<()> {
        let began = Instant::now();
        loop {
            let reached = reached.clone();
            let (is_reached, failure) = self.ask(move |studio, _| {
                let failure = match &studio.model.fit.status {
                    FitStatus::Failed(message) => Some(message.clone()),
                    _ => None,
                };
                (reached(studio), failure)
            })?;
            if is_reached {
                return Ok(());
            }
            if let Some(message) = failure {
                return Err(Error::new(ErrorKind::Internal, format!("the fit of the bench failed: {message}")));
            }
            if began.elapsed().as_secs_f64() > patience_seconds {
                return Err(Error::new(ErrorKind::Internal, format!("waited in vain: {what}")));
            }
            std::thread::sleep(LOOK_INTERVAL);
        }
    }

    /// Does nothing for a while, as somebody who watches.
    pub fn watch(&self, seconds: f64) {
        std::thread::sleep(Duration::from_secs_f64(seconds.max(0.0)));
    }

    /// Hands events to the window, as the system would.
    pub fn push(&self, events: impl IntoIterator<Item = Event>) {
        self.shared.push(events);
        self.context.request_repaint();
    }

    /// Presses and releases a key.
    pub fn press(&self, key: Key) {
        let modifiers = Modifiers::NONE;
        let event = |pressed| Event::Key { key, physical_key: None, pressed, repeat: false, modifiers };
        self.push([event(true), event(false)]);
    }

    /// Takes hold of a place with the left button.
    pub fn grab(&self, at: Pos2) {
        self.push([Event::PointerMoved(at), button(at, true)]);
    }

    /// Moves the mouse.
    pub fn move_to(&self, at: Pos2) {
        self.push([Event::PointerMoved(at)]);
    }

    /// Lets go, and takes the mouse off the window.
    pub fn let_go(&self, at: Pos2) {
        self.shared.set_orbiting(None);
        self.push([button(at, false)]);
        self.watch(0.1);
        self.push([Event::PointerGone]);
        self.watch(0.3);
    }

    /// Turns the eye by the mouse without a pause for so many seconds.
    pub fn orbit(&self, around: egui::Rect, seconds: f64) {
        let centre = around.center();
        self.grab(centre);
        self.watch(0.3);
        self.shared.set_orbiting(Some(Orbiting { centre, radius: 0.2 * around.width().min(around.height()) }));
        self.context.request_repaint();
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        while Instant::now() < until {
            self.look();
            self.shared.wait_for_news(Duration::from_millis(5));
        }
        self.let_go(centre);
    }

    /// Lets the adapter tell what it is done with.
    fn look(&self) {
        if let Some(device) = &self.device {
            let _ = device.poll(wgpu::PollType::Poll);
        }
    }

    /// Does something and counts the seconds until a frame that answers it is presented; `None` when none is in time.
    /// The answer sees the last frame before and a later one.
    pub fn answer_seconds(
        &self,
        patience_seconds: f64,
        stimulus: impl FnOnce(),
        answer: impl Fn(&Glance, &Glance) -> bool,
    ) -> Option<f64> {
        let before = self.shared.newest()?;
        let began = Instant::now();
        stimulus();
        while began.elapsed().as_secs_f64() < patience_seconds {
            self.look();
            if let Some(glance) = self.shared.shown(before.frame, |glance| answer(&before, glance)) {
                let presented = glance.presented.unwrap_or_else(Instant::now);
                return Some(presented.saturating_duration_since(began).as_secs_f64());
            }
            std::thread::sleep(GLANCE_INTERVAL);
        }
        None
    }
}

fn button(pos: Pos2, pressed: bool) -> Event {
    Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
}
