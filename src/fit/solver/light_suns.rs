//! Where a light may have suns: texels that are believed to be much brighter than the sky around them.

use super::light_shape::LightShape;
use super::light_step::usual_radiance;

/// How many times its excess over the usual radiance a narrow hat may be (one standard deviation), see [`narrow_scales`], in
/// one solution after the other. To be weighed by what was found is a prior with heavy tails (reweighted least squares): few
/// suns, each as bright as it likes. It has many minima, so it begins wide, where all narrow hats are free to share what is
/// bright, and narrows down (graduated non-convexity; Blake and Zisserman 1987). Cauchy's distribution
/// would end at 0.7.
pub const GROWTHS: [f64; 3] = [10.0, 3.0, 1.0];

/// What narrow hats are believed to be (one standard deviation), over the usual radiance of their channel, by the light
/// before the step, given with its coefficients. Where all channels are bright there is a sun, and it may be much
/// brighter; elsewhere there is sky. One channel alone is no sun: solved by themselves, channels put blue or red suns where
/// only held-out views look.
pub fn narrow_scales(shape: &LightShape, light: &[[f32; 3]], coefficients: &[Vec<f32>; 3], growth: f64) -> Vec<f64> {
    let usual = coefficients.each_ref().map(|x| usual_radiance(shape, x));
    let brightness = |&texel: &u32| {
        let radiance = light[texel as usize];
        (0..3).map(|c| f64::from(radiance[c]) / usual[c]).fold(f64::INFINITY, f64::min)
    };
    let scale = |texel: &u32| 1.0 + growth * (brightness(texel) - 1.0).max(0.0);
    shape.fine.iter().map(scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_brighter_may_be_brighter_still() {
        let (sun, beside, lamp) = (8 * 64 + 9, 8 * 64 + 12, 8 * 64 + 40);
        let shape = LightShape::new((64, 32), vec![sun, beside, lamp]);
        let mut light = vec![[1.0f32; 3]; 64 * 32];
        light[sun as usize] = [1000.0; 3];
        light[beside as usize] = [10.0; 3];
        light[lamp as usize] = [500.0; 3];
        let coefficients = shape.coefficients_of_channels(&light);
        let any = narrow_scales(&shape, &light, &coefficients, 10.0);
        assert!(any[0] > any[2] && any[2] > any[1] && any[1] > 10.0, "{any:?}");
        // Fewer and brighter ones as the belief narrows.
        let narrow = narrow_scales(&shape, &light, &coefficients, 1.0);
        assert!(
            narrow.iter().zip(&any).all(|(narrow, wide)| (narrow - 1.0) * 10.0 - (wide - 1.0) < 1e-6),
            "{narrow:?}"
        );
    }
}
