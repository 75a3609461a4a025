//! The window. It holds no algorithm: what it shows is made by the library, what it does goes through [`crate::job`].
//!
//! There are two workspaces: scenes, and object mode ([`workspace::Workspace`], with the panels of each).
//!
//! Read [`app`] first: one frame is news taken in, panels drawn, acts done. [`model`] is what the window knows, without a
//! widget; [`act`] lists everything a person can do, once, for menus, palette, keys and help; [`perform`] does it.
//! [`panel`] draws, one file a panel; [`layout`] arranges them; [`theme`] names every colour. [`stage`] draws the mesh in
//! 3-D and [`picture`] shows linear pictures: both know nothing of the rest. [`launch`] opens the window, or says in one
//! sentence why there is none. [`pace`] decides how often a running fit is looked at; `repaint` draws what changed alone
//! where there is no graphics card.
//!
//! Nothing here blocks: reading, preparing, fitting, tracing and saving are threads that are polled once a frame, and a
//! panic in any of them is a message.

pub mod act;
pub mod app;
mod copy;
pub mod launch;
pub mod layout;
pub mod model;
pub mod pace;
pub mod panel;
pub mod perform;
pub mod picture;
mod repaint;
pub mod stage;
pub mod theme;
pub mod workspace;

pub use app::StudioOptions;
pub use launch::run;
