//! The pixels that a fit uses, out of one photo or several: what was measured, and what each pixel sees.

use super::geometry::{ObjectGeometry, ObjectPixel, Visibility};
use super::photo::{Evidence, ObjectPhoto};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::math::random::SequentialRandom;

/// With fewer pixels of known radiance no fit is tried.
pub const FEWEST_PIXELS: usize = 8;
/// With fewer the result is warned of.
const FEW_PIXELS: usize = 200;

/// One photo with the geometry that was photographed.
#[derive(Clone, Debug)]
pub struct ObjectView {
    /// The photo.
    pub photo: ObjectPhoto,
    /// What its pixels see.
    pub geometry: ObjectGeometry,
}

impl ObjectView {
    /// Joins photo and geometry; the geometry keeps the pixels that the photo's mask allows.
    ///
    /// # Errors
    /// `InvalidScene` when their sizes differ or no pixel is left.
    pub fn new(photo: ObjectPhoto, mut geometry: ObjectGeometry) -> Result<Self> {
        let size = (photo.radiance.width(), photo.radiance.height());
        if size != (geometry.width, geometry.height) {
            let message = format!(
                "the photo is {} x {} but its camera or normals are for {} x {}",
                size.0, size.1, geometry.width, geometry.height
            );
            return Err(Error::new(ErrorKind::InvalidScene, message)
                .at(Place::View(photo.name.clone()))
                .remedy("use the photo that they were made for"));
        }
        let is_shown = |pixel: &ObjectPixel| photo.is_object[(pixel.row as usize, pixel.column as usize)];
        geometry.pixels.retain(is_shown);
        geometry.grazing.retain(is_shown);
        if geometry.pixels.is_empty() {
            return Err(Error::new(ErrorKind::InvalidScene, "no pixel of the photo shows the object")
                .at(Place::View(photo.name.clone()))
                .remedy("check mesh, camera and mask: `patina check` draws the outline over the photo"));
        }
        Ok(ObjectView { photo, geometry })
    }
}

/// The pixels of a fit.
#[derive(Clone, Debug)]
pub struct Observations {
    /// What each pixel sees.
    pub pixels: Vec<ObjectPixel>,
    /// Linear radiance of each.
    pub measured: Vec<[f32; 3]>,
    /// What each channel is evidence for.
    pub evidence: Vec<[Evidence; 3]>,
    /// Which texels light each; `None` when shadows are left out or nothing shadows.
    pub visibility: Option<Visibility>,
    /// Median over pixels of known radiance of the mean over channels: the exposure of the photos.
    pub exposure: f64,
}

impl Observations {
    /// Takes about `most` pixels of all views together, as many of each, spread over each photo and drawn by `seed`, and
    /// traces their
    /// shadow rays to a `light_width x light_height` environment unless `shadows` is off.
    ///
    /// # Errors
    /// `InvalidScene` with fewer than [`FEWEST_PIXELS`] pixels, or when all are black or saturated.
    pub fn gather(
        views: &[ObjectView],
        most: usize,
        light_size: (usize, usize),
        shadows: bool,
        seed: u64,
    ) -> Result<(Self, Vec<Finding>)> {
        let total: usize = views.iter().map(|view| view.geometry.pixels.len()).sum();
        let mut findings = Vec::new();
        if total < FEWEST_PIXELS {
            let message = format!("only {total} pixels show the object: nothing can be estimated of so few");
            return Err(
                Error::new(ErrorKind::InvalidScene, message).remedy("check the mask, or photograph the object larger")
            );
        }
        if total < FEW_PIXELS {
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "object-few-pixels",
                    format!("only {total} pixels show the object: light and reflectance are little more than priors"),
                )
                .remedy("photograph the object larger"),
            );
        }
        let mut random = SequentialRandom::new(seed);
        let mut gathered = Observations {
            pixels: Vec::new(),
            measured: Vec::new(),
            evidence: Vec::new(),
            visibility: None,
            exposure: 0.0,
        };
        let mut bits = Vec::new();
        for view in views {
            let own = view.geometry.pixels.len();
            let share = if total <= most { own } else { (own * most).div_ceil(total).min(own) };
            // One pixel of each of `share` strata in row-major order.
            let chosen: Vec<ObjectPixel> = (0..share)
                .map(|stratum| {
                    let (begin, end) = (stratum * own / share, (stratum + 1) * own / share);
                    view.geometry.pixels[begin + random.below((end - begin).max(1))]
                })
                .collect();
            for pixel in &chosen {
                let value = view.photo.radiance[(pixel.row as usize, pixel.column as usize)].to_array();
                gathered.measured.push(value);
                gathered.evidence.push(value.map(|channel| view.photo.evidence(channel)));
            }
            if shadows {
                bits.push(view.geometry.visibility(&chosen, light_size.0, light_size.1).ok_or(chosen.len()));
            }
            gathered.pixels.extend(chosen);
        }
        if bits.iter().any(std::result::Result::is_ok) {
            let texels = light_size.0 * light_size.1;
            let parts = bits.into_iter().map(|part| part.unwrap_or_else(|pixels| Visibility::open(pixels, texels)));
            gathered.visibility = Visibility::joined(parts.collect());
        }
        gathered.measure_exposure(&mut findings)?;
        Ok((gathered, findings))
    }

    fn measure_exposure(&mut self, findings: &mut Vec<Finding>) -> Result<()> {
        let known = |evidence: &[Evidence; 3]| evidence.iter().all(|channel| *channel == Evidence::Equal);
        let mut levels: Vec<f64> = self
            .measured
            .iter()
            .zip(&self.evidence)
            .filter(|(_, evidence)| known(evidence))
            .map(|(value, _)| value.iter().map(|&channel| f64::from(channel)).sum::<f64>() / 3.0)
            .collect();
        if levels.len() < FEWEST_PIXELS {
            let message = format!("only {} pixels are neither black nor saturated", levels.len());
            return Err(Error::new(ErrorKind::InvalidScene, message).remedy("expose the photo otherwise"));
        }
        levels.sort_by(f64::total_cmp);
        self.exposure = levels[levels.len() / 2];
        let saturated = self.evidence.iter().filter(|channels| channels.contains(&Evidence::AtLeast)).count();
        let black = self.evidence.iter().filter(|channels| channels.contains(&Evidence::AtMost)).count();
        for (count, code, what, meaning) in [
            (saturated, "photo-saturated", "saturated", "they only bound the radiance from below"),
            (black, "photo-black", "black", "they only bound the radiance from above"),
        ] {
            if count > 0 {
                let message = format!("{count} of {} pixels are {what}: {meaning}", self.evidence.len());
                findings.push(Finding::new(Severity::Note, code, message));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use glam::Vec3;

    fn sphere(value: impl FnMut(usize, usize) -> Vec3) -> ObjectView {
        let (photo, _) = ObjectPhoto::new("a", Image::from_fn(48, 48, value), 10.0, 0.0).unwrap();
        ObjectView::new(photo, ObjectGeometry::sphere(48, 48, 24.0)).unwrap()
    }

    #[test]
    fn pixels_are_spread_and_the_same_for_a_seed() {
        let view = sphere(|row, _| Vec3::splat(0.1 + row as f32));
        let gather = |seed| Observations::gather(std::slice::from_ref(&view), 100, (32, 16), true, seed).unwrap().0;
        let (first, again, other) = (gather(1), gather(1), gather(2));
        assert_eq!((first.pixels.len(), first.visibility.is_none()), (100, true));
        assert_eq!(first.pixels, again.pixels);
        assert_ne!(first.pixels, other.pixels);
        let upper = first.pixels.iter().filter(|pixel| pixel.row < 24).count();
        assert!((45..=55).contains(&upper), "{upper}");
    }

    #[test]
    fn three_pixels_are_an_error_and_few_a_warning() {
        let mut view = sphere(|_, _| Vec3::ONE);
        let gather = |view: &ObjectView| Observations::gather(std::slice::from_ref(view), 100, (32, 16), true, 1);
        view.geometry.pixels.truncate(50);
        assert_eq!(gather(&view).unwrap().1[0].code, "object-few-pixels");
        view.geometry.pixels.truncate(3);
        assert!(gather(&view).unwrap_err().message().contains("only 3 pixels"));
        let black = sphere(|_, _| Vec3::ZERO);
        assert!(gather(&black).unwrap_err().message().contains("neither black nor saturated"));
    }
}
