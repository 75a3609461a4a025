//! Squared difference between a pixel's estimate and its photo, with censored and background pixels.

use super::targets::Target;
use crate::math::real::Real;
use crate::render::accumulate::{PixelDerivative, PixelEstimate, PixelLoss};
use crate::scene::{Background, PixelState, Scene};
use std::sync::atomic::{AtomicU64, Ordering};

/// Mean squared error of one view; a sum over pixels times `weight`.
pub struct ViewLoss<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The photograph.
    pub target: &'a Target,
    /// Factor of each pixel's squared error: one over the number of values in the view's mean.
    pub weight: f32,
    /// Gain of the view: the picture is multiplied by it before it is compared.
    pub gain: f32,
    /// Whether background pixels are evidence for the light.
    pub use_background: bool,
    /// Derivative of the loss by the gain over `weight`, in units of 2^-20, added up in whole numbers so that the order
    /// of pixels does not matter. A pixel adds at most 2^42 units: a million of them cannot overflow.
    pub d_gain: AtomicU64,
    /// Squared error of unclipped surface pixels, summed over channels, in the same units, and their number.
    surface_error: (AtomicU64, AtomicU64),
}

/// Units of whole-number sums in one.
const UNIT: f64 = (1u64 << 20) as f64;
/// The most that a pixel adds.
const LARGEST_UNITS: f64 = (1u64 << 42) as f64;

impl<'a> ViewLoss<'a> {
    /// The loss of a view.
    pub fn new(scene: &'a Scene, target: &'a Target, weight: f32, gain: f32, use_background: bool) -> Self {
        ViewLoss {
            scene,
            target,
            weight,
            gain,
            use_background,
            d_gain: AtomicU64::new(0),
            surface_error: Default::default(),
        }
    }

    /// Derivative of the loss by the gain.
    pub fn gain_derivative(&self) -> f32 {
        (self.d_gain.load(Ordering::Relaxed) as i64 as f64 / UNIT * f64::from(self.weight)) as f32
    }

    /// Root mean squared error over the unclipped surface pixels so far, as held-out views are judged; `None` where there
    /// was none. Of an unbiased estimate of the squared error; one below zero counts as zero.
    pub fn surface_rmse(&self) -> Option<f32> {
        let (sum, count) = &self.surface_error;
        let (sum, count) = (sum.load(Ordering::Relaxed) as i64 as f64 / UNIT, count.load(Ordering::Relaxed));
        (count > 0).then(|| (sum / (3.0 * count as f64)).max(0.0).sqrt() as f32)
    }

    /// Adds up the error of a pixel, over the weight, if it is one that views are judged by.
    fn add_surface_error(&self, state: PixelState, escaped: f32, error: f64) {
        if state.is_surface() && !state.is_clipped() && escaped == 0.0 && error.is_finite() {
            self.surface_error.0.fetch_add(units(error), Ordering::Relaxed);
            self.surface_error.1.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// What a pixel is evidence for, given which share of its camera rays met nothing.
    fn is_evidence(&self, state: PixelState, escaped: f32) -> bool {
        match (state, self.scene.background) {
            (PixelState::Ignored, _) => false,
            // A black background is known exactly: mixed pixels are right, empty ones say nothing.
            (_, Background::Black) => escaped < 1.0 && state.is_surface(),
            // Mask and rays must agree: what a mask says is surface and rays miss, through a hole of the mesh, say, is no
            // sky. A mixed pixel shows some background, which in a photograph is not at infinity.
            (state, Background::Environment) if state.is_surface() => {
                escaped == 0.0 || (self.use_background && escaped == 1.0 && !self.target.has_mask)
            }
            (_, Background::Environment) => escaped == 1.0 && self.use_background,
        }
    }
}

/// A number in whole units, held in a range in which the sum over all pixels cannot wrap.
fn units(value: f64) -> u64 {
    (value * UNIT).clamp(-LARGEST_UNITS, LARGEST_UNITS) as i64 as u64
}

impl<R: Real> PixelLoss<R> for ViewLoss<'_> {
    fn at(&self, pixel: usize, estimate: &PixelEstimate<R>) -> Option<PixelDerivative<R>> {
        let (photo, state) = self.target.at(self.scene, pixel);
        if !self.is_evidence(state, estimate.escaped) {
            return None;
        }
        let gain = R::from_f32(self.gain);
        let weight = R::from_f32(self.weight);
        let mut derivative = PixelDerivative { loss: R::zero(), d_first: [R::zero(); 3], d_second: [R::zero(); 3] };
        let mut d_gain = R::zero();
        let clipped = if state.is_clipped() { self.target.clipped_at(self.scene, pixel) } else { [false; 3] };
        for channel in 0..3 {
            let photo_value = R::from_f32(photo[channel]);
            if clipped[channel] {
                // The radiance is at least this much. The mean of both estimates is compared: with their product one
                // half above the bound could push the other down.
                let half = R::from_f32(0.5);
                let sum = estimate.first[channel] + estimate.second[channel];
                let rest = sum * half * gain - photo_value;
                if rest.to_f32() < 0.0 {
                    derivative.loss += weight * rest * rest;
                    derivative.d_first[channel] = weight * rest * gain;
                    derivative.d_second[channel] = weight * rest * gain;
                    d_gain += weight * rest * sum;
                }
                continue;
            }
            let first = estimate.first[channel] * gain - photo_value;
            let second = estimate.second[channel] * gain - photo_value;
            derivative.loss += weight * first * second;
            derivative.d_first[channel] = weight * second * gain;
            derivative.d_second[channel] = weight * first * gain;
            d_gain += weight * (second * estimate.first[channel] + first * estimate.second[channel]);
        }
        let over_weight = f64::from(d_gain.to_f32()) / f64::from(self.weight).max(f64::MIN_POSITIVE);
        self.d_gain.fetch_add(units(over_weight), Ordering::Relaxed);
        let error = f64::from(derivative.loss.to_f32()) / f64::from(self.weight).max(f64::MIN_POSITIVE);
        self.add_surface_error(state, estimate.escaped, error);
        Some(derivative)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::scene::{Camera, Mesh, Photo, View};
    use glam::Vec3;

    fn scene(photo: Vec3, state: PixelState) -> Scene {
        Scene {
            name: "test".into(),
            folder: None,
            mesh: Mesh::default(),
            views: vec![View {
                name: "0".into(),
                camera: Camera::looking_at(Vec3::Z, Vec3::ZERO, 1, 1, 1.0),
                photo: Photo::Linear32(Image::filled(1, 1, photo)),
                states: Image::filled(1, 1, state),
                held_out: false,
                exposure_prior_stops: None,
            }],
            world_from_source: Default::default(),
            background: Background::Environment,
            truth: None,
            findings: Vec::new(),
        }
    }

    fn at(scene: &Scene, estimate: PixelEstimate<f64>, use_background: bool) -> Option<PixelDerivative<f64>> {
        let target = Target::new(scene, 0, 0);
        ViewLoss::new(scene, &target, 0.5, 1.0, use_background).at(0, &estimate)
    }

    #[test]
    fn views_are_judged_by_their_unclipped_surface_alone() {
        let estimate = PixelEstimate { first: [0.5f64; 3], second: [0.7; 3], escaped: 0.0 };
        let judged = |state, escaped| {
            let scene = scene(Vec3::splat(0.2), state);
            let target = Target::new(&scene, 0, 0);
            let loss = ViewLoss::new(&scene, &target, 0.01, 1.0, true);
            loss.at(0, &PixelEstimate { escaped, ..estimate });
            loss.surface_rmse()
        };
        let rmse = judged(PixelState::Surface, 0.0).unwrap();
        assert!((rmse - 0.15f32.sqrt()).abs() < 1e-4, "{rmse}");
        assert_eq!(judged(PixelState::Surface, 1.0), None);
        assert_eq!(judged(PixelState::Background, 1.0), None);
    }

    #[test]
    fn the_product_of_two_estimates_and_its_derivative() {
        let scene = scene(Vec3::new(0.2, 0.4, 0.6), PixelState::Surface);
        let estimate = PixelEstimate { first: [0.3, 0.4, 0.5], second: [0.1, 0.5, 0.9], escaped: 0.0 };
        let result = at(&scene, estimate, true).unwrap();
        let expected = 0.5 * (0.1 * -0.1 + 0.0 * 0.1 + -0.1 * 0.3);
        assert!((result.loss - expected).abs() < 1e-7);
        assert!((result.d_first[2] - 0.5 * 0.3).abs() < 1e-7);
        assert!((result.d_second[0] - 0.5 * 0.1).abs() < 1e-7);
    }

    #[test]
    fn clipped_channels_push_up_but_never_down() {
        let scene = scene(Vec3::new(1.0, 0.5, 1.0), PixelState::SurfaceClipped);
        let estimate = PixelEstimate { first: [3.0, 0.6, 0.2], second: [3.0, 0.6, 0.2], escaped: 0.0 };
        let result = at(&scene, estimate, true).unwrap();
        assert_eq!(result.d_first[0], 0.0);
        assert!(result.d_first[1] > 0.0 && result.d_first[2] < 0.0);
    }

    #[test]
    fn a_shrunk_pixel_with_a_clipped_part_is_a_lower_bound_as_well() {
        let mut scene = scene(Vec3::ONE, PixelState::SurfaceClipped);
        let view = &mut scene.views[0];
        view.camera = Camera::looking_at(Vec3::Z, Vec3::ZERO, 2, 1, 1.0);
        // Clipped in red on the left half; green is known everywhere.
        let half = [Vec3::new(1.0, 0.5, 0.3), Vec3::new(0.5, 0.5, 0.3)];
        view.photo = Photo::Linear32(Image::from_pixels(2, 2, [half, half].concat()));
        view.camera.height = 2;
        view.states = Image::from_pixels(2, 2, [PixelState::SurfaceClipped, PixelState::Surface].repeat(2));
        let target = Target::new(&scene, 0, 1);
        let at = |value: f64| {
            let estimate = PixelEstimate { first: [value; 3], second: [value; 3], escaped: 0.0 };
            ViewLoss::new(&scene, &target, 1.0, 1.0, true).at(0, &estimate).unwrap()
        };
        assert_eq!(at(0.9).d_first[0], 0.0, "above the mean of 0.75, which is a bound");
        assert!(at(0.9).d_first[1] > 0.0, "green is known");
        assert!(at(0.6).d_first[0] < 0.0);
    }

    #[test]
    fn below_the_bound_no_estimate_is_pushed_down() {
        let scene = scene(Vec3::ONE, PixelState::SurfaceClipped);
        let estimate = PixelEstimate { first: [1.8; 3], second: [0.0; 3], escaped: 0.0 };
        let result = at(&scene, estimate, true).unwrap();
        assert!(result.d_first[0] < 0.0 && result.d_second[0] < 0.0);
    }

    #[test]
    fn a_gain_under_a_sun_keeps_its_sign() {
        let mut scene = scene(Vec3::ZERO, PixelState::Surface);
        let view = &mut scene.views[0];
        view.camera.width = 3;
        view.photo = Photo::Linear32(Image::filled(3, 1, Vec3::ZERO));
        view.states = Image::filled(3, 1, PixelState::Surface);
        let target = Target::new(&scene, 0, 0);
        let loss = ViewLoss::new(&scene, &target, 1.0, 1.0, true);
        for pixel in 0..3 {
            let estimate = PixelEstimate::<f32> { first: [1e6; 3], second: [1e6; 3], escaped: 0.0 };
            loss.at(pixel, &estimate).unwrap();
        }
        assert!(loss.gain_derivative() > 0.0, "{}", loss.gain_derivative());
    }

    #[test]
    fn a_photo_that_is_not_finite_says_nothing() {
        for value in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e13] {
            let scene = scene(Vec3::new(0.1, value, 0.1), PixelState::SurfaceClipped);
            assert!(at(&scene, PixelEstimate { first: [0.5; 3], second: [0.5; 3], escaped: 0.0 }, true).is_none());
        }
    }

    #[test]
    fn mask_and_rays_must_agree() {
        let estimate = |escaped| PixelEstimate { first: [0.0; 3], second: [0.0; 3], escaped };
        let surface = scene(Vec3::ONE * 0.5, PixelState::Surface);
        assert!(at(&surface, estimate(0.0), false).is_some());
        assert!(at(&surface, estimate(0.5), true).is_none(), "a mixed pixel");
        assert!(at(&surface, estimate(1.0), true).is_some(), "without a mask rays say what is sky");
        let mut masked = surface.clone();
        masked.views[0].camera = Camera::looking_at(Vec3::Z, Vec3::ZERO, 2, 1, 1.0);
        masked.views[0].photo = Photo::Linear32(Image::filled(2, 1, Vec3::ONE * 0.5));
        masked.views[0].states = Image::from_pixels(2, 1, vec![PixelState::Surface, PixelState::Background]);
        assert!(at(&masked, estimate(1.0), true).is_none(), "the mask says surface, rays say sky");
        assert!(at(&masked, estimate(0.0), true).is_some());
        let background = scene(Vec3::ONE * 0.5, PixelState::Background);
        assert!(at(&background, estimate(1.0), true).is_some());
        assert!(at(&background, estimate(1.0), false).is_none());
        assert!(at(&background, estimate(0.0), true).is_none(), "the mask says background, rays say surface");
        assert!(at(&scene(Vec3::ONE, PixelState::Ignored), estimate(0.0), true).is_none());
    }
}
