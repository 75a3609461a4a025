//! What undo takes back: settings, lights, display, layer. Where the eye stands is not among them.

use super::lights::LightName;
use super::object_form::ObjectForm;
use crate::fit::FitSettings;
use crate::image::display::DisplaySettings;
use crate::light::Environment;
use crate::light::day::Day;
use crate::studio::stage::Layer;
use egui::util::undoer::{Settings, Undoer};

/// How the photo is laid against the stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PhotoLook {
    /// Not at all.
    #[default]
    Off,
    /// Behind the surface, in place of the background.
    Under,
    /// Over the stage with this opacity.
    Over(f32),
    /// Left of a line at this share of the width.
    Wipe(f32),
}

/// The light or the two lights in which the stage is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Relight {
    /// The light; left of the line when there are two.
    pub first: LightName,
    /// The light right of the line.
    pub second: Option<LightName>,
    /// Place of the line as a share of the width.
    pub wipe: f32,
    /// Turn about the up axis, in degrees.
    pub turn_degrees: f32,
    /// Strength of the light as a power of two.
    pub strength_stops: f32,
    /// Whether other lights are brought to the brightness of the fitted one.
    pub matched: bool,
    /// Whether the light shows behind the surface.
    pub as_background: bool,
    /// Whether it is out of focus there.
    pub is_background_blurred: bool,
    /// Whether a ground under the surface catches its shadow.
    pub ground: bool,
    /// Whether a chrome and a grey ball show the light over the stage.
    pub balls: bool,
    /// Hour and latitude of [`LightName::Day`].
    pub day: Day,
}

impl Default for Relight {
    fn default() -> Self {
        Relight {
            first: LightName::Fitted,
            second: None,
            wipe: 0.5,
            turn_degrees: 0.0,
            strength_stops: 0.0,
            matched: true,
            as_background: true,
            is_background_blurred: false,
            ground: false,
            balls: false,
            day: Day::default(),
        }
    }
}

/// By how many degrees a background that is out of focus is blurred: about as the stage's second layer of a light is.
const BACKGROUND_BLUR_DEGREES: f32 = 10.0;

impl Relight {
    /// A light with turn and strength in its texels.
    pub fn turned(&self, light: &Environment) -> Environment {
        let turned = light.rotated_about_up(self.turn_degrees.to_radians());
        let factor = self.strength_stops.exp2();
        Environment { radiance: turned.radiance.map(|radiance| *radiance * factor) }
    }

    /// By how many degrees the light is blurred where it shows behind the surface.
    pub fn background_blur_degrees(&self) -> f32 {
        if self.is_background_blurred { BACKGROUND_BLUR_DEGREES } else { 0.0 }
    }
}

/// What undo takes back.
#[derive(Clone, Debug, PartialEq)]
pub struct Edits {
    /// Settings of the fit: of the one in progress where it can still change, of the next one otherwise.
    pub fit: FitSettings,
    /// How pictures are shown.
    pub display: DisplaySettings,
    /// What the stage shows on the surface.
    pub layer: Layer,
    /// Where between photos (0), diffuse reflectance (1) and materials under the light (2) [`Layer::Crossfade`] stands.
    pub crossfade: f32,
    /// The light of the stage.
    pub relight: Relight,
    /// The photo against the stage.
    pub photo: PhotoLook,
    /// What an estimation from photos of one object is asked for.
    pub object: ObjectForm,
}

impl Default for Edits {
    fn default() -> Self {
        Edits {
            fit: FitSettings::default(),
            display: DisplaySettings::default(),
            layer: Layer::Lit,
            crossfade: 1.0,
            relight: Relight::default(),
            photo: PhotoLook::Off,
            object: ObjectForm::default(),
        }
    }
}

/// Remembers edits. A change counts when nothing has moved for half a second, so a drag is one step of undo.
pub struct History(Undoer<Edits>);

impl Default for History {
    fn default() -> Self {
        History(Undoer::with_settings(Settings { max_undos: 200, stable_time: 0.5, auto_save_interval: 20.0 }))
    }
}

impl History {
    /// Tells the history how things are, once a frame.
    pub fn feed(&mut self, seconds: f64, edits: &Edits) {
        self.0.feed_state(seconds, edits);
    }

    /// Begins anew, with nothing to take back.
    pub fn restart(&mut self, edits: &Edits) {
        *self = History::default();
        self.0.add_undo(edits);
    }

    /// Whether something can be taken back.
    pub fn can_undo(&self, edits: &Edits) -> bool {
        self.0.has_undo(edits)
    }

    /// Whether something can be done again.
    pub fn can_redo(&self, edits: &Edits) -> bool {
        self.0.has_redo(edits)
    }

    /// Takes back the last change.
    pub fn undo(&mut self, edits: &mut Edits) {
        if let Some(before) = self.0.undo(edits) {
            *edits = before.clone();
        }
    }

    /// Does again what was taken back.
    pub fn redo(&mut self, edits: &mut Edits) {
        if let Some(after) = self.0.redo(edits) {
            *edits = after.clone();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drag_is_one_step_and_redo_ends_with_a_new_change() {
        let mut edits = Edits::default();
        let mut history = History::default();
        let mut seconds = 0.0;
        let mut settle = |history: &mut History, edits: &Edits| {
            for _ in 0..3 {
                seconds += 1.0;
                history.feed(seconds, edits);
            }
        };
        settle(&mut history, &edits);
        for step in 1..=10 {
            edits.display.exposure_stops = step as f32 / 10.0;
            history.feed(3.0 + f64::from(step) * 0.01, &edits);
        }
        settle(&mut history, &edits);
        edits.layer = Layer::Diffuse;
        settle(&mut history, &edits);
        history.undo(&mut edits);
        assert_eq!((edits.layer, edits.display.exposure_stops), (Layer::Lit, 1.0));
        history.undo(&mut edits);
        assert_eq!(edits, Edits::default());
        assert!(!history.can_undo(&edits) && history.can_redo(&edits));
        history.redo(&mut edits);
        assert_eq!(edits.display.exposure_stops, 1.0);
        edits.relight.turn_degrees = 15.0;
        settle(&mut history, &edits);
        assert!(!history.can_redo(&edits));
    }
}
