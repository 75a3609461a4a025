//! Analytic models against real materials, the hard ones among them.

#![allow(clippy::unwrap_used)]

use super::beside::data;
use glam::DVec3;
use patina::measured::analytic::OwnLobe;
use patina::measured::baseline::Baseline;
use patina::measured::fit_model::ModelFitSettings;
use patina::measured::fits::neural::WEIGHTS_FILE;
use patina::measured::metrics::{model_error, table_error};
use patina::measured::sphere::{displayed_scores, render_table, showing_lamps};
use patina::measured::{HalfDifference, MeasuredBrdf, NeuralFits};
use std::f64::consts::{FRAC_PI_2, PI};

fn library() -> Option<NeuralFits> {
    data(&format!("brdf/{WEIGHTS_FILE}"))?;
    data("brdf").map(|folder| NeuralFits::read(&folder).unwrap())
}

/// A cloth that is black from above and bright at grazing angles, both forward and back towards the lamp.
fn velvet(at: HalfDifference) -> [f64; 3] {
    let (light, eye) = at.directions();
    let rim = (1.0 - light.z).powi(4) + (1.0 - eye.z).powi(4);
    let back = 0.3 * (-(at.theta_difference / 0.3).powi(2)).exp();
    [1e-4 + 0.4 * rim + back, 1e-4 + 0.3 * rim + back, 1e-4 + 0.5 * rim]
}

#[test]
#[ignore = "slow: every model fitted to the hardest materials"]
fn all_rivals_survive_chrome_black_cloth_and_velvet() {
    let mut tables = vec![("velvet", MeasuredBrdf::from_fn(velvet))];
    if let Some(library) = library() {
        for name in ["chrome-steel", "black-fabric"] {
            tables.push((name, library.find(name).unwrap().table()));
        }
    }
    for (name, table) in &tables {
        // Few steps: what is asked here is whether they are sound.
        let settings = ModelFitSettings { followed: 1, steps: 2, scouting_steps: 2, ..Default::default() };
        let mut errors = Vec::new();
        for rival in [
            Baseline::Bivariate,
            Baseline::Ggx,
            Baseline::CookTorrance,
            Baseline::Ward,
            Baseline::OwnLobe,
            Baseline::Dsbrdf,
        ] {
            let fit = rival.fit(table, &settings).unwrap();
            println!("{name}, {}: {:.4}", rival.name(), fit.error.log_rmse);
            assert!(fit.error.log_rmse.is_finite() && fit.parameters.iter().all(|p| p.is_finite()));
            // The figure of the model is that of its table.
            let again = table_error(&fit.table(), table).unwrap().log_rmse;
            assert!((again - fit.error.log_rmse).abs() < 1e-9 * (1.0 + again), "{name} {}", rival.name());
            // The ends of every range.
            for theta_half in [0.0, FRAC_PI_2] {
                for theta_difference in [0.0, FRAC_PI_2] {
                    for phi_difference in [0.0, PI] {
                        let at = [HalfDifference { theta_half, theta_difference, phi_difference }];
                        let mut value = [[0.0; 3]];
                        fit.model.evaluate(&fit.parameters, &at, &mut value);
                        assert!(value[0].iter().all(|v| v.is_finite()), "{name} {} {at:?}", rival.name());
                    }
                }
            }
            errors.push(fit.error.log_rmse);
        }
        assert!(errors[1..].iter().all(|error| errors[0] < *error), "{name}: {errors:?}");
    }
}

#[test]
fn real_tables_are_reciprocal_and_finite_at_the_ends_of_the_angles() {
    let Some(library) = library() else { return };
    for name in ["chrome-steel", "black-fabric", "white-fabric"] {
        let table = library.find(name).unwrap().table();
        let start = table.lookup(HalfDifference { theta_half: 0.4, theta_difference: 0.5, phi_difference: 0.0 });
        let end = table.lookup(HalfDifference { theta_half: 0.4, theta_difference: 0.5, phi_difference: PI });
        assert_eq!(start, end, "{name}: phi 0 and pi are the same place");
        let mirror = table.evaluate(DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.6, 0.0, 0.8));
        assert!(mirror.iter().all(|v| v.is_finite() && *v > 0.0));
        let (light, eye) = (DVec3::new(0.3, 0.5, 0.6), DVec3::new(-0.7, 0.2, 0.1));
        let (forth, back) = (table.evaluate(light, eye), table.evaluate(eye, light));
        assert!((0..3).all(|c| (forth[c] - back[c]).abs() <= 1e-9 * forth[c]), "{name}");
    }
}

#[test]
fn a_plastic_is_projected_onto_the_maps_of_a_scene() {
    let Some(library) = library() else { return };
    let table = library.find("yellow-plastic").unwrap().table();
    let fit = Baseline::OwnLobe.fit(&table, &ModelFitSettings::default()).unwrap();
    let maps = OwnLobe::map_values(&fit.parameters);
    println!("{maps:?}, log-RMSE {:.4}", fit.error.log_rmse);
    // Yellow stays yellow, and the lobe is narrow.
    assert!(maps.diffuse[0] > 2.0 * maps.diffuse[2] && maps.roughness < 0.3, "{maps:?}");
    let lamps = showing_lamps();
    let truth = render_table(48, &table, &lamps);
    let psnr = displayed_scores(&render_table(48, &fit.table(), &lamps), &truth).unwrap().psnr;
    println!("sphere {psnr:.1} dB");
    assert!(psnr > 20.0, "{psnr}");
    let start = OwnLobe::parameters_of(&maps);
    assert!((model_error(&OwnLobe, &start, &table).unwrap().log_rmse - fit.error.log_rmse).abs() < 1e-3);
}
