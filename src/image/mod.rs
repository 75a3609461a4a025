//! Linear images, image files and metrics.
//!
//! Read [`raster`] first: an image is a row-major table of pixels, row 0 at the top. Values are linear; transfer
//! curves ([`transfer`]) are applied by [`mod@file`] at the file border and nowhere else.

pub mod area;
pub mod display;
pub mod file;
pub mod histogram;
pub mod linear;
pub mod metrics;
pub mod raster;
pub mod resize;
pub mod transfer;
pub mod value_scale;

pub use raster::{GreyImage, Image, RgbImage};
