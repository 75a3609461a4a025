//! Stand-in for image files.
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{GreyImage, Image, RgbImage};
use glam::Vec3;
use std::path::Path;

pub fn read_rgb(path: &Path) -> Result<RgbImage> {
    if !path.exists() {
        return Err(Error::reading(path, std::io::ErrorKind::NotFound.into()));
    }
    let image = image::open(path)
        .map_err(|e| Error::new(ErrorKind::Malformed, e.to_string()).at(Place::File(path.into())))?
        .into_rgb32f();
    let (width, height) = (image.width() as usize, image.height() as usize);
    Ok(Image::from_pixels(width, height, image.pixels().map(|p| Vec3::from_array(p.0)).collect()))
}
pub fn read_grey(path: &Path) -> Result<GreyImage> {
    Ok(read_rgb(path)?.map(|p| p.x))
}
pub fn write_exr_rgb(path: &Path, image: &RgbImage) -> Result<()> {
    exr::prelude::write_rgb_file(path, image.width(), image.height(), |x, y| {
        let p = image[(y, x)];
        (p.x, p.y, p.z)
    })
    .map_err(|e| Error::new(ErrorKind::Unwritable, e.to_string()).at(Place::File(path.into())))
}
pub fn write_exr_grey(path: &Path, image: &GreyImage) -> Result<()> {
    write_exr_rgb(path, &image.map(|&v| Vec3::splat(v)))
}
pub fn encode_png_srgb8(image: &Image<[u8; 3]>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let flat: Vec<u8> = image.pixels().iter().flatten().copied().collect();
    let _ = image::ImageEncoder::write_image(
        encoder,
        &flat,
        image.width() as u32,
        image.height() as u32,
        image::ExtendedColorType::Rgb8,
    );
    bytes
}
pub fn encode_jpeg(image: &Image<[u8; 3]>, quality: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let flat: Vec<u8> = image.pixels().iter().flatten().copied().collect();
    let _ = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality).encode(
        &flat,
        image.width() as u32,
        image.height() as u32,
        image::ExtendedColorType::Rgb8,
    );
    bytes
}
pub fn ssim(a: &RgbImage, b: &RgbImage, counted: &Image<bool>) -> f64 {
    let mut sum = 0.0;
    let mut n = 0.0;
    for ((a, b), _) in a.pixels().iter().zip(b.pixels()).zip(counted.pixels()).filter(|(_, c)| **c) {
        let (x, y) = (f64::from(a.x), f64::from(b.x));
        sum += (2.0 * x * y + 1e-4) / (x * x + y * y + 1e-4);
        n += 1.0;
    }
    sum / n
}
