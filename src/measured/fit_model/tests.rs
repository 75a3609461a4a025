use super::*;
use crate::measured::analytic::{AnalyticModel, Dsbrdf, LambertLobes, LobeKind, OwnLobe};
use crate::measured::table::INVALID;

#[test]
fn each_model_finds_itself() {
    let models: [(&dyn AnalyticModel, Vec<f64>); 4] = [
        (&LambertLobes::new(LobeKind::Ggx, 1), vec![-1.0, -2.0, -1.5, -1.0, -1.2, -1.4, -2.5, -2.0]),
        (&LambertLobes::new(LobeKind::CookTorrance, 1), vec![-3.0, -2.0, -1.5, 0.0, -0.2, -0.4, -1.5, -1.0]),
        (&LambertLobes::new(LobeKind::Ward, 1), vec![-1.0, -2.0, -1.5, -3.0, -3.2, -3.4, -2.0]),
        (&OwnLobe, vec![-1.0, -2.0, -1.5, -3.0, -3.2, -2.8, 0.3]),
    ];
    for (model, truth) in models {
        let table = MeasuredBrdf::from_model(model, &truth);
        let fit = fit_model(model, &model.starts(&table), &table, &ModelFitSettings::default()).unwrap();
        assert!(fit.error.log_rmse < 1e-3, "{}: {:?}", model.name(), fit);
    }
}

#[test]
fn the_objective_is_the_figure_in_expectation_and_exact_over_all_cells() {
    let table = MeasuredBrdf::from_fn(|at| [(0.2 + at.theta_half) * (1.2 + at.phi_difference.cos()), 0.1, 0.3]);
    let model = LambertLobes::new(LobeKind::Ggx, 1);
    let full = model_error(&model, &model.start(), &table).unwrap().log_rmse.powi(2);
    let all = CellSample::draw(&table, PHI_DIFFERENCE_COUNT, 1).objective(&model, &model.start());
    assert!((all / full - 1.0).abs() < 1e-9, "{all} {full}");
    let mean = (0..20).map(|seed| CellSample::draw(&table, 1, seed).objective(&model, &model.start())).sum::<f64>();
    assert!((mean / 20.0 / full - 1.0).abs() < 3e-3, "{mean} {full}");
}

#[test]
fn few_cells_and_flat_tables_are_fitted_without_harm() {
    let mut raw = vec![INVALID; 3 * grid::CELL_COUNT];
    for cell in [0, 1, 20_000] {
        (0..3).for_each(|channel| raw[channel * grid::CELL_COUNT + cell] = 100.0);
    }
    let few = MeasuredBrdf::from_raw(raw).unwrap();
    let black = MeasuredBrdf::from_fn(|_| [1e-9, 0.0, 0.0]);
    let bright = MeasuredBrdf::from_fn(|at| [1e6 * (-at.theta_half * 1e3).exp() + 1e-7; 3]);
    // Few steps: what is asked is whether they are sound.
    let settings = ModelFitSettings { followed: 1, steps: 3, scouting_steps: 2, ..Default::default() };
    for table in [few, black, bright] {
        let models: [&dyn AnalyticModel; 3] = [&LambertLobes::new(LobeKind::Ggx, 1), &Dsbrdf::new(3), &OwnLobe];
        for model in models {
            let fit = fit_model(model, &model.starts(&table), &table, &settings).unwrap();
            assert!(fit.error.log_rmse.is_finite(), "{}", model.name());
        }
    }
}

#[test]
fn wrong_starts_are_refused() {
    let table = MeasuredBrdf::from_fn(|_| [0.1; 3]);
    let settings = ModelFitSettings::default();
    assert!(fit_model(&OwnLobe, &[vec![0.0; 3]], &table, &settings).is_err());
    assert!(fit_model(&OwnLobe, &[vec![f64::NAN; 7]], &table, &settings).is_err());
    assert!(fit_model(&crate::measured::analytic::Bivariate, &[], &table, &settings).is_err());
}
