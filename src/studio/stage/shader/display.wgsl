// The finished picture: radiance through exposure and curve, the photo and the path-traced picture over it, then the
// frustums and the lines of the wipes. Mirrors `ScreenUniform` in `uniforms.rs`.

struct Screen {
    // Width and height of the rectangle in pixels, width and height of the target of radiance.
    size: vec4<f32>,
    // Upper left corner and size of the photo in pixels of the rectangle.
    photo_rect: vec4<f32>,
    // Two to the power of the exposure, opacity or place of the photo, levels of detail of photo and traced picture.
    numbers: vec4<f32>,
    // Columns of the wipes of light and photo, or below 0; pixels a point; 1 where the photo's border is drawn.
    marks: vec4<f32>,
    // Curve, 1 for false colour, 1 for stripes, mode of the photo: 0 off, 1 under, 2 over, 3 wipe.
    choice: vec4<u32>,
    // 1 for a traced picture, 1 where photo, traced picture are shown pixel by pixel, padding.
    pictures: vec4<u32>,
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
    if screen.choice.z != 0u && (u32(place.y) + u32(place.x)) / STRIPE_PIXELS % 2u == 0u {
        let largest = max(exposed.r, max(exposed.g, exposed.b));
        if largest > 1.0 {
            return TOO_BRIGHT;
        }
        if largest <= 0.0 {
            return TOO_DARK;
        }
    }
    if screen.choice.y != 0u {
        return scale_colour(dot(exposed, vec3(0.2126, 0.7152, 0.0722)));
    }
    let curve = screen.choice.x;
    return vec3(encode(exposed.r, curve), encode(exposed.g, curve), encode(exposed.b, curve));
}

fn target_at(place: vec2<i32>) -> vec4<f32> {
    return textureLoad(radiance_target, clamp(place, vec2(0), vec2<i32>(screen.size.zw) - 1), 0);
}

// Kinds must not be mixed, and bright pixels would swallow dark ones: colours are mixed, as they are shown.
fn scene(place: vec2<f32>) -> vec3<f32> {
    let scaled = place * screen.size.zw / screen.size.xy;
    if all(screen.size.xy == screen.size.zw) {
        return shown(target_at(vec2<i32>(scaled)), place);
    }
    let corner = floor(scaled - 0.5);
    let share = scaled - 0.5 - corner;
    let first = vec2<i32>(corner);
    let upper = mix(shown(target_at(first), place), shown(target_at(first + vec2(1, 0)), place), share.x);
    let lower = mix(shown(target_at(first + vec2(0, 1)), place), shown(target_at(first + vec2(1, 1)), place), share.x);
    return mix(upper, lower, share.y);
}

// A pixel of a picture marks what is not finite by alpha 0; a filter may have mixed it with others.
fn of_picture(pixel: vec4<f32>) -> vec4<f32> {
    return vec4(pixel.rgb, select(READY, RADIANCE, pixel.a > 0.999));
}

fn over(below: vec3<f32>, above: vec3<f32>, opacity: f32) -> vec3<f32> {
    return mix(below, above, clamp(opacity, 0.0, 1.0));
}

fn mark(colour: vec3<f32>, place: f32, line: f32) -> vec3<f32> {
    if line < 0.0 {
        return colour;
    }
    // A light line in a dark one, seen on any picture.
    let away = abs(place - line) / screen.marks.z;
    let dark = mix(vec3(0.0), colour, clamp(away - 0.4, 0.55, 1.0));
    return select(select(dark, vec3(0.95), away <= 0.5), colour, away > 1.5);
}

@fragment
fn colour_of_screen(corner: ScreenCorner) -> @location(0) vec4<f32> {
    let place = corner.place;
    let of_size = place / screen.size.xy;
    var colour = scene(place);
    if screen.pictures.x != 0u {
        var pixel = textureSampleLevel(traced, smooth_sampler, of_size, screen.numbers.w);
        if screen.pictures.z != 0u {
            pixel = textureLoad(traced, vec2<i32>(place), 0);
        }
        colour = shown(of_picture(pixel), place);
    }
    let in_photo = place - screen.photo_rect.xy;
    let is_in_photo = all(in_photo >= vec2(0.0)) && all(in_photo < screen.photo_rect.zw);
    let mode = screen.choice.w;
    if mode != 0u && is_in_photo {
        var pixel = textureSampleLevel(photo, smooth_sampler, in_photo / screen.photo_rect.zw, screen.numbers.z);
        if screen.pictures.y != 0u {
            pixel = textureLoad(photo, vec2<i32>(in_photo), 0);
        }
        let photo_colour = shown(of_picture(pixel), place);
        if mode == 1u {
            let scaled = vec2<i32>(place * screen.size.zw / screen.size.xy);
            colour = select(colour, photo_colour, target_at(scaled).a >= BEHIND - 0.5);
        } else if mode == 2u {
            colour = over(colour, photo_colour, screen.numbers.y);
        } else {
            colour = select(colour, photo_colour, place.x < screen.marks.y);
        }
    }
    let overlay = textureSampleLevel(overlay_target, smooth_sampler, of_size, 0.0);
    colour = colour * (1.0 - overlay.a) + overlay.rgb;
    colour = mark(colour, place.x, screen.marks.x);
    if is_in_photo {
        colour = mark(colour, place.x, screen.marks.y);
    }
    if screen.marks.w > 0.5 {
        let outside = max(screen.photo_rect.xy - place, place - screen.photo_rect.xy - screen.photo_rect.zw);
        let away = max(outside.x, outside.y) / screen.marks.z;
        // Around the photo, not on it: none of its pixels is hidden.
        if away > 0.0 {
            colour = select(mix(colour, vec3(0.08), 0.35), vec3(0.75), away <= 1.0);
        }
    }
    return vec4(colour, 1.0);
}
