use super::*;

#[test]
fn two_steps_go_from_coarse_to_fine_and_keep_every_step() {
    let settings = FitSettings {
        method: Method::Adam,
        steps_diffuse: 10,
        steps_all: 7,
        levels: 3,
        map_size: 64,
        ..Default::default()
    };
    let stages = stages(&settings);
    assert_eq!(stages.iter().map(|stage| stage.steps).sum::<usize>(), 17);
    assert_eq!(stages.iter().map(|stage| stage.map_size).collect::<Vec<_>>(), [16, 32, 64, 64, 64]);
    assert_eq!(stages[3].kind, StageKind::All);
    assert_eq!(stages[0].lobe_strength(3, 20), 0.0);
    assert!(stages[3].lobe_strength(0, 20) > 0.0);
    assert!((stages[0].rate(0, 0.1) - 1.0).abs() < 1e-6);
    assert!(stages[2].rate(stages[2].steps, 0.1) < 0.11);
}

/// Walks a plan step by step: (stage, step in stage) before each step, and at the very end.
fn walk(plan: &[Stage]) -> Vec<(usize, usize)> {
    let places = plan.iter().enumerate().flat_map(|(stage, own)| (0..=own.steps).map(move |step| (stage, step)));
    places.chain([(plan.len(), 0)]).collect()
}

#[test]
fn the_same_settings_keep_the_plan_wherever_it_is() {
    for (steps_diffuse, steps_all, levels) in [(10, 7, 3), (0, 11, 4), (2, 0, 3), (1, 1, 2), (10, 3, 4)] {
        for steps in [Steps::TwoStep, Steps::OneStep] {
            let settings = FitSettings {
                method: Method::Adam,
                steps,
                steps_diffuse,
                steps_all,
                levels,
                map_size: 64,
                ..Default::default()
            };
            let plan = stages(&settings);
            for (stage, step) in walk(&plan) {
                assert_eq!(revised(&settings, &plan, stage, step).unwrap(), plan, "{settings:?} at {stage}, {step}");
            }
        }
    }
}

#[test]
fn other_numbers_of_steps_keep_what_is_done_and_reach_the_finest_level() {
    let of = |steps_diffuse, steps_all| FitSettings {
        method: Method::Adam,
        steps_diffuse,
        steps_all,
        levels: 3,
        map_size: 64,
        ..Default::default()
    };
    let before = of(10, 7);
    let plan = stages(&before);
    for (stage, step) in walk(&plan) {
        for (steps_diffuse, steps_all) in [(10, 20), (40, 7), (5, 7), (10, 4), (12, 0), (0, 7), (4, 3)] {
            let after = of(steps_diffuse, steps_all);
            let done: usize = plan[..stage].iter().map(|stage| stage.steps).sum::<usize>() + step;
            match revised(&after, &plan, stage, step) {
                Ok(new) => {
                    assert_eq!(new.iter().map(|stage| stage.steps).sum::<usize>(), steps_diffuse + steps_all);
                    assert_eq!(new.last().unwrap().map_size, 64);
                    let kept = stage.min(plan.len() - 1);
                    let steps = |plan: &[Stage]| plan[..kept].iter().map(|stage| stage.steps).collect::<Vec<_>>();
                    assert_eq!(steps(&new), steps(&plan));
                    assert!(new.windows(2).all(|pair| pair[0].map_size <= pair[1].map_size));
                    // Asking again changes nothing, a step later neither.
                    assert_eq!(revised(&after, &new, stage, step).unwrap(), new);
                    if new.get(stage).is_some_and(|stage| stage.steps > step) {
                        assert_eq!(revised(&after, &new, stage, step + 1).unwrap(), new);
                    }
                }
                Err(error) => {
                    assert!(error.to_string().contains("--steps-"), "{error}");
                    assert!(done >= steps_diffuse.min(10) || steps_diffuse == 0, "{error} after {done} steps");
                }
            }
        }
    }
    assert!(revised(&of(9, 7), &plan, 3, 1).unwrap_err().to_string().contains("--steps-diffuse"));
    assert!(revised(&of(10, 2), &plan, 4, 0).unwrap_err().to_string().contains("--steps-all"));
    assert_eq!(revised(&of(10, 9), &plan, plan.len(), 0).unwrap().last().unwrap().steps, plan[4].steps + 2);
}

#[test]
fn the_solver_visits_the_smallest_size_twice_and_keeps_its_plan_wherever_it_is() {
    let usual = FitSettings { method: Method::Solver, map_size: 256, ..Default::default() };
    let names: Vec<String> = stages(&usual).iter().map(Stage::name).collect();
    assert_eq!(names[5..], ["narrow light", "maps", "refine"]);
    let large = FitSettings { solver_levels: 3, ..usual.clone() };
    let names: Vec<String> = stages(&large).iter().map(Stage::name).collect();
    assert_eq!(names, ["wide light 1/2", "narrow light 1/2", "maps 1/2", "refine"]);
    let settings = FitSettings { solver_refine: 0, ..usual };
    let plan = stages(&settings);
    let names: Vec<String> = plan.iter().map(Stage::name).collect();
    let half = ["wide light 1/2", "narrow light 1/2", "maps 1/2", "narrow light 1/2", "maps 1/2"];
    assert_eq!(names[..5], half);
    assert_eq!(names[5..], ["narrow light", "maps"]);
    for (stage, step) in walk(&plan) {
        assert_eq!(revised(&settings, &plan, stage, step).unwrap(), plan, "{stage}, {step}");
        let refined = FitSettings { solver_refine: 1, solver_levels: 3, ..settings.clone() };
        let revised = revised(&refined, &plan, stage, step).unwrap();
        // The descent makes the finest maps, unless tiles have begun them, and needs no second visit that has not begun.
        let kept = match stage {
            0..3 => 3,
            3..5 => 5,
            _ => plan.len(),
        };
        assert_eq!((revised.len(), revised.last().unwrap().steps), (kept + 1, 1), "{stage}, {step}");
        assert_eq!(revised[..kept], plan[..kept], "{stage}, {step}");
        assert_eq!((revised[kept].kind, revised[kept].map_size), (StageKind::Refine, 256));
    }
    let refined = FitSettings { solver_refine: 1, solver_levels: 3, ..settings.clone() };
    let plan_with = stages(&refined);
    for (stage, step) in walk(&plan_with) {
        assert_eq!(revised(&refined, &plan_with, stage, step).unwrap(), plan_with, "{stage}, {step}");
    }
    // Left out once more, it is as if it had never been asked for.
    assert_eq!(revised(&settings, &plan_with, 2, 0).unwrap(), plan);
    // On finer ones there is one round on the light for two, but where two have begun.
    let three = FitSettings { solver_levels: 3, map_size: 512, ..settings.clone() };
    let begun = stages(&three);
    let rounds = |plan: &[Stage], level: usize| {
        let own = plan.iter().filter(|stage| stage.kind == StageKind::NarrowLight && stage.photo_level == level);
        own.map(|stage| stage.steps).sum::<usize>()
    };
    let of_descent = FitSettings { solver_refine: 1, solver_levels: 4, ..three.clone() };
    assert_eq!([rounds(&begun, 1), rounds(&stages(&of_descent), 1)], [2, 1]);
    assert_eq!(rounds(&revised(&of_descent, &begun, 5, 1).unwrap(), 1), 2);
    // Without coarser maps the solver makes what there is, twice as well.
    let small = stages(&FitSettings { map_size: 64, ..settings.clone() });
    let names: Vec<String> = small.iter().map(Stage::name).collect();
    assert_eq!(names, ["wide light", "narrow light", "maps", "narrow light", "maps"]);
    // A fit begun without the second visit goes on: with it before its turn, without it after.
    let once: Vec<Stage> = [0, 1, 2, 5, 6].map(|number| plan[number]).to_vec();
    assert_eq!(revised(&settings, &once, 1, 1).unwrap(), plan);
    assert_eq!(revised(&settings, &once, 3, 1).unwrap(), once);
    assert_eq!(revised(&settings, &once, once.len(), 0).unwrap(), once);
}
