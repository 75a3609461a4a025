//! The window as a person uses it, found by labels, without a display.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

mod acts;
pub mod adapter;
mod faults;
mod film;
mod fit;
mod hand;
mod known;
mod manners;
mod memory;
mod object;
mod object_again;
mod panels;
mod picture;
mod pictures;
mod queue;
mod relight;
mod saving;
mod stage;
mod states;
mod support;
mod ways_in_and_out;
mod welcome;
