// The mesh and what is behind it, into the target of radiance.

@group(1) @binding(0) var map_sampler: sampler;
@group(1) @binding(1) var diffuse_map: texture_2d<f32>;
@group(1) @binding(2) var specular_map: texture_2d<f32>;
// In a crossfade the photos.
@group(1) @binding(3) var quantity_map: texture_2d<f32>;

@group(2) @binding(0) var light_sampler: sampler;
@group(2) @binding(1) var light_map: texture_2d<f32>;
@group(2) @binding(2) var light_layers: texture_2d_array<f32>;
@group(2) @binding(3) var other_light_map: texture_2d<f32>;
@group(2) @binding(4) var other_light_layers: texture_2d_array<f32>;
@group(2) @binding(5) var reflectance_table: texture_2d<f32>;

// What of all this a pipeline is made for: what is not chosen costs nothing, on a processor too, which computes both sides
// of a branch. See `variants.rs`.
override LAYER: u32 = 0u;
override HAS_LOBE: bool = false;
override HAS_OTHER_LIGHT: bool = false;
override HAS_COLOURS: bool = false;
// The crossfade is that of diffuse map and light, not of photos and diffuse map.
override FADES_TO_LIT: bool = false;
// 0 one colour, 1 the light, 2 the light out of focus.
override BACKDROP: u32 = 0u;

const PI = 3.14159265358979;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) uv: vec2<f32>,
    // Times its weight, which is 1 where it is known.
    @location(3) colour: vec4<f32>,
}

@vertex
fn corner_of_mesh(
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) uv: vec2<f32>,
    @location(3) colour: vec4<f32>,
) -> Corner {
    var out: Corner;
    out.colour = colour;
    out.clip = view.clip_from_world * vec4(place, 1.0);
    out.place = place;
    out.normal = normal;
    out.uv = uv;
    return out;
}

// Directions of the world as the turned light knows them.
fn turned(direction: vec3<f32>, light: vec4<f32>) -> vec3<f32> {
    return vec3(light.x * direction.x - light.y * direction.z, direction.y, light.y * direction.x + light.x * direction.z);
}

// Place on a latitude-longitude map: theta = acos(d.y), phi = atan2(d.x, -d.z); the sampler wraps.
fn place_on_map(direction: vec3<f32>) -> vec2<f32> {
    let flat_length = length(direction.xz);
    let away = select(-direction.z, 1.0, flat_length < 1e-12);
    return vec2(atan2(direction.x, away) / (2.0 * PI), atan2(flat_length, direction.y) / PI);
}

fn is_other_light(column: f32) -> bool {
    return HAS_OTHER_LIGHT && column >= view.shading.x;
}

fn light_towards(direction: vec3<f32>, column: f32) -> vec3<f32> {
    if is_other_light(column) {
        let place = place_on_map(turned(direction, view.other_light));
        return textureSampleLevel(other_light_map, light_sampler, place, 0.0).rgb * view.other_light.z;
    }
    let place = place_on_map(turned(direction, view.light));
    return textureSampleLevel(light_map, light_sampler, place, 0.0).rgb * view.light.z;
}

fn blurred_light(direction: vec3<f32>, layer: i32, column: f32) -> vec3<f32> {
    if is_other_light(column) {
        let place = place_on_map(turned(direction, view.other_light));
        return textureSampleLevel(other_light_layers, light_sampler, place, layer, 0.0).rgb * view.other_light.z;
    }
    let place = place_on_map(turned(direction, view.light));
    return textureSampleLevel(light_layers, light_sampler, place, layer, 0.0).rgb * view.light.z;
}

// Light from about a direction, blurred by a lobe of this microfacet width.
fn light_about(direction: vec3<f32>, width: f32, column: f32) -> vec3<f32> {
    if width < FIRST_WIDTH {
        let sharp = light_towards(direction, column);
        return mix(sharp, blurred_light(direction, 1, column), max(width, 0.0) / FIRST_WIDTH);
    }
    let step = clamp(log(width / FIRST_WIDTH) / log(1.0 / FIRST_WIDTH), 0.0, 1.0) * f32(WIDTHS - 1);
    let below = min(i32(step), WIDTHS - 2);
    let narrow = blurred_light(direction, 1 + below, column);
    return mix(narrow, blurred_light(direction, 2 + below, column), step - f32(below));
}

fn lit(place: vec3<f32>, normal: vec3<f32>, uv: vec2<f32>, column: f32) -> vec3<f32> {
    let diffuse = textureSample(diffuse_map, map_sampler, uv).rgb;
    let specular = textureSample(specular_map, map_sampler, uv);
    let towards_eye = normalize(view.world_from_camera[3].xyz - place);
    let cosine = clamp(dot(normal, towards_eye), 0.0, 1.0);
    let width = sqrt(clamp(specular.a, 0.0, 1.0));
    var radiance = clamp(diffuse, vec3(0.0), vec3(1.0)) * blurred_light(normal, 0, column);
    if HAS_LOBE {
        let table = textureSampleLevel(reflectance_table, map_sampler, vec2(cosine, width), 0.0).xy;
        let reflected = clamp(specular.rgb, vec3(0.0), vec3(1.0)) * table.x + table.y;
        let about = reflect(-towards_eye, normal);
        radiance += view.shading.y * reflected * light_about(about, width, column);
    }
    return radiance;
}

fn checker(uv: vec2<f32>) -> vec3<f32> {
    let cell = floor(uv * 32.0);
    let odd = abs(cell.x + cell.y) % 2.0;
    return mix(vec3(0.18), vec3(0.9), vec3(clamp(uv, vec2(0.0), vec2(1.0)), 0.45)) * mix(0.62, 1.0, odd);
}

@fragment
fn colour_of_mesh(corner: Corner, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    // A normal of length 0 has no side: it shows as if towards the eye.
    let towards_eye = view.world_from_camera[3].xyz - corner.place;
    let known = dot(corner.normal, corner.normal) > 1e-12;
    let outward = normalize(select(towards_eye, corner.normal, known));
    let normal = select(-outward, outward, is_front || !known);
    let uv = vec2(corner.uv.x, 1.0 - corner.uv.y);
    // Rows of the target do not matter here, and columns are the same on every adapter.
    let column = corner.clip.x;
    switch LAYER {
        case 0u: {
            return vec4(min(lit(corner.place, normal, uv, column), vec3(LARGEST)), RADIANCE);
        }
        case 1u: {
            return vec4(textureSample(diffuse_map, map_sampler, uv).rgb, REFLECTANCE);
        }
        case 2u: {
            return vec4(textureSample(specular_map, map_sampler, uv).rgb, REFLECTANCE);
        }
        case 3u: {
            // Perceptual: the square root of the width, of which the map holds the square.
            let roughness = clamp(textureSample(specular_map, map_sampler, uv).a, 0.0, 1.0);
            return vec4(vec3(sqrt(sqrt(roughness))), REFLECTANCE);
        }
        case 4u: {
            return vec4(0.5 * normal + 0.5, READY);
        }
        case 14u: {
            return vec4(checker(corner.uv), READY);
        }
        case 15u: {
            let on_map = textureSample(diffuse_map, map_sampler, uv).rgb;
            if !HAS_COLOURS {
                return vec4(min(on_map, vec3(LARGEST)), RADIANCE);
            }
            if corner.colour.a < 0.01 {
                return vec4(UNKNOWN, READY);
            }
            return vec4(min(corner.colour.rgb / corner.colour.a, vec3(LARGEST)), RADIANCE);
        }
        case 16u: {
            // Radiance is exposed here: reflectance is not, and both are mixed.
            let diffuse = textureSample(diffuse_map, map_sampler, uv).rgb;
            var mixed: vec3<f32>;
            if FADES_TO_LIT {
                mixed = mix(diffuse, view.crossfade.y * lit(corner.place, normal, uv, column), view.crossfade.x);
            } else {
                let photos = textureSample(quantity_map, map_sampler, uv).rgb;
                mixed = mix(view.crossfade.y * photos, diffuse, view.crossfade.x);
            }
            return vec4(min(mixed, vec3(LARGEST)), REFLECTANCE);
        }
        default: {
            let quantity = textureSample(quantity_map, map_sampler, uv).xy;
            if quantity.y < 0.01 {
                return vec4(UNKNOWN, READY);
            }
            return vec4(scale_colour((quantity.x / quantity.y - view.shading.z) * view.shading.w), READY);
        }
    }
}

struct Behind {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec2<f32>,
}

@vertex
fn corner_behind(@builtin(vertex_index) index: u32) -> Behind {
    let corner = vec2(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
    var out: Behind;
    out.clip = vec4(corner, 0.0, 1.0);
    out.place = vec2(0.5 + 0.5 * corner.x, 0.5 - 0.5 * corner.y) * view.size.xy;
    return out;
}

@fragment
fn colour_behind(behind: Behind) -> @location(0) vec4<f32> {
    if BACKDROP == 0u {
        return vec4(view.backdrop.rgb, READY + BEHIND);
    }
    let on_plane = (behind.place - view.focal_centre.zw) / view.focal_centre.xy;
    let axes = view.world_from_camera;
    let direction = axes[0].xyz * on_plane.x + axes[1].xyz * on_plane.y + axes[2].xyz;
    let towards = normalize(direction);
    var radiance: vec3<f32>;
    if BACKDROP == 2u {
        radiance = blurred_light(towards, OUT_OF_FOCUS, behind.place.x);
    } else {
        radiance = light_towards(towards, behind.place.x);
    }
    return vec4(min(radiance, vec3(LARGEST)), RADIANCE + BEHIND);
}
