//! The sRGB transfer curve (IEC 61966-2-1): the only place where encoded and linear values meet.

use glam::Vec3;

/// The linear value of an sRGB-encoded value; both in [0, 1].
pub fn linear_from_srgb(encoded: f32) -> f32 {
    let encoded = f64::from(encoded);
    let linear = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
    linear as f32
}

/// The sRGB-encoded value of a linear value, clamped to [0, 1]. NaN stays NaN.
pub fn srgb_from_linear(linear: f32) -> f32 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear RGB of sRGB-encoded bytes, by table.
pub fn linear_from_srgb8(bytes: [u8; 3]) -> Vec3 {
    static TABLE: std::sync::LazyLock<[f32; 256]> =
        std::sync::LazyLock::new(|| std::array::from_fn(|byte| linear_from_srgb(byte as f32 / 255.0)));
    Vec3::from_array(bytes.map(|byte| TABLE[byte as usize]))
}

/// The sRGB byte nearest to a linear value; below 0 is 0, above 1 is 255. NaN is 0: callers mark it beforehand.
pub fn srgb8_from_linear_value(linear: f32) -> u8 {
    (srgb_from_linear(linear) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_the_way_there_and_back() {
        for byte in 0..=255u8 {
            assert_eq!(srgb8_from_linear_value(linear_from_srgb8([byte; 3]).x), byte);
        }
        // Middle grey of the standard: 0.5 encoded is 0.21404 linear.
        assert!((linear_from_srgb(0.5) - 0.214_041).abs() < 1e-6);
        assert_eq!(srgb8_from_linear_value(f32::INFINITY), 255);
        assert_eq!(srgb8_from_linear_value(-1.0), 0);
    }
}
