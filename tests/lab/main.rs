//! The lab as a program.

#![allow(clippy::unwrap_used)]

mod contest;
