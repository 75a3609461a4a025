//! Linear pictures on the screen: zoom, pan, exposure, false colour, numbers on pixels, comparison.
//!
//! Read [`widget::show`] first: every picture of the studio goes through it, be it a photograph, a map, an environment
//! or a relit view. It takes a [`Source`], a [`PictureView`] kept by the caller and an [`Overlay`], and tells what is
//! under the pointer. [`paint`] makes the pixels from the values that `rows` reads, `cache` keeps them while nothing changes. [`histogram`],
//! [`scale_bar`] and [`thumbnails`] are the small ones beside it.
//!
//! It keeps nothing of the application: which picture, which exposure and which view are the caller's. It computes no
//! picture either; means, tone curves, colour scales and histograms are those of [`crate::image`].

mod cache;
pub mod histogram;
pub mod levels;
mod lines;
mod marks;
pub mod overlay;
pub mod paint;
mod rows;
pub mod scale_bar;
pub mod source;
pub mod thumbnails;
pub mod view;
pub mod widget;

pub use overlay::{Compare, Comparison, LineSpace, Lines, Mark, Overlay};
pub use source::{Place, Source, Value, describe};
pub use thumbnails::ThumbnailCache;
pub use view::PictureView;
pub use widget::show;
