//! One photo of an object: radiance, which pixels show the object, and what each channel is evidence for.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::{Image, RgbImage, file, transfer};
use glam::Vec3;
use std::path::Path;

/// Bytes from here on are clipped: cameras and JPEG move a saturated 255 by one.
const CLIPPED_BYTE: u8 = 254;

/// What one channel of one pixel says of the radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Evidence {
    /// It is the radiance.
    #[default]
    Equal,
    /// The radiance is at least this: the channel is saturated.
    AtLeast,
    /// The radiance is at most this: the channel is black.
    AtMost,
}

/// A photo of an object in linear radiance.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectPhoto {
    /// Short name, for messages.
    pub name: String,
    /// Linear RGB, finite and at least 0.
    pub radiance: RgbImage,
    /// Which pixels may show the object; geometry has its own say.
    pub is_object: Image<bool>,
    /// A channel at or above this is saturated; infinite when nothing saturates.
    pub clip: f32,
    /// A channel at or below this is black: all that is known is that it is not above it.
    pub floor: f32,
}

impl ObjectPhoto {
    /// A photo of linear radiance. Values that are not finite leave their pixel out, negative ones count as 0; both are
    /// told by a finding.
    ///
    /// # Errors
    /// `InvalidScene` without pixels, `NonFinite` without a finite pixel.
    pub fn new(name: &str, radiance: RgbImage, clip: f32, floor: f32) -> Result<(Self, Vec<Finding>)> {
        let place = || Place::View(name.into());
        if radiance.pixels().is_empty() {
            return Err(Error::new(ErrorKind::InvalidScene, "the photo has no pixels").at(place()));
        }
        let mut findings = Vec::new();
        let is_object = radiance.map(|pixel| pixel.is_finite());
        let lost = is_object.pixels().iter().filter(|&&kept| !kept).count();
        if lost == radiance.pixels().len() {
            return Err(Error::new(ErrorKind::NonFinite, "no pixel of the photo is finite")
                .at(place())
                .remedy("export the photo again"));
        }
        if lost > 0 {
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "photo-not-finite",
                    format!("{lost} pixels are not finite and are left out"),
                )
                .at(place())
                .remedy("render or export the photo again if they matter"),
            );
        }
        let negative = radiance.pixels().iter().filter(|pixel| pixel.is_finite() && pixel.min_element() < 0.0).count();
        if negative > 0 {
            let message = format!("{negative} pixels are negative: they are set to 0");
            findings.push(Finding::new(Severity::Note, "photo-negative", message).at(place()));
        }
        let radiance = radiance.map(|pixel| if pixel.is_finite() { pixel.max(Vec3::ZERO) } else { Vec3::ZERO });
        Ok((ObjectPhoto { name: name.into(), radiance, is_object, clip, floor: floor.max(0.0) }, findings))
    }

    /// Reads a photo: EXR, HDR and PFM as stored, PNG and JPEG decoded from sRGB with their clipped and black bytes as
    /// bounds.
    ///
    /// # Errors
    /// Those of [`file::read_rgb`] and of [`ObjectPhoto::new`].
    pub fn read(path: &Path) -> Result<(Self, Vec<Finding>)> {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let linear = file::read_header(path)?.is_linear;
        let radiance = file::read_rgb(path)?;
        if linear {
            return ObjectPhoto::new(&name, radiance, f32::INFINITY, 0.0);
        }
        ObjectPhoto::new(&name, radiance, clip_of_bytes(), floor_of_bytes())
    }

    /// The photo as an 8-bit camera would have kept it: sRGB bytes after an exposure factor, decoded again and divided
    /// by that factor.
    pub fn as_bytes(&self, exposure: f32) -> Self {
        let round = |value: f32| {
            transfer::linear_from_srgb(f32::from(transfer::srgb8_from_linear_value(value * exposure)) / 255.0)
                / exposure
        };
        let radiance = self.radiance.map(|pixel| Vec3::new(round(pixel.x), round(pixel.y), round(pixel.z)));
        ObjectPhoto { radiance, clip: clip_of_bytes() / exposure, floor: floor_of_bytes() / exposure, ..self.clone() }
    }

    /// Keeps the pixels that the mask marks: 0.5 and above is object.
    ///
    /// # Errors
    /// `InvalidScene` when the sizes differ or when nothing is left.
    pub fn apply_mask(&mut self, mask: &Image<f32>, place: Place) -> Result<()> {
        let size = (self.radiance.width(), self.radiance.height());
        if (mask.width(), mask.height()) != size {
            let message =
                format!("the mask is {} x {} but the photo is {} x {}", mask.width(), mask.height(), size.0, size.1);
            return Err(Error::new(ErrorKind::InvalidScene, message)
                .at(place)
                .remedy("make the mask in the size of the photo"));
        }
        for (kept, value) in self.is_object.pixels_mut().iter_mut().zip(mask.pixels()) {
            *kept &= *value >= 0.5;
        }
        if !self.is_object.pixels().contains(&true) {
            return Err(Error::new(ErrorKind::InvalidScene, "the mask marks no pixel of the photo as object")
                .at(place)
                .remedy("255 is object: make the mask again"));
        }
        Ok(())
    }

    /// What a channel of this value is evidence for.
    pub fn evidence(&self, value: f32) -> Evidence {
        if value >= self.clip {
            Evidence::AtLeast
        } else if value <= self.floor {
            Evidence::AtMost
        } else {
            Evidence::Equal
        }
    }
}

/// Linear value from which an sRGB byte counts as saturated.
fn clip_of_bytes() -> f32 {
    transfer::linear_from_srgb((f32::from(CLIPPED_BYTE) - 0.5) / 255.0)
}

/// Largest linear value that an sRGB byte of 0 can stand for.
fn floor_of_bytes() -> f32 {
    transfer::linear_from_srgb(0.5 / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_bound_what_they_cannot_hold() {
        let pixels = vec![Vec3::splat(3.0), Vec3::splat(1e-6), Vec3::splat(0.4), Vec3::new(f32::NAN, 0.0, 0.0)];
        let (photo, findings) = ObjectPhoto::new("a", Image::from_pixels(4, 1, pixels), f32::INFINITY, 0.0).unwrap();
        assert_eq!(findings.len(), 1);
        assert_eq!(photo.is_object.pixels(), [true, true, true, false]);
        let bytes = photo.as_bytes(1.0);
        let evidence: Vec<_> = bytes.radiance.pixels()[..3].iter().map(|pixel| bytes.evidence(pixel.x)).collect();
        assert_eq!(evidence, [Evidence::AtLeast, Evidence::AtMost, Evidence::Equal]);
        assert!((bytes.radiance[(0, 2)].x - 0.4).abs() < 2e-3);
    }

    #[test]
    fn masks_of_another_size_or_without_object_are_refused() {
        let (mut photo, _) = ObjectPhoto::new("a", Image::filled(4, 3, Vec3::ONE), f32::INFINITY, 0.0).unwrap();
        let place = || Place::View("a".into());
        assert!(photo.apply_mask(&Image::filled(3, 4, 1.0), place()).is_err());
        assert!(photo.clone().apply_mask(&Image::filled(4, 3, 0.0), place()).is_err());
        photo.apply_mask(&Image::from_fn(4, 3, |row, _| if row == 0 { 1.0 } else { 0.0 }), place()).unwrap();
        assert_eq!(photo.is_object.pixels().iter().filter(|&&kept| kept).count(), 4);
    }
}
