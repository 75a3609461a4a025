//! Light between surfaces, once more with the reflectances that were found.
//!
//! Maps are made under the light that surfaces sent each other when they began. Where that is most of the light, as in a
//! deep bowl of plaster, maps that differ from those by little are lit differently by much, ten times as much as
//! where things stand on a floor. So diffuse reflectances follow what arrives, and that follows them, until both stay.

use super::diffuse_system::DiffuseRow;
use super::estimate::Estimate;
use super::report::ErrorSums;
use super::scene::SolverScene;
use crate::render::cached::PointLight;
use std::sync::atomic::AtomicBool;

/// Arriving light that changes by less than this, relative root mean square over the points of the grid, has settled.
const SETTLED: f64 = 0.01;
/// Most sweeps.
const MOST_SWEEPS: usize = 4;

impl SolverScene {
    /// Goes on from maps that were made under `at_points`, until what arrives hardly changes; `rows` are what they were solved from.
    /// The outer `None` says that `stop` was raised, the inner one that nothing had to change, else there are the errors
    /// that are left.
    pub(super) fn settle(
        &self,
        estimate: &mut Estimate,
        at_points: PointLight,
        rows: &mut [DiffuseRow],
        stop: &AtomicBool,
    ) -> Option<Option<ErrorSums>> {
        let PointLight { mut arriving, direct, .. } = at_points;
        let (mut errors, mut rho) = (None, estimate.diffuse());
        for _ in 0..MOST_SWEEPS {
            let reflectance = self.transport.reflectance_of_points(&estimate.texels, self.settings.map_size);
            let now = self.transport.with_bounces(direct.clone(), &reflectance).arriving;
            if relative_change(&arriving, &now) < SETTLED {
                break;
            }
            // Halfway: with reflectances near 1 the whole way swings beyond what it looks for.
            for (arriving, now) in arriving.iter_mut().flatten().zip(now.iter().flatten()) {
                *arriving = 0.5 * (*arriving + now);
            }
            for (index, row) in rows.iter_mut().enumerate().filter(|(_, row)| row.weight > 0.0) {
                row.arriving = self.interpolate(&arriving, index);
            }
            errors = Some(self.solve_diffuse(rows, &mut rho, stop)?);
            estimate.set_diffuse(&rho);
            self.fill_from_neighbours(estimate);
        }
        Some(errors)
    }
}

/// Root mean square of the change over that of what is there now; 0 where there is no light.
fn relative_change(before: &[[f32; 3]], now: &[[f32; 3]]) -> f64 {
    let (mut change, mut power) = (0.0f64, 0.0f64);
    for (before, now) in before.iter().flatten().zip(now.iter().flatten()) {
        change += f64::from(now - before).powi(2);
        power += f64::from(*now).powi(2);
    }
    if power > 0.0 { (change / power).sqrt() } else { 0.0 }
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::super::SolverSettings;
    use super::super::diffuse_system::DiffuseSystem;
    use super::super::estimate::TexelVariance;
    use super::super::solver::Solver;
    use super::*;
    use crate::core_tests::hard_scenes::bowl_of_plaster;
    use crate::light::Environment;
    use crate::material::Material;
    use crate::material::texels::texels_from_maps;
    use crate::render::Surface;
    use glam::Vec3;

    #[test]
    fn a_bowl_of_plaster_is_lit_by_what_was_found_of_it() {
        const SIZE: usize = 64;
        let scene = bowl_of_plaster(SIZE);
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let truth = scene.truth.as_ref().unwrap();
        let solver_settings = SolverSettings {
            map_size: SIZE,
            grid: SIZE,
            max_bounces: truth.max_bounces,
            light_size: (32, 16),
            ..SolverSettings::default()
        };
        let light = Environment::constant(32, 16, Vec3::ONE);
        let Solver { scene, mut estimate } = Solver::new(&scene, &surface, solver_settings, Some(&light)).unwrap();
        let planes = scene.transport.basis.planes(&estimate.light);
        let never = AtomicBool::new(false);
        estimate.texels = texels_from_maps(&truth.maps);
        estimate.variances.fill(TexelVariance { variance: Material::from_array([1.0; 7]), lobe_cluster_size: 1.0 });
        let real = scene.point_light(&estimate, &planes).arriving;

        // What pixels show of the truth, taken for lit by a bowl that is less white.
        let row = |arriving: &[[f32; 3]], index| DiffuseRow {
            arriving: scene.interpolate(arriving, index),
            radiance: [0.0; 3],
            weight: 1.0,
        };
        let count = scene.observations.list.len();
        let rows: Vec<DiffuseRow> = (0..count).map(|index| row(&real, index)).collect();
        let mut rho = estimate.diffuse();
        let shown = DiffuseSystem::new(&scene.footprints, &scene.observations, &rows, SIZE).models(&rho);
        let mut darker = estimate.clone();
        darker.texels.iter_mut().for_each(|texel| texel.diffuse = texel.diffuse.map(|value| value * 0.8));
        let at_points = scene.point_light(&darker, &planes);
        let mut rows: Vec<DiffuseRow> = (0..count).map(|index| row(&at_points.arriving, index)).collect();
        rows.iter_mut().zip(&shown).for_each(|(row, shown)| row.radiance = *shown);
        scene.solve_diffuse(&rows, &mut rho, &never).unwrap();
        estimate.set_diffuse(&rho);
        let before = relative_change(&scene.point_light(&estimate, &planes).arriving, &real);
        let errors = scene.settle(&mut estimate, at_points, &mut rows, &never).unwrap();
        let after = relative_change(&scene.point_light(&estimate, &planes).arriving, &real);
        println!("light between surfaces off by {before:.4}, then by {after:.4}");
        assert!(errors.is_some() && before > 0.03 && after < 0.3 * before, "{before} {after}");

        // What has settled is left alone.
        let (settled, now) = (estimate.clone(), scene.point_light(&estimate, &planes));
        assert!(scene.settle(&mut estimate, now, &mut rows, &never).unwrap().is_none());
        assert_eq!(estimate, settled);
    }
}
