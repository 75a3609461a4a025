//! What the light sends to one observation, as rows over the coefficients that the light is sought in.

use super::light_shape::LightShape;
use super::observations::Observation;
use super::round::Round;
use crate::math::sum_of_products;
use crate::render::cached::SeenLight;
use crate::render::cached::irradiance::add_irradiance_row;
use crate::render::cached::lobe_place::LobeSums;
use crate::render::cached::lobe_sum::{add_lobe_row, lobe_with_derivative};

/// Rows of one observation after the other, in memory that is used again.
pub(super) struct LightReach {
    /// Rows over the coefficients: times diffuse reflectance, times F0, and what the lobe sends whatever F0.
    pub rows: [Vec<f32>; 3],
    /// The lobe under the light as it is.
    pub sums: LobeSums,
    /// What of the lobe's two sums comes of other surface, not of the light itself.
    pub of_surface: [[f32; 3]; 2],
    /// Light that arrives from the light itself.
    pub direct: [f32; 3],
    full: Vec<f32>,
    seen: SeenLight,
}

impl LightReach {
    /// Of no observation yet.
    pub fn new(round: &Round, shape: &LightShape) -> Self {
        LightReach {
            rows: [(); 3].map(|()| vec![0.0; shape.count()]),
            sums: LobeSums::default(),
            of_surface: [[0.0; 3]; 2],
            direct: [0.0; 3],
            full: vec![0.0; round.transport.basis.padded()],
            seen: SeenLight::default(),
        }
    }

    /// Looks at an observation, for a lobe of this width. Those of one point of the grid in a row are quicker.
    pub fn look(&mut self, round: &Round, observation: &Observation, width: f32, shape: &LightShape) {
        let (transport, basis) = (round.transport, &round.transport.basis);
        let point = round.point(observation);
        for row in &mut self.rows {
            row.fill(0.0);
        }
        self.full.fill(0.0);
        for &(at, weight) in round.footprints[observation.view as usize].lit_of(point) {
            let normal = transport.grid.points[at as usize].shading_normal;
            add_irradiance_row(basis, normal, transport.visibility.of(at as usize), weight, &mut self.full);
        }
        shape.reduce(&self.full, &mut self.rows[0]);
        let place = transport.lobe_place(point, round.light, round.at_points, &mut self.seen);
        self.sums = lobe_with_derivative(basis, &place, width);
        // What the lobe sends of other surface: what is left of it without the light.
        for (which, scales) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
            self.full.fill(0.0);
            add_lobe_row(basis, &place, width, scales, &mut self.full);
            shape.reduce(&self.full, &mut self.rows[1 + which]);
            let all = [&self.sums.base, &self.sums.grazing][which];
            self.of_surface[which] =
                [0, 1, 2].map(|c| all[c] - sum_of_products::<16>(&self.full, &round.light.channels[c]));
        }
        self.direct = round.interpolate(&round.at_points.direct, observation);
    }
}
