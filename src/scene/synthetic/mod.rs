//! What scenes made in code are made of; [`demo`](super::demo) puts it together.
//!
//! Read [`shapes`] first: closed surfaces cut into charts. [`layout`] lays the charts side by side in one texture,
//! [`bake`] evaluates a [`finish`], made of [`procedural`] patterns, over it. [`orbit`] places the cameras,
//! [`seen`] tells which texels they see. The light is [`crate::light::sky`].
//!
//! Nothing here renders, and the layout is no unwrapper: it packs rectangles that are charts already.

pub mod bake;
pub mod finish;
pub mod layout;
pub mod orbit;
pub mod procedural;
pub mod seen;
pub mod shapes;
