//! The photographs at the resolution of a stage.

use crate::image::Image;
use crate::scene::{Camera, PixelState, Scene, View};
use glam::Vec3;
use rayon::prelude::*;

/// A photograph at the resolution of a stage.
#[derive(Clone, Debug)]
pub struct Target {
    /// Index of the view in the scene.
    pub view: usize,
    /// The camera, shrunk like the photo.
    pub camera: Camera,
    /// Shrunk pixels; `None` at full size, where the view itself is read.
    shrunk: Option<(Vec<Vec3>, Vec<PixelState>)>,
}

impl Target {
    /// The photograph of a view, shrunk by `2^level`. A shrunk pixel is evidence only if all its pixels agree on what
    /// they show; it is clipped when any of them is.
    pub fn new(scene: &Scene, view: usize, level: usize) -> Self {
        let source = &scene.views[view];
        let factor = 1usize << level;
        let factor = factor.min(source.camera.width).min(source.camera.height);
        let camera = source.camera.shrunk(factor);
        let shrunk = (factor > 1).then(|| shrink(source, &camera, factor));
        Target { view, camera, shrunk }
    }

    /// Radiance and state of a pixel, row-major.
    #[inline]
    pub fn at(&self, scene: &Scene, pixel: usize) -> (Vec3, PixelState) {
        match &self.shrunk {
            Some((radiance, states)) => (radiance[pixel], states[pixel]),
            None => {
                let view = &scene.views[self.view];
                let (row, column) = (pixel / self.camera.width, pixel % self.camera.width);
                (view.photo.radiance(row, column), view.states[(row, column)])
            }
        }
    }

    /// Number of pixels.
    pub fn pixel_count(&self) -> usize {
        self.camera.width * self.camera.height
    }
}

/// Targets of the given views, made in parallel.
pub fn targets(scene: &Scene, views: &[usize], level: usize) -> Vec<Target> {
    views.par_iter().map(|&view| Target::new(scene, view, level)).collect()
}

fn shrink(source: &View, camera: &Camera, factor: usize) -> (Vec<Vec3>, Vec<PixelState>) {
    let mut radiance = Vec::with_capacity(camera.width * camera.height);
    let mut states = Vec::with_capacity(camera.width * camera.height);
    for row in 0..camera.height {
        for column in 0..camera.width {
            let mut sum = Vec3::ZERO;
            let mut state = None;
            for i in 0..factor * factor {
                let place = (row * factor + i / factor, column * factor + i % factor);
                sum += source.photo.radiance(place.0, place.1);
                state = Some(join(state, source.states[place]));
            }
            radiance.push(sum / (factor * factor) as f32);
            states.push(state.unwrap_or_default());
        }
    }
    (radiance, states)
}

/// The state of a pixel made of several.
fn join(so_far: Option<PixelState>, next: PixelState) -> PixelState {
    use PixelState::*;
    match (so_far, next) {
        (None, state) => state,
        (Some(Surface | SurfaceClipped), SurfaceClipped) | (Some(SurfaceClipped), Surface) => SurfaceClipped,
        (Some(Background | BackgroundClipped), BackgroundClipped) | (Some(BackgroundClipped), Background) => {
            BackgroundClipped
        }
        (Some(state), next) if state == next => state,
        _ => Ignored,
    }
}

/// A picture shrunk by a whole factor, box-filtered; for showing.
pub fn shrink_picture(picture: &Image<Vec3>, factor: usize) -> Image<Vec3> {
    let factor = factor.clamp(1, picture.width().min(picture.height()).max(1));
    Image::from_fn(picture.width() / factor, picture.height() / factor, |row, column| {
        let mut sum = Vec3::ZERO;
        for i in 0..factor * factor {
            sum += picture[(row * factor + i / factor, column * factor + i % factor)];
        }
        sum / (factor * factor) as f32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrunk_pixels_agree_or_say_nothing() {
        use PixelState::*;
        let join_all = |states: &[PixelState]| states.iter().fold(None, |a, &b| Some(join(a, b))).unwrap();
        assert_eq!(join_all(&[Surface, Surface]), Surface);
        assert_eq!(join_all(&[Surface, SurfaceClipped, Surface]), SurfaceClipped);
        assert_eq!(join_all(&[Surface, Background]), Ignored);
        assert_eq!(join_all(&[BackgroundClipped, Background]), BackgroundClipped);
        assert_eq!(join_all(&[Surface, Ignored, Surface]), Ignored);
    }
}
