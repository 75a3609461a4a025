//! States of the fit that are kept as it goes, so that one can look at it again as it was.
//!
//! Each state that was seen is one; where they take more memory than [`MOST_BYTES`] every second of the older ones goes.
//! Looking back changes neither the fit nor its files: newer states are kept meanwhile, and shown once one returns to them.

use super::Model;
use crate::job::Snapshot;
use crate::light::Environment;
use crate::material::MaterialMaps;
use std::sync::Arc;

/// Memory that kept states may take, in bytes.
const MOST_BYTES: usize = 256 << 20;
/// Numbers of 4 bytes a texel of the maps has: diffuse and specular reflectance and roughness.
const NUMBERS_PER_TEXEL: usize = 7;

/// Maps and light at a time.
#[derive(Clone, Debug)]
pub struct KeptState {
    /// Seconds since the start of the fit, at the end of the last step before it.
    pub seconds: f64,
    /// Phase of the fit.
    pub stage: String,
    /// The maps.
    pub maps: Arc<MaterialMaps>,
    /// The light.
    pub environment: Arc<Environment>,
}

impl KeptState {
    fn of(snapshot: &Snapshot) -> Self {
        KeptState {
            seconds: snapshot.losses.last().map_or(0.0, |row| row.seconds),
            stage: snapshot.stage.clone(),
            maps: Arc::clone(&snapshot.maps),
            environment: Arc::clone(&snapshot.environment),
        }
    }

    fn bytes(&self) -> usize {
        4 * NUMBERS_PER_TEXEL * self.maps.diffuse.pixels().len()
    }
}

/// Kept states, the oldest first, and which of them is looked at.
#[derive(Clone, Debug, Default)]
pub struct Timeline {
    states: Vec<KeptState>,
    /// `None` for the newest, whichever that is.
    shown: Option<usize>,
}

impl Timeline {
    /// The states, the oldest first.
    pub fn states(&self) -> &[KeptState] {
        &self.states
    }

    /// The state of the past that is looked at.
    pub fn shown(&self) -> Option<usize> {
        self.shown
    }

    /// Whether this is the newest state.
    pub(super) fn has_newest(&self, environment: &Arc<Environment>) -> bool {
        self.states.last().is_some_and(|own| Arc::ptr_eq(&own.environment, environment))
    }

    /// Keeps a state.
    pub(super) fn keep(&mut self, snapshot: &Snapshot) {
        self.keep_within(KeptState::of(snapshot), MOST_BYTES);
    }

    fn keep_within(&mut self, state: KeptState, most_bytes: usize) {
        self.states.push(state);
        while self.states.len() > 2 && self.states.iter().map(KeptState::bytes).sum::<usize>() > most_bytes {
            // The first, the newest and what is looked at stay.
            let (newest, shown) = (self.states.len() - 1, self.shown);
            let stays = |index: usize| index.is_multiple_of(2) || index == newest || Some(index) == shown;
            let before = self.states.len();
            self.shown = shown.map(|shown| (0..shown).filter(|&index| stays(index)).count());
            let mut index = 0..;
            self.states.retain(|_| index.next().is_some_and(stays));
            if self.states.len() == before {
                break;
            }
        }
    }
}

impl Model {
    /// Shows the fit as it was at a kept state; the newest one, and those to come, for `None`.
    pub fn look_back(&mut self, state: Option<usize>) {
        let newest = self.timeline.states.len().saturating_sub(1);
        let state = state.filter(|&state| state < newest);
        if state == self.timeline.shown || self.timeline.states.is_empty() {
            return;
        }
        self.timeline.shown = state;
        match state {
            Some(state) => {
                let own = self.timeline.states[state].clone();
                self.show_maps(own.maps, own.environment);
            }
            None => self.show_newest(),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::image::Image;
    use glam::Vec3;

    fn state(seconds: f64) -> KeptState {
        KeptState {
            seconds,
            stage: "maps".into(),
            maps: Arc::new(MaterialMaps {
                diffuse: Image::filled(4, 4, Vec3::ONE),
                specular: Image::filled(4, 4, Vec3::ONE),
                roughness: Image::filled(4, 4, 0.5),
            }),
            environment: Arc::new(Environment::constant(4, 2, Vec3::ONE)),
        }
    }

    #[test]
    fn old_states_are_thinned_and_the_first_the_newest_and_the_one_in_view_stay() {
        let mut timeline = Timeline::default();
        let bytes = state(0.0).bytes();
        assert_eq!(bytes, 16 * 7 * 4);
        for second in 0..4 {
            timeline.keep_within(state(f64::from(second)), 6 * bytes);
        }
        timeline.shown = Some(3);
        for second in 4..40 {
            timeline.keep_within(state(f64::from(second)), 6 * bytes);
            let seconds: Vec<f64> = timeline.states.iter().map(|own| own.seconds).collect();
            assert!(seconds.len() <= 6 && seconds.is_sorted(), "{seconds:?}");
            assert_eq!((seconds[0], *seconds.last().unwrap()), (0.0, f64::from(second)));
            assert_eq!(seconds[timeline.shown.unwrap()], 3.0, "{seconds:?}");
        }
    }
}
