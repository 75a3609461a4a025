//! Colour spaces as a matrix to linear Rec. 709 and a transfer curve, whatever way a file tells them.
//!
//! White points are adapted by the linear Bradford transform (Lam 1985; ICC.1:2022 annex E). Matrices work in double
//! precision: that of ProPhoto has entries of opposite sign that nearly cancel.

use crate::image::transfer;
use glam::{DMat3, DVec2, DVec3, Mat3};

/// Chromaticities (x, y) of the primaries and the white of an RGB colour space, CIE 1931.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primaries {
    /// Red.
    pub red: DVec2,
    /// Green.
    pub green: DVec2,
    /// Blue.
    pub blue: DVec2,
    /// White.
    pub white: DVec2,
}

/// White of Rec. 709 and sRGB: D65.
const D65: DVec2 = DVec2::new(0.3127, 0.3290);
/// White of the profile connection space, as XYZ (ICC.1:2022, 7.2.16).
const D50_XYZ: DVec3 = DVec3::new(0.9642, 1.0, 0.8249);
/// Colour spaces with less than this between the entries of their matrices are one.
const SAME_MATRIX: f64 = 2e-3;

impl Primaries {
    /// ITU-R BT.709 and sRGB.
    pub const REC_709: Primaries = Primaries {
        red: DVec2::new(0.64, 0.33),
        green: DVec2::new(0.30, 0.60),
        blue: DVec2::new(0.15, 0.06),
        white: D65,
    };
    /// ITU-R BT.2020.
    pub const REC_2020: Primaries = Primaries {
        red: DVec2::new(0.708, 0.292),
        green: DVec2::new(0.170, 0.797),
        blue: DVec2::new(0.131, 0.046),
        white: D65,
    };
    /// SMPTE EG 432-1 with the white D65, as in Display P3.
    pub const DISPLAY_P3: Primaries = Primaries {
        red: DVec2::new(0.680, 0.320),
        green: DVec2::new(0.265, 0.690),
        blue: DVec2::new(0.150, 0.060),
        white: D65,
    };
    /// Adobe RGB (1998).
    pub const ADOBE_RGB: Primaries = Primaries {
        red: DVec2::new(0.64, 0.33),
        green: DVec2::new(0.21, 0.71),
        blue: DVec2::new(0.15, 0.06),
        white: D65,
    };

    /// XYZ of linear RGB, with the white at Y = 1 (SMPTE RP 177); `None` where the primaries span no space.
    fn xyz_from_rgb(&self) -> Option<DMat3> {
        let column = |xy: DVec2| DVec3::new(xy.x, xy.y, 1.0 - xy.x - xy.y);
        let primaries = DMat3::from_cols(column(self.red), column(self.green), column(self.blue));
        let finite = primaries.is_finite() && self.white.is_finite();
        if !finite || primaries.determinant().abs() < 1e-6 || self.white.y < 1e-3 {
            return None;
        }
        let scales = primaries.inverse() * (column(self.white) / self.white.y);
        Some(primaries * DMat3::from_diagonal(scales)).filter(DMat3::is_finite)
    }

    /// Linear Rec. 709 of linear RGB of these primaries, its white made that of Rec. 709; `None` where the primaries span
    /// no space.
    pub fn rec709_from_rgb(&self) -> Option<DMat3> {
        let white = DVec3::new(self.white.x, self.white.y, 1.0 - self.white.x - self.white.y) / self.white.y;
        let d65 = DVec3::new(D65.x, D65.y, 1.0 - D65.x - D65.y) / D65.y;
        Some(rec709_from_xyz_d65() * adaptation(white, d65) * self.xyz_from_rgb()?).filter(DMat3::is_finite)
    }
}

/// Linear Rec. 709 of CIE XYZ under its own white.
pub fn rec709_from_xyz_d65() -> DMat3 {
    // Its primaries span a space: the fallback is never taken.
    Primaries::REC_709.xyz_from_rgb().unwrap_or(DMat3::IDENTITY).inverse()
}

/// Linear Rec. 709 of XYZ of the profile connection space, whose white is D50.
pub fn rec709_from_xyz_d50() -> DMat3 {
    let d65 = DVec3::new(D65.x, D65.y, 1.0 - D65.x - D65.y) / D65.y;
    rec709_from_xyz_d65() * adaptation(D50_XYZ, d65)
}

/// XYZ under the white `to` of XYZ under the white `from`, by the linear Bradford transform.
fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let cone = DMat3::from_cols(
        DVec3::new(0.8951, -0.7502, 0.0389),
        DVec3::new(0.2664, 1.7135, -0.0685),
        DVec3::new(-0.1614, 0.0367, 1.0296),
    );
    cone.inverse() * DMat3::from_diagonal((cone * to) / (cone * from)) * cone
}

/// Whether a matrix to Rec. 709 says that the colours are those of Rec. 709 already.
pub fn is_identity(rec709_from_rgb: &DMat3) -> bool {
    let difference = *rec709_from_rgb - DMat3::IDENTITY;
    difference.to_cols_array().iter().all(|entry| entry.abs() < SAME_MATRIX)
}

/// How stored numbers become linear ones.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// They are.
    Linear,
    /// sRGB (IEC 61966-2-1).
    Srgb,
    /// A power.
    Gamma(f64),
    /// Values at even distances over [0, 1], linear between them.
    Table(Vec<f32>),
    /// `(a x + b)^g + e` from d on, `c x + f` below: ICC.1:2022, 10.18, function type 4, in the order g a b c d e f.
    Parametric([f64; 7]),
}

impl Curve {
    /// The linear value of a stored one; stored values of [0, 1] are the scale, others go on as the formula does.
    pub fn linear(&self, stored: f32) -> f32 {
        let value = f64::from(stored);
        let linear = match self {
            Curve::Linear => return stored,
            Curve::Srgb => return transfer::linear_from_srgb(stored),
            Curve::Gamma(power) => value.signum() * value.abs().powf(*power),
            Curve::Table(values) => {
                let last = values.len().saturating_sub(1);
                let place = value.clamp(0.0, 1.0) * last as f64;
                let index = (place as usize).min(last.saturating_sub(1));
                let at = |index: usize| f64::from(values.get(index).copied().unwrap_or_default());
                at(index) + (place - index as f64) * (at((index + 1).min(last)) - at(index))
            }
            Curve::Parametric([g, a, b, c, d, e, f]) => {
                if value < *d {
                    c * value + f
                } else {
                    (a * value + b).max(0.0).powf(*g) + e
                }
            }
        };
        linear as f32
    }

    /// Whether bytes mean by this curve what they mean by sRGB, to less than half a step of a byte.
    pub fn is_srgb(&self) -> bool {
        *self == Curve::Srgb
            || (0..=255u8).all(|byte| {
                let stored = f32::from(byte) / 255.0;
                let encoded = transfer::srgb_from_linear(self.linear(stored));
                (encoded - stored).abs() < 0.5 / 255.0
            })
    }
}

/// How the stored RGB of a file becomes linear Rec. 709.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourSpace {
    /// A curve for each channel.
    pub curves: [Curve; 3],
    /// The matrix after them; `None` for colours of Rec. 709.
    pub rec709_from_rgb: Option<Mat3>,
}

impl ColourSpace {
    /// One curve for all channels, and colours of Rec. 709.
    pub fn of_curve(curve: Curve) -> Self {
        ColourSpace { curves: [curve.clone(), curve.clone(), curve], rec709_from_rgb: None }
    }

    /// Adobe RGB (1998), whose power is 563/256.
    pub fn adobe_rgb() -> Self {
        let space = ColourSpace::of_curve(Curve::Gamma(563.0 / 256.0));
        // Its primaries span a space: the fallback is never taken.
        space.with_matrix(Primaries::ADOBE_RGB.rec709_from_rgb().unwrap_or(DMat3::IDENTITY))
    }

    /// Whether its bytes mean what they mean in sRGB.
    pub fn is_srgb(&self) -> bool {
        self.rec709_from_rgb.is_none() && self.curves.iter().all(Curve::is_srgb)
    }

    /// With this matrix; one that changes nothing is left out.
    pub fn with_matrix(mut self, rec709_from_rgb: DMat3) -> Self {
        self.rec709_from_rgb = (!is_identity(&rec709_from_rgb)).then(|| rec709_from_rgb.as_mat3());
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DMat3, b: DMat3, tolerance: f64) -> bool {
        (a - b).to_cols_array().iter().all(|entry| entry.abs() < tolerance)
    }

    #[test]
    fn matrices_are_those_of_the_standards() {
        // sRGB of XYZ by IEC 61966-2-1, printed to four digits.
        let standard = DMat3::from_cols(
            DVec3::new(3.2406, -0.9689, 0.0557),
            DVec3::new(-1.5372, 1.8758, -0.2040),
            DVec3::new(-0.4986, 0.0415, 1.0570),
        );
        assert!(close(rec709_from_xyz_d65(), standard, 6e-4));
        // Rec. 709 of Rec. 2020 by ITU-R BT.2087, printed to four digits.
        let published = DMat3::from_cols(
            DVec3::new(1.6605, -0.1246, -0.0182),
            DVec3::new(-0.5876, 1.1329, -0.1006),
            DVec3::new(-0.0728, -0.0083, 1.1187),
        );
        assert!(close(Primaries::REC_2020.rec709_from_rgb().unwrap(), published, 2e-4));
        assert!(is_identity(&Primaries::REC_709.rec709_from_rgb().unwrap()));
        assert!(!is_identity(&Primaries::DISPLAY_P3.rec709_from_rgb().unwrap()));
    }

    #[test]
    fn white_stays_white_whatever_the_primaries() {
        let d50 = Primaries { white: DVec2::new(0.3457, 0.3585), ..Primaries::REC_2020 };
        for primaries in [Primaries::REC_2020, Primaries::DISPLAY_P3, d50] {
            let white = primaries.rec709_from_rgb().unwrap() * DVec3::ONE;
            assert!((white - DVec3::ONE).abs().max_element() < 1e-9, "{white}");
        }
        assert!((rec709_from_xyz_d50() * D50_XYZ - DVec3::ONE).abs().max_element() < 1e-9);
        let line = Primaries { green: DVec2::new(0.64, 0.33), ..Primaries::REC_709 };
        assert_eq!(line.rec709_from_rgb(), None);
    }

    #[test]
    fn curves_go_through_known_points_and_tell_srgb() {
        assert!((Curve::Gamma(2.0).linear(0.5) - 0.25).abs() < 1e-7);
        assert_eq!(Curve::Table(vec![0.0, 0.1, 1.0]).linear(0.75), 0.55);
        assert_eq!(Curve::Table(vec![0.5]).linear(0.75), 0.5);
        let srgb = Curve::Parametric([2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045, 0.0, 0.0]);
        assert!(srgb.is_srgb() && !Curve::Gamma(2.2).is_srgb() && !Curve::Linear.is_srgb());
        assert!((srgb.linear(0.5) - transfer::linear_from_srgb(0.5)).abs() < 1e-6);
    }
}
