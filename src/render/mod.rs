//! Where light is added up: the path tracer and its reverse pass.
//!
//! Read in this order:
//! 1. [`surface`]: from a ray to a point on the mesh.
//! 2. [`path`]: a path is traced once, with a frozen sampling proposal, into a short record: which texels it reads,
//!    which light texels it sees, with which weights. No radiance is computed there. [`packet`] traces the paths of a
//!    pixel side by side.
//! 3. [`sums`]: radiance is a smooth function of the maps and the light over that record; its derivative stands beside
//!    it. Both run in any [`Real`](crate::math::real::Real): `f32` to fit, `f64` to audit, dual numbers for
//!    Hessian-vector products.
//! 4. [`accumulate`]: pixels in parallel, gradients reduced in a fixed order.
//! 5. [`cached`]: the same light without rays, for scenes whose geometry is known and stays. [`relight`]: a view of it
//!    under any light, at once.
//! 6. [`picture`]: pictures and layers. [`first_hits`]: primary rays traced once.
//!    [`progressive`]: a picture that refines, by [`passes`]. [`ground`]: the shadow on a ground that is not there.
//!    [`regions`] and [`measured_regions`]: pictures in which parts of the surface have measured reflectance in place of
//!    the maps'; nothing is fitted there, so no record is kept.
//!
//! The record replaces a second tracing pass: it lives for one pixel, so memory grows neither with the picture nor
//! with the number of steps, and the reverse pass casts no ray. Silhouettes do not move (geometry and cameras are
//! given), so no boundary term is needed.
//! What is not here: losses and optimisers (those are in `fit`), transmission, volumes, light sources in the scene.

pub mod accumulate;
pub mod cached;
pub mod first_hits;
pub mod ground;
pub mod measured_regions;
pub mod packet;
pub mod passes;
pub mod path;
pub mod picture;
pub mod picture_settings;
pub mod progressive;
pub mod regions;
pub mod relight;
pub mod sums;
pub mod surface;
mod taps;

pub use path::{PathArena, PathSettings, PathTracer};
pub use sums::{ParameterGradient, Parameters};
pub use surface::Surface;
