// The finished picture, in the pixels of the targets: radiance through exposure and curve, the photo and the path-traced
// picture over it, then the frustums and the lines of the wipes. Mirrors `ScreenUniform` in `uniforms.rs`.

// What a pipeline is made for; see `variants.rs`.
override CURVE: u32 = 0u;
override FALSE_COLOUR: bool = false;
override STRIPES: bool = false;
// 0 off, 1 under, 2 over, 3 wipe.
override PHOTO_MODE: u32 = 0u;
override PHOTO_IS_EXACT: bool = false;
override HAS_TRACED: bool = false;
// The drawn scene shows through it.
override FADES_TO_TRACED: bool = false;
override TRACED_IS_EXACT: bool = false;
override HAS_LIGHT_WIPE: bool = false;
// The border of the photo is drawn.
override THROUGH_PHOTO: bool = false;

struct Screen {
    // Upper left corner and size of the photo in pixels.
    photo_rect: vec4<f32>,
    // Two to the power of the exposure, opacity or place of the photo, levels of detail of photo and traced picture.
    numbers: vec4<f32>,
    // Columns of the wipes of light and photo; pixels a point; opacity of the traced picture.
    marks: vec4<f32>,
    // Width and height in pixels, padding.
    size: vec4<f32>,
}

@group(0) @binding(0) var<uniform> screen: Screen;
@group(0) @binding(1) var smooth_sampler: sampler;
@group(0) @binding(2) var radiance_target: texture_2d<f32>;
@group(0) @binding(3) var overlay_target: texture_2d<f32>;
@group(0) @binding(4) var photo: texture_2d<f32>;
@group(0) @binding(5) var traced: texture_2d<f32>;

struct ScreenCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec2<f32>,
}

@vertex
fn corner_of_screen(@builtin(vertex_index) index: u32) -> ScreenCorner {
    let corner = vec2(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
    var out: ScreenCorner;
    out.clip = vec4(corner, 0.0, 1.0);
    out.place = vec2(0.5 + 0.5 * corner.x, 0.5 - 0.5 * corner.y) * screen.size.xy;
    return out;
}

// The colour of a pixel by its kind; see `colour.wgsl`.
fn shown(pixel: vec4<f32>, place: vec2<f32>) -> vec3<f32> {
    let kind = pixel.a - select(0.0, BEHIND, pixel.a >= BEHIND - 0.5);
    if kind < 0.5 {
        return pixel.rgb;
    }
    let exposed = pixel.rgb * select(1.0, screen.numbers.x, kind < 1.5);
    if STRIPES && (u32(place.y) + u32(place.x)) / STRIPE_PIXELS % 2u == 0u {
        let largest = max(exposed.r, max(exposed.g, exposed.b));
        if largest > 1.0 {
            return TOO_BRIGHT;
        }
        if largest <= 0.0 {
            return TOO_DARK;
        }
    }
    if FALSE_COLOUR {
        return scale_colour(dot(exposed, vec3(0.2126, 0.7152, 0.0722)));
    }
    return vec3(encode(exposed.r, CURVE), encode(exposed.g, CURVE), encode(exposed.b, CURVE));
}

// A pixel of a picture marks what is not finite by alpha 0; a filter may have mixed it with others.
fn of_picture(pixel: vec4<f32>) -> vec4<f32> {
    return vec4(pixel.rgb, select(READY, RADIANCE, pixel.a > 0.999));
}

fn over(below: vec3<f32>, above: vec3<f32>, opacity: f32) -> vec3<f32> {
    return mix(below, above, clamp(opacity, 0.0, 1.0));
}

fn mark(colour: vec3<f32>, place: f32, line: f32) -> vec3<f32> {
    // A light line in a dark one, seen on any picture.
    let away = abs(place - line) / screen.marks.z;
    let dark = mix(vec3(0.0), colour, clamp(away - 0.4, 0.55, 1.0));
    return select(select(dark, vec3(0.95), away <= 0.5), colour, away > 1.5);
}

@fragment
fn colour_of_screen(corner: ScreenCorner) -> @location(0) vec4<f32> {
    let place = corner.place;
    let of_size = place / screen.size.xy;
    let drawn = textureLoad(radiance_target, vec2<i32>(place), 0);
    var colour: vec3<f32>;
    if HAS_TRACED {
        var pixel: vec4<f32>;
        if TRACED_IS_EXACT {
            pixel = textureLoad(traced, vec2<i32>(place), 0);
        } else {
            pixel = textureSampleLevel(traced, smooth_sampler, of_size, screen.numbers.w);
        }
        colour = shown(of_picture(pixel), place);
        if FADES_TO_TRACED {
            colour = over(shown(drawn, place), colour, screen.marks.w);
        }
    } else {
        colour = shown(drawn, place);
    }
    let in_photo = place - screen.photo_rect.xy;
    let is_in_photo = all(in_photo >= vec2(0.0)) && all(in_photo < screen.photo_rect.zw);
    if PHOTO_MODE != 0u && is_in_photo {
        var pixel: vec4<f32>;
        if PHOTO_IS_EXACT {
            pixel = textureLoad(photo, vec2<i32>(in_photo), 0);
        } else {
            pixel = textureSampleLevel(photo, smooth_sampler, in_photo / screen.photo_rect.zw, screen.numbers.z);
        }
        let photo_colour = shown(of_picture(pixel), place);
        if PHOTO_MODE == 1u {
            colour = select(colour, photo_colour, drawn.a >= BEHIND - 0.5);
        } else if PHOTO_MODE == 2u {
            colour = over(colour, photo_colour, screen.numbers.y);
        } else {
            colour = select(colour, photo_colour, place.x < screen.marks.y);
        }
    }
    let overlay = textureLoad(overlay_target, vec2<i32>(place), 0);
    colour = colour * (1.0 - overlay.a) + overlay.rgb;
    if HAS_LIGHT_WIPE {
        colour = mark(colour, place.x, screen.marks.x);
    }
    if PHOTO_MODE == 3u && is_in_photo {
        colour = mark(colour, place.x, screen.marks.y);
    }
    if THROUGH_PHOTO {
        let outside = max(screen.photo_rect.xy - place, place - screen.photo_rect.xy - screen.photo_rect.zw);
        let away = max(outside.x, outside.y) / screen.marks.z;
        // Around the photo, not on it: none of its pixels is hidden.
        if away > 0.0 {
            colour = select(mix(colour, vec3(0.08), 0.35), vec3(0.75), away <= 1.0);
        }
    }
    return vec4(colour, 1.0);
}
