//! The pictures and gradients that are timed.

use crate::image::RgbImage;
use crate::light::EnvironmentSampler;
use crate::material::GradientPyramid;
use crate::render::accumulate::{PassKey, PixelDerivative, PixelEstimate, PixelLoss, accumulate};
use crate::render::first_hits::{CameraRays, PixelFilter};
use crate::render::path::{PathSettings, PathTracer};
use crate::render::picture::{PictureSettings, render};
use crate::render::{ParameterGradient, Parameters, Surface};
use crate::scene::{Background, Scene};
use std::sync::atomic::AtomicBool;

/// Standard deviation of a pixel's channel relative to the mean, from two independent sets of the same pictures.
pub fn relative_deviation(one: &[RgbImage], other: &[RgbImage]) -> f64 {
    let pairs = || one.iter().zip(other).flat_map(|(one, other)| one.pixels().iter().zip(other.pixels()));
    let squares: f64 = pairs().map(|(a, b)| f64::from((*a - *b).length_squared())).sum();
    let sum: f64 = pairs().map(|(a, b)| f64::from((*a + *b).element_sum())).sum();
    let channels = 3.0 * pairs().count().max(1) as f64;
    (0.5 * squares / channels).sqrt() / (0.5 * sum / channels)
}

/// What is drawn and differentiated.
#[derive(Clone, Copy)]
pub struct Workload<'a> {
    /// The scene, for its cameras and its background.
    pub scene: &'a Scene,
    /// Its surface.
    pub surface: &'a Surface,
    /// Maps and light.
    pub lit: &'a Parameters<f32>,
    /// Indices of the views.
    pub views: &'a [usize],
    /// Number of surface hits on the longest path.
    pub bounces: usize,
    /// Paths a pixel.
    pub samples: usize,
}

impl Workload<'_> {
    /// Paths of one round over all views.
    pub fn paths(&self) -> usize {
        let camera = |&view: &usize| &self.scene.views[view].camera;
        self.samples * self.views.iter().map(camera).map(|camera| camera.width * camera.height).sum::<usize>()
    }

    /// Pictures of all views.
    pub fn pictures(&self, seed: u64) -> Vec<RgbImage> {
        let settings = PictureSettings {
            samples: self.samples,
            max_bounces: self.bounces,
            seed,
            background_visible: self.scene.background == Background::Environment,
            ..Default::default()
        };
        let stop = AtomicBool::new(false);
        let picture = |&view: &usize| {
            render(self.surface, &self.scene.views[view].camera, self.lit, view as u32, &settings, &stop)
        };
        self.views.iter().map(picture).map(|picture| picture.radiance).collect()
    }

    /// The gradient of a squared error in all views by all maps and the light; how many pixels took part.
    pub fn gradients(&self) -> usize {
        let sampler = EnvironmentSampler::new(&self.lit.environment());
        let mut gradient = ParameterGradient {
            texels: GradientPyramid::zeros_by(&self.lit.texels),
            light: vec![[0.0; 3]; self.lit.light.len()],
        };
        let stop = AtomicBool::new(false);
        let mut done = 0;
        for &view in self.views {
            let camera = &self.scene.views[view].camera;
            let tracer = PathTracer {
                surface: self.surface,
                proposal: &self.lit.texels,
                light: &sampler,
                environment_size: self.lit.environment_size,
                settings: PathSettings {
                    max_bounces: self.bounces,
                    lobe_strength: 1.0,
                    background_visible: self.scene.background == Background::Environment,
                    two_sided: false,
                    camera_cone_radians: 0.0,
                    bounce_cone_radians: 0.0,
                },
            };
            let rays = CameraRays::fresh(self.surface, camera, PixelFilter::Box, self.samples);
            let pixels: Vec<u32> = (0..(camera.width * camera.height) as u32).collect();
            let key = PassKey::halves(1, 0, view as u32);
            done +=
                accumulate(&tracer, &rays, &pixels, key, self.lit, &AgainstGrey, &mut gradient, &stop).pixels as usize;
        }
        done
    }
}

/// The squared error against a grey photo.
struct AgainstGrey;

impl PixelLoss<f32> for AgainstGrey {
    fn at(&self, _: usize, estimate: &PixelEstimate<f32>) -> Option<PixelDerivative<f32>> {
        let difference = |value: [f32; 3]| value.map(|value| value - 0.25);
        let (a, b) = (difference(estimate.first), difference(estimate.second));
        Some(PixelDerivative { loss: (0..3).map(|c| a[c] * b[c]).sum(), d_first: b, d_second: a })
    }
}
