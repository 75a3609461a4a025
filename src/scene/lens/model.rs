//! The formulas of lens models.

use super::dual::Real;

/// How a direction becomes a place in units of the focal length.
#[derive(Clone, Debug, PartialEq)]
pub enum Model {
    /// Polynomials in the radius: Brown (1966), its rational and thin-prism kin, fisheyes (Kannala and Brandt 2006).
    /// With no coefficient it is the pinhole.
    Polynomial(Polynomial),
    /// Devernay and Faugeras (2001): r_d = atan(2 r tan(omega / 2)) / omega.
    FieldOfView {
        /// The field of view of the ideal fisheye, in radians.
        omega: f64,
    },
    /// Fitzgibbon (2001): r = r_d / (1 + k r_d²).
    Division {
        /// The coefficient.
        k: f64,
    },
    /// Khomutenko, Garcia and Martinet (2016), the enhanced unified camera model.
    ExtendedUnified {
        /// Weight of the sphere, in [0, 1].
        alpha: f64,
        /// Shape of the ellipsoid, positive.
        beta: f64,
    },
}

/// What the polynomials are taken of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Base {
    /// Places on the plane z = 1.
    #[default]
    Plane,
    /// Angles from the axis, along the same azimuth: an equidistant fisheye.
    Angle,
}

/// A polynomial model. With p the base, r its length and `q` = p, or p times the radial part if `after_radial`:
/// p (1 + n1 r² + n2 r⁴ + ...) / (1 + d1 r² + ...) + tangential(q) (1 + g1 r² + g2 r⁴) + prism(q).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polynomial {
    /// What it is a polynomial of.
    pub base: Base,
    /// Radial coefficients of r², r⁴, ... in the numerator.
    pub numerator: [f64; 6],
    /// The same in the denominator.
    pub denominator: [f64; 3],
    /// p1, p2 in OpenCV's order: 2 p1 x y + p2 (r² + 2 x²), p1 (r² + 2 y²) + 2 p2 x y.
    pub tangential: [f64; 2],
    /// Growth of the tangential part with r² and r⁴ (Metashape's P3 and P4).
    pub tangential_growth: [f64; 2],
    /// Thin prism along x: coefficients of r² and r⁴.
    pub prism_x: [f64; 2],
    /// Thin prism along y.
    pub prism_y: [f64; 2],
    /// Whether tangential and prism parts are taken of what the radial part gave.
    pub after_radial: bool,
}

impl Default for Model {
    fn default() -> Self {
        Model::Polynomial(Polynomial::default())
    }
}

impl Model {
    /// Whether directions are parametrised by angles from the axis and not by places on the plane z = 1.
    pub fn is_on_angles(&self) -> bool {
        match self {
            Model::Polynomial(polynomial) => polynomial.base == Base::Angle,
            Model::ExtendedUnified { .. } => true,
            Model::FieldOfView { .. } | Model::Division { .. } => false,
        }
    }

    /// The direction of two parameters: (a, b, 1), or the one at the angle |(a, b)| from the axis.
    pub fn direction<T: Real>(&self, a: T, b: T) -> (T, T, T) {
        if !self.is_on_angles() {
            return (a, b, T::constant(1.0));
        }
        let squared = a * a + b * b;
        if squared.value() < 1e-16 {
            return (a, b, T::constant(1.0));
        }
        let angle = squared.sqrt();
        let sine_over_angle = angle.sin() / angle;
        (a * sine_over_angle, b * sine_over_angle, angle.cos())
    }

    /// Where a direction falls, in units of the focal length from the principal point.
    pub fn project<T: Real>(&self, x: T, y: T, z: T) -> (T, T) {
        let constant = T::constant;
        match self {
            Model::Polynomial(polynomial) => match polynomial.base {
                Base::Plane => polynomial.distort(x / z, y / z),
                Base::Angle => {
                    let squared = x * x + y * y;
                    if squared.value() < 1e-16 * z.value() * z.value() {
                        return polynomial.distort(x / z, y / z);
                    }
                    let radius = squared.sqrt();
                    let angle_over_radius = radius.atan2(z) / radius;
                    polynomial.distort(x * angle_over_radius, y * angle_over_radius)
                }
            },
            Model::FieldOfView { omega } => {
                let (x, y) = (x / z, y / z);
                let squared = x * x + y * y;
                let slope = 2.0 * (0.5 * omega).tan();
                if omega.abs() < 1e-6 || squared.value() < 1e-14 {
                    let scale = constant(if omega.abs() < 1e-6 { 1.0 } else { slope / omega });
                    return (x * scale, y * scale);
                }
                let radius = squared.sqrt();
                let scale = (radius * constant(slope)).atan2(constant(1.0)) / (radius * constant(*omega));
                (x * scale, y * scale)
            }
            Model::Division { k } => {
                let root = (z * z - constant(4.0 * k) * (x * x + y * y)).sqrt();
                let scale = constant(2.0) / (z + root);
                (x * scale, y * scale)
            }
            Model::ExtendedUnified { alpha, beta } => {
                let distance = (constant(*beta) * (x * x + y * y) + z * z).sqrt();
                let depth = constant(*alpha) * distance + constant(1.0 - alpha) * z;
                (x / depth, y / depth)
            }
        }
    }

    /// Whether no coefficient is larger than `nothing`: a pinhole.
    pub fn is_pinhole(&self, nothing: f64) -> bool {
        match self {
            Model::Polynomial(polynomial) => {
                polynomial.base == Base::Plane && polynomial.coefficients().all(|value| value.abs() < nothing)
            }
            Model::FieldOfView { omega } => omega.abs() < nothing,
            Model::Division { k } => k.abs() < nothing,
            Model::ExtendedUnified { alpha, .. } => alpha.abs() < nothing,
        }
    }

    /// Whether every coefficient is a finite number.
    pub fn is_finite(&self) -> bool {
        match self {
            Model::Polynomial(polynomial) => {
                polynomial.coefficients().chain(polynomial.tangential_growth).all(f64::is_finite)
            }
            Model::FieldOfView { omega } => omega.is_finite(),
            Model::Division { k } => k.is_finite(),
            Model::ExtendedUnified { alpha, beta } => alpha.is_finite() && beta.is_finite(),
        }
    }
}

impl Polynomial {
    /// The coefficients that move a place by themselves.
    fn coefficients(&self) -> impl Iterator<Item = f64> {
        let all = self.numerator.iter().chain(&self.denominator).chain(&self.tangential);
        all.chain(&self.prism_x).chain(&self.prism_y).copied()
    }

    fn distort<T: Real>(&self, x: T, y: T) -> (T, T) {
        let constant = T::constant;
        let one = constant(1.0);
        let of = |coefficients: &[f64], squared: T| {
            coefficients.iter().rev().fold(constant(0.0), |sum, value| (sum + constant(*value)) * squared)
        };
        let squared = x * x + y * y;
        let radial = (one + of(&self.numerator, squared)) / (one + of(&self.denominator, squared));
        let (radial_x, radial_y) = (x * radial, y * radial);
        let (x, y) = if self.after_radial { (radial_x, radial_y) } else { (x, y) };
        let squared = x * x + y * y;
        let two = constant(2.0);
        let [p1, p2] = self.tangential.map(constant);
        let growth = one + of(&self.tangential_growth, squared);
        let across = two * x * y;
        (
            radial_x + (p1 * across + p2 * (squared + two * x * x)) * growth + of(&self.prism_x, squared),
            radial_y + (p1 * (squared + two * y * y) + p2 * across) * growth + of(&self.prism_y, squared),
        )
    }
}
