use super::*;

fn plot(points: Vec<(f64, f64)>, y_scale: Scale) -> LinePlot {
    LinePlot {
        x_label: "steps".into(),
        y_label: "loss".into(),
        x_scale: Scale::Linear,
        y_scale,
        series: vec![Series { name: "loss <a&b>".into(), points, marked: false }],
        marks: vec![(1.0, "second".into())],
    }
}

#[test]
fn nothing_to_show_is_none_and_odd_numbers_do_not_panic() {
    assert!(plot(vec![], Scale::Linear).svg().is_none());
    assert!(plot(vec![(0.0, f64::NAN), (1.0, f64::INFINITY)], Scale::Linear).svg().is_none());
    assert!(plot(vec![(0.0, 0.0), (1.0, -1.0)], Scale::Logarithmic).svg().is_none());
    for values in [vec![0.0], vec![1e-200, 1e200], vec![3.0, 3.0], vec![-1e299, 1e299], vec![1.0, f64::NAN, 2.0]] {
        for scale in [Scale::Linear, Scale::Logarithmic] {
            let points = values.iter().enumerate().map(|(i, &v)| (i as f64, v)).collect();
            if let Some(svg) = plot(points, scale).svg() {
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{values:?}: {svg}");
            }
        }
    }
    assert!(bar_svg("empty", &[]).is_none());
    let nan = Bar { label: "x".into(), value: f64::NAN, range: None };
    assert!(bar_svg("nan", &[nan]).is_none());
}

#[test]
fn a_gap_is_left_at_a_value_that_is_not_finite() {
    let svg = plot(vec![(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 2.0)], Scale::Linear).svg();
    assert_eq!(svg.unwrap().matches("<polyline").count(), 2);
}

#[test]
fn thinning_keeps_the_extremes() {
    let points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), if i == 54_321 { 9.0 } else { 1.0 })).collect();
    let kept = thinned(&points);
    assert!(kept.len() <= MOST_POINTS + 2 && kept.contains(&(54_321.0, 9.0)));
    assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
}

#[test]
fn ticks_are_round_and_inside() {
    assert_eq!(linear_ticks(0.0, 100.0), [0.0, 50.0, 100.0]);
    assert_eq!(logarithmic_ticks(0.005, 20.0), [0.01, 0.1, 1.0, 10.0]);
    assert_eq!(logarithmic_ticks(1.5, 30.0), [2.0, 5.0, 10.0, 20.0]);
    assert_eq!(logarithmic_ticks(22.0, 130.0), [30.0, 40.0, 60.0, 80.0, 100.0]);
}

#[test]
fn a_file_of_plots_has_quoted_attributes_and_keeps_text() {
    let bar = Bar { label: "a=b".into(), value: 2.0, range: Some((1.0, 3.0)) };
    let file = standalone(&[bar_svg("t = 1", &[bar]).unwrap()]);
    assert!(file.contains(">a=b</text>") && file.contains(">t = 1</text>"));
    assert!(file.contains("class='bar'") && !file.contains("class=bar"));
}
