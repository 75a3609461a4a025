//! Lenses: where a direction falls on the picture, its inverse, and photos resampled to a pinhole.
//!
//! A lens works in units of the focal length: it takes a direction in the camera (x right, y down, z forward) to a place
//! relative to the principal point. [`Model`] holds the formulas, each written once over [`dual::Real`], so that its
//! Jacobian is exact; [`undistort`](mod@undistort) resamples. Everything downstream of the readers sees pinholes.
//!
//! What it refuses: pictures of more than 180 degrees, and whatever lies beyond the radius where a model folds over.

pub mod dual;
pub mod model;
pub mod undistort;

pub use model::{Base, Model, Polynomial};
pub use undistort::{Pinhole, Undistorted, undistort};

use dual::{Dual, Real};
use glam::{DVec2, DVec3};

/// A lens: its model, and the shear of the pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lens {
    /// The formula.
    pub model: Model,
    /// What is added to x for each unit of y after the distortion: skew over the focal length along x.
    pub shear: f64,
}

/// Half of the widest picture that is read: 90 degrees from the axis, less what keeps a tangent finite.
const WIDEST_RADIANS: f64 = std::f64::consts::FRAC_PI_2 - 1e-3;
/// Steps of the search for the radius where a model folds over, and directions it is made along.
const RADIUS_STEPS: usize = 400;
const AZIMUTHS: usize = 12;
/// Coefficients below this move nothing by a hundredth of a pixel.
const NOTHING: f64 = 1e-9;

impl Lens {
    /// A lens of a model without shear.
    pub fn new(model: Model) -> Self {
        Lens { model, shear: 0.0 }
    }

    /// Whether it is a pinhole, whatever the name of its model: photos need no resampling.
    pub fn is_pinhole(&self) -> bool {
        self.shear.abs() < NOTHING && self.model.is_pinhole(NOTHING)
    }

    /// Whether every number of it is finite.
    pub fn is_finite(&self) -> bool {
        self.shear.is_finite() && self.model.is_finite()
    }

    /// Where a direction in the camera falls, in units of the focal length from the principal point. The direction needs
    /// no length; for models on the plane it must point forward.
    pub fn project(&self, direction: DVec3) -> DVec2 {
        let (x, y) = self.sheared(self.model.project(direction.x, direction.y, direction.z));
        DVec2::new(x, y)
    }

    fn sheared<T: Real>(&self, (x, y): (T, T)) -> (T, T) {
        (x + T::constant(self.shear) * y, y)
    }

    /// The place and its Jacobian rows by the parameters of a direction: see [`Model::direction`].
    pub fn project_with_jacobian(&self, parameters: DVec2) -> (DVec2, [DVec2; 2]) {
        let (x, y, z) = self.model.direction(Dual::first(parameters.x), Dual::second(parameters.y));
        let (u, v) = self.sheared(self.model.project(x, y, z));
        (DVec2::new(u.value, v.value), [DVec2::from_array(u.by), DVec2::from_array(v.by)])
    }

    /// How wide and how high a picture taken through it is, along the sides through the principal point, in radians: infinite
    /// where that is more than 180 degrees and nothing falls on a side. A side beyond the radius where the model folds over
    /// counts as far as that.
    pub fn field_of_view_radians(&self, size: (usize, usize), pinhole: &Pinhole) -> DVec2 {
        let valid = self.valid_radius();
        let widest = if self.model.is_on_angles() { WIDEST_RADIANS } else { WIDEST_RADIANS.tan() };
        let angle_to = |side: DVec2| {
            let place = (side - pinhole.centre_pixels) / pinhole.focal_pixels;
            let angle = |direction: DVec3| direction.z.clamp(-1.0, 1.0).acos();
            match self.unproject(place, valid) {
                Some(direction) => angle(direction),
                // Folded over before.
                None if valid < widest => {
                    if self.model.is_on_angles() {
                        valid
                    } else {
                        valid.atan()
                    }
                }
                None if self.model.is_on_angles() => {
                    self.unproject(place, std::f64::consts::PI).map_or(f64::INFINITY, angle)
                }
                None => f64::INFINITY,
            }
        };
        let (width, height) = (size.0 as f64, size.1 as f64);
        let centre = pinhole.centre_pixels;
        DVec2::new(
            angle_to(DVec2::new(0.0, centre.y)) + angle_to(DVec2::new(width, centre.y)),
            angle_to(DVec2::new(centre.x, 0.0)) + angle_to(DVec2::new(centre.x, height)),
        )
    }

    /// Largest radius of the parameters of a direction up to which the model neither folds over nor leaves 180 degrees.
    pub fn valid_radius(&self) -> f64 {
        let radius_at = |step: usize| {
            let angle = WIDEST_RADIANS * step as f64 / RADIUS_STEPS as f64;
            if self.model.is_on_angles() { angle } else { angle.tan() }
        };
        let unfolded = |radius: f64| {
            (0..AZIMUTHS).all(|azimuth| {
                let turn = std::f64::consts::TAU * azimuth as f64 / AZIMUTHS as f64;
                let (place, rows) = self.project_with_jacobian(DVec2::from_angle(turn) * radius);
                let determinant = rows[0].perp_dot(rows[1]);
                // Along the radius it must grow as well: two folds keep the sign of the determinant.
                let outwards = DVec2::from_angle(turn);
                let growth = DVec2::new(rows[0].dot(outwards), rows[1].dot(outwards)).dot(outwards);
                place.is_finite() && determinant > 0.0 && growth > 0.0
            })
        };
        let last = (1..=RADIUS_STEPS).take_while(|&step| unfolded(radius_at(step))).last();
        last.map_or(0.0, radius_at)
    }

    /// The direction that falls on a place, unit length, by Newton's iteration with halved steps; `None` beyond
    /// `valid_radius` (from [`Lens::valid_radius`]) or where nothing falls.
    pub fn unproject(&self, place: DVec2, valid_radius: f64) -> Option<DVec3> {
        const TOLERANCE: f64 = 1e-12;
        let mut parameters = place.clamp_length_max(0.9 * valid_radius);
        let (mut found, mut rows) = self.project_with_jacobian(parameters);
        for _ in 0..60 {
            let miss = place - found;
            if miss.length() <= TOLERANCE * (1.0 + place.length()) {
                let (x, y, z) = self.model.direction(parameters.x, parameters.y);
                return DVec3::new(x, y, z).try_normalize();
            }
            let determinant = rows[0].perp_dot(rows[1]);
            let full = DVec2::new(
                (rows[1].y * miss.x - rows[0].y * miss.y) / determinant,
                (rows[0].x * miss.y - rows[1].x * miss.x) / determinant,
            );
            let mut share = 1.0;
            loop {
                let tried = parameters + share * full;
                let (next, next_rows) = self.project_with_jacobian(tried);
                if tried.length() <= valid_radius && (place - next).length() < miss.length() {
                    (parameters, found, rows) = (tried, next, next_rows);
                    break;
                }
                share *= 0.5;
                if share < 1e-6 {
                    return None;
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lens of each kind, with the coefficients of real cameras.
    pub fn lenses() -> Vec<(&'static str, Lens)> {
        let brown = Polynomial {
            numerator: [-0.12, 0.05, 0.01, 0.002, 0.0, 0.0],
            tangential: [1e-3, -2e-3],
            tangential_growth: [0.1, 0.02],
            ..Default::default()
        };
        let rational = Polynomial {
            numerator: [0.4, 0.02, 0.001, 0.0, 0.0, 0.0],
            denominator: [0.5, 0.05, 0.002],
            ..Default::default()
        };
        let fisheye =
            Polynomial { base: Base::Angle, numerator: [0.03, -0.01, 0.002, -1e-4, 0.0, 0.0], ..Default::default() };
        let prism =
            Polynomial { tangential: [1e-3, 5e-4], prism_x: [2e-3, 0.0], prism_y: [-1e-3, 0.0], ..fisheye.clone() };
        let aria = Polynomial { after_radial: true, prism_x: [1e-3, -1e-4], prism_y: [5e-4, 2e-4], ..prism.clone() };
        vec![
            ("pinhole", Lens::default()),
            ("brown", Lens { model: Model::Polynomial(brown), shear: 1e-3 }),
            ("rational", Lens::new(Model::Polynomial(rational))),
            ("fisheye", Lens::new(Model::Polynomial(fisheye))),
            ("thin prism", Lens::new(Model::Polynomial(prism))),
            ("thin prism after the radial part", Lens::new(Model::Polynomial(aria))),
            ("field of view", Lens::new(Model::FieldOfView { omega: 0.9 })),
            ("division", Lens::new(Model::Division { k: -0.2 })),
            ("extended unified", Lens::new(Model::ExtendedUnified { alpha: 0.6, beta: 1.1 })),
        ]
    }

    #[test]
    fn unprojection_inverts_projection_for_every_model() {
        for (name, lens) in lenses() {
            let valid = lens.valid_radius();
            assert!(valid > 0.6, "{name} is valid to {valid}");
            for step in 0..200 {
                let radius = 0.95 * valid.min(2.0) * f64::from(step) / 199.0;
                let parameters = DVec2::from_angle(2.4 * f64::from(step)) * radius;
                let (x, y, z) = lens.model.direction(parameters.x, parameters.y);
                let direction = DVec3::new(x, y, z).normalize();
                let again = lens.unproject(lens.project(direction), valid);
                let again = again.unwrap_or_else(|| panic!("{name}: nothing at radius {radius}"));
                assert!((again - direction).length() < 1e-9, "{name} at {radius}: {direction} {again}");
            }
        }
    }

    #[test]
    fn jacobians_agree_with_differences() {
        for (name, lens) in lenses() {
            for place in [DVec2::new(0.3, -0.2), DVec2::new(1e-5, 0.4), DVec2::ZERO] {
                let (_, rows) = lens.project_with_jacobian(place);
                let step = 1e-6;
                for (axis, along) in [DVec2::X, DVec2::Y].into_iter().enumerate() {
                    let high = lens.project_with_jacobian(place + step * along).0;
                    let low = lens.project_with_jacobian(place - step * along).0;
                    let difference = (high - low) / (2.0 * step);
                    let exact = DVec2::new(rows[0][axis], rows[1][axis]);
                    assert!((difference - exact).length() < 1e-6, "{name} at {place}: {difference} {exact}");
                }
            }
        }
    }

    #[test]
    fn the_field_of_view_is_that_of_the_photo_and_not_of_its_pinhole() {
        let pinhole =
            |focal: f64| Pinhole { focal_pixels: DVec2::splat(focal), centre_pixels: DVec2::new(91.0, 136.5) };
        let degrees = |lens: &Lens, focal: f64| {
            let angle = lens.field_of_view_radians((182, 273), &pinhole(focal));
            [angle.x.to_degrees(), angle.y.to_degrees()]
        };
        let equidistant = Lens::new(Model::Polynomial(Polynomial { base: Base::Angle, ..Default::default() }));
        let [wide, high] = degrees(&equidistant, 60.0);
        assert!(
            (wide - (182.0f64 / 60.0).to_degrees()).abs() < 1e-6
                && (high - (273.0f64 / 60.0).to_degrees()).abs() < 1e-6
        );
        let [wide, _] = degrees(&Lens::default(), 91.0);
        assert!((wide - 90.0).abs() < 1e-6, "{wide}");
        // The division model has 180 degrees at the radius 1 / sqrt(-k).
        let division = Lens::new(Model::Division { k: -1.0 });
        let [wide, high] = degrees(&division, 100.0);
        assert!(wide < 180.0 && high.is_infinite(), "{wide} {high}");
        let folding = Polynomial { numerator: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], ..Default::default() };
        let [_, high] = degrees(&Lens::new(Model::Polynomial(folding)), 100.0);
        assert!(high < 100.0, "what folds over is no wide picture: {high}");
    }

    #[test]
    fn a_model_that_folds_over_ends_where_it_does() {
        // r - 0.3 r³ turns back where 1 = 0.9 r².
        let folding = Polynomial { numerator: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], ..Default::default() };
        let lens = Lens::new(Model::Polynomial(folding));
        let valid = lens.valid_radius();
        assert!((valid - (1.0f64 / 0.9).sqrt()).abs() < 0.02, "{valid}");
        assert!(lens.unproject(DVec2::new(0.9, 0.0), valid).is_none(), "nothing falls beyond the fold");
    }

    #[test]
    fn models_with_zero_coefficients_are_pinholes() {
        assert!(Lens::new(Model::Polynomial(Polynomial::default())).is_pinhole());
        assert!(Lens::new(Model::Division { k: 0.0 }).is_pinhole());
        assert!(!Lens::new(Model::Polynomial(Polynomial { base: Base::Angle, ..Default::default() })).is_pinhole());
        assert!(!Lens { shear: 0.01, ..Default::default() }.is_pinhole());
    }

    #[test]
    fn a_number_that_is_none_is_neither_nothing_nor_finite() {
        let polynomial = Polynomial { tangential: [0.0, f64::NAN], ..Default::default() };
        for lens in [Lens::new(Model::Polynomial(polynomial)), Lens { shear: f64::NAN, ..Default::default() }] {
            assert!(!lens.is_pinhole() && !lens.is_finite(), "{lens:?}");
        }
        assert!(lenses().iter().all(|(_, lens)| lens.is_finite()));
    }
}
