//! ICC profiles: from the bytes in a file to linear Rec. 709.
//!
//! Profiles of cameras and editors are three curves and a matrix: these are taken apart and computed here, so that 16 bits
//! and values beyond white stay what they are. Profiles that are tables go through `moxcms`. Its parser is used for both.

use super::colour::{ColourSpace, Curve, rec709_from_xyz_d50};
use glam::{DMat3, DVec3, Vec3};
use moxcms::{
    ColorProfile, DataColorSpace, Layout, ParsingOptions, ProfileText, ToneReprCurve, TransformExecutor,
    TransformOptions,
};
use std::sync::Arc;

/// Profiles of photos have at most some 3 MB, those with large tables.
const LARGEST_PROFILE: usize = 1 << 24;

/// What an embedded profile says.
#[allow(clippy::large_enum_variant, reason = "there is one for each file that is open")]
pub enum Profile {
    /// Curves and a matrix.
    Matrix(ColourSpace),
    /// Tables: the transform to linear Rec. 709.
    Tables(Arc<TransformExecutorF32>),
    /// Of colours that are not RGB or grey, such as CMYK; the name of the space.
    Other(&'static str),
}

type TransformExecutorF32 = dyn TransformExecutor<f32> + Send + Sync;

/// A profile and its name.
pub struct NamedProfile {
    /// What it says.
    pub profile: Profile,
    /// Its description, as told to the user; empty when it has none.
    pub name: String,
}

/// Reads a profile; `None` where its bytes are damaged or say nothing of use.
pub fn read(bytes: &[u8]) -> Option<NamedProfile> {
    let options = ParsingOptions { max_profile_size: LARGEST_PROFILE, ..Default::default() };
    // A table cannot hold more than the profile does; the parser allocates by what its header claims.
    if bytes.len() < 128 || bytes.len() >= LARGEST_PROFILE {
        return None;
    }
    let profile = ColorProfile::new_from_slice_with_options(bytes, options).ok()?;
    let name = name_of(&profile);
    let profile = match profile.color_space {
        DataColorSpace::Rgb => match matrix_of(&profile) {
            Some(space) => Profile::Matrix(space),
            None => tables_of(&profile)?,
        },
        DataColorSpace::Gray => Profile::Matrix(ColourSpace::of_curve(curve_of(profile.gray_trc.as_ref()?)?)),
        DataColorSpace::Cmyk => Profile::Other("CMYK"),
        DataColorSpace::Lab => Profile::Other("Lab"),
        _ => Profile::Other("another space than RGB"),
    };
    Some(NamedProfile { profile, name })
}

/// Curves and matrix, where the profile has them and no tables that would say it better.
fn matrix_of(profile: &ColorProfile) -> Option<ColourSpace> {
    let has_tables = profile.lut_a_to_b_colorimetric.is_some() || profile.lut_a_to_b_perceptual.is_some();
    if has_tables || profile.pcs != DataColorSpace::Xyz {
        return None;
    }
    let curve = |trc: &Option<ToneReprCurve>| curve_of(trc.as_ref()?);
    let curves = [curve(&profile.red_trc)?, curve(&profile.green_trc)?, curve(&profile.blue_trc)?];
    let column = |xyz: moxcms::Xyzd| DVec3::new(xyz.x, xyz.y, xyz.z);
    let xyz_from_rgb =
        DMat3::from_cols(column(profile.red_colorant), column(profile.green_colorant), column(profile.blue_colorant));
    if !xyz_from_rgb.is_finite() || xyz_from_rgb.determinant().abs() < 1e-9 {
        return None;
    }
    let space = ColourSpace { curves, rec709_from_rgb: None };
    Some(space.with_matrix(rec709_from_xyz_d50() * xyz_from_rgb))
}

fn curve_of(curve: &ToneReprCurve) -> Option<Curve> {
    match curve {
        ToneReprCurve::Lut(values) => Some(match values.as_slice() {
            [] => Curve::Linear,
            // One entry is a power in eighths of a byte (ICC.1:2022, 10.6).
            [power] => power_of(f64::from(*power) / 256.0),
            values => Curve::Table(values.iter().map(|&value| f32::from(value) / 65_535.0).collect()),
        }),
        ToneReprCurve::Parametric(parameters) => {
            let p: Vec<f64> = parameters.iter().map(|&parameter| f64::from(parameter)).collect();
            let curve = match p.as_slice() {
                [g] => power_of(*g),
                [g, a, b] => Curve::Parametric([*g, *a, *b, 0.0, -b / a, 0.0, 0.0]),
                [g, a, b, c] => Curve::Parametric([*g, *a, *b, 0.0, -b / a, *c, *c]),
                [g, a, b, c, d] => Curve::Parametric([*g, *a, *b, *c, *d, 0.0, 0.0]),
                [g, a, b, c, d, e, f] => Curve::Parametric([*g, *a, *b, *c, *d, *e, *f]),
                _ => return None,
            };
            p.iter().all(|parameter| parameter.is_finite()).then_some(curve)
        }
    }
}

fn power_of(power: f64) -> Curve {
    if (power - 1.0).abs() < 1e-4 { Curve::Linear } else { Curve::Gamma(power) }
}

fn tables_of(profile: &ColorProfile) -> Option<Profile> {
    let mut linear = ColorProfile::new_srgb();
    let straight = || Some(ToneReprCurve::Parametric(vec![1.0]));
    (linear.red_trc, linear.green_trc, linear.blue_trc, linear.cicp) = (straight(), straight(), straight(), None);
    let options = TransformOptions { allow_use_cicp_transfer: false, ..Default::default() };
    let transform = profile.create_transform_f32(Layout::Rgb, &linear, Layout::Rgb, options).ok()?;
    Some(Profile::Tables(transform))
}

/// Linear Rec. 709 by a profile of tables; `None` where it refuses.
pub fn through_tables(transform: &TransformExecutorF32, pixels: &[Vec3]) -> Option<Vec<Vec3>> {
    let stored: &[f32] = bytemuck::cast_slice(pixels);
    let mut linear = vec![0.0f32; stored.len()];
    transform.transform(stored, &mut linear).ok()?;
    Some(linear.chunks_exact(3).map(Vec3::from_slice).collect())
}

fn name_of(profile: &ColorProfile) -> String {
    let text = match &profile.description {
        Some(ProfileText::PlainString(text)) => text.clone(),
        Some(ProfileText::Localizable(texts)) => texts.first().map(|text| text.value.clone()).unwrap_or_default(),
        Some(ProfileText::Description(text)) => text.ascii_string.clone(),
        None => String::new(),
    };
    text.chars().filter(|letter| !letter.is_control()).take(60).collect::<String>().trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(profile: ColorProfile) -> ColourSpace {
        match read(&profile.encode().unwrap()).unwrap().profile {
            Profile::Matrix(space) => space,
            _ => panic!("curves and a matrix are expected"),
        }
    }

    #[test]
    fn known_profiles_become_their_curves_and_matrices() {
        assert!(matrix(ColorProfile::new_srgb()).is_srgb());
        let p3 = matrix(ColorProfile::new_display_p3());
        assert!(p3.curves[0].is_srgb());
        // A pure red of Display P3 lies outside Rec. 709: its red is 1.2249 and its green -0.0420.
        let red = p3.rec709_from_rgb.unwrap() * Vec3::X;
        assert!((red - Vec3::new(1.2249, -0.0420, -0.0196)).abs().max_element() < 2e-3, "{red}");
        let adobe = matrix(ColorProfile::new_adobe_rgb());
        assert!((adobe.curves[1].linear(0.5) - 0.5f32.powf(563.0 / 256.0)).abs() < 1e-3);
        let green = adobe.rec709_from_rgb.unwrap() * Vec3::Y;
        assert!((green - Vec3::new(-0.3983, 1.0, -0.0429)).abs().max_element() < 3e-3, "{green}");
        let pro = matrix(ColorProfile::new_pro_photo_rgb());
        assert!((pro.rec709_from_rgb.unwrap() * Vec3::ONE - Vec3::ONE).abs().max_element() < 5e-3);
        let grey = matrix(ColorProfile::new_gray_with_gamma(1.0));
        assert!(grey.rec709_from_rgb.is_none() && (grey.curves[0].linear(0.25) - 0.25).abs() < 1e-4);
    }

    #[test]
    fn damaged_profiles_say_nothing() {
        let bytes = ColorProfile::new_display_p3().encode().unwrap();
        for length in [0, 10, 127, 140] {
            assert!(read(&bytes[..length]).is_none());
        }
    }
}
