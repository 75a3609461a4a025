//! A weak wish for a smooth light.
//!
//! Many texels of the light are seen by no pixel and lit by no shadow edge: their gradient is noise, and steps of a
//! normalised size would wander for ever. The prior is a relative difference to the mean of the four neighbours,
//! `lambda sum_i w_i rho_i^2`, `rho = (L - m) / (L + m + mean)`, with solid-angle weights that sum to one. It is bounded:
//! a sun a thousand times its neighbours costs no more than a texel twice as bright, so it does not dim suns.

use crate::math::sphere::solid_angle_of_texel;

/// Adds the derivative of the prior to that of the loss and returns the prior's value. Neighbours and denominators are
/// taken as fixed within a step.
pub fn add_gradient(
    light: &[[f32; 3]],
    (width, height): (usize, usize),
    mean: f32,
    weight: f32,
    d_light: &mut [[f32; 3]],
) -> f64 {
    if weight <= 0.0 {
        return 0.0;
    }
    let mut value = 0.0;
    for index in 0..width * height {
        let (row, column) = (index / width, index % width);
        let share = (solid_angle_of_texel(row, width, height) / (4.0 * std::f64::consts::PI)) as f32;
        let neighbours = [
            row.saturating_sub(1) * width + column,
            (row + 1).min(height - 1) * width + column,
            row * width + (column + 1) % width,
            row * width + (column + width - 1) % width,
        ];
        for channel in 0..3 {
            let around = 0.25 * neighbours.iter().map(|&other| light[other][channel]).sum::<f32>();
            let own = light[index][channel];
            let scale = (own + around + mean).max(1e-12);
            let difference = (own - around) / scale;
            value += f64::from(weight * share * difference * difference) / 3.0;
            d_light[index][channel] += 2.0 / 3.0 * weight * share * difference / scale;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_light_costs_nothing_and_a_lone_texel_is_pulled_to_its_neighbours() {
        let mut light = vec![[1.0f32; 3]; 32];
        let mut d_light = vec![[0.0f32; 3]; 32];
        assert_eq!(add_gradient(&light, (8, 4), 1.0, 0.1, &mut d_light), 0.0);
        assert!(d_light.iter().flatten().all(|&d| d == 0.0));
        light[12] = [5.0, 0.0, 1.0];
        assert!(add_gradient(&light, (8, 4), 1.0, 0.1, &mut d_light) > 0.0);
        assert!(d_light[12][0] > 0.0 && d_light[12][1] < 0.0 && d_light[12][2] == 0.0);
        // Bounded: a sun costs less than its whole share.
        light[12] = [1e6; 3];
        let share = (solid_angle_of_texel(1, 8, 4) / (4.0 * std::f64::consts::PI)) as f32;
        d_light.fill([0.0; 3]);
        add_gradient(&light, (8, 4), 1.0, 0.1, &mut d_light);
        assert!(d_light[12][0] * 1e6 < share, "the pull relative to the sun itself is small");
    }
}
