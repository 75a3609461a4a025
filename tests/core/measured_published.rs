//! Published parameters against the neural fits: two independent descriptions of the same measurements.

#![allow(clippy::unwrap_used)]

use super::beside::data;
use glam::DVec3;
use patina::ErrorKind;
use patina::math::random::SequentialRandom;
use patina::math::statistics::quantile;
use patina::measured::fits::PublishedFits;
use patina::measured::fits::neural::WEIGHTS_FILE;
use patina::measured::{HalfDifference, NeuralFits};
use std::io::Write;
use std::path::PathBuf;

fn library() -> Option<PathBuf> {
    data("brdf/fits")?;
    data("brdf").filter(|folder| folder.join(WEIGHTS_FILE).is_file())
}

/// Pairs of directions spread evenly over both hemispheres.
fn pairs(count: usize) -> Vec<(HalfDifference, f64)> {
    let mut random = SequentialRandom::new(3);
    let mut direction = || {
        let (z, phi) = (0.02 + 0.98 * f64::from(random.next_number()), 6.2 * f64::from(random.next_number()));
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * phi.cos(), radius * phi.sin(), z)
    };
    (0..count)
        .map(|_| {
            let (light, eye) = (direction(), direction());
            (HalfDifference::from_directions(light, eye), light.z)
        })
        .collect()
}

#[test]
fn independent_fits_agree_with_the_neural_ones() {
    let Some(folder) = library() else { return };
    let neural = NeuralFits::read(&folder).unwrap();
    let pairs = pairs(3000);
    let at: Vec<HalfDifference> = pairs.iter().map(|pair| pair.0).collect();
    let mut truths = Vec::new();
    for fit in &neural.materials {
        let mut values = vec![[0.0; 3]; at.len()];
        fit.evaluate(&at, &mut values);
        truths.push(values);
    }
    // (file, materials, largest median over materials of the mean of |difference of ln(1 + f cos)|).
    for (file, count, limit) in [
        ("low_lowsmooth_E2", 88, 0.003),
        ("low_lowmicrofacet_E2", 88, 0.0026),
        ("low_cooktorrance_E1", 88, 0.0045),
        ("low_cooktorrance_E2", 88, 0.004),
        ("low_ashikhminshirley_E1", 88, 0.0045),
        ("low_ashikhminshirley_E2", 88, 0.0038),
        ("bagher_sgd", 88, 0.0045),
        ("ngan_cooktorrance", 78, 0.0055),
        ("ngan_ward", 78, 0.0065),
        ("ngan_wardduer", 78, 0.0062),
        ("ngan_ashikhminshirley", 78, 0.0055),
        ("ngan_blinnphong", 78, 0.0065),
        ("ngan_lafortune", 78, 0.006),
    ] {
        let fits = PublishedFits::read(&folder.join("fits").join(format!("{file}.fit"))).unwrap();
        assert_eq!(fits.materials.len(), count, "{file}");
        let means: Vec<f64> = neural
            .materials
            .iter()
            .zip(&truths)
            .filter_map(|(material, truth)| fits.find(&material.name).map(|fit| (fit, truth)))
            .map(|(fit, truth)| {
                let mut sum = 0.0;
                for ((at, cosine), truth) in pairs.iter().zip(truth) {
                    let value = fit.value(*at).unwrap();
                    sum +=
                        (0..3).map(|c| ((value[c] * cosine).ln_1p() - (truth[c] * cosine).ln_1p()).abs()).sum::<f64>();
                }
                sum / (3 * pairs.len()) as f64
            })
            .collect();
        let median = quantile(&means, 0.5);
        println!("{file}: {median:.4} over {} materials", means.len());
        assert!(median < limit, "{file}: {median}");
    }
    let he = PublishedFits::read(&folder.join("fits/ngan_he.fit")).unwrap();
    assert_eq!(he.materials.len(), 78);
    assert_eq!(he.materials[0].table().unwrap_err().kind(), ErrorKind::Unsupported);
}

#[test]
fn a_published_fit_becomes_a_table() {
    let Some(folder) = library() else { return };
    let fits = PublishedFits::read(&folder.join("fits/low_lowsmooth_E2.fit")).unwrap();
    let fit = fits.find("brass").unwrap();
    let table = fit.table().unwrap();
    let at = HalfDifference { theta_half: 0.2, theta_difference: 0.5, phi_difference: 1.0 };
    let (found, truth) = (table.lookup(at).unwrap(), fit.value(at).unwrap());
    assert!((0..3).all(|c| (found[c] / truth[c] - 1.0).abs() < 0.02), "{found:?} {truth:?}");
}

#[test]
fn damaged_files_name_the_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.fit");
    let error = |text: &[u8]| {
        std::fs::File::create(&path).unwrap().write_all(text).unwrap();
        PublishedFits::read(&path).unwrap_err()
    };
    let line = "a = Aggregate(Lambertian(albedo = [0, 0, 0]), NganWard(albedo = [1, 1, 1], roughness = 0.1))\n";
    assert!(error(format!("# x\n{line}b = \n").as_bytes()).to_string().contains("line 3"));
    assert!(error(format!("{line}{line}").as_bytes()).to_string().contains("twice"));
    assert!(error(line.replace("0.1", "0").as_bytes()).to_string().contains("roughness"));
    assert_eq!(error(b"").kind(), ErrorKind::Malformed);
    assert_eq!(error(&[0xff, 0xfe]).kind(), ErrorKind::Malformed);
}
