//! Derivatives against central differences on the built-in scene, at full size.

#![allow(clippy::unwrap_used)]

use patina::lab::audit::report::AuditReport;
use patina::lab::audit::{AuditSettings, built_in, gradients};
use std::sync::atomic::AtomicBool;

#[test]
fn ten_thousand_derivatives_agree_with_central_differences() {
    let settings = AuditSettings::default();
    let own = built_in(&settings).unwrap();
    let stop = AtomicBool::new(false);
    let report = gradients(&own.scene, &own.surface, &own.parameters, &own.weights, &settings, &stop).unwrap();
    println!("{}", report.to_markdown());
    assert!(report.parameters >= 10_000, "{}", report.parameters);
    assert!(report.passes(), "{}", report.to_markdown());
    // The audit saw what it is meant to see.
    assert!(report.silhouette_pixels > 100);
    assert!(report.paths_by_hits.iter().skip(2).sum::<usize>() > 1000, "bounces: {:?}", report.paths_by_hits);
    assert!(report.reads_per_level.iter().skip(1).sum::<usize>() > 1000, "levels: {:?}", report.reads_per_level);
    let count = |name: &str| report.gradient.iter().find(|group| group.name == name).map_or(0, |group| group.count);
    for place in ["texture seam", "silhouette", "coarse level", "after a bounce"] {
        assert!(count(place) > 1000, "{place}: {}", count(place));
    }
    assert!(count("light pole") > 100 && count("light wrap") > 100);
    assert!(report.consistency.iter().take(4).all(|group| group.count >= 75), "{:?}", report.consistency);
    // What a fit computes in single precision points the same way.
    assert!(report.gradient.iter().all(|group| group.single.cosine > 0.999));
    // A report survives its file.
    let json = serde_json::to_string(&report).unwrap();
    assert_eq!(serde_json::from_str::<AuditReport>(&json).unwrap().worst.len(), report.worst.len());
}
