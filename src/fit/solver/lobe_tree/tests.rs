//! What trees must make of tiles whose lobes are known.

use super::super::cell_sums::System;
use super::super::lobe_prior::{LobeFamily, LobeKind};
use super::super::lobe_sums::tests::of_systems;
use super::super::lobe_widths::weighed_log_widths;
use super::*;

/// Sums of a texel whose pixels say F0 with this precision at a width, and that other widths are worse.
fn sums(specular: f64, log_width: f64, precision: f64) -> LobeSumsOfGroup {
    of_systems(&weighed_log_widths().map(|x| {
        let misfit = precision * 0.5 * (x - log_width).powi(2);
        let mut sums = System::default();
        sums.observe(precision, 0.0, 1.0, specular);
        sums.yy += misfit;
        [sums; 3]
    }))
}

fn tile(of: impl Fn(usize, usize) -> (f64, f64, [f32; 3]), precision: f64) -> Vec<LobeBelief> {
    shared(of, precision, LobeSharing::QUICK)
}

/// The same, with this many trees.
fn by_trees(of: impl Fn(usize, usize) -> (f64, f64, [f32; 3]), precision: f64, trees: usize) -> Vec<LobeBelief> {
    shared(of, precision, LobeSharing { trees, ..LobeSharing::QUICK })
}

/// Beliefs of 8 by 8 texels of F0, logarithm of the width and diffuse reflectance by row and column.
fn shared(of: impl Fn(usize, usize) -> (f64, f64, [f32; 3]), precision: f64, sharing: LobeSharing) -> Vec<LobeBelief> {
    let mut texels = Vec::new();
    let mut all = Vec::new();
    for row in 0..8 {
        for column in 0..8 {
            let (specular, log_width, colour) = of(row, column);
            texels.push(TreeTexel { row: row as u16, column: column as u16, colour });
            all.push(sums(specular, log_width, precision));
        }
    }
    beliefs(&texels, &all, 8, &weighed_log_widths(), (&LobePrior::default(), sharing)).0
}

/// Root mean squared error of F0 over 8 by 8 texels.
fn error_of_specular(beliefs: &[LobeBelief], of: impl Fn(usize, usize) -> (f64, f64, [f32; 3])) -> f64 {
    let errors = beliefs.iter().enumerate().map(|(index, belief)| {
        let (specular, _, _) = of(index / 8, index % 8);
        (belief.mean[0] - specular).powi(2)
    });
    (errors.sum::<f64>() / 64.0).sqrt()
}

#[test]
fn texels_that_agree_share_a_lobe_and_are_surer_together() {
    let beliefs = tile(|_, _| (0.3, -1.2, [0.5; 3]), 20.0);
    for belief in &beliefs {
        assert!(belief.shared > 50.0, "{belief:?}");
        assert!((belief.mean[0] - 0.3).abs() < 0.02 && (belief.mean[3] + 1.2).abs() < 0.05, "{belief:?}");
        // Alone a texel would know F0 to 1 / sqrt(20).
        assert!(belief.square[0].sqrt() < 0.06, "{belief:?}");
    }
}

/// A border between columns 2 and 3 that no colour tells: squares of one tree end at 2 and 4.
#[test]
fn trees_whose_squares_end_elsewhere_find_a_border_that_one_misses() {
    let of = |_, column| (if column < 3 { 0.6 } else { 0.1 }, -1.2, [0.5; 3]);
    let error = |trees: usize| error_of_specular(&by_trees(of, 60.0, trees), of);
    let (one, four) = (error(1), error(MOST_TREES));
    println!("one tree {one:.4}, four {four:.4}");
    assert!(four < 0.8 * one, "one tree {one}, four {four}");
}

#[test]
fn where_all_texels_agree_the_number_of_trees_changes_nothing() {
    let of = |_, _| (0.3, -1.2, [0.5; 3]);
    for (one, four) in by_trees(of, 20.0, 1).iter().zip(by_trees(of, 20.0, MOST_TREES)) {
        assert!((one.mean[0] - four.mean[0]).abs() < 1e-3 && (one.mean[3] - four.mean[3]).abs() < 1e-2);
        assert!((one.square[0] / four.square[0] - 1.0).abs() < 0.1, "{one:?} {four:?}");
    }
}

#[test]
fn a_border_of_colour_that_no_quarter_follows_is_found() {
    let stripe = |row: usize, column: usize| (row + column).is_multiple_of(3);
    let of = |row, column| if stripe(row, column) { (0.7, -0.5, [0.1; 3]) } else { (0.05, -2.0, [0.6; 3]) };
    let beliefs = tile(of, 60.0);
    for (index, belief) in beliefs.iter().enumerate() {
        let (specular, log_width, _) = of(index / 8, index % 8);
        assert!((belief.mean[0] - specular).abs() < 0.05, "{index}: {belief:?}");
        assert!((belief.mean[3] - log_width).abs() < 0.1, "{index}: {belief:?}");
    }
}

/// Three materials in stripes, of the colours given.
fn three_stripes(colours: [[f32; 3]; 3]) -> impl Fn(usize, usize) -> (f64, f64, [f32; 3]) {
    let lobes = [(0.7, -0.5), (0.05, -2.0), (0.3, -1.2)];
    move |row, column| {
        let which = (row + column) % 3;
        let (specular, log_width) = lobes[which];
        (specular, log_width, colours[which])
    }
}

const CUT_ONCE: LobeSharing = LobeSharing::QUICK;
const CUT_TWICE: LobeSharing = LobeSharing { colour_cuts: 2, ..LobeSharing::QUICK };

#[test]
fn three_hues_are_told_apart_by_cutting_twice() {
    let of = three_stripes([[0.1, 0.1, 0.1], [0.6, 0.2, 0.1], [0.1, 0.3, 0.6]]);
    let error = |sharing: LobeSharing| error_of_specular(&shared(&of, 60.0, sharing), &of);
    let (once, twice) = (error(CUT_ONCE), error(CUT_TWICE));
    println!("cut once {once:.4}, twice {twice:.4}");
    assert!(twice < 0.02 && once > 3.0 * twice, "cut once {once}, twice {twice}");
}

/// Grain is no material of its own: of one hue the lighter and the darker are told apart by the first cut alone.
#[test]
fn parts_of_one_hue_are_not_cut_again() {
    let of = three_stripes([[0.1; 3], [0.5; 3], [0.7; 3]]);
    assert_eq!(shared(&of, 60.0, CUT_ONCE), shared(&of, 60.0, CUT_TWICE));
}

#[test]
fn a_lobe_does_not_outshine_what_is_seen() {
    // Light arrives alike through the lobe and diffusely, so pixels say how much is sent back in all, 0.1, and no more.
    // What is believed of a metal would make F0 0.127 of it, over a diffuse reflectance of -0.027.
    let texels: Vec<TreeTexel> = (0..64).map(|k| TreeTexel { row: k / 8, column: k % 8, colour: [0.05; 3] }).collect();
    let grey = weighed_log_widths().map(|_| {
        let mut sums = System::default();
        sums.observe(1e4, 1.0, 1.0, 0.1);
        [sums; 3]
    });
    let LobePrior { families, keep } = LobePrior::default();
    for kind in families[0].kinds.iter().map(|kind| LobeKind { share: 1.0, ..*kind }) {
        let family = LobeFamily { kinds: vec![kind], ..families[0] };
        let prior = LobePrior { families: vec![family], keep };
        let sums = vec![of_systems(&grey); texels.len()];
        for belief in beliefs(&texels, &sums, 8, &weighed_log_widths(), (&prior, LobeSharing::QUICK)).0 {
            assert!(belief.mean[0] < 0.105, "{kind:?}: {belief:?}");
        }
    }
}

#[test]
fn without_evidence_what_is_believed_comes_back() {
    let prior = LobePrior::default();
    let beliefs = tile(|_, _| (0.3, -1.2, [0.5; 3]), 0.0);
    for belief in beliefs {
        // The normal distribution of the width, cut off at widths over 1: mean -0.6 - 0.5 phi(1.2) / Phi(1.2).
        assert!((belief.mean[3] + 0.7097).abs() < 0.02 && belief.square[3].sqrt() > 0.3, "{belief:?}");
        let mean: f64 = prior.families[0].kinds.iter().map(|kind| kind.specular.0[0] * kind.share).sum();
        assert!((belief.mean[0] - mean).abs() < 0.02, "{belief:?}");
    }
}
