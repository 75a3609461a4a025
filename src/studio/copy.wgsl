// A finished picture into the window, smoothed where its pixels are not the window's.

@group(0) @binding(0) var smooth_sampler: sampler;
@group(0) @binding(1) var picture: texture_2d<f32>;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec2<f32>,
}

@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
    let corner = vec2(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
    var out: Corner;
    out.clip = vec4(corner, 0.0, 1.0);
    out.place = vec2(0.5 + 0.5 * corner.x, 0.5 - 0.5 * corner.y);
    return out;
}

@fragment
fn colour(corner: Corner) -> @location(0) vec4<f32> {
    return textureSample(picture, smooth_sampler, corner.place);
}
