//! Pictures that refine, and the thread that draws them for a window.

#![allow(clippy::unwrap_used)]

use super::common::*;
use glam::Vec3;
use patina::image::RgbImage;
use patina::job::preview::{Preview, PreviewPicture, PreviewRequest};
use patina::render::passes::Accumulation;
use patina::render::picture::{PictureSettings, render};
use patina::render::progressive::PictureTracer;
use patina::render::{Parameters, Surface};
use patina::scene::Camera;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

static GO: AtomicBool = AtomicBool::new(false);
/// Beyond this a test gives up: a thread that died is a failure, not a test that hangs.
const PATIENCE: Duration = Duration::from_secs(120);

fn camera(width: usize, height: usize) -> Camera {
    camera_at(30.0, 35.0, width, height)
}

fn refined(surface: &Surface, lit: &Parameters<f32>, settings: PictureSettings, passes: &[usize]) -> Accumulation {
    let camera = camera(40, 28);
    let tracer = PictureTracer::new(surface, lit, settings);
    let mut accumulation = Accumulation::new(camera.width, camera.height);
    for &samples in passes {
        assert!(accumulation.add_pass(&tracer, &camera, 0, samples, &GO, &|_| {}));
    }
    accumulation
}

#[test]
fn passes_together_are_one_picture_of_all_their_samples() {
    let trial = Trial::default();
    let (surface, lit) = (trial.surface(), trial.truth());
    let settings = PictureSettings { samples: 48, max_bounces: 2, seed: 3, ..Default::default() };
    let whole = render(&surface, &camera(40, 28), &lit, 0, &settings, &GO);
    // Same seed: passes of any length draw the numbers of one sequence.
    for passes in [vec![4; 12], vec![1, 1, 2, 4, 8, 16, 16]] {
        let same = refined(&surface, &lit, settings, &passes);
        assert_eq!((same.samples(), same.passes() as usize, same.non_finite()), (48, passes.len(), 0));
        for (a, b) in same.picture().pixels().iter().zip(whole.radiance.pixels()) {
            assert!((*a - *b).abs().max_element() <= 1e-4 * b.max_element().max(0.1), "{a} {b}");
        }
        for (a, b) in same.coverage().pixels().iter().zip(whole.coverage.pixels()) {
            assert!((a - b).abs() < 1e-5);
        }
    }

    // Another seed: the means agree within their noise, as groups tell it.
    let groups = PictureSettings { samples: 4, groups: 12, ..settings };
    let variance = render(&surface, &camera(40, 28), &lit, 0, &groups, &GO).variance.unwrap();
    let other = refined(&surface, &lit, PictureSettings { seed: 77, ..settings }, &[1, 1, 2, 4, 8, 16, 16]);
    for channel in 0..3 {
        let (mut difference, mut squared) = (0.0f64, 0.0f64);
        for (index, pixel) in other.picture().pixels().iter().enumerate() {
            difference += f64::from(pixel[channel] - whole.radiance.pixels()[index][channel]);
            squared += 2.0 * f64::from(variance.pixels()[index][channel]);
        }
        let z = difference / squared.sqrt();
        assert!(z.abs() < 4.0, "channel {channel}: z = {z}");
    }
    assert_ne!(other.picture(), &whole.radiance);
}

#[test]
fn samples_of_one_sequence_vary_less_than_independent_groups_of_them() {
    let trial = Trial::default();
    let (surface, lit) = (trial.surface(), trial.truth());
    // Mean squared difference of two pictures of 16 samples a pixel: twice their variance.
    let difference = |settings: [PictureSettings; 2]| {
        let [a, b] = settings.map(|settings| render(&surface, &camera(40, 28), &lit, 0, &settings, &GO).radiance);
        a.pixels().iter().zip(b.pixels()).map(|(a, b)| f64::from((*a - *b).length_squared())).sum::<f64>()
    };
    let of = |samples, groups| {
        let settings = PictureSettings { samples, groups, max_bounces: 2, ..Default::default() };
        difference([11, 12].map(|seed| PictureSettings { seed, ..settings }))
    };
    let (together, apart) = (of(16, 1), of(2, 8));
    assert!(together < 0.6 * apart, "{together} {apart}");
}

#[test]
fn passes_are_the_same_bits_on_any_number_of_threads_and_a_stopped_one_leaves_no_trace() {
    let trial = Trial::default();
    let (surface, lit) = (trial.surface(), trial.truth());
    let settings = PictureSettings { max_bounces: 2, ..Default::default() };
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let one = pool(1).install(|| refined(&surface, &lit, settings, &[1, 2]));
    let three = pool(3).install(|| refined(&surface, &lit, settings, &[1, 2]));
    assert_eq!(one, three);

    let tracer = PictureTracer::new(&surface, &lit, settings);
    let mut interrupted = refined(&surface, &lit, settings, &[1]);
    let stop = AtomicBool::new(false);
    let raise = |_| stop.store(true, Ordering::Relaxed);
    assert!(!interrupted.add_pass(&tracer, &camera(40, 28), 0, 2, &stop, &raise));
    assert!(interrupted.add_pass(&tracer, &camera(40, 28), 0, 2, &GO, &|_| {}));
    assert_eq!(interrupted, one);
}

#[test]
fn a_coarse_picture_has_the_full_size_and_the_right_brightness() {
    let trial = Trial::default();
    let (surface, lit) = (trial.surface(), trial.truth());
    let settings = PictureSettings { max_bounces: 2, ..Default::default() };
    let full = refined(&surface, &lit, settings, &[32]);
    let tracer = PictureTracer::new(&surface, &lit, settings);
    // 40 x 28 is a multiple of 4, 37 x 27 is not.
    for (width, height) in [(40, 28), (37, 27)] {
        let coarse = tracer.coarse(&camera(width, height), 0, 4, &GO, &|_| {}).unwrap();
        assert_eq!((coarse.width(), coarse.height()), (width, height));
    }
    let mean = |picture: &RgbImage| picture.pixels().iter().sum::<Vec3>() / picture.pixels().len() as f32;
    let coarse = tracer.coarse(&camera(40, 28), 0, 2, &GO, &|_| {}).unwrap();
    let (ours, theirs) = (mean(&coarse), mean(full.picture()));
    assert!((ours - theirs).length() < 0.1 * theirs.length(), "{ours} {theirs}");
    assert!(tracer.coarse(&camera(40, 28), 0, 4, &AtomicBool::new(true), &|_| {}).is_none());
}

fn request(key: u64, size: usize, samples_target: usize) -> PreviewRequest {
    let trial = Trial::default();
    PreviewRequest {
        surface: trial.surface(),
        parameters: Arc::new(trial.truth()),
        camera: camera(size, size),
        settings: PictureSettings { max_bounces: 2, ..Default::default() },
        samples_target,
        coarse_first: false,
        key,
    }
}

fn wait_until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(value) = found() {
            return value;
        }
        assert!(began.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn wait_done(preview: &Preview, key: u64) -> Arc<PreviewPicture> {
    wait_until("the picture", || {
        let (_, picture) = preview.pictures.newest()?;
        (picture.key == key && picture.is_done).then_some(picture)
    })
}

#[test]
fn the_newest_request_wins_and_its_picture_is_that_of_the_passes() {
    let wakes = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&wakes);
    let wake: patina::job::preview::Wake = Arc::new(move || {
        counted.fetch_add(1, Ordering::Relaxed);
    });
    let preview = Preview::start(2, Some(wake)).unwrap();
    preview.request(request(1, 96, 1_000_000));
    wait_until("work on the first request", || (preview.tiles_drawn() > 0).then_some(()));
    preview.request(request(2, 24, 4));
    preview.request(PreviewRequest { coarse_first: true, ..request(3, 24, 4) });
    let picture = wait_done(&preview, 3);
    assert_eq!((picture.samples, picture.factor), (4, 1));
    // Two coarse pictures, the first pass and the last.
    wait_until("four calls", || (wakes.load(Ordering::Relaxed) >= 4).then_some(()));

    let trial = Trial::default();
    let (surface, lit) = (trial.surface(), trial.truth());
    let settings = PictureSettings { max_bounces: 2, ..Default::default() };
    let tracer = PictureTracer::new(&surface, &lit, settings);
    let mut expected = Accumulation::new(24, 24);
    for samples in [1, 1, 2] {
        expected.add_pass(&tracer, &camera(24, 24), 0, samples, &GO, &|_| {});
    }
    assert_eq!(&picture.picture, expected.picture());
    assert!(preview.failures.newest().is_none());
}

#[test]
fn a_cancelled_request_draws_no_further_tile() {
    let preview = Preview::start(1, None).unwrap();
    // A small share: the thread sleeps most of the time, and must hear the call in its sleep too.
    preview.set_share(0.05);
    preview.request(request(1, 128, 1_000_000));
    wait_until("work", || (preview.tiles_drawn() > 0).then_some(()));
    preview.cancel();
    let drawn = preview.tiles_drawn();
    preview.set_share(1.0);
    preview.request(request(2, 16, 2));
    wait_done(&preview, 2);
    // Two passes of one tile, and at most the tile that was in the making.
    let further = preview.tiles_drawn() - drawn;
    assert!((2..=3).contains(&further), "{further} tiles");
}

#[test]
fn a_panic_is_told_and_the_next_picture_is_drawn() {
    let preview = Preview::start(1, None).unwrap();
    let mut broken = request(7, 24, 4);
    let mut parameters = (*broken.parameters).clone();
    parameters.light.clear();
    broken.parameters = Arc::new(parameters);
    preview.request(broken);
    let (_, failure) = wait_until("the failure", || preview.failures.newest());
    assert_eq!(failure.key, 7);
    assert_eq!(failure.error.kind(), patina::ErrorKind::Internal);
    assert!(failure.error.message().contains("8 x 4"), "{}", failure.error);
    preview.request(request(8, 16, 1));
    assert_eq!(wait_done(&preview, 8).samples, 1);
}
