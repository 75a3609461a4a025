//! The window as a person uses it, found by labels, without a display.

#![allow(clippy::unwrap_used)]

mod support;
mod welcome;
