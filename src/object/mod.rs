//! Object mode: light and measured reflectance from one photo of an object of known shape.
//!
//! The second paper: Chen, Nobuhara and Nishino 2020, "Invertible Neural BRDF for Object Inverse Rendering". Read
//! [`joint`] first: it is the estimation, step by step. Below it, from the photo up:
//!
//! | file | what it holds |
//! |---|---|
//! | [`photo`], [`geometry`], [`observations`] | radiance with its bounds; normals, eyes, shadows; the pixels of a fit |
//! | [`outline`] | the circle that a mask lies on |
//! | [`directions`], [`nodes`], [`transport`], [`matrices`] | the image as a linear function of the light and of the reflectance |
//! | [`likelihood`] | Laplace on log radiance |
//! | [`prior`] | what is known of light: the deep prior and its rivals |
//! | [`light_step`], [`reflectance_step`], `run` | one unknown while the other is held; each light, and the reflectance that they share |
//! | [`starts`], [`screen`], [`evidence`] | where to begin, tried at low resolution and ranked |
//! | [`split`], [`seen`], [`bands`] | what the photo leaves open; which directions and which details of the light it sees |
//! | [`picture`] | re-renders and relit pictures |
//! | [`settings`], [`progress`] | what is asked, what is told |
//! | [`inputs`], [`read`](mod@read), [`result_folder`], [`result_read`], [`page`] | files that are read, what is left on disk, that read again |
//!
//! Any [`ReflectanceModel`](crate::measured::model::ReflectanceModel) can be estimated: it is asked for its values at
//! nodes and nothing else. What this folder refuses to do: light that bounces between parts of the object, spatially
//! varying reflectance (that is `fit`), and anything that needs a window or a thread of its own.

pub mod angles;
pub mod bands;
pub mod directions;
pub mod evidence;
pub mod geometry;
pub mod inputs;
pub mod joint;
mod light_holder;
pub mod light_step;
pub mod likelihood;
pub mod matrices;
pub mod nodes;
pub mod observations;
pub mod outline;
pub mod page;
pub mod photo;
pub mod picture;
mod posterior;
pub mod prior;
pub mod problem;
pub mod progress;
pub mod read;
pub mod reflectance_step;
pub mod result_folder;
pub mod result_read;
mod run;
pub mod screen;
pub mod seen;
pub mod settings;
pub mod split;
pub mod starts;
pub mod transport;

pub use geometry::ObjectGeometry;
pub use joint::{Estimate, Known, estimate};
pub use observations::ObjectView;
pub use photo::ObjectPhoto;
pub use settings::ObjectSettings;
pub use starts::StartedModel;
