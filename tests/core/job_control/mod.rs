//! What a watcher may do to a fit while it runs, and what the world may do to its folder.

#![allow(clippy::unwrap_used)]

mod budget;
mod faults;
mod line;
mod opening;
mod settings;
mod support;
mod watching;
