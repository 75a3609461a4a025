//! The sky of an hour: where the sun stands at a latitude, and the daylight it gives.
//!
//! Hours are solar: the sun is highest at 12. Declination by the series of Spencer 1971, "Fourier series representation
//! of the position of the sun"; elevation and azimuth by the usual spherical triangle. North is -z, east +x.

use super::environment::Environment;
use super::sky::{SkySettings, physical_irradiance, sun_and_sky};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::math::sphere::direction_of_angles;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::f32::consts::{PI, TAU};

/// Steepness of the haze over the ground: how much of it is gone at a look straight down.
const GROUND_HAZE: f32 = 0.03;
/// A sun lower than this, in radians, is taken as set: its way through the air is beyond what the model was made for.
const LOWEST_SUN: f32 = 0.02;
/// Days of a year.
const DAYS: u16 = 365;

/// A place in time and on Earth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Day {
    /// Solar time in hours, in [0, 24].
    pub hour: f32,
    /// Degrees north of the equator, in [-90, 90].
    pub latitude_degrees: f32,
    /// Day of the year, from 1.
    pub day_of_year: u16,
    /// Turbidity of the air, 2 (very clear) to 10 (thick haze).
    pub haze: f32,
}

impl Default for Day {
    fn default() -> Self {
        // An afternoon of spring in the middle latitudes.
        Day { hour: 15.0, latitude_degrees: 48.0, day_of_year: 110, haze: 3.0 }
    }
}

impl Day {
    /// A day by its name, `HOUR@LATITUDE` or `HOUR@LATITUDE,DAY`, such as `16:30@48` or `9.5@-33.9,355`; `None` for
    /// another name.
    pub fn of_name(name: &str) -> Option<Self> {
        let (hour, place) = name.split_once('@')?;
        let hour = match hour.split_once(':') {
            Some((hours, minutes)) => hours.parse::<f32>().ok()? + minutes.parse::<f32>().ok()? / 60.0,
            None => hour.parse().ok()?,
        };
        let usual = Day::default();
        let (latitude, day) = match place.split_once(',') {
            Some((latitude, day)) => (latitude, day.parse().ok()?),
            None => (place, usual.day_of_year),
        };
        let day = Day { hour, latitude_degrees: latitude.parse().ok()?, day_of_year: day, ..usual };
        let is_there = (0.0..=24.0).contains(&day.hour) && (-90.0..=90.0).contains(&day.latitude_degrees);
        (is_there && (1..=DAYS + 1).contains(&day.day_of_year)).then_some(day)
    }

    /// The name that [`Day::of_name`] reads.
    pub fn name(&self) -> String {
        format!("{}@{},{}", self.clock(), self.latitude_degrees, self.day_of_year)
    }

    /// The hour as a clock shows it.
    pub fn clock(&self) -> String {
        let minutes = (self.hour.clamp(0.0, 24.0) * 60.0).round() as u32;
        format!("{:02}:{:02}", minutes / 60, minutes % 60)
    }

    /// Declination of the sun in radians, Spencer 1971.
    fn declination(&self) -> f32 {
        let angle = TAU * (f32::from(self.day_of_year) - 1.0) / f32::from(DAYS);
        0.006918 - 0.399912 * angle.cos() + 0.070257 * angle.sin() - 0.006758 * (2.0 * angle).cos()
            + 0.000907 * (2.0 * angle).sin()
            - 0.002697 * (3.0 * angle).cos()
            + 0.00148 * (3.0 * angle).sin()
    }

    /// Elevation of the sun above the horizon and its azimuth from north over east, in radians.
    pub fn sun(&self) -> (f32, f32) {
        let (declination, latitude) = (self.declination(), self.latitude_degrees.to_radians());
        let angle = (self.hour - 12.0) * PI / 12.0;
        let up = latitude.sin() * declination.sin() + latitude.cos() * declination.cos() * angle.cos();
        let east = -declination.cos() * angle.sin();
        let north = latitude.cos() * declination.sin() - latitude.sin() * declination.cos() * angle.cos();
        (up.clamp(-1.0, 1.0).asin(), east.atan2(north).rem_euclid(TAU))
    }

    /// Direction towards the sun.
    pub fn towards_sun(&self) -> Vec3 {
        let (elevation, azimuth) = self.sun();
        direction_of_angles(azimuth, 0.5 * PI - elevation)
    }

    /// The hours between which the sun is up; `None` where it does not rise.
    pub fn daylight(&self) -> Option<(f32, f32)> {
        let (declination, latitude) = (self.declination(), self.latitude_degrees.to_radians());
        let level = LOWEST_SUN.sin() - latitude.sin() * declination.sin();
        let cosine = level / (latitude.cos() * declination.cos()).max(1e-6);
        (cosine < 1.0).then(|| {
            let half = cosine.max(-1.0).acos() * 12.0 / PI;
            (12.0 - half, 12.0 + half)
        })
    }

    /// What the daylight is made of; brighter and darker as hours are, so that noon of the built-in skies is the measure.
    ///
    /// # Errors
    /// `InvalidSetting` where the sun has not risen.
    pub fn settings(&self) -> Result<SkySettings> {
        let (elevation, azimuth) = self.sun();
        if elevation.is_nan() || elevation < LOWEST_SUN - 1e-3 {
            return Err(self.below_horizon());
        }
        let noon = SkySettings::noon();
        let settings = SkySettings {
            sun_elevation_radians: elevation,
            sun_azimuth_radians: azimuth,
            sun_radius_radians: 1.5f32.to_radians(),
            haze: self.haze,
            ground_haze: GROUND_HAZE,
            ..noon
        };
        let ratio = physical_irradiance(&settings) / physical_irradiance(&noon).max(f32::MIN_POSITIVE);
        Ok(SkySettings { irradiance: noon.irradiance * ratio, ..settings })
    }

    /// Its daylight, of so many rows.
    ///
    /// # Errors
    /// As of [`Day::settings`].
    pub fn environment(&self, height: usize) -> Result<Environment> {
        Ok(sun_and_sky(2 * height, height, &self.settings()?))
    }

    fn below_horizon(&self) -> Error {
        let remedy = match self.daylight() {
            Some((rise, set)) => {
                let clock = |hour| Day { hour, ..*self }.clock();
                format!("give an hour from {} to {}, or another latitude or day", clock(rise), clock(set))
            }
            None => "the sun does not rise there on that day: give another latitude or day".into(),
        };
        let message = format!("at {} the sun is below the horizon of latitude {}", self.clock(), self.latitude_degrees);
        Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting("env".into())).remedy(remedy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::luminance;

    #[test]
    fn the_sun_stands_where_almanacs_say() {
        let sun = |hour, latitude_degrees, day_of_year| {
            let (elevation, azimuth) = Day { hour, latitude_degrees, day_of_year, ..Day::default() }.sun();
            (elevation.to_degrees(), azimuth.to_degrees())
        };
        // Noon of an equinox: 90 degrees less the latitude, in the south; of the summer solstice 23.4 more.
        for (day, more) in [(80, 0.0), (172, 23.44), (355, -23.44)] {
            let (elevation, azimuth) = sun(12.0, 48.0, day);
            assert!((elevation - (42.0 + more)).abs() < 0.6 && (azimuth - 180.0).abs() < 0.1, "{day}: {elevation}");
        }
        // It rises in the east and stands in the north over the other half of the Earth.
        let (elevation, azimuth) = sun(6.0, 0.0, 80);
        assert!(elevation.abs() < 0.6 && (azimuth - 90.0).abs() < 0.6, "{elevation} {azimuth}");
        assert!(sun(15.0, 48.0, 110).1 > 180.0, "in the west after noon");
        let (_, azimuth) = sun(12.0, -33.9, 355);
        assert!(!(0.1..=359.9).contains(&azimuth), "{azimuth}");
    }

    #[test]
    fn the_length_of_a_day_goes_with_season_and_latitude() {
        let hours = |latitude_degrees, day_of_year| {
            let day = Day { latitude_degrees, day_of_year, ..Day::default() };
            day.daylight().map(|(rise, set)| set - rise)
        };
        assert!((hours(0.0, 80).unwrap() - 12.0).abs() < 0.3);
        assert!(hours(48.0, 172).unwrap() > 15.5 && hours(48.0, 355).unwrap() < 8.5);
        assert_eq!(hours(80.0, 355), None, "the polar night");
        assert!(hours(80.0, 172).unwrap() > 23.99, "and day");
        // At both ends the sun has just risen, and there is a sky.
        let day = Day::default();
        let (rise, set) = day.daylight().unwrap();
        for hour in [rise, set] {
            assert!(Day { hour, ..day }.environment(8).is_ok(), "{hour}");
        }
    }

    #[test]
    fn names_are_read_as_they_are_written_and_others_are_not() {
        for (name, hour, latitude, day) in
            [("16:30@48", 16.5, 48.0, 110), ("9.5@-33.9,355", 9.5, -33.9, 355), ("12@0,1", 12.0, 0.0, 1)]
        {
            let read = Day::of_name(name).unwrap();
            assert_eq!((read.hour, read.latitude_degrees, read.day_of_year), (hour, latitude, day), "{name}");
            assert_eq!(Day::of_name(&read.name()), Some(read));
        }
        for name in ["noon", "25@48", "12@95", "12:xx@1", "12@1,0", "12@1,400", "@", "NaN@1", "12@NaN", "a@b"] {
            assert_eq!(Day::of_name(name), None, "{name}");
        }
    }

    #[test]
    fn a_sun_below_the_horizon_is_an_error_that_names_the_hours_of_light() {
        let error = Day { hour: 2.0, ..Day::default() }.environment(8).unwrap_err();
        assert!(error.remedy_text().contains("from 0"), "{error}");
        let polar = Day { latitude_degrees: 85.0, day_of_year: 355, ..Day::default() };
        assert!(polar.settings().unwrap_err().remedy_text().contains("does not rise"));
    }

    #[test]
    fn light_is_dimmer_and_warmer_towards_the_evening() {
        let at = |hour| {
            let sky = Day { hour, day_of_year: 172, ..Day::default() }.environment(32).unwrap();
            let brightest =
                sky.radiance.pixels().iter().copied().max_by(|a, b| luminance(*a).total_cmp(&luminance(*b)));
            (luminance(sky.mean_radiance()), brightest.unwrap())
        };
        let ((noon, noon_sun), (evening, evening_sun)) = (at(12.0), at(19.0));
        assert!(evening < 0.4 * noon, "{evening} {noon}");
        assert!(evening_sun.x / evening_sun.z > 1.3 * noon_sun.x / noon_sun.z, "{evening_sun} {noon_sun}");
    }
}
