// What every pass over the scene knows. Mirrors `ViewUniform` in `uniforms.rs`.

struct View {
    clip_from_world: mat4x4<f32>,
    // Columns: right, down and forward of the eye in the world, and its position.
    world_from_camera: mat4x4<f32>,
    // Focal lengths and centre in pixels of the target.
    focal_centre: vec4<f32>,
    // Width and height of the target, pixels of the target a point of the screen, near plane in world units.
    size: vec4<f32>,
    // Of each light: cosine and sine of its turn, strength, 1 where there is one.
    light: vec4<f32>,
    other_light: vec4<f32>,
    // Column of the target where the first light ends, strength of the specular lobe, lower end of the scale, 1 over its length.
    shading: vec4<f32>,
    // sRGB of the background, padding.
    backdrop: vec4<f32>,
    // Share of the second picture of a crossfade, factor of the exposure, padding.
    crossfade: vec4<f32>,
}

@group(0) @binding(0) var<uniform> view: View;
