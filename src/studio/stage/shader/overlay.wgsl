// Frustums over the scene: thin smooth lines and small pictures, into a target of sRGB with opacity.

struct LineCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) colour: vec4<f32>,
    // Across the line from its middle, along it from its start, half its width, length of a dash; all in pixels.
    @location(1) place: vec4<f32>,
}

@vertex
fn corner_of_line(
    @builtin(vertex_index) index: u32,
    @location(0) start_and_width: vec4<f32>,
    @location(1) end_and_dash: vec4<f32>,
    @location(2) colour: vec4<f32>,
) -> LineCorner {
    var out: LineCorner;
    out.colour = colour;
    var start = view.clip_from_world * vec4(start_and_width.xyz, 1.0);
    var end = view.clip_from_world * vec4(end_and_dash.xyz, 1.0);
    let near = view.size.w;
    if start.w < near && end.w < near {
        out.clip = vec4(2.0, 2.0, 0.0, 1.0);
        return out;
    }
    // What is behind the eye would come out mirrored: cut at the near plane.
    if start.w < near {
        start = mix(start, end, (near - start.w) / (end.w - start.w));
    } else if end.w < near {
        end = mix(end, start, (near - end.w) / (start.w - end.w));
    }
    let half_size = 0.5 * view.size.xy;
    let from_place = start.xy / start.w * half_size;
    let to_place = end.xy / end.w * half_size;
    let length_pixels = max(distance(from_place, to_place), 1e-3);
    let along = (to_place - from_place) / length_pixels;
    let across = vec2(-along.y, along.x);
    // 0 and 1 along, -1 and 1 across, as two triangles.
    let is_end = select(0.0, 1.0, index == 1u || index == 2u || index == 4u);
    let side = select(-1.0, 1.0, index >= 2u && index != 3u);
    let half_width = 0.5 * start_and_width.w * view.size.z;
    let reach = half_width + 2.0;
    let overhang = mix(-half_width, half_width, is_end) * 0.7;
    let place = mix(from_place, to_place, is_end) + along * overhang + across * side * reach;
    // A trifle nearer, so that lines on a surface are not eaten by it. Divided here: nothing is bent by perspective later.
    let depth = mix(start.z / start.w, end.z / end.w, is_end) * 1.003;
    out.clip = vec4(place / half_size, min(depth, 1.0), 1.0);
    out.place = vec4(side * reach, is_end * length_pixels + overhang, half_width, end_and_dash.w * view.size.z);
    return out;
}

@fragment
fn colour_of_line(corner: LineCorner) -> @location(0) vec4<f32> {
    let away = abs(corner.place.x) - corner.place.z;
    let line = clamp(0.5 - away, 0.0, 1.0);
    // A faint border, light about dark lines and dark about light ones: seen on any background.
    let is_dark = dot(corner.colour.rgb, vec3(0.2126, 0.7152, 0.0722)) < 0.35;
    let border = (1.0 - line) * clamp(1.5 - away, 0.0, 1.0) * 0.35;
    var opacity = corner.colour.a;
    let dash = corner.place.w;
    if dash > 0.0 {
        // Smooth over a pixel at both ends of a dash.
        let within = (corner.place.y % (2.0 * dash) + 2.0 * dash) % (2.0 * dash);
        opacity *= clamp(min(within, dash - within) + 0.5, 0.0, 1.0);
    }
    let colour = corner.colour.rgb * line + vec3(select(0.0, 1.0, is_dark)) * border;
    return vec4(colour, line + border) * opacity;
}

@group(1) @binding(0) var picture_sampler: sampler;
@group(1) @binding(1) var pictures: texture_2d<f32>;

struct PictureCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec2<f32>,
    @location(1) brightness: f32,
}

@vertex
fn corner_of_picture(
    @location(0) position: vec3<f32>,
    @location(1) brightness: f32,
    @location(2) place: vec2<f32>,
) -> PictureCorner {
    var out: PictureCorner;
    out.clip = view.clip_from_world * vec4(position, 1.0);
    out.place = place;
    out.brightness = brightness;
    return out;
}

@fragment
fn colour_of_picture(corner: PictureCorner) -> @location(0) vec4<f32> {
    return vec4(textureSample(pictures, picture_sampler, corner.place).rgb * corner.brightness, 1.0);
}
