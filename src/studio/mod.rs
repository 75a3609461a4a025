//! The window. It holds no algorithm: what it shows is made by the library, what it does goes through [`crate::job`].
//!
//! [`stage`] draws the mesh in 3-D, [`picture`] shows linear pictures.

pub mod picture;
pub mod stage;
