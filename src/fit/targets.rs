//! The photographs at the resolution of a stage.

use super::views::ViewUse;
use crate::image::Image;
use crate::math::parallel;
use crate::scene::{Camera, PixelState, Scene, View};
use glam::Vec3;

/// Pixels of a held-out view that the curve looks at.
const HELD_OUT_PIXELS: usize = 20_000;

/// A photograph at the resolution of a stage.
#[derive(Clone, Debug)]
pub struct Target {
    /// Index of the view in the scene.
    pub view: usize,
    /// The camera, shrunk like the photo.
    pub camera: Camera,
    /// Whether a mask says which pixels show surface; without one rays decide.
    pub has_mask: bool,
    /// Pixels of the photo along a side of one of these.
    factor: usize,
    /// Shrunk pixels; `None` at full size, where the view itself is read.
    shrunk: Option<Shrunk>,
}

#[derive(Clone, Debug, Default)]
struct Shrunk {
    radiance: Vec<Vec3>,
    states: Vec<PixelState>,
    /// Channels in which a pixel of the photo is clipped: there the mean is a lower bound as well.
    clipped: Vec<[bool; 3]>,
}

/// Linear radiance of an 8-bit sRGB value of 254: at and above it a channel of a clipped pixel counts as clipped.
pub const CLIPPED_RADIANCE: f32 = 0.991;

/// Beyond this a number in a photo is a defect, no radiance: its square, summed over a picture, would leave the range
/// of `f32`.
pub const LARGEST_RADIANCE: f32 = 1e12;

/// Whether all channels can be a radiance.
pub fn is_radiance(value: Vec3) -> bool {
    // Written so that NaN fails too.
    value.to_array().iter().all(|channel| channel.abs() <= LARGEST_RADIANCE)
}

/// A pixel of a photo; one that is no radiance says nothing.
fn pixel_of(view: &View, row: usize, column: usize) -> (Vec3, PixelState) {
    let radiance = view.photo.radiance(row, column);
    if is_radiance(radiance) { (radiance, view.states[(row, column)]) } else { (Vec3::ZERO, PixelState::Ignored) }
}

fn clipped_channels(radiance: Vec3, state: PixelState) -> [bool; 3] {
    radiance.to_array().map(|value| state.is_clipped() && value >= CLIPPED_RADIANCE)
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
        Target { view, camera, has_mask: source.has_mask(), factor, shrunk }
    }

    /// Radiance and state of a pixel, row-major.
    #[inline]
    pub fn at(&self, scene: &Scene, pixel: usize) -> (Vec3, PixelState) {
        match &self.shrunk {
            Some(shrunk) => (shrunk.radiance[pixel], shrunk.states[pixel]),
            None => pixel_of(&scene.views[self.view], pixel / self.camera.width, pixel % self.camera.width),
        }
    }

    /// In which channels a pixel's radiance is only known to be at least what [`Target::at`] says.
    #[inline]
    pub fn clipped_at(&self, scene: &Scene, pixel: usize) -> [bool; 3] {
        match &self.shrunk {
            Some(shrunk) => shrunk.clipped[pixel],
            None => {
                let (radiance, state) = self.at(scene, pixel);
                clipped_channels(radiance, state)
            }
        }
    }

    /// Row and column in the photo of the upper left corner of a pixel.
    pub fn place_in_photo(&self, pixel: usize) -> (usize, usize) {
        (pixel / self.camera.width * self.factor, pixel % self.camera.width * self.factor)
    }

    /// Number of pixels.
    pub fn pixel_count(&self) -> usize {
        self.camera.width * self.camera.height
    }
}

/// Targets of the given views, made in parallel.
pub fn targets(scene: &Scene, views: &[usize], level: usize) -> Vec<Target> {
    parallel::map_items(views, |&view| Target::new(scene, view, level))
}

/// The held-out views of a scene, shrunk to a size at which looking at them costs little.
pub(super) fn held_out_targets(scene: &Scene, uses: &[ViewUse]) -> Vec<Target> {
    (0..scene.views.len())
        .filter(|&view| uses[view] == ViewUse::HeldOut)
        .map(|view| Target::new(scene, view, scene.views[view].camera.level_within(HELD_OUT_PIXELS)))
        .collect()
}

fn shrink(source: &View, camera: &Camera, factor: usize) -> Shrunk {
    let mut shrunk = Shrunk::default();
    for row in 0..camera.height {
        for column in 0..camera.width {
            let mut sum = Vec3::ZERO;
            let mut state = None;
            let mut clipped = [false; 3];
            for i in 0..factor * factor {
                let place = (row * factor + i / factor, column * factor + i % factor);
                let (radiance, own) = pixel_of(source, place.0, place.1);
                sum += radiance;
                state = Some(join(state, own));
                let own = clipped_channels(radiance, own);
                clipped = std::array::from_fn(|channel| clipped[channel] || own[channel]);
            }
            shrunk.radiance.push(sum / (factor * factor) as f32);
            shrunk.states.push(state.unwrap_or_default());
            shrunk.clipped.push(clipped);
        }
    }
    shrunk
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
