//! Rays and the bounding volume hierarchy.
//!
//! Read [`Bvh`] first: it is built once from positions and triangles and then answers two questions, which triangle a
//! ray meets first ([`Bvh::closest_hit`]) and whether it meets any ([`Bvh::is_occluded`]).
//!
//! | file | what it holds |
//! |---|---|
//! | `prepare` | which triangles take part: checks, zero areas, copies |
//! | `binary` | the binary tree, built by obvhs; a balanced one where that would grow too deep |
//! | `wide` | the tree that rays walk through: nodes of eight children and blocks of triangles |
//! | `collapse` | from the binary tree to the wide one |
//! | `query` | what one ray needs over and over: inverse direction, padding, shear |
//! | `plain` | the walk through the tree in portable Rust |
//! | `frame`, `vector` | query and walk with AVX2, chosen at run time |
//!
//! Both walks test triangles by the same sums in the same order: their hits are the same bits. Two triangles that share an edge
//! leave no gap for a ray to pass. Where several triangles are hit at the same `t`, the one of lowest index is given.
//!
//! This folder knows positions and triangles, nothing of materials or scenes; it culls no backfaces, moves no
//! triangles after the build and holds no instances.

mod binary;
mod collapse;
#[cfg(target_arch = "x86_64")]
mod frame;
mod plain;
mod prepare;
mod query;
#[cfg(target_arch = "x86_64")]
mod vector;
mod wide;

use crate::error::Result;
use glam::Vec3;
use query::Query;

/// A ray: points `origin + t direction` for `t` in `(0, t_max)`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Start, in world units.
    pub origin: Vec3,
    /// Direction, any length above zero; `t` is counted in its length.
    pub direction: Vec3,
    /// Where the ray ends; infinite for a ray into the open.
    pub t_max: f32,
}

/// Where a ray meets the nearest triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// Index of the triangle in the mesh the hierarchy was built from.
    pub triangle: u32,
    /// Barycentric weight of the triangle's second corner.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner; the first has `1 - u - v`.
    pub v: f32,
}

/// A bounding volume hierarchy over triangles: eight children a node, blocks of triangles in its leaves.
///
/// It keeps its own copy of the positions. Triangles without area and exact copies of an earlier triangle (same three
/// positions in any order) are left out; hits name triangles by their index in the list the hierarchy was built from.
#[derive(Clone, Debug)]
pub struct Bvh {
    tree: wide::WideTree,
    /// Lower and upper corner of the box around all triangles that take part.
    bounds: (Vec3, Vec3),
    /// Largest absolute coordinate; rounding errors of points on the surface are a multiple of it.
    largest_coordinate: f32,
    /// How many triangles take part.
    triangle_count: usize,
    /// Which walk answers.
    walk: Walk,
}

/// Which instructions walk through the tree. The hits are the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Walk {
    /// Portable Rust.
    Plain,
    /// AVX2, on the processors of x86-64 that have it.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Walk {
    /// The walks this machine can do, the fastest last.
    pub fn available() -> Vec<Walk> {
        #[cfg(target_arch = "x86_64")]
        if vector::is_available() {
            return vec![Walk::Plain, Walk::Avx2];
        }
        vec![Walk::Plain]
    }
}

impl Bvh {
    /// Builds the hierarchy.
    ///
    /// # Errors
    /// `InvalidScene` when a triangle names a vertex that is not there, or when no triangle has an area; `NonFinite`
    /// when a triangle's vertex is not finite. The place is the first such triangle.
    pub fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Bvh> {
        let prepared = prepare::prepare(positions, triangles)?;
        let tree = collapse::build(&prepared);
        let bounds = prepared.bounds();
        let largest_coordinate = bounds.0.abs().max(bounds.1.abs()).max_element();
        Ok(Bvh {
            tree,
            bounds,
            largest_coordinate,
            triangle_count: prepared.triangles.len(),
            walk: Walk::available().last().copied().unwrap_or(Walk::Plain),
        })
    }

    /// The nearest hit with `t` in `(0, t_max)`, from either side of a triangle.
    ///
    /// `None` for a ray that meets nothing and for one that is none: a number that is not finite in origin or
    /// direction, a direction of zero, or a `t_max` that is not above zero.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        match self.walk {
            Walk::Plain => plain::closest_hit(&self.tree, &Query::new(ray, self.largest_coordinate)?),
            // SAFETY: only walks of `Walk::available` are ever set.
            #[cfg(target_arch = "x86_64")]
            Walk::Avx2 => unsafe { vector::closest_hit(&self.tree, ray, self.largest_coordinate) },
        }
    }

    /// Whether anything lies on the ray: true exactly when [`Bvh::closest_hit`] finds a hit.
    pub fn is_occluded(&self, ray: &Ray) -> bool {
        match self.walk {
            Walk::Plain => {
                Query::new(ray, self.largest_coordinate).is_some_and(|query| plain::is_occluded(&self.tree, &query))
            }
            // SAFETY: only walks of `Walk::available` are ever set.
            #[cfg(target_arch = "x86_64")]
            Walk::Avx2 => unsafe { vector::is_occluded(&self.tree, ray, self.largest_coordinate) },
        }
    }

    /// Whether something stands between a point on the surface and an eye. `geometric_normal` is that of the triangle
    /// the point lies on, see [`Bvh::offset_origin`]; what lies behind the eye hides nothing.
    pub fn is_hidden_from(&self, point: Vec3, geometric_normal: Vec3, eye: Vec3) -> bool {
        let origin = self.offset_origin(point, geometric_normal, eye - point);
        self.is_occluded(&Ray { origin, direction: eye - origin, t_max: 1.0 })
    }

    /// Moves a point that was computed on the surface off it, to the side that `direction` leaves to, by just more
    /// than the rounding errors of the point and of the ray test.
    ///
    /// `point` lies on a triangle of geometric normal `geometric_normal` (any sign; unit length, otherwise the step
    /// scales with it); `direction` is the ray that starts there. The step is `2^-19` (2 millionths) of the largest
    /// coordinate of the scene: points are interpolated from corners, so their error is relative to the corners and
    /// not to the point, which may lie close to the origin of the world. This is why the step of Waechter and Binder
    /// 2019 (Ray Tracing Gems, chapter 6), relative to each coordinate of the point, is not used as it stands: its
    /// constant floor of `2^-16` world units near the origin fits scenes of about a metre only.
    pub fn offset_origin(&self, point: Vec3, geometric_normal: Vec3, direction: Vec3) -> Vec3 {
        let step = self.largest_coordinate.max(point.abs().max_element()) * (1.0 / 524_288.0);
        point + geometric_normal * step.copysign(direction.dot(geometric_normal))
    }

    /// Has rays answered by another walk, for tests and comparisons; one this machine cannot do is not taken up.
    pub fn set_walk(&mut self, walk: Walk) {
        if Walk::available().contains(&walk) {
            self.walk = walk;
        }
    }

    /// Lower and upper corner of the box around all triangles that take part, in world units.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds
    }

    /// How many triangles take part: those with an area, copies counted once.
    pub fn triangle_count(&self) -> usize {
        self.triangle_count
    }

    /// Size of the hierarchy in memory, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.tree.memory_bytes()
    }
}
