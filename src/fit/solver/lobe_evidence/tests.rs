use super::super::cell_sums::System;
use super::super::lobe_sums::tests::of_systems;
use super::super::lobe_widths::weighed_log_widths;
use super::*;
use crate::math::random::SequentialRandom;

#[test]
fn a_parabola_is_met_between_widths() {
    let x: [f64; LOBE_WIDTHS] = std::array::from_fn(|k| (k as f64 * 0.7).powf(1.1));
    let parabola = |x: f64| 2.0 - 3.0 * (x - 1.7).powi(2);
    let family = FamilyEvidence::new(&LobePrior::default().families[0], [0.3; 3], &x);
    let mut y = [0.0; FOURS * DOUBLES];
    y.iter_mut().zip(x).for_each(|(y, x)| *y = parabola(x));
    for (node, (slope, bent)) in bends(&family, &y).into_iter().take(LOBE_WIDTHS - 1).enumerate() {
        let at = 0.3 * x[node] + 0.7 * x[node + 1];
        let found = y[node] + (at - x[node]) * (slope + bent * (at - x[node + 1]));
        assert!((found - parabola(at)).abs() < 1e-9, "{node}: {found}");
    }
}

/// Sums of pixels that show a lobe of this F0, better the nearer the width is to that of `-1.2`.
fn group(specular: f64, seed: u64) -> LobeSumsOfGroup {
    let mut random = SequentialRandom::new(seed);
    let mut number = || f64::from(random.next_number());
    let mut systems = [[System::default(); 3]; LOBE_WIDTHS];
    for _ in 0..12 {
        let (e, s, noise) = (0.5 + number(), 2.0 * number(), 0.1 * (number() - 0.5));
        for (systems, width) in systems.iter_mut().zip(weighed_log_widths()) {
            for system in systems {
                let y = 0.3 * e + specular * s + noise;
                system.observe(3.0, e, s * (1.0 + 0.3 * (width + 1.2)), y);
            }
        }
    }
    of_systems(&systems)
}

/// Families of all kinds and of one, that look at all widths and at some.
fn families() -> Vec<LobeFamily> {
    let any = LobePrior::default().families.remove(0);
    let metal = LobeFamily { kinds: vec![any.kinds[1]], log_width: (-0.9, 0.15), reach: 3.0 };
    vec![any, metal]
}

#[test]
fn a_group_is_judged_alike_by_all_versions_and_point_by_point() {
    let widths = weighed_log_widths();
    for own in families() {
        let family = FamilyEvidence::new(&own, [0.3; 3], &widths);
        for (index, specular) in [0.0, 0.05, 0.4, 0.9].into_iter().enumerate() {
            let sums = group(specular, index as u64);
            let (log, belief) = lobe(&family, &sums);
            assert_eq!((log, belief), lobe_in(&family, &sums));
            // Point by point, with moments that are straight between widths.
            let (log_at, moments) = at_widths(&family, &sums);
            let bends = bends(&family, &log_at);
            let (centre, deviation) = own.log_width;
            let mut points = Vec::new();
            for width in family.first..family.last {
                let (left, right) = (widths[width], widths[width + 1]);
                let ends = if width + 1 == family.last { POINTS + 1 } else { POINTS };
                for k in 0..ends {
                    let way = k as f64 / POINTS as f64;
                    let x = left * (1.0 - way) + right * way;
                    let likely = (-0.5 * ((x - centre) / deviation).powi(2)).exp()
                        / (deviation * (2.0 * std::f64::consts::PI).sqrt());
                    let (slope, bent) = bends[width];
                    let rise = (x - left) * (slope + bent * (x - right));
                    let log = log_at[width] + rise + (likely * (right - left) / POINTS as f64).ln();
                    let of = |width: usize, k: usize| moments[width / DOUBLES][1][k].0[width % DOUBLES];
                    let mixed = |k: usize| of(width, k) * (1.0 - way) + of(width + 1, k) * way;
                    points.push((log, [mixed(0), mixed(1), x, x * x]));
                }
            }
            let total = log_sum(points.iter().map(|point| point.0));
            let mean = |k: usize| points.iter().map(|(log, values)| (log - total).exp() * values[k]).sum::<f64>();
            let expected = [0, 1, 2, 3].map(mean);
            let found = [belief.mean[1], belief.square[1], belief.mean[3], belief.square[3]];
            assert!((log - total).abs() < 1e-9 * (1.0 + total.abs()), "{log} {total}");
            assert!((0..4).all(|k| (found[k] - expected[k]).abs() < 1e-9), "{found:?} {expected:?}");
        }
    }
}

#[test]
fn bright_lobes_are_found_where_pixels_show_them() {
    let evidence = Evidence::new([0.3; 3], &weighed_log_widths(), &LobePrior::default());
    let dull = evidence.shared_lobe(&group(0.04, 1)).1.mean[1];
    let bright = evidence.shared_lobe(&group(0.5, 1)).1.mean[1];
    assert!(dull < 0.1 && (bright - 0.5).abs() < 0.15, "{dull} {bright}");
}
