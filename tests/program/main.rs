//! The house from outside: the order of its layers, and its program.

#![allow(clippy::unwrap_used)]

mod layers;
