//! How a picture is compared with a photograph.
//!
//! A pixel counts when the mask and the rays say surface, it is not clipped, and both sides are finite: background and
//! clipped pixels would reward or punish what a fit cannot know. RMSE is taken on linear radiance; PSNR and SSIM on
//! sRGB-encoded values clamped to [0, 1], as they are printed elsewhere. The scale-aligned twins multiply the picture,
//! channel by channel, by the factor that brings it nearest to the photograph in linear least squares. The noise of our own
//! path tracer is taken off all of them ([`score_halves`]).

use crate::error::{Error, ErrorKind, Result};
use crate::image::{Image, RgbImage, metrics, transfer};
use crate::scene::PixelState;
use glam::Vec3;

/// Scores of one picture. NaN when no pixel counts; PSNR is infinite for equal pictures.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PictureScore {
    /// Root of the mean squared difference of linear radiance, over pixels and channels.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub rmse_linear: f64,
    /// `-10 log10(mean squared difference)` of sRGB-encoded values in [0, 1], in decibels.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub psnr_srgb_db: f64,
    /// Structural similarity (Wang et al. 2004) of the luminance of sRGB-encoded values, mean over counted pixels;
    /// 1 is equal. Pixels that do not count are taken as equal where a window reaches them.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub ssim_srgb: f64,
}

impl PictureScore {
    /// The score of nothing.
    pub const NONE: PictureScore = PictureScore { rmse_linear: f64::NAN, psnr_srgb_db: f64::NAN, ssim_srgb: f64::NAN };
}

/// Sums that give the best scale of one picture, of many together, and the error after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AlignmentSums {
    /// Number of pixels that count.
    pub pixels: u64,
    /// Sum of squares of the photograph, per channel.
    pub photo_squared: [f64; 3],
    /// Sum of squares of the picture, per channel.
    pub picture_squared: [f64; 3],
    /// Sum of products, per channel.
    pub product: [f64; 3],
    /// Sum of squared differences over all channels, before alignment.
    pub squared_difference: f64,
}

impl AlignmentSums {
    /// The sums over the counted pixels of one picture, given as two halves with independent noise: products of the two
    /// have no noise in their mean, where squares of one would. A picture without noise is its own half.
    pub fn of(photo: &RgbImage, halves: [&RgbImage; 2], counted: &Image<bool>) -> Self {
        let mut sums = AlignmentSums::default();
        for (index, _) in counted.pixels().iter().enumerate().filter(|(_, counted)| **counted) {
            sums.pixels += 1;
            let photo = photo.pixels()[index].as_dvec3().to_array();
            let [first, second] = halves.map(|half| half.pixels()[index].as_dvec3().to_array());
            for channel in 0..3 {
                let (y, a, b) = (photo[channel], first[channel], second[channel]);
                sums.photo_squared[channel] += y * y;
                sums.picture_squared[channel] += a * b;
                sums.product[channel] += 0.5 * (a + b) * y;
                sums.squared_difference += (a - y) * (b - y);
            }
        }
        sums
    }

    /// The sums of a picture whose pixels have this variance, estimated from groups of paths: the expected square of a
    /// mean of paths is too large by it. `None` takes nothing off.
    pub fn without_variance(
        photo: &RgbImage,
        picture: &RgbImage,
        variance: Option<&RgbImage>,
        counted: &Image<bool>,
    ) -> Self {
        let mut sums = AlignmentSums::of(photo, [picture, picture], counted);
        let variances = variance.into_iter().flat_map(|variance| variance.pixels().iter().zip(counted.pixels()));
        for (variance, _) in variances.filter(|(_, counted)| **counted) {
            for channel in 0..3 {
                sums.picture_squared[channel] -= f64::from(variance[channel]);
                sums.squared_difference -= f64::from(variance[channel]);
            }
        }
        sums
    }

    /// Adds the sums of another picture.
    pub fn add(&mut self, other: &AlignmentSums) {
        self.pixels += other.pixels;
        self.squared_difference += other.squared_difference;
        for channel in 0..3 {
            self.photo_squared[channel] += other.photo_squared[channel];
            self.picture_squared[channel] += other.picture_squared[channel];
            self.product[channel] += other.product[channel];
        }
    }

    /// The factor per channel that brings the pictures nearest to the photographs: `sum xy / sum xx`.
    /// 1 for a channel that is black or points the other way.
    pub fn scale(&self) -> [f64; 3] {
        std::array::from_fn(|channel| {
            let scale = self.product[channel] / self.picture_squared[channel];
            if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }
        })
    }

    /// Linear RMSE before alignment; NaN when no pixel counts, 0 when noise was all there was.
    pub fn rmse(&self) -> f64 {
        (self.squared_difference.max(0.0) / (3 * self.pixels) as f64).sqrt()
    }

    /// Linear RMSE after multiplying the pictures by `scale`; NaN when no pixel counts.
    pub fn rmse_at(&self, scale: [f64; 3]) -> f64 {
        let sum: f64 = (0..3)
            .map(|c| {
                let s = scale[c];
                (self.photo_squared[c] - 2.0 * s * self.product[c] + s * s * self.picture_squared[c]).max(0.0)
            })
            .sum();
        (sum / (3 * self.pixels) as f64).sqrt()
    }
}

/// What is found on one view.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ViewScores {
    /// As rendered.
    pub raw: PictureScore,
    /// After multiplying the picture by `scale`.
    pub aligned: PictureScore,
    /// The factor per channel of `aligned`: the best one of this view alone.
    pub scale: [f64; 3],
    /// Share in [0, 1] of the surface pixels that are clipped, and so left out.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub clipped_share: f64,
    /// Surface pixels left out because the picture or the photograph is not finite there.
    pub non_finite_pixels: u64,
    /// The sums behind the RMSE, to score many views together.
    pub sums: AlignmentSums,
}

/// Which pixels count: surface by the mask and by the rays, not clipped. Without `coverage` the mask alone decides.
pub fn counted_pixels(states: &Image<PixelState>, coverage: Option<&Image<bool>>) -> Image<bool> {
    Image::from_fn(states.width(), states.height(), |row, column| {
        let state = states[(row, column)];
        state.is_surface() && !state.is_clipped() && coverage.is_none_or(|coverage| coverage[(row, column)])
    })
}

/// Scores a picture against a photograph, both linear.
///
/// `coverage` says where rays hit the surface. `exposure_stops` multiplies both sides by `2^stops` before sRGB encoding
/// (PSNR, SSIM): 0 for 8-bit photographs.
///
/// # Errors
/// `InvalidScene` when the sizes differ.
pub fn score_view(
    photo: &RgbImage,
    picture: &RgbImage,
    states: &Image<PixelState>,
    coverage: Option<&Image<bool>>,
    exposure_stops: f32,
) -> Result<ViewScores> {
    score_halves(photo, [picture, picture], states, coverage, exposure_stops)
}

/// Scores a path-traced picture as [`score_view`] would without its noise: it is given as two halves with independent
/// noise, whose mean is the picture. Without this a picture of few paths under a strong sun is scored by its noise.
///
/// # Errors
/// `InvalidScene` when the sizes differ.
pub fn score_halves(
    photo: &RgbImage,
    halves: [&RgbImage; 2],
    states: &Image<PixelState>,
    coverage: Option<&Image<bool>>,
    exposure_stops: f32,
) -> Result<ViewScores> {
    let size = (photo.width(), photo.height());
    let sizes = [
        ("picture", halves[0].width(), halves[0].height()),
        ("second half of the picture", halves[1].width(), halves[1].height()),
        ("pixel states", states.width(), states.height()),
        ("coverage", coverage.map_or(size.0, Image::width), coverage.map_or(size.1, Image::height)),
    ];
    for (name, width, height) in sizes {
        if (width, height) != size {
            let message = format!("the {name} is {width} x {height}, the photograph {} x {}", size.0, size.1);
            return Err(Error::new(ErrorKind::InvalidScene, message).remedy("render at the size of the photograph"));
        }
    }
    let mut counted = counted_pixels(states, coverage);
    let mut non_finite_pixels = 0;
    for (index, counted) in counted.pixels_mut().iter_mut().enumerate() {
        let is_finite = [photo, halves[0], halves[1]].iter().all(|image| image.pixels()[index].is_finite());
        if *counted && !is_finite {
            *counted = false;
            non_finite_pixels += 1;
        }
    }
    let on_surface =
        |index: usize| states.pixels()[index].is_surface() && coverage.is_none_or(|coverage| coverage.pixels()[index]);
    let surface = (0..states.pixels().len()).filter(|&index| on_surface(index)).count();
    let clipped = (0..states.pixels().len()).filter(|&i| on_surface(i) && states.pixels()[i].is_clipped()).count();

    let sums = AlignmentSums::of(photo, halves, &counted);
    let scale = sums.scale();
    let gain = exposure_stops.exp2();
    let encoded_photo = encoded(photo, gain);
    let encoded_score = |rmse_linear: f64, halves: [&RgbImage; 2]| -> Result<PictureScore> {
        if sums.pixels == 0 {
            return Ok(PictureScore::NONE);
        }
        let [first, second] = halves.map(|half| encoded(half, gain));
        // Windows of the similarity reach over the silhouette: what does not count is equal there, and has no noise.
        let both = |of: &dyn Fn(usize) -> Vec3, otherwise: &dyn Fn(usize) -> Vec3| {
            let pixel = |index: usize| if counted.pixels()[index] { of(index) } else { otherwise(index) };
            Image::from_pixels(size.0, size.1, (0..photo.pixels().len()).map(pixel).collect())
        };
        let mean = mean_of(halves);
        let encoded_mean = encoded(&mean, gain);
        let encoded_picture = both(&|index| encoded_mean.pixels()[index], &|index| encoded_photo.pixels()[index]);
        let noise = both(&|index| 0.5 * (first.pixels()[index] - second.pixels()[index]), &|_| Vec3::ZERO);
        let score = metrics::scores_without_noise(&encoded_picture, Some(&noise), &encoded_photo, Some(&counted))?;
        Ok(PictureScore { rmse_linear, psnr_srgb_db: score.psnr, ssim_srgb: score.ssim })
    };
    let aligned = halves.map(|half| scaled(half, scale));
    let aligned = aligned.each_ref();
    Ok(ViewScores {
        raw: encoded_score(sums.rmse(), halves)?,
        aligned: encoded_score(AlignmentSums::of(photo, aligned, &counted).rmse(), aligned)?,
        scale,
        clipped_share: clipped as f64 / surface as f64,
        non_finite_pixels,
        sums,
    })
}

/// The mean of two halves of a picture.
pub fn mean_of([first, second]: [&RgbImage; 2]) -> RgbImage {
    let pixels = first.pixels().iter().zip(second.pixels()).map(|(a, b)| 0.5 * (*a + *b));
    Image::from_pixels(first.width(), first.height(), pixels.collect())
}

/// The picture times a factor per channel.
pub fn scaled(picture: &RgbImage, scale: [f64; 3]) -> RgbImage {
    let scale = Vec3::from_array(scale.map(|s| s as f32));
    picture.map(|&pixel| pixel * scale)
}

/// sRGB-encoded values in [0, 1] of linear ones times `gain`; NaN becomes 0.
fn encoded(image: &RgbImage, gain: f32) -> RgbImage {
    let encode = |linear: f32| if linear.is_nan() { 0.0 } else { transfer::srgb_from_linear(linear * gain) };
    image.map(|&pixel| Vec3::from_array(pixel.to_array().map(encode)))
}

/// Scores of many views together.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AggregateScore {
    /// Number of views with at least one pixel that counts.
    pub views: usize,
    /// RMSE over all pixels of all views; PSNR and SSIM as means over the views.
    pub raw: PictureScore,
    /// The same, aligned: RMSE with one factor per channel for all views together, since the scene has one scale;
    /// PSNR and SSIM as means over the views aligned one by one.
    pub aligned: PictureScore,
    /// The one factor per channel.
    pub scale: [f64; 3],
}

/// Scores many views together, in their order. Views where nothing counts are left out.
pub fn aggregate<'a>(views: impl IntoIterator<Item = &'a ViewScores>) -> AggregateScore {
    let views: Vec<&ViewScores> = views.into_iter().filter(|view| view.sums.pixels > 0).collect();
    let mut sums = AlignmentSums::default();
    views.iter().for_each(|view| sums.add(&view.sums));
    let scale = sums.scale();
    let mean = |number: fn(&ViewScores) -> f64| views.iter().map(|view| number(view)).sum::<f64>() / views.len() as f64;
    AggregateScore {
        views: views.len(),
        raw: PictureScore {
            rmse_linear: sums.rmse(),
            psnr_srgb_db: mean(|view| view.raw.psnr_srgb_db),
            ssim_srgb: mean(|view| view.raw.ssim_srgb),
        },
        aligned: PictureScore {
            rmse_linear: sums.rmse_at(scale),
            psnr_srgb_db: mean(|view| view.aligned.psnr_srgb_db),
            ssim_srgb: mean(|view| view.aligned.ssim_srgb),
        },
        scale,
    }
}

#[cfg(test)]
mod tests;
