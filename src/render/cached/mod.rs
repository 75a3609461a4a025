//! Cached transport: geometry and cameras never change, so rays are traced once and never again.
//!
//! Read in this order:
//! 1. [`light_basis`]: the light is a sum of hats; two integrals of each serve both lobes.
//! 2. [`points`] and [`visibility`]: points of the surface on a grid over the atlas, and which share of each hat they see.
//! 3. [`mod@irradiance`]: diffuse light, a masked sum. [`lobe_sum`] and [`half_vector`]: the specular integrals `S0 - S5`
//!    and `S5`, and their derivative by the width.
//! 4. [`bounce`]: light between surfaces as a sparse matrix with its transpose; [`surroundings`] and
//!    [`seen_light`]: the same as lobes see it.
//! 5. [`footprint`]: what a camera sees, as shading points with lists of texels.
//! 6. [`traced`] is what rays find out; [`transport`]: all of it together, `shade`: the radiance it gives. Sums run on several numbers at a time
//!    (`math::vector`).
//!
//! For fixed roughness the result is linear in the light; for fixed light and roughness it is linear in diffuse and
//! specular reflectance. Nothing is random after the cache is traced, and nothing depends on the number of threads.
//!
//! What is approximate, and judged against the path tracer by the tests of this folder and by `patina-lab bench cache`:
//! * visibility between points of the grid is interpolated for diffuse light and taken from the nearest for the lobe;
//! * a surface that lights another does so as if its lobe were diffuse, with the right amount of energy;
//! * the lobe sees other surface as coarsely as cells of the light ([`surroundings`]).
//!
//! What it refuses to do: mirrors that show other surface more sharply than that, and moving anything.

pub mod bounce;
pub mod footprint;
pub mod half_vector;
mod half_vector_kernel;
pub mod half_vector_places;
pub mod irradiance;
pub mod light_basis;
pub mod lobe_frozen;
mod lobe_kernel;
pub mod lobe_place;
pub mod lobe_sum;
pub mod points;
pub mod seen_light;
pub mod settings;
mod shade;
pub mod surroundings;
pub mod traced;
pub mod transport;
pub mod visibility;

#[cfg(test)]
mod tests;

pub use footprint::{FootprintSettings, ShadingPoint, ViewFootprints};
pub use light_basis::LightPlanes;
pub use points::VisibilityGrid;
pub use seen_light::{SeenLight, SeenRows};
pub use settings::CachedSettings;
pub use transport::{CachedTransport, PointLight};
