//! What happens in a fit that the user should know. A checkpoint holds it as the text that is shown.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Something that happened in a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
#[non_exhaustive]
pub enum FitEvent {
    /// The fit began at an exact saddle, black maps under a black light, and left it by the measured start.
    SaddleLeft {
        /// Norm of the gradient by the maps.
        maps: f64,
        /// Norm of the gradient by the light, of four digits.
        light: f64,
    },
    /// What a checkpoint tells in other words.
    Told(String),
}

const BEFORE_MAPS: &str =
    "The start of diffuse 0 and light 0 is a saddle: the gradient by the maps is exactly zero (norm ";
const BEFORE_LIGHT: &str = "), by the light its norm is ";
const AFTER_LIGHT: &str = ". It was left by the measured start: light from the photographs, one grey for the surface.";

impl FitEvent {
    /// That the saddle was left, with the norms of the gradient by maps and light. Of the latter as many digits are kept
    /// as are told, so that a fit that is taken up knows the same.
    pub fn saddle_left(maps: f64, light: f64) -> Self {
        FitEvent::SaddleLeft { maps, light: format!("{light:.3e}").parse().unwrap_or(light) }
    }

    /// Whether it says that the saddle was left.
    pub fn is_of_saddle(&self) -> bool {
        match self {
            FitEvent::SaddleLeft { .. } => true,
            FitEvent::Told(_) => false,
        }
    }
}

impl fmt::Display for FitEvent {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FitEvent::SaddleLeft { maps, light } => {
                write!(formatter, "{BEFORE_MAPS}{maps}{BEFORE_LIGHT}{light:.3e}{AFTER_LIGHT}")
            }
            FitEvent::Told(text) => formatter.write_str(text),
        }
    }
}

impl From<FitEvent> for String {
    fn from(event: FitEvent) -> Self {
        event.to_string()
    }
}

impl From<String> for FitEvent {
    fn from(text: String) -> Self {
        let numbers = || {
            let (maps, light) = text.strip_prefix(BEFORE_MAPS)?.strip_suffix(AFTER_LIGHT)?.split_once(BEFORE_LIGHT)?;
            Some(FitEvent::SaddleLeft { maps: maps.parse().ok()?, light: light.parse().ok()? })
        };
        numbers().unwrap_or(FitEvent::Told(text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_checkpoints_are_read_and_written_as_they_are() {
        let written = "The start of diffuse 0 and light 0 is a saddle: the gradient by the maps is exactly zero (norm 0), \
                       by the light its norm is 3.142e-3. It was left by the measured start: light from the photographs, \
                       one grey for the surface.";
        let event = FitEvent::saddle_left(0.0, 0.003_141_592_6);
        assert_eq!(event.to_string(), written);
        assert!(event.is_of_saddle());
        for text in [written, "something else, by another version"] {
            let json = serde_json::to_string(text).unwrap();
            let read: FitEvent = serde_json::from_str(&json).unwrap();
            assert_eq!(serde_json::to_string(&read).unwrap(), json);
            assert_eq!(read.is_of_saddle(), text == written);
        }
        assert_eq!(FitEvent::from(written.to_owned()), event, "a fit that is taken up knows the same");
    }
}
