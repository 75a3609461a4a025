//! Where a light may have suns: texels that are believed to be much brighter than the sky around them.

use super::light_shape::LightShape;
use super::light_step::usual_radiance;
use super::settings::Suns;
use crate::math::sphere::{direction_of_texel, solid_angle_of_texel};
use glam::Vec3;

/// How many times its excess over the usual radiance a narrow hat may be (one standard deviation), see [`narrow_scales`], in
/// one solution after the other. To be weighed by what was found is a prior with heavy tails (reweighted least squares): few
/// suns, each as bright as it likes. It has many minima, so it begins wide, where all narrow hats are free to share what is
/// bright, and narrows down (graduated non-convexity; Blake and Zisserman 1987). Cauchy's distribution
/// would end at 0.7.
pub const GROWTHS: [f64; 3] = [10.0, 3.0, 1.0];
/// A sun, with what is bright around it, reaches so far from its brightest texel, in degrees.
const SUN_RADIUS_DEGREES: f32 = 20.0;

/// What narrow hats are believed to be (one standard deviation), over the usual radiance of their channel, by the light
/// before the step, given with its coefficients. Where all channels are bright there is a sun, and it may be much
/// brighter; elsewhere there is sky. One channel alone is no sun: solved by themselves, channels put blue or red suns where
/// only held-out views look.
pub fn narrow_scales(
    shape: &LightShape,
    light: &[[f32; 3]],
    coefficients: &[Vec<f32>; 3],
    suns: Suns,
    growth: f64,
) -> Vec<f64> {
    let usual = coefficients.each_ref().map(|x| usual_radiance(shape, x));
    let brightness = |&texel: &u32| {
        let radiance = light[texel as usize];
        (0..3).map(|c| f64::from(radiance[c]) / usual[c]).fold(f64::INFINITY, f64::min)
    };
    let may_shine = places_of_suns(shape, brightness, suns);
    let scale = |texel: &u32| match may_shine(*texel) {
        true => 1.0 + growth * (brightness(texel) - 1.0).max(0.0),
        false => 1.0,
    };
    shape.fine.iter().map(scale).collect()
}

/// Tells of a texel whether a sun may be there.
fn places_of_suns(shape: &LightShape, brightness: impl Fn(&u32) -> f64, suns: Suns) -> impl Fn(u32) -> bool {
    let (width, height) = shape.size;
    let power = move |texel: &u32| brightness(texel) * solid_angle_of_texel(*texel as usize / width, width, height);
    let direction = move |texel: u32| direction_of_texel(texel as usize / width, texel as usize % width, width, height);
    let sun: Option<Vec3> = match suns {
        Suns::Any => None,
        Suns::One => shape.fine.iter().max_by(|a, b| power(a).total_cmp(&power(b))).map(|&texel| direction(texel)),
    };
    let least_cosine = SUN_RADIUS_DEGREES.to_radians().cos();
    move |texel| sun.is_none_or(|sun| direction(texel).dot(sun) >= least_cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn daylight_has_one_sun_and_rooms_have_lamps() {
        let (sun, beside, lamp) = (8 * 64 + 9, 8 * 64 + 12, 8 * 64 + 40);
        let shape = LightShape::new((64, 32), vec![sun, beside, lamp]);
        let mut light = vec![[1.0f32; 3]; 64 * 32];
        light[sun as usize] = [1000.0; 3];
        light[beside as usize] = [10.0; 3];
        light[lamp as usize] = [500.0; 3];
        let coefficients = shape.coefficients_of_channels(&light);
        let any = narrow_scales(&shape, &light, &coefficients, Suns::Any, 10.0);
        assert!(any[0] > any[2] && any[2] > any[1] && any[1] > 10.0, "{any:?}");
        // What is beside a sun is of it: here by three texels of 5.6 degrees. The lamp is on the other side.
        assert_eq!(narrow_scales(&shape, &light, &coefficients, Suns::One, 10.0), [any[0], any[1], 1.0]);
    }
}
