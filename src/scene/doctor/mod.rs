//! The pre-flight check.
pub mod pixel_centre;
