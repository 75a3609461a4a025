// What the viewer draws with: sources of its shaders for WebGL 2. The lobe, the split sum and the tone curve stand here and
// nowhere else in the page.
// Places on the sun's disc that shadows are cast from: together they make its penumbra.
const suns = 16;
const common = `#version 300 es
  precision highp float;
  precision highp sampler2D;
  const float PI = 3.14159265358979;
  uniform float rotation;
  // The light turned about +y by the angle: what was at +z goes towards +x.
  vec2 place(vec3 d) {
    float phi = atan(d.x, -d.z) + rotation;
    return vec2(phi / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
  }
  uniform float exposure;
  uniform int curve;
  vec3 shown(vec3 radiance) {
    vec3 c = radiance * exposure;
    if (curve == 1) c = c * (1.0 + c / 16.0) / (1.0 + c);
    c = clamp(c, 0.0, 1.0);
    return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, vec3(lessThanEqual(c, vec3(0.0031308))));
  }
  uniform sampler2D level0;
  // The sun: towards it in the world, irradiance of what faces it, cosine of its radius (above 1: there is none).
  uniform vec3 sun_towards, sun_irradiance;
  uniform float sun_cosine;`;
const surface_vertex = `#version 300 es
  precision highp float;
  in vec3 position; in vec4 normal; in vec2 uv; in vec4 direct_a, direct_b;
  // By way of other surface: nine numbers of red, of green, of blue, and the openness of the back.
  in vec4 between_0, between_1, between_2, between_3, between_4, between_5, between_6;
  uniform vec3 low, extent; uniform mat4 clip_from_world;
  // The light in spherical harmonics, turned, its sun among it.
  uniform vec3 harmonics_with_sun[9];
  uniform float largest_between;
  out vec3 world, direction, between; out vec2 coordinate; out float openness, openness_behind; out vec4 passed_a, passed_b;
  float sum_of(vec4 a, vec4 b, float c, int channel) {
    float sum = c * harmonics_with_sun[8][channel];
    for (int i = 0; i < 4; i++) sum += a[i] * harmonics_with_sun[i][channel] + b[i] * harmonics_with_sun[i + 4][channel];
    return sum;
  }
  void main() {
    world = low + extent * position;
    direction = normal.xyz;
    openness = normal.w;
    openness_behind = between_6.w;
    passed_a = direct_a;
    passed_b = direct_b;
    vec3 sums = vec3(
      sum_of(between_0, between_1, between_2.x, 0),
      sum_of(vec4(between_2.yzw, between_3.x), vec4(between_3.yzw, between_4.x), between_4.y, 1),
      sum_of(vec4(between_4.zw, between_5.xy), vec4(between_5.zw, between_6.xy), between_6.z, 2));
    between = max(largest_between * sums, 0.0);
    coordinate = uv;
    gl_Position = clip_from_world * vec4(world, 1.0);
  }`;
const surface_fragment = `${common.replace('precision highp float;', `#define SUNS ${suns}\n    precision highp float;`)}
  precision highp sampler2DArrayShadow;
  in vec3 world, direction, between; in vec2 coordinate; in float openness, openness_behind; in vec4 passed_a, passed_b;
  uniform vec3 eye;
  // The light in spherical harmonics about +y, turned, and the transfer that a byte of 127 stands for.
  uniform vec3 harmonics[9];
  uniform float largest;
  // One for each place on the sun's disc.
  uniform mat4 shadow_from_world[SUNS];
  uniform sampler2DArrayShadow shadow_map;
  uniform float shadow_lift;
  uniform bool is_ggx;
  uniform sampler2D diffuse_map, specular_map, width_map, table, irradiance_map;
  uniform sampler2D levels;
  uniform float level_count; uniform bool has_lobe;
  out vec4 colour;
  // All blurred levels lie in one texture, one above the other.
  vec3 level(vec3 d, float index) {
    vec2 at = place(d);
    float rows = float(textureSize(levels, 0).y) / (level_count - 1.0);
    float y = clamp(at.y * rows, 0.5, rows - 0.5) + (index - 1.0) * rows;
    return texture(levels, vec2(at.x, y / float(textureSize(levels, 0).y))).rgb;
  }
  // Irradiance over pi past the mesh itself: that of the open normal, less what is hidden in bands 0 to 2.
  vec3 sky(vec3 n) {
    // x, y and z of the usual definition; cosine lobe over pi: 1, 2/3, 1/4 of the bands.
    float x = n.z, y = n.x, z = n.y;
    vec4 a = largest * passed_a, b = largest * passed_b;
    vec3 open = texture(irradiance_map, place(n)).rgb;
    vec3 sum = harmonics[0] * 0.2820948 * (openness - 1.0);
    sum += harmonics[1] * (a.x - 0.6666667 * 0.4886025 * y);
    sum += harmonics[2] * (a.y - 0.6666667 * 0.4886025 * z);
    sum += harmonics[3] * (a.z - 0.6666667 * 0.4886025 * x);
    sum += harmonics[4] * (a.w - 0.25 * 1.0925484 * x * y);
    sum += harmonics[5] * (b.x - 0.25 * 1.0925484 * y * z);
    sum += harmonics[6] * (b.y - 0.25 * 0.3153916 * (3.0 * z * z - 1.0));
    sum += harmonics[7] * (b.z - 0.25 * 1.0925484 * x * z);
    sum += harmonics[8] * (b.w - 0.25 * 0.5462742 * (x * x - y * y));
    // Never more than in the open, never less than a tenth of the even share.
    return clamp(open + sum, 0.1 * openness * open, open);
  }
  // Share of the sun's disc that a place sees.
  float sunlit(vec3 n) {
    float sum = 0.0;
    vec4 place = vec4(world + shadow_lift * n, 1.0);
    for (int i = 0; i < SUNS; i++) {
      vec3 at = (shadow_from_world[i] * place).xyz * 0.5 + 0.5;
      sum += texture(shadow_map, vec4(at.xy, float(i), at.z));
    }
    return sum / float(SUNS);
  }
  // D G / (4 (n.i)(n.o)) of the fitted lobe.
  float lobe(float width, float i, float o, float h) {
    float squared = width * width;
    if (is_ggx) {
      float spread = 1.0 + (1.0 / squared - 1.0) * (1.0 - h * h);
      float shadowing = i * sqrt(squared + (1.0 - squared) * o * o) + o * sqrt(squared + (1.0 - squared) * i * i);
      return 0.5 / (PI * squared * spread * spread * max(shadowing, 1e-6));
    }
    float k = 0.5 * width;
    return exp((2.0 / squared - 2.0) * log(max(h, 1e-6))) / (PI * squared) * 0.25
      / ((i * (1.0 - k) + k) * (o * (1.0 - k) + k));
  }
  void main() {
    vec3 n = normalize(direction), o = normalize(eye - world);
    vec3 facet = cross(dFdx(world), dFdy(world));
    bool is_back = dot(facet, n) * dot(facet, o) < 0.0;
    if (is_back) n = -n;
    if (dot(n, o) < 0.0) n = normalize(n - 1.02 * dot(n, o) * o);
    float open_here = is_back ? openness_behind : openness;
    vec2 at = vec2(coordinate.x, 1.0 - coordinate.y);
    float cosine = clamp(dot(n, o), 0.0, 1.0);
    vec3 albedo = texture(diffuse_map, at).rgb;
    vec3 sun_share = vec3(0.0);
    float i = dot(n, sun_towards);
    if (sun_cosine <= 1.0 && i > 0.0) sun_share = sun_irradiance * i * sunlit(n);
    // Of the back only the share of the sky is known that it sees.
    vec3 falling = is_back ? open_here * texture(irradiance_map, place(n)).rgb : sky(n) + between;
    vec3 light = albedo * falling;
    if (has_lobe) {
      vec3 f0 = texture(specular_map, at).rgb;
      float width = texture(width_map, at).r;
      vec2 ab = texture(table, vec2(cosine, width)).rg;
      vec3 r = reflect(-o, n);
      float index = sqrt(width) * (level_count - 1.0);
      vec3 near = index < 1.0 ? texture(level0, place(r)).rgb : level(r, floor(index));
      vec3 far = level(r, min(floor(index) + 1.0, level_count - 1.0));
      // Lagarde and de Rousiers 2014: what a closed place hides of a lobe.
      float open = clamp(pow(cosine + open_here, exp2(-16.0 * width - 1.0)) - 1.0 + open_here, 0.0, 1.0);
      // What is hidden of it shows other surface, as bright as what sends light here is in the mean.
      vec3 around = is_back ? vec3(0.0) : between / max(1.0 - openness, 0.05);
      light += (f0 * ab.x + ab.y) * mix(around, mix(near, far, fract(index)), open);
    }
    if (sun_share != vec3(0.0)) {
      vec3 reflected = albedo / PI;
      if (has_lobe) {
        vec3 h = normalize(sun_towards + o), f0 = texture(specular_map, at).rgb;
        // Wider by the sun's own width, of which a half vector sees half.
        float width = max(texture(width_map, at).r, 0.005);
        width = min(sqrt(width * width + 0.25 * (1.0 - sun_cosine * sun_cosine)), 1.0);
        vec3 fresnel = f0 + (1.0 - f0) * pow(clamp(1.0 - dot(h, o), 0.0, 1.0), 5.0);
        reflected += fresnel * lobe(width, i, max(cosine, 1e-3), clamp(dot(n, h), 0.0, 1.0));
      }
      light += reflected * sun_share;
    }
    colour = vec4(shown(light), 1.0);
  }`;
const backdrop_vertex = `#version 300 es
  out vec2 corner;
  void main() {
    corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.99999, 1.0);
  }`;
const backdrop_fragment = `${common}
  in vec2 corner; uniform mat4 world_from_clip; uniform bool visible; out vec4 colour;
  void main() {
    vec4 near = world_from_clip * vec4(corner, -1.0, 1.0), far = world_from_clip * vec4(corner, 1.0, 1.0);
    vec3 d = normalize(far.xyz / far.w - near.xyz / near.w);
    vec3 radiance = texture(level0, place(d)).rgb;
    if (dot(d, sun_towards) > sun_cosine) radiance += sun_irradiance / (2.0 * PI * (1.0 - sun_cosine));
    colour = vec4(visible ? shown(radiance) : vec3(0.09), 1.0);
  }`;
const shadow_vertex = `#version 300 es
  precision highp float;
  in vec3 position;
  uniform vec3 low, extent; uniform mat4 shadow_from_world;
  void main() { gl_Position = shadow_from_world * vec4(low + extent * position, 1.0); }`;
const shadow_fragment = `#version 300 es
  precision mediump float;
  void main() {}`;
