//! The window as a person uses it, found by labels, without a display.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

mod acts;
#[path = "../common/adapter.rs"]
mod adapter;
mod faults;
mod fit;
mod hand;
mod manners;
mod memory;
mod object;
mod panels;
mod pictures;
mod relight;
mod saving;
mod support;
mod welcome;
