// From linear radiance to the screen: the same sums as `image::display`, whose constants are written in front of this.

// The fourth number of a pixel of the target says what the others are.
const READY = 0.0; // sRGB, shown as it is
const RADIANCE = 1.0; // linear, shown with exposure and curve
const REFLECTANCE = 2.0; // linear, shown with curve but without exposure
const BEHIND = 4.0; // added where there is no mesh

const LARGEST = 60000.0;

fn scale_colour(value: f32) -> vec3<f32> {
    var scale = SCALE;
    let place = clamp(value, 0.0, 1.0) * f32(SCALE_LENGTH - 1);
    let below = min(i32(place), SCALE_LENGTH - 2);
    return mix(scale[below], scale[below + 1], place - f32(below));
}

fn srgb_from_linear(linear: f32) -> f32 {
    let value = clamp(linear, 0.0, 1.0);
    if value <= 0.0031308 {
        return value * 12.92;
    }
    return 1.055 * pow(value, 1.0 / 2.4) - 0.055;
}

fn encode(linear: f32, curve: u32) -> f32 {
    let value = clamp(linear, 0.0, 1e4);
    switch curve {
        case 0u: {
            return srgb_from_linear(value);
        }
        case 1u: {
            let shoulder = value * (2.51 * value + 0.03) / (value * (2.43 * value + 0.59) + 0.14);
            return srgb_from_linear(shoulder);
        }
        default: {
            return min(value, 1.0);
        }
    }
}
