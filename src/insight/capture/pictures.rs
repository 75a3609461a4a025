//! Photos beside the fitted model's pictures, small enough that all of it takes a few seconds.

use crate::fit::settings::BackgroundEvidence;
use crate::fit::targets::Target;
use crate::fit::{Fitter, ViewUse};
use crate::image::{GreyImage, Image, RgbImage};
use crate::math::statistics::quantile;
use crate::math::{evenly_spread, luminance, parallel};
use crate::render::picture::{Picture, PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::{Background, Camera, PixelState, Scene};
use glam::{Vec2, Vec3};
use std::sync::atomic::{AtomicBool, Ordering};

/// Views that are looked at, at most.
const MOST_VIEWS: usize = 24;
/// Pixels of all of them together, at most.
const MOST_PIXELS: usize = 400_000;
/// Paths of all of them together, about.
const PATHS: usize = 3_200_000;
/// Fewest and most paths of a pixel in each of its two pictures.
const PATHS_OF_PIXEL: (usize, usize) = (4, 16);
/// A pixel without a surface has this distance.
pub const NO_SURFACE: f32 = f32::INFINITY;

/// A photo and the model's picture of it, at one reduced size.
pub struct Compared {
    /// Index of the view in the scene.
    pub view: usize,
    /// The camera of the reduced size.
    pub camera: Camera,
    /// Pixels of the photo along one pixel here.
    pub photo_pixels: f64,
    /// The photo, linear radiance.
    pub photo: RgbImage,
    /// The model's picture, times the view's fitted gain, twice with independent noise.
    pub halves: [RgbImage; 2],
    /// What the photo's pixels are evidence for; clipped pixels of any kind are ignored ones here.
    pub states: Image<PixelState>,
    /// Share of each pixel that the surface covers, in [0, 1].
    pub coverage: GreyImage,
    /// Distance of the surface along the ray through each pixel's centre, in world units.
    pub distance: GreyImage,
    /// Whether the photo has a mask: some pixel of it is background.
    pub has_mask: bool,
}

impl Compared {
    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.camera.width, self.camera.height)
    }

    /// The model's picture.
    pub fn model(&self) -> RgbImage {
        mean_of(&self.halves)
    }

    /// Whether a pixel and its eight neighbours are all surface, or all background.
    pub fn is_inside(&self, row: usize, column: usize, surface: bool) -> bool {
        let (width, height) = self.size();
        (row.saturating_sub(1)..(row + 2).min(height)).all(|row| {
            (column.saturating_sub(1)..(column + 2).min(width)).all(|column| {
                let coverage = self.coverage[(row, column)];
                if surface { coverage >= 0.999 } else { coverage <= 0.001 }
            })
        })
    }
}

/// All that is compared, and what holds for every view.
pub struct Comparison {
    /// By view, in the order of the scene.
    pub views: Vec<Compared>,
    /// Median luminance of the photos' surface pixels: the unit in which radiance is bright or dark.
    pub level: f32,
    /// Whether pixels without surface can be compared: a background that the model knows.
    pub background_known: bool,
}

/// Renders views of a fit, evenly spread over those that were fitted to: where they did not look, the model
/// knows nothing, and held-out views would be blamed for that. `None` when `stop` was raised or there is
/// nothing to look at.
pub fn compare(fitter: &Fitter, stop: &AtomicBool) -> Option<Comparison> {
    let (scene, surface) = (fitter.scene().as_ref(), fitter.surface().as_ref());
    let parameters = fitter.parameters();
    let chosen = spread(fitter.view_uses());
    let most_pixels = MOST_PIXELS / chosen.len().max(1);
    let targets: Vec<Target> = parallel::map_items(&chosen, |&view| {
        Target::new(scene, view, scene.views[view].camera.level_within(most_pixels))
    });
    let pixels: usize = targets.iter().map(Target::pixel_count).sum();
    let samples = (PATHS / (2 * pixels).max(1)).clamp(PATHS_OF_PIXEL.0, PATHS_OF_PIXEL.1);
    let settings = PictureSettings {
        samples,
        max_bounces: fitter.settings().bounces,
        filter: fitter.settings().pixel_filter,
        background_visible: scene.background == Background::Environment,
        lobe_strength: if fitter.settings().has_lobe() { 1.0 } else { 0.0 },
        two_sided: true,
        seed: fitter.settings().seed ^ 0xca97,
        ..Default::default()
    };
    let views: Vec<Compared> = targets
        .iter()
        .map(|target| {
            let gain = fitter.state().log_gains.get(target.view).map_or(1.0, |log| log.exp());
            compared(scene, surface, &parameters, target, gain, &settings, stop)
        })
        .collect();
    if views.is_empty() || stop.load(Ordering::Relaxed) {
        return None;
    }
    let background_known = match scene.background {
        Background::Black => true,
        Background::Environment => fitter.settings().background == BackgroundEvidence::Use,
    };
    let level = level_of(&views);
    Some(Comparison { views, level, background_known })
}

/// The mean of two pictures of one size.
pub fn mean_of([first, second]: &[RgbImage; 2]) -> RgbImage {
    Image::from_fn(first.width(), first.height(), |row, column| 0.5 * (first[(row, column)] + second[(row, column)]))
}

/// Indices of at most [`MOST_VIEWS`] views, evenly spread over those that were fitted to.
fn spread(uses: &[ViewUse]) -> Vec<usize> {
    let used: Vec<usize> = (0..uses.len()).filter(|&view| uses[view] == ViewUse::Training).collect();
    evenly_spread(&used, MOST_VIEWS)
}

fn compared(
    scene: &Scene,
    surface: &Surface,
    parameters: &Parameters<f32>,
    target: &Target,
    gain: f32,
    settings: &PictureSettings,
    stop: &AtomicBool,
) -> Compared {
    let camera = target.camera;
    let drawn: [Picture; 2] = [0, 0x1a1f].map(|other| {
        let settings = PictureSettings { seed: settings.seed ^ other, ..*settings };
        render(surface, &camera, parameters, target.view as u32, &settings, stop)
    });
    let (width, height) = (camera.width, camera.height);
    let at = |row: usize, column: usize| target.at(scene, row * width + column);
    let own = &scene.views[target.view];
    let coverage = Image::from_fn(width, height, |row, column| {
        0.5 * (drawn[0].coverage[(row, column)] + drawn[1].coverage[(row, column)])
    });
    let distance = |row: usize, column: usize| {
        let place = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
        surface.closest(&camera.ray_through(place)).map_or(NO_SURFACE, |hit| hit.t)
    };
    let centres = parallel::map_small(width * height, |pixel| distance(pixel / width, pixel % width));
    Compared {
        view: target.view,
        photo_pixels: own.camera.width as f64 / width as f64,
        photo: Image::from_fn(width, height, |row, column| at(row, column).0),
        states: Image::from_fn(width, height, |row, column| match at(row, column).1 {
            state if state.is_clipped() => PixelState::Ignored,
            state => state,
        }),
        halves: drawn.map(|picture| picture.radiance.map(|&radiance| radiance * gain)),
        coverage,
        distance: Image::from_pixels(width, height, centres),
        has_mask: own.has_mask(),
        camera,
    }
}

fn level_of(views: &[Compared]) -> f32 {
    let mut values = Vec::new();
    for own in views {
        for (index, &photo) in own.photo.pixels().iter().enumerate().step_by(3) {
            if own.coverage.pixels()[index] >= 0.999 && own.states.pixels()[index] != PixelState::Ignored {
                values.push(f64::from(luminance(photo)));
            }
        }
    }
    let level = quantile(&values, 0.5) as f32;
    if level.is_finite() && level > 0.0 { level } else { 1.0 }
}

/// Radiance brought into [0, 1): `x / (x + level)`. Suns and highlights of any brightness then weigh like white paper.
pub fn compressed(picture: &RgbImage, level: f32) -> RgbImage {
    picture.map(|&radiance| {
        let radiance = radiance.max(Vec3::ZERO);
        let value = radiance / (radiance + level);
        if value.is_finite() { value } else { Vec3::ONE }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_spread_evenly_and_left_out_ones_stay_out() {
        let mut uses = vec![ViewUse::Training; 100];
        uses[0] = ViewUse::LeftOut;
        let chosen = spread(&uses);
        assert_eq!(chosen.len(), MOST_VIEWS);
        assert!(chosen[0] == 1 && chosen.windows(2).all(|pair| (4..=5).contains(&(pair[1] - pair[0]))));
        assert_eq!(spread(&uses[..3]), [1, 2]);
        assert!(spread(&uses[..1]).is_empty());
    }
}
