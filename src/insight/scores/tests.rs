use super::*;

fn grey(width: usize, height: usize, value: f32) -> RgbImage {
    Image::filled(width, height, Vec3::splat(value))
}

#[test]
fn noise_of_the_picture_is_taken_off() {
    let (width, height) = (96, 64);
    let photo = Image::from_fn(width, height, |row, column| {
        Vec3::splat(0.3 + 0.1 * ((row as f32) * 0.3).sin() + 0.1 * ((column as f32) * 0.2).cos())
    });
    let truth = photo.map(|&pixel| pixel * 1.1 + Vec3::splat(0.02));
    let mut random = crate::math::random::SequentialRandom::new(5);
    let mut noisy =
        || truth.map(|&pixel| pixel + Vec3::from_array([(); 3].map(|()| 0.2 * (random.next_number() - 0.5))));
    let (first, second) = (noisy(), noisy());
    let states = Image::filled(width, height, PixelState::Surface);
    let exact = score_view(&photo, &truth, &states, None, 0.0).unwrap();
    let halves = score_halves(&photo, [&first, &second], &states, None, 0.0).unwrap();
    let as_it_is = score_view(&photo, &mean_of([&first, &second]), &states, None, 0.0).unwrap();
    let off = |a: PictureScore, exact: PictureScore| {
        [a.rmse_linear - exact.rmse_linear, a.psnr_srgb_db - exact.psnr_srgb_db, a.ssim_srgb - exact.ssim_srgb]
    };
    let (without, with) = (off(halves.raw, exact.raw), off(as_it_is.raw, exact.raw));
    assert!(without[0].abs() < 0.1 * with[0].abs(), "{without:?} {with:?}");
    // Encoding bends noise and similarity is a ratio: a part of it stays in both.
    assert!(without[1].abs() < 0.25 * with[1].abs(), "{without:?} {with:?}");
    assert!(without[2].abs() < 0.25 * with[2].abs(), "{without:?} {with:?}");
    // After the best factor nearly nothing but noise is left: decibels of nothing are not compared.
    let (without, with) = (off(halves.aligned, exact.aligned), off(as_it_is.aligned, exact.aligned));
    assert!(without[0].abs() < 0.1 * with[0].abs(), "{without:?} {with:?}");
}

#[test]
fn rmse_and_psnr_match_a_hand_calculation() {
    // Four pixels: one background, one clipped, one that misses the mesh; the last two differ by 0.1 and 0.3.
    let states = Image::from_pixels(
        5,
        1,
        vec![
            PixelState::Background,
            PixelState::SurfaceClipped,
            PixelState::Surface,
            PixelState::Surface,
            PixelState::Surface,
        ],
    );
    let coverage = Image::from_pixels(5, 1, vec![true, true, false, true, true]);
    let photo = grey(5, 1, 0.5);
    let mut picture = photo.map(|_| Vec3::splat(9.0));
    picture[(0, 3)] = Vec3::splat(0.6);
    picture[(0, 4)] = Vec3::splat(0.2);
    let scores = score_view(&photo, &picture, &states, Some(&coverage), 0.0).unwrap();
    assert_eq!(scores.sums.pixels, 2);
    assert!((scores.raw.rmse_linear - 0.05f64.sqrt()).abs() < 1e-6, "{scores:?}");
    // sRGB curve at 0.5, 0.6, 0.2, computed apart: 0.735357, 0.797738, 0.484529.
    let mean_squared = ((0.797738f64 - 0.735357).powi(2) + (0.484529f64 - 0.735357).powi(2)) / 2.0;
    assert!((scores.raw.psnr_srgb_db + 10.0 * mean_squared.log10()).abs() < 1e-3, "{scores:?}");
    // Scale: (0.6 + 0.2) 0.5 / (0.36 + 0.04) = 1; so the twin is equal.
    assert!((scores.scale[0] - 1.0).abs() < 1e-6);
    assert!((scores.clipped_share - 1.0 / 3.0).abs() < 1e-12, "one of three covered surface pixels");
}

#[test]
fn a_scaled_picture_is_equal_after_alignment_and_only_then() {
    let photo = Image::from_fn(16, 16, |r, c| Vec3::new(0.1 + 0.02 * r as f32, 0.3, 0.01 * c as f32 + 0.2));
    let picture = photo.map(|&p| p * Vec3::new(2.0, 0.5, 1.25));
    let states = Image::filled(16, 16, PixelState::Surface);
    let scores = score_view(&photo, &picture, &states, None, 0.0).unwrap();
    for (scale, expected) in scores.scale.iter().zip([0.5, 2.0, 0.8]) {
        assert!((scale - expected).abs() < 1e-6);
    }
    assert!(scores.raw.rmse_linear > 0.1 && scores.aligned.rmse_linear < 1e-7);
    assert!(scores.aligned.psnr_srgb_db > 100.0 && scores.aligned.ssim_srgb > 0.9999);
    let together = aggregate([&scores, &scores]);
    assert!(together.aligned.rmse_linear < 1e-7 && together.views == 2);
    assert!((together.raw.rmse_linear - scores.raw.rmse_linear).abs() < 1e-12);
}

#[test]
fn one_scale_for_all_views_does_not_hide_that_views_disagree() {
    let states = Image::filled(8, 8, PixelState::Surface);
    let bright = score_view(&grey(8, 8, 0.4), &grey(8, 8, 0.2), &states, None, 0.0).unwrap();
    let dark = score_view(&grey(8, 8, 0.4), &grey(8, 8, 0.8), &states, None, 0.0).unwrap();
    assert!(bright.aligned.rmse_linear < 1e-7 && dark.aligned.rmse_linear < 1e-7);
    // s = (0.08 + 0.32) / (0.04 + 0.64) = 10/17; errors 0.4 - 2/17 and 0.4 - 8/17.
    let expected = (((0.4f64 - 2.0 / 17.0).powi(2) + (0.4f64 - 8.0 / 17.0).powi(2)) / 2.0).sqrt();
    let together = aggregate([&bright, &dark]);
    assert!((together.aligned.rmse_linear - expected).abs() < 1e-6, "{together:?}");
}

#[test]
fn nothing_to_count_and_not_finite_pixels_do_not_panic() {
    let none = score_view(&grey(4, 4, 0.1), &grey(4, 4, 0.1), &Image::filled(4, 4, PixelState::Ignored), None, 0.0);
    assert!(none.unwrap().raw.rmse_linear.is_nan());
    let mut picture = grey(4, 4, 0.1);
    picture[(1, 2)] = Vec3::new(f32::NAN, 0.0, f32::INFINITY);
    let states = Image::filled(4, 4, PixelState::Surface);
    let scores = score_view(&grey(4, 4, 0.1), &picture, &states, None, 0.0).unwrap();
    assert_eq!((scores.non_finite_pixels, scores.sums.pixels), (1, 15));
    assert!(scores.raw.rmse_linear.abs() < 1e-9 && scores.raw.psnr_srgb_db == f64::INFINITY);
    assert!(score_view(&grey(4, 4, 0.1), &grey(3, 4, 0.1), &states, None, 0.0).is_err());
    assert!(aggregate([]).raw.rmse_linear.is_nan());
    let empty = score_view(&grey(0, 0, 0.0), &grey(0, 0, 0.0), &Image::filled(0, 0, PixelState::Surface), None, 0.0);
    assert!(empty.unwrap().clipped_share.is_nan());
}
