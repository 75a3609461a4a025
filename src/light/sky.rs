//! A daylight made by formula: for the built-in demo, and for relighting when no photographed environment is at hand.
//!
//! Sky: Preetham, Shirley and Smits 1999, "A Practical Analytic Model for Daylight", appendix A.2 (five-parameter
//! distribution of Perez, Seals and Michalsky 1993, by turbidity). Clouds: the overcast sky of Moon and Spencer 1942,
//! mixed in. Sun: its illuminance outside the air, dimmed and reddened along its path (same appendix, A.1), spread
//! over a soft disc. Ground: diffuse, lit by both.
//!
//! It is plausible, not a prediction: three bands stand for the spectrum, and the whole is scaled to a wanted
//! irradiance as an exposure would.

use super::environment::Environment;
use crate::image::{Image, RgbImage};
use crate::math::{luminance, sphere};
use glam::Vec3;
use std::f32::consts::PI;

/// What a procedural daylight is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkySettings {
    /// Height of the sun above the horizon in radians, in [0, pi/2]; clamped.
    pub sun_elevation_radians: f32,
    /// Place of the sun along the horizon in radians: 0 at -z, pi/2 at +x (the phi of the map's convention).
    pub sun_azimuth_radians: f32,
    /// Standard deviation of the soft disc of the sun in radians; at least half a texel is used. The energy of the sun
    /// does not depend on it.
    pub sun_radius_radians: f32,
    /// Brightness of the sun as a factor of the physical one; 0 leaves it out.
    pub sun_strength: f32,
    /// Turbidity: 2 is very clear air, 10 is thick haze; clamped to that range.
    pub haze: f32,
    /// Part of the sky behind clouds, in [0, 1]; 1 is a grey sky without a sun.
    pub cloud_cover: f32,
    /// Diffuse reflectance of the ground, linear RGB in [0, 1].
    pub ground_reflectance: Vec3,
    /// How much of the ground straight below is lost in the air before it; further out it is more, and at the horizon the
    /// ground is as bright as the sky. 0 gives a ground of one brightness.
    pub ground_haze: f32,
    /// Luminance of the irradiance of an upward surface. At pi a white horizontal diffuse surface has radiance 1.
    pub irradiance: f32,
}

/// The skies that are built in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BuiltInSky {
    /// A clear day with a high sun.
    Noon,
    /// A low sun in haze.
    Evening,
    /// Clouds alone.
    Overcast,
}

impl BuiltInSky {
    /// All of them, in the order in which they are shown.
    pub const ALL: [BuiltInSky; 3] = [BuiltInSky::Noon, BuiltInSky::Evening, BuiltInSky::Overcast];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            BuiltInSky::Noon => "noon",
            BuiltInSky::Evening => "evening",
            BuiltInSky::Overcast => "overcast",
        }
    }

    /// The sky of a name; `None` where no sky has it.
    pub fn of_name(name: &str) -> Option<Self> {
        BuiltInSky::ALL.into_iter().find(|sky| sky.name() == name)
    }

    /// What it is made of.
    pub fn settings(self) -> SkySettings {
        match self {
            BuiltInSky::Noon => SkySettings::noon(),
            BuiltInSky::Evening => SkySettings::evening(),
            BuiltInSky::Overcast => SkySettings::overcast(),
        }
    }
}

impl SkySettings {
    /// A clear day with a high sun.
    pub fn noon() -> Self {
        SkySettings {
            sun_elevation_radians: 55f32.to_radians(),
            sun_azimuth_radians: 140f32.to_radians(),
            sun_radius_radians: 3f32.to_radians(),
            sun_strength: 1.0,
            haze: 2.8,
            cloud_cover: 0.0,
            ground_reflectance: Vec3::new(0.20, 0.18, 0.14),
            ground_haze: 0.0,
            irradiance: PI,
        }
    }

    /// A warm low sun.
    pub fn evening() -> Self {
        SkySettings {
            sun_elevation_radians: 9f32.to_radians(),
            sun_azimuth_radians: 250f32.to_radians(),
            haze: 4.0,
            irradiance: 0.35 * PI,
            ..Self::noon()
        }
    }

    /// A grey sky, brightest above.
    pub fn overcast() -> Self {
        SkySettings { sun_strength: 0.0, cloud_cover: 1.0, irradiance: 0.8 * PI, ..Self::noon() }
    }
}

/// A daylight of this size; sides of 0 count as 1.
pub fn sun_and_sky(width: usize, height: usize, settings: &SkySettings) -> Environment {
    let (width, height) = (width.max(1), height.max(1));
    let Daylight { elevation, sun, cloud_cover, clear } = Daylight::of(settings);
    // Zenith luminance under cloud in kcd/m^2, Krochmann and Seidl 1974.
    let cloud_zenith = 0.123 + 8.6 * elevation.sin();
    let sky = |direction: Vec3| {
        // Clouds are lit from all sides; their light is a little bluer than the sun's.
        let cloud = Vec3::new(0.96, 1.0, 1.07) * cloud_zenith * (1.0 + 2.0 * direction.y) / 3.0;
        clear.radiance(direction, sun) * (1.0 - cloud_cover) + cloud * cloud_cover
    };
    let mut radiance = over_upper_half(width, height, sky);
    add_sun(&mut radiance, sun, settings, sun_illuminance(elevation, settings.haze) * (1.0 - cloud_cover).powi(2));
    // The ground reflects what falls on it.
    let horizontal = irradiance_from_above(&radiance);
    let ground = settings.ground_reflectance * horizontal / PI;
    let below = over_upper_half(width, height, |_| Vec3::ONE);
    let scale = settings.irradiance / luminance(horizontal).max(f32::MIN_POSITIVE);
    let radiance = Image::from_fn(width, height, |row, column| {
        let place = (row, column);
        let under = Vec3::ONE - below[place];
        let direction = sphere::direction_of_texel(row, column, width, height);
        let seen = match settings.ground_haze > 0.0 && direction.y < 0.0 {
            true => {
                hazy(ground, sky(Vec3::new(direction.x, 0.0, direction.z).normalize_or(Vec3::X)), direction, settings)
            }
            false => ground,
        };
        ((radiance[place] + seen * under) * scale).max(Vec3::ZERO)
    });
    Environment { radiance }
}

/// The ground below through the air before it, which shines like the sky at the horizon: the way to the ground is longer by
/// one over the sine of the depression (Koschmieder 1924).
fn hazy(ground: Vec3, horizon: Vec3, direction: Vec3, settings: &SkySettings) -> Vec3 {
    let left = (-settings.ground_haze / (-direction.y).max(1e-3)).exp();
    ground * left + horizon * (1.0 - left)
}

/// Luminance of the irradiance of an upward surface before it is brought to [`SkySettings::irradiance`], in units that all
/// skies share.
pub fn physical_irradiance(settings: &SkySettings) -> f32 {
    const HEIGHT: usize = 32;
    let Daylight { elevation, sun, cloud_cover, clear } = Daylight::of(settings);
    let mut radiance = over_upper_half(2 * HEIGHT, HEIGHT, |direction| clear.radiance(direction, sun));
    add_sun(&mut radiance, sun, settings, sun_illuminance(elevation, settings.haze) * (1.0 - cloud_cover).powi(2));
    luminance(irradiance_from_above(&radiance))
}

/// What sun and sky of some settings have in common.
struct Daylight {
    elevation: f32,
    sun: Vec3,
    cloud_cover: f32,
    clear: ClearSky,
}

impl Daylight {
    fn of(settings: &SkySettings) -> Self {
        let elevation = settings.sun_elevation_radians.clamp(0.0, PI / 2.0);
        Daylight {
            elevation,
            sun: sphere::direction_of_angles(settings.sun_azimuth_radians, PI / 2.0 - elevation),
            cloud_cover: settings.cloud_cover.clamp(0.0, 1.0),
            clear: ClearSky::new(elevation, settings.haze),
        }
    }
}

/// The mean of a radiance over each texel; below the horizon it is 0.
fn over_upper_half(width: usize, height: usize, radiance: impl Fn(Vec3) -> Vec3) -> RgbImage {
    const SPLIT: usize = 4;
    Image::from_fn(width, height, |row, column| {
        let mut sum = Vec3::ZERO;
        for step in 0..SPLIT * SPLIT {
            let (fine_row, fine_column) = (row * SPLIT + step / SPLIT, column * SPLIT + step % SPLIT);
            let direction = sphere::direction_of_texel(fine_row, fine_column, width * SPLIT, height * SPLIT);
            if direction.y > 0.0 {
                sum += radiance(direction);
            }
        }
        sum / (SPLIT * SPLIT) as f32
    })
}

/// Irradiance of an upward surface, from texels.
fn irradiance_from_above(radiance: &RgbImage) -> Vec3 {
    let (width, height) = (radiance.width(), radiance.height());
    let rows = radiance.pixels().chunks_exact(width).enumerate();
    rows.map(|(row, texels)| {
        // The integral of cos(theta) over a band, per solid angle: the cosine of its middle in terms of the sine.
        let (top, bottom) = (row as f32 / height as f32 * PI, (row + 1) as f32 / height as f32 * PI);
        let (top, bottom) = (top.min(PI / 2.0), bottom.min(PI / 2.0));
        let projected = PI * (bottom.sin().powi(2) - top.sin().powi(2)).max(0.0) / width as f32;
        texels.iter().copied().sum::<Vec3>() * projected
    })
    .sum()
}

/// Adds a soft disc whose illuminance on a surface facing it is `illuminance` times the wanted strength.
fn add_sun(radiance: &mut RgbImage, sun: Vec3, settings: &SkySettings, illuminance: Vec3) {
    let (width, height) = (radiance.width(), radiance.height());
    let deviation = settings.sun_radius_radians.max(0.5 * PI / height as f32);
    let shape = over_upper_half(width, height, |direction| {
        let angle = direction.dot(sun).clamp(-1.0, 1.0).acos();
        Vec3::splat((-0.5 * (angle / deviation).powi(2)).exp())
    });
    let total: f64 = shape
        .pixels()
        .iter()
        .enumerate()
        .map(|(index, value)| f64::from(value.x) * sphere::solid_angle_of_texel(index / width, width, height))
        .sum();
    if total > 0.0 {
        let peak = illuminance * settings.sun_strength.max(0.0) / total as f32;
        radiance.pixels_mut().iter_mut().zip(shape.pixels()).for_each(|(texel, value)| *texel += peak * *value);
    }
}

/// Illuminance of the sun in klx per channel after its way through the air.
fn sun_illuminance(elevation: f32, haze: f32) -> Vec3 {
    const OUTSIDE: f32 = 128.0;
    let haze = haze.clamp(2.0, 10.0);
    let zenith_degrees = 90.0 - elevation.to_degrees();
    // Air mass, Kasten 1965 as printed by Preetham et al.
    let mass = 1.0 / (elevation.sin() + 0.15 * (93.885 - zenith_degrees).powf(-1.253));
    let turbidity_coefficient = 0.04608 * haze - 0.04586;
    // Micrometres of the three channels.
    let transmitted = [0.610f32, 0.550, 0.465].map(|wavelength| {
        let rayleigh = 0.008735 * wavelength.powf(-4.08);
        let aerosol = turbidity_coefficient * wavelength.powf(-1.3);
        (-(rayleigh + aerosol) * mass).exp()
    });
    OUTSIDE * Vec3::from_array(transmitted)
}

/// The clear sky of Preetham, Shirley and Smits for one sun and one turbidity.
struct ClearSky {
    /// Distribution coefficients A to E of luminance Y and of chromaticities x and y.
    distribution: [[f32; 5]; 3],
    /// Y, x and y at the zenith over the distribution there: the factor of the distribution.
    factor: [f32; 3],
}

impl ClearSky {
    fn new(elevation: f32, haze: f32) -> Self {
        let t = haze.clamp(2.0, 10.0);
        let sun_zenith = PI / 2.0 - elevation;
        let distribution = [
            [
                0.1787 * t - 1.4630,
                -0.3554 * t + 0.4275,
                -0.0227 * t + 5.3251,
                0.1206 * t - 2.5771,
                -0.0670 * t + 0.3703,
            ],
            [
                -0.0193 * t - 0.2592,
                -0.0665 * t + 0.0008,
                -0.0004 * t + 0.2125,
                -0.0641 * t - 0.8989,
                -0.0033 * t + 0.0452,
            ],
            [
                -0.0167 * t - 0.2608,
                -0.0950 * t + 0.0092,
                -0.0079 * t + 0.2102,
                -0.0441 * t - 1.6537,
                -0.0109 * t + 0.0529,
            ],
        ];
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * sun_zenith);
        let luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
        let chromaticity = |rows: [[f32; 4]; 3]| {
            let cubic = |[a, b, c, d]: [f32; 4]| ((a * sun_zenith + b) * sun_zenith + c) * sun_zenith + d;
            (cubic(rows[0]) * t + cubic(rows[1])) * t + cubic(rows[2])
        };
        let x = chromaticity([
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        ]);
        let y = chromaticity([
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        ]);
        let at_zenith = |row: usize| perez(&distribution[row], 1.0, sun_zenith);
        let factor = [luminance.max(0.05) / at_zenith(0), x / at_zenith(1), y / at_zenith(2)];
        ClearSky { distribution, factor }
    }

    /// Linear RGB in kcd/m^2 towards a direction above the horizon.
    fn radiance(&self, direction: Vec3, sun: Vec3) -> Vec3 {
        let from_sun = direction.dot(sun).clamp(-1.0, 1.0).acos();
        let [luminance, x, y] =
            [0, 1, 2].map(|row| self.factor[row] * perez(&self.distribution[row], direction.y, from_sun));
        if luminance <= 0.0 || y <= 0.0 {
            return Vec3::ZERO;
        }
        let (big_x, big_z) = (luminance * x / y, luminance * (1.0 - x - y) / y);
        // Linear Rec. 709 from CIE XYZ (IEC 61966-2-1).
        Vec3::new(
            3.2406 * big_x - 1.5372 * luminance - 0.4986 * big_z,
            -0.9689 * big_x + 1.8758 * luminance + 0.0415 * big_z,
            0.0557 * big_x - 0.2040 * luminance + 1.0570 * big_z,
        )
        .max(Vec3::ZERO)
    }
}

/// F(theta, gamma) = (1 + A exp(B/cos theta))(1 + C exp(D gamma) + E cos^2 gamma), Preetham et al. eq. 3.
fn perez([a, b, c, d, e]: &[f32; 5], cos_zenith: f32, from_sun: f32) -> f32 {
    (1.0 + a * (b / cos_zenith.max(0.01)).exp()) * (1.0 + c * (d * from_sun).exp() + e * from_sun.cos().powi(2))
}
