//! The pixels of a photograph, kept as compact as they came.

pub use crate::image::transfer::linear_from_srgb8;
use crate::image::{Image, RgbImage};
use glam::Vec3;
use half::f16;

/// A photograph. Eight-bit files stay eight-bit, so that a thousand views fit in memory.
#[derive(Clone, Debug, PartialEq)]
pub enum Photo {
    /// sRGB-encoded bytes.
    Srgb8(Image<[u8; 3]>),
    /// Linear radiance in half precision, each the mean of several pixels of sRGB-encoded bytes, or made of bytes of another
    /// colour space.
    MeanOfSrgb8(Image<[f16; 3]>),
    /// Linear radiance in half precision, finite.
    Linear16(Image<[f16; 3]>),
    /// Linear radiance, finite.
    Linear32(RgbImage),
}

/// What a pixel is evidence for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::NoUninit)]
#[repr(u8)]
pub enum PixelState {
    /// The surface, and its radiance is known.
    #[default]
    Surface = 0,
    /// The background, and its radiance is known.
    Background = 1,
    /// The surface; some channel is clipped: the radiance is at least what the photo says.
    SurfaceClipped = 2,
    /// The background, clipped.
    BackgroundClipped = 3,
    /// Nothing: masked by the user, outside the undistorted picture, not finite.
    Ignored = 4,
}

impl PixelState {
    /// Whether some channel is clipped.
    pub fn is_clipped(self) -> bool {
        matches!(self, PixelState::SurfaceClipped | PixelState::BackgroundClipped)
    }

    /// Whether the mask says background.
    pub fn is_background(self) -> bool {
        matches!(self, PixelState::Background | PixelState::BackgroundClipped)
    }

    /// Whether the mask says surface. Without a mask every pixel does, and rays decide.
    pub fn is_surface(self) -> bool {
        matches!(self, PixelState::Surface | PixelState::SurfaceClipped)
    }
}

impl Photo {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        match self {
            Photo::Srgb8(image) => image.width(),
            Photo::MeanOfSrgb8(image) | Photo::Linear16(image) => image.width(),
            Photo::Linear32(image) => image.width(),
        }
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        match self {
            Photo::Srgb8(image) => image.height(),
            Photo::MeanOfSrgb8(image) | Photo::Linear16(image) => image.height(),
            Photo::Linear32(image) => image.height(),
        }
    }

    /// Whether its file holds linear radiance, as renderers write it, and not the eight bits of a camera.
    pub fn is_linear(&self) -> bool {
        !matches!(self, Photo::Srgb8(_) | Photo::MeanOfSrgb8(_))
    }

    /// Linear radiance of a pixel.
    pub fn radiance(&self, row: usize, column: usize) -> Vec3 {
        match self {
            Photo::Srgb8(image) => linear_from_srgb8(image[(row, column)]),
            Photo::MeanOfSrgb8(image) | Photo::Linear16(image) => {
                Vec3::from_array(image[(row, column)].map(f16::to_f32))
            }
            Photo::Linear32(image) => image[(row, column)],
        }
    }

    /// The whole photograph in linear radiance.
    pub fn to_linear(&self) -> RgbImage {
        Image::from_fn(self.width(), self.height(), |row, column| self.radiance(row, column))
    }
}
