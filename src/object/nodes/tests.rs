use super::super::angles::angles;
use super::*;
use crate::math::random::SequentialRandom;
use glam::DVec3;

fn direction(random: &mut SequentialRandom) -> DVec3 {
    let z = f64::from(random.next_number());
    let phi = std::f64::consts::TAU * f64::from(random.next_number());
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * phi.cos(), r * phi.sin(), z)
}

#[test]
fn angles_without_a_frame_are_those_of_the_frame() {
    let mut random = SequentialRandom::new(3);
    for _ in 0..20_000 {
        let (light, eye) = (direction(&mut random), direction(&mut random));
        let exact = HalfDifference::from_directions(light, eye);
        let (half, difference, azimuth) = angles(Vec3::Z, light.as_vec3(), eye.as_vec3());
        assert!((f64::from(half) - exact.theta_half).abs() < 3e-6);
        assert!((f64::from(difference) - exact.theta_difference).abs() < 3e-6);
        let apart = (f64::from(azimuth) - exact.phi_difference).abs();
        let around = apart.min(std::f64::consts::PI - apart) * exact.theta_half.sin() * exact.theta_difference.sin();
        assert!(around < 1e-5, "{azimuth} {exact:?}");
    }
}

#[test]
fn places_invert_the_axes_and_weights_sum_to_one() {
    let grid = NodeGrid::new([9, 7, 6]);
    for place in 0..=20 {
        let place = place as f32 / 20.0;
        assert!((half_coordinate(half_angle(place)) - place).abs() < 1e-5);
        assert!((difference_coordinate(difference_angle(place)) - place).abs() < 2e-4, "{place}");
    }
    for (node, point) in grid.points().iter().enumerate() {
        let (light, eye) = point.directions();
        assert!(light.z > 0.0 && eye.z > 0.0 || point.theta_half > 1.57, "{point:?}");
        // A node that was not lowered is found at itself.
        let place =
            grid.place(point.theta_half as f32, point.theta_difference as f32, point.phi_difference as f32 + 1e-6);
        let (corners, weights) = (grid.corners(place.cell), weights(place.fraction));
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        let own: f32 = (0..8).filter(|&k| corners[k] == node).map(|k| weights[k]).sum();
        let index = node / 6 % 7;
        let raised = f64::from(difference_angle(index as f32 / 6.0)) > point.theta_difference + 1e-6;
        assert!(raised || own > 0.99, "{point:?}: {own}");
    }
}

#[test]
fn the_azimuth_is_periodic() {
    let grid = NodeGrid::new([5, 5, 8]);
    let place = grid.place(0.3, 0.6, PI - 1e-4);
    let corners = grid.corners(place.cell);
    assert_eq!(corners[1] % 8, 0);
    assert!(grid.corners((grid.len() - 1) as u16 - 40 - 8).iter().all(|&corner| corner < grid.len()));
}
