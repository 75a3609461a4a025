//! The paths of a pixel are traced side by side, one surface hit of all of them after the other.
//!
//! What a hit asks for between its rays, angles, logarithms, random numbers, is a long chain of steps that wait for each
//! other. For one path that took longer than its rays; for sixteen at a time it takes little longer than for one, with
//! the vectors that the machine has (`math::vector`). Rays, triangles and texels are still looked up one by one.
//!
//! `kernel` holds the arithmetic, `light_cells` the part of it that reads the light's table; this file is what is done path
//! by path: find the point that was hit, cast the shadow ray and the next ray, and write the record ([`PathVertex`]).

mod kernel;
mod lanes;
mod light_cells;
#[cfg(test)]
mod tests;

pub use self::kernel::camera_pairs;
use self::kernel::{Arrivals, Directions, Proposals, propose};
use super::path::{Bounce, Connection, MAX_BOUNCES, PathArena, PathHead, PathTracer, PathVertex, balance_heuristic};
use super::surface::SurfacePoint;
use crate::material::{LobeGeometry, TextureTap};
use crate::math::luminance;
use crate::math::random::SampleStream;
use crate::math::sphere::angles_of_direction;
use crate::math::vector::WIDEST;
use crate::trace::{Hit, Ray};
use glam::Vec3;
use std::f32::consts::TAU;

/// Paths that are traced side by side, at most.
pub const PACKET: usize = WIDEST;

/// Directions whose density from the lobe's sampler is lower are not followed: their weight would be noise.
pub(super) const LEAST_DENSITY: f32 = 1e-9;

/// A path before it begins.
#[derive(Clone, Copy, Debug)]
pub struct PathStart {
    /// The camera ray.
    pub ray: Ray,
    /// Where it meets the surface first.
    pub first_hit: Option<Hit>,
    /// Random numbers of what follows.
    pub stream: SampleStream,
}

/// A path on its way to the next surface hit.
#[derive(Clone, Copy, Debug)]
struct Traveller {
    /// Which of the arena's paths it is.
    path: usize,
    ray: Ray,
    hit: Hit,
    stream: SampleStream,
}

/// Where a path has arrived, for the record.
#[derive(Clone, Copy, Debug)]
struct Place {
    path: usize,
    point: SurfacePoint,
    texture: TextureTap,
}

/// Memory for a packet on its way, used again and again.
#[derive(Clone, Debug, Default)]
pub(super) struct Packet {
    travellers: Vec<Traveller>,
    places: Vec<Place>,
    arrivals: Box<Arrivals>,
    proposals: Box<Proposals>,
    connections: [Option<Connection>; PACKET],
}

impl PathTracer<'_> {
    /// Traces paths and adds their records to the arena, in order.
    pub fn trace(&self, starts: impl Iterator<Item = PathStart>, arena: &mut PathArena) {
        let max_bounces = self.settings.max_bounces.min(MAX_BOUNCES);
        let mut starts = starts.peekable();
        while starts.peek().is_some() {
            arena.packet.travellers.clear();
            for start in starts.by_ref().take(PACKET) {
                self.begin(start, max_bounces, arena);
            }
            for bounce_index in 0..max_bounces {
                if arena.packet.travellers.is_empty() {
                    break;
                }
                self.arrive(bounce_index, &mut arena.packet);
                let Packet { arrivals, proposals, .. } = &mut arena.packet;
                propose(arrivals, self.light, self.environment_size, self.settings.lobe_strength, proposals);
                self.connect(&mut arena.packet);
                self.follow(arena);
            }
        }
    }

    /// Adds a path without vertices to the arena, and its traveller if it meets the surface.
    fn begin(&self, start: PathStart, max_bounces: usize, arena: &mut PathArena) {
        let PathStart { ray, first_hit, stream } = start;
        let escaped = first_hit.is_none();
        let background =
            (escaped && self.settings.background_visible).then(|| self.light_tap(angles_of_direction(ray.direction)));
        let first = arena.reserve(if escaped { 0 } else { max_bounces });
        if let Some(hit) = first_hit {
            arena.packet.travellers.push(Traveller { path: arena.paths.len(), ray, hit, stream });
        }
        arena.paths.push(PathHead { first, count: 0, background, escaped });
    }

    /// Finds the surface under the travellers. Those that meet it from behind end there.
    fn arrive(&self, bounce_index: usize, packet: &mut Packet) {
        let Packet { travellers, places, arrivals, .. } = packet;
        places.clear();
        for &Traveller { path, ray, hit, stream } in travellers.iter() {
            let to_viewer = -ray.direction;
            let point = if self.settings.two_sided {
                self.surface.point_facing(&hit, to_viewer)
            } else {
                self.surface.point(&hit)
            };
            let is_front = point.geometric_normal.dot(to_viewer) > 0.0 && point.shading_normal.dot(to_viewer) > 0.0;
            if !is_front {
                continue;
            }
            let texture = self.proposal.tap(point.uv, self.mip_level(bounce_index, &point, &ray, hit.t));
            let lane = places.len();
            places.push(Place { path, point, texture });
            arrivals.streams[lane] = stream;
            for axis in 0..3 {
                arrivals.normal[axis][lane] = point.shading_normal[axis];
                arrivals.geometric_normal[axis][lane] = point.geometric_normal[axis];
                arrivals.to_viewer[axis][lane] = to_viewer[axis];
            }
        }
        // Apart, so that the processor waits for the texels of several paths at once.
        for (lane, place) in places.iter().enumerate() {
            let material = self.proposal.fetch(&place.texture);
            arrivals.specular[lane] = luminance(Vec3::from_array(material.specular));
            arrivals.diffuse[lane] = luminance(Vec3::from_array(material.diffuse));
            arrivals.log_width[lane] = material.log_width;
        }
        arrivals.count = places.len();
        arrivals.model = self.proposal.model;
    }

    /// Keeps those directions towards the light that nothing is in the way of.
    fn connect(&self, packet: &mut Packet) {
        let Packet { places, proposals, connections, .. } = packet;
        for (lane, place) in places.iter().enumerate() {
            let directions = &proposals.of_light;
            connections[lane] = None;
            if !proposals.has_light
                || !(directions.above[lane] > 0.0)
                || self.surface.is_shadowed(&place.point, directions.direction(lane))
            {
                continue;
            }
            let density = proposals.light_density[lane];
            let weight = balance_heuristic(density, directions.lobe_density[lane]) / density;
            let geometry = directions.geometry(lane, proposals.cos_out[lane]);
            connections[lane] = Some(Connection { geometry, light: directions.taps.tap(lane), weight });
        }
    }

    /// Follows the directions drawn from the lobe, and writes the records. Who meets the surface travels on.
    fn follow(&self, arena: &mut PathArena) {
        let Packet { travellers, places, arrivals, proposals, connections } = &mut arena.packet;
        travellers.clear();
        let directions = &proposals.of_lobe;
        for (lane, &Place { path, point, texture }) in places.iter().enumerate() {
            let density = directions.lobe_density[lane];
            let mut bounce = None;
            if directions.above[lane] > 0.0 && density > LEAST_DENSITY {
                let direction = directions.direction(lane);
                let ray = self.surface.ray_from(&point, direction);
                let escape = match self.surface.closest(&ray) {
                    Some(hit) => {
                        travellers.push(Traveller { path, ray, hit, stream: arrivals.streams[lane] });
                        None
                    }
                    None => {
                        let phi = proposals.phi[lane];
                        let phi = if phi < 0.0 { phi + TAU } else { phi };
                        let other = self.light.pdf_at_angles(direction, (phi, proposals.theta[lane]));
                        Some((directions.taps.tap(lane), balance_heuristic(density, other)))
                    }
                };
                let geometry = directions.geometry(lane, proposals.cos_out[lane]);
                bounce = Some(Bounce { geometry, inverse_density: 1.0 / density, escape });
            }
            let head = &mut arena.paths[path];
            arena.vertices[(head.first + head.count) as usize] =
                PathVertex { texture, connection: connections[lane], bounce };
            head.count += 1;
        }
    }
}

impl Directions {
    /// The unit direction of one path.
    fn direction(&self, lane: usize) -> Vec3 {
        Vec3::new(self.direction[0][lane], self.direction[1][lane], self.direction[2][lane])
    }

    /// The geometry of one path's lobe.
    fn geometry(&self, lane: usize, cos_out: f32) -> LobeGeometry {
        LobeGeometry {
            cos_in: self.cos_in[lane],
            cos_out,
            ln_cos_half: self.ln_cos_half[lane],
            half_dot_out: self.half_dot_out[lane],
        }
    }
}
