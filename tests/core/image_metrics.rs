//! Metrics against values of another program and against arithmetic by hand.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::image::metrics::{best_scale_per_channel, compare, psnr_of_rmse, rmse, rmse_grey, scores, ssim_map};
use patina::image::{GreyImage, Image, RgbImage};

/// Two smooth images with some structure between them.
fn pair() -> (RgbImage, RgbImage) {
    let first = |row: f64, column: f64| 0.5 + 0.3 * (column * 0.7).sin() * (row * 0.4).cos();
    let second = |row: f64, column: f64| {
        0.45 + 0.25 * (column * 0.7 + 0.3).sin() * (row * 0.4).cos() + 0.1 * (column * row).sin()
    };
    let image = |value: &dyn Fn(f64, f64) -> f64| {
        Image::from_fn(48, 40, |row, column| Vec3::splat(value(row as f64, column as f64) as f32))
    };
    (image(&first), image(&second))
}

#[test]
fn ssim_and_rmse_equal_those_of_scikit_image() {
    // scikit-image 0.26: structural_similarity(gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
    // data_range=1, win_size=11) of the two images above.
    let (estimate, truth) = pair();
    let found = scores(&estimate, &truth, None).unwrap();
    assert!((found.ssim - 0.795_400_142_982_459_2).abs() < 1e-6, "{}", found.ssim);
    assert!((found.rmse - 0.097_008_103_944_250_36).abs() < 1e-8, "{}", found.rmse);
    let grey = |image: &RgbImage| image.map(|rgb| rgb.x);
    let map = ssim_map(&grey(&estimate), &grey(&truth));
    assert!((map[(20, 24)] - 0.834_753_967_324_037_2).abs() < 1e-6, "{}", map[(20, 24)]);
}

#[test]
fn equal_images_score_perfectly() {
    let (image, _) = pair();
    let found = compare(&image, &image, None).unwrap();
    assert_eq!((found.raw.rmse, found.raw.psnr, found.raw.relative_rmse), (0.0, f64::INFINITY, 0.0));
    assert!((found.raw.ssim - 1.0).abs() < 1e-12);
    assert_eq!(found.scale, [1.0; 3]);
}

#[test]
fn a_known_difference_gives_known_scores() {
    let truth = RgbImage::filled(4, 4, Vec3::splat(0.5));
    let estimate = RgbImage::filled(4, 4, Vec3::new(0.6, 0.5, 0.4));
    let found = scores(&estimate, &truth, None).unwrap();
    let expected = (0.02f64 / 3.0).sqrt();
    assert!((found.rmse - expected).abs() < 1e-7 && (found.relative_rmse - expected / 0.5).abs() < 1e-7);
    assert!((psnr_of_rmse(0.1) - 20.0).abs() < 1e-12 && (found.psnr - psnr_of_rmse(expected)).abs() < 1e-5);
}

#[test]
fn alignment_finds_the_factor_of_each_channel_within_the_mask() {
    let (truth, _) = pair();
    let factor = Vec3::new(2.0, 0.5, 1.0);
    let mut estimate = truth.map(|&rgb| rgb * factor * Vec3::new(1.0, 1.0, 0.0));
    let mask = Image::from_fn(48, 40, |row, _| row >= 10);
    estimate[(0, 0)] = Vec3::splat(1e6);
    let scale = best_scale_per_channel(&estimate, &truth, Some(&mask)).unwrap();
    assert!((scale - Vec3::new(0.5, 2.0, 1.0)).abs().max_element() < 1e-6, "a black channel keeps factor 1: {scale}");
    let found = compare(&truth.map(|&rgb| rgb * 3.0), &truth, Some(&mask)).unwrap();
    assert!(found.raw.relative_rmse > 1.9 && found.aligned.relative_rmse < 1e-6);
    assert!(found.aligned.ssim > 0.999_999 && found.raw.ssim < 0.9);
}

#[test]
fn only_the_mask_counts_and_what_is_not_finite_is_counted_not_hidden() {
    let truth = RgbImage::filled(20, 20, Vec3::splat(0.25));
    let mut estimate = truth.clone();
    estimate[(3, 3)] = Vec3::new(0.0, f32::NAN, 0.0);
    estimate[(4, 4)] = Vec3::splat(0.75);
    let all = scores(&estimate, &truth, None).unwrap();
    assert_eq!((all.pixels, all.not_finite), (399, 1));
    assert!((all.rmse - (0.25f64 / 399.0).sqrt()).abs() < 1e-9 && all.ssim.is_finite());
    // What one image does not know makes no difference around it.
    let bright = Image::filled(20, 20, Vec3::splat(0.7));
    let mut hole = bright.clone();
    hole[(10, 10)] = Vec3::NAN;
    assert_eq!(scores(&hole, &bright, None).unwrap().ssim, 1.0);
    let one = Image::from_fn(20, 20, |row, column| row == 4 && column == 4);
    assert_eq!(rmse(&estimate, &truth, Some(&one)).unwrap(), 0.5);
    let nothing = scores(&estimate, &truth, Some(&Image::filled(20, 20, false))).unwrap();
    assert!(nothing.rmse.is_nan() && nothing.ssim.is_nan() && nothing.pixels == 0);
}

#[test]
fn images_of_different_sizes_are_an_error_and_tiny_ones_are_not() {
    let small = RgbImage::filled(3, 2, Vec3::ONE);
    assert!(compare(&small, &RgbImage::filled(2, 3, Vec3::ONE), None).is_err());
    assert!((scores(&small, &small, None).unwrap().ssim - 1.0).abs() < 1e-12);
    let grey = GreyImage::filled(2, 2, 0.5);
    assert!((rmse_grey(&grey, &GreyImage::filled(2, 2, 0.25), None).unwrap() - 0.25).abs() < 1e-12);
}

#[test]
fn an_error_below_the_noise_is_not_reported_as_none() {
    use patina::image::metrics::scores_without_noise;
    let mut random = patina::math::random::SequentialRandom::new(8);
    let truth = Image::from_fn(48, 48, |row, column| Vec3::splat(0.4 + 0.004 * (row as f32 - 0.5 * column as f32)));
    // Half of these pictures have more noise in the mean of their halves than in the halves' difference.
    for _ in 0..12 {
        let mut noisy = || truth.map(|&value| value + 0.05 * (random.next_number() - 0.5));
        let (first, second) = (noisy(), noisy());
        let half_of = |sign: f32| {
            let pixels = first.pixels().iter().zip(second.pixels()).map(|(a, b)| 0.5 * (*a + sign * *b));
            Image::from_pixels(48, 48, pixels.collect())
        };
        let score = scores_without_noise(&half_of(1.0), Some(&half_of(-1.0)), &truth, None).unwrap();
        // The noise of the mean is .0102 a channel; without it next to nothing is left, but never nothing at all.
        assert!(score.rmse > 0.0 && score.rmse < 0.004, "{}", score.rmse);
        assert!(score.psnr.is_finite() && score.ssim <= 1.0 && score.ssim > 0.9, "{} {}", score.psnr, score.ssim);
    }
}
