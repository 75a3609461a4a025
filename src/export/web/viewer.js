"use strict";
// A viewer of one fitted surface. Light is read from maps that were blurred by the lobe beforehand, but for the sun of an
// environment, which casts shadows; see convention.txt.
(() => {
  const data = JSON.parse(document.getElementById("document").textContent);
  const element = (name) => document.getElementById(name);
  const canvas = element("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  const note = element("note");
  if (!gl) {
    note.textContent = "This browser has no WebGL 2: the surface cannot be shown.";
    return;
  }
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const words = (text) => new Uint16Array(bytes(text).buffer);

  // ---- Shaders
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
    in vec3 position; in vec4 normal; in vec2 uv; in vec4 transfer_a, transfer_b;
    uniform vec3 low, extent; uniform mat4 clip_from_world;
    out vec3 world, direction; out vec2 coordinate; out float openness; out vec4 passed_a, passed_b;
    void main() {
      world = low + extent * position;
      direction = normal.xyz;
      openness = normal.w;
      passed_a = transfer_a;
      passed_b = transfer_b;
      coordinate = uv;
      gl_Position = clip_from_world * vec4(world, 1.0);
    }`;
  const surface_fragment = `${common.replace('precision highp float;', `#define SUNS ${suns}\n    precision highp float;`)}
    precision highp sampler2DArrayShadow;
    in vec3 world, direction; in vec2 coordinate; in float openness; in vec4 passed_a, passed_b;
    uniform vec3 eye;
    // The light in spherical harmonics about +y, turned, and the transfer that a byte of 127 stands for.
    uniform vec3 harmonics[9];
    uniform float largest;
    // One for each place on the sun's disc.
    uniform mat4 shadow_from_world[SUNS];
    uniform sampler2DArrayShadow shadow_map;
    uniform float shadow_lift;
    // Mean diffuse reflectance of the surface.
    uniform vec3 mean_albedo;
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
      if (dot(n, o) < 0.0) n = normalize(n - 1.02 * dot(n, o) * o);
      vec2 at = vec2(coordinate.x, 1.0 - coordinate.y);
      float cosine = clamp(dot(n, o), 0.0, 1.0);
      vec3 albedo = texture(diffuse_map, at).rgb;
      vec3 sun_share = vec3(0.0);
      float i = dot(n, sun_towards);
      if (sun_cosine <= 1.0 && i > 0.0) sun_share = sun_irradiance * i * sunlit(n);
      // What is hidden of the sky is a surface like this one, as brightly lit: light goes back and forth in it.
      vec3 falling = sky(n) + sun_share / PI;
      vec3 returned = (1.0 - openness) * albedo;
      vec3 light = albedo * (falling / (1.0 - returned) - sun_share / PI);
      if (has_lobe) {
        vec3 f0 = texture(specular_map, at).rgb;
        float width = texture(width_map, at).r;
        vec2 ab = texture(table, vec2(cosine, width)).rg;
        vec3 r = reflect(-o, n);
        float index = sqrt(width) * (level_count - 1.0);
        vec3 near = index < 1.0 ? texture(level0, place(r)).rgb : level(r, floor(index));
        vec3 far = level(r, min(floor(index) + 1.0, level_count - 1.0));
        // Lagarde and de Rousiers 2014: what a closed place hides of a lobe.
        float open = clamp(pow(cosine + openness, exp2(-16.0 * width - 1.0)) - 1.0 + openness, 0.0, 1.0);
        // What is hidden of it shows the surface, lit as this place is.
        vec3 around = mean_albedo * falling / (1.0 - (1.0 - openness) * mean_albedo);
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
  function program_of(vertex, fragment) {
    const program = gl.createProgram();
    // Both programs that draw the surface read its places by one array.
    gl.bindAttribLocation(program, 0, "position");
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const name = gl.getActiveUniform(program, i).name;
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return { program, uniforms };
  }
  const surface = program_of(surface_vertex, surface_fragment);
  const backdrop = program_of(backdrop_vertex, backdrop_fragment);
  const shadow = program_of(shadow_vertex, shadow_fragment);

  // ---- Mesh
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  const attribute = (name, values, size, type, normalised) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    const place = gl.getAttribLocation(surface.program, name);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, type, normalised, 0, 0);
  };
  attribute("position", words(data.mesh.positions), 3, gl.UNSIGNED_SHORT, true);
  attribute("normal", new Int8Array(bytes(data.mesh.normals).buffer), 4, gl.BYTE, true);
  const transfer = new Int8Array(bytes(data.mesh.transfer).buffer);
  const half_of = (first) => {
    const part = new Int8Array(transfer.length / 2);
    for (let vertex = 0; vertex < part.length / 4; vertex++)
      for (let k = 0; k < 4; k++) part[4 * vertex + k] = transfer[8 * vertex + first + k];
    return part;
  };
  attribute("transfer_a", half_of(0), 4, gl.BYTE, true);
  attribute("transfer_b", half_of(4), 4, gl.BYTE, true);
  attribute("uv", words(data.mesh.uvs), 2, gl.UNSIGNED_SHORT, true);
  const indices = new Uint32Array(bytes(data.mesh.indices).buffer);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
  gl.bindVertexArray(null);

  // ---- Textures
  const wrapped = (texture, wrap) => {
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, wrap);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    return texture;
  };
  const floats = (width, height, values, internal, format, wrap) => {
    const texture = wrapped(gl.createTexture(), wrap);
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, gl.HALF_FLOAT, values);
    return texture;
  };
  const table = floats(data.table.size, data.table.size, words(data.table.values), gl.RG16F, gl.RG, gl.CLAMP_TO_EDGE);
  const lights = data.lights.map((light) => {
    const rgba = (part) => floats(part.width, part.height, words(part.values), gl.RGBA16F, gl.RGBA, gl.REPEAT);
    const blurred = light.levels.slice(1);
    const stacked = new Uint16Array(blurred.reduce((sum, part) => sum + part.width * part.height * 4, 0));
    let at = 0;
    for (const part of blurred) {
      const values = words(part.values);
      stacked.set(values, at);
      at += values.length;
    }
    const rows = blurred.reduce((sum, part) => sum + part.height, 0);
    return {
      name: light.name, mean: light.mean, sun: light.sun, harmonics: light.harmonics, sharp: rgba(light.levels[0]), irradiance: rgba(light.irradiance),
      levels: floats(blurred[0].width, rows, stacked, gl.RGBA16F, gl.RGBA, gl.REPEAT),
    };
  });
  const shadow_size = Math.min(1024, gl.getParameter(gl.MAX_TEXTURE_SIZE));
  const shadow_map = gl.createTexture(), shadow_frame = gl.createFramebuffer();
  gl.bindTexture(gl.TEXTURE_2D_ARRAY, shadow_map);
  gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.DEPTH_COMPONENT24, shadow_size, shadow_size, suns);
  for (const [name, value] of [
    [gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE], [gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL],
    [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
    [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
  ]) gl.texParameteri(gl.TEXTURE_2D_ARRAY, name, value);
  const finer = gl.getExtension("EXT_texture_filter_anisotropic");
  const map = async (source, is_colour) => {
    const picture = new Image();
    picture.src = source;
    await picture.decode();
    const texture = wrapped(gl.createTexture(), gl.CLAMP_TO_EDGE);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.texImage2D(gl.TEXTURE_2D, 0, is_colour ? gl.SRGB8_ALPHA8 : gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    if (finer) gl.texParameterf(gl.TEXTURE_2D, finer.TEXTURE_MAX_ANISOTROPY_EXT, 8);
    return texture;
  };

  // ---- Camera: matrices are columns of four, as WebGL takes them.
  const product = (a, b) => {
    const c = new Array(16).fill(0);
    for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++) for (let k = 0; k < 4; k++) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
    return c;
  };
  const inverse = (m) => {
    const a = [];
    for (let i = 0; i < 4; i++) a.push([m[i], m[4 + i], m[8 + i], m[12 + i], ...[0, 1, 2, 3].map((j) => +(i === j))]);
    for (let i = 0; i < 4; i++) {
      let pivot = i;
      for (let k = i; k < 4; k++) if (Math.abs(a[k][i]) > Math.abs(a[pivot][i])) pivot = k;
      [a[i], a[pivot]] = [a[pivot], a[i]];
      const scale = a[i][i];
      a[i] = a[i].map((value) => value / scale);
      for (let k = 0; k < 4; k++) if (k !== i) {
        const factor = a[k][i];
        a[k] = a[k].map((value, column) => value - factor * a[i][column]);
      }
    }
    const result = [];
    for (let j = 0; j < 4; j++) for (let i = 0; i < 4; i++) result.push(a[i][4 + j]);
    return result;
  };
  const subtract = (a, b) => a.map((value, i) => value - b[i]);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => a.map((value) => value / Math.hypot(...a));
  const centre = data.mesh.low.map((value, i) => value + 0.5 * data.mesh.extent[i]);
  const radius = 0.5 * Math.hypot(...data.mesh.extent);
  const orbit = { yaw: 0.5, pitch: 0.35, distance: 2.6 * radius, target: centre.slice() };
  const depths = [0.01 * radius, 30 * radius];
  function orbit_camera(aspect) {
    const { yaw, pitch, distance, target } = orbit;
    const back = [Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch), Math.cos(pitch) * Math.cos(yaw)];
    const eye = target.map((value, i) => value + distance * back[i]);
    const right = unit(cross([0, 1, 0], back)), up = cross(back, right);
    const view = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
      -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
    const f = 1 / Math.tan((20 * Math.PI) / 180), [near, far] = depths;
    const projection = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
    return { eye, clip: product(projection, view) };
  }
  // A photo's camera looks along +z with y down.
  function photo_camera(photo) {
    const { width, height, focal, centre: c, rotation: r, translation: t } = photo, [near, far] = depths;
    const projection = [(2 * focal[0]) / width, 0, 0, 0, 0, (-2 * focal[1]) / height, 0, 0,
      (2 * c[0]) / width - 1, 1 - (2 * c[1]) / height, (far + near) / (far - near), 1, 0, 0, (-2 * far * near) / (far - near), 0];
    const view = [r[0], r[1], r[2], 0, r[3], r[4], r[5], 0, r[6], r[7], r[8], 0, t[0], t[1], t[2], 1];
    const eye = [0, 1, 2].map((i) => -(r[3 * i] * t[0] + r[3 * i + 1] * t[1] + r[3 * i + 2] * t[2]));
    return { eye, clip: product(projection, view) };
  }

  // The sun under a turned light, and views from places of its disc that hold the whole surface.
  function sun_of(light, turn) {
    if (!light.sun) return { towards: [0, 1, 0], irradiance: [0, 0, 0], cosine: 2, matrices: new Array(16 * suns).fill(0) };
    const [x, y, z] = light.sun.towards, phi = Math.atan2(x, -z) - turn, level = Math.hypot(x, z);
    const towards = [level * Math.sin(phi), y, -level * Math.cos(phi)];
    const reach = Math.tan(Math.acos(light.sun.cosine)), right = across(towards), up = cross(towards, right);
    const matrices = [];
    for (let i = 0; i < suns; i++) {
      // Evenly over the disc: each turned by the golden angle.
      const radius_ = reach * Math.sqrt((i + 0.5) / suns), angle = 2.399963 * i;
      const [a, b] = [radius_ * Math.cos(angle), radius_ * Math.sin(angle)];
      matrices.push(...view_of_sun(unit(towards.map((value, k) => value + a * right[k] + b * up[k]))));
    }
    return { towards, irradiance: light.sun.irradiance, cosine: light.sun.cosine, matrices };
  }
  const across = (d) => unit(cross(Math.abs(d[1]) > 0.99 ? [1, 0, 0] : [0, 1, 0], d));
  function view_of_sun(towards) {
    const right = across(towards), up = cross(towards, right);
    const axes = [right, up, towards.map((value) => -value)].map((axis) => axis.map((value) => value / (1.01 * radius)));
    return [...[0, 1, 2].flatMap((column) => [axes[0][column], axes[1][column], axes[2][column], 0]),
      ...axes.map((axis) => -dot(axis, centre)), 1];
  }

  // Harmonics of a light that is turned as the maps are: what was at azimuth phi (from -z towards +x) goes to phi - turn.
  function turned_harmonics(light, turn) {
    const own = light.harmonics, result = own.map((value) => value.slice());
    // About +y, with x at +z and y at +x, the azimuth of the functions goes the other way round.
    for (const [sine, cosine, order] of [[1, 3, 1], [5, 7, 1], [4, 8, 2]]) {
      const c = Math.cos(order * turn), s = Math.sin(order * turn);
      for (let channel = 0; channel < 3; channel++) {
        result[sine][channel] = c * own[sine][channel] + s * own[cosine][channel];
        result[cosine][channel] = c * own[cosine][channel] - s * own[sine][channel];
      }
    }
    return new Float32Array(result.flat());
  }

  // ---- Controls
  const chosen = { light: 0, view: -1 };
  const option = (select, text, value) => select.add(new Option(text, value));
  lights.forEach((light, i) => option(element("light"), light.name, i));
  option(element("view"), "none", -1);
  data.photos.forEach((photo, i) => option(element("view"), photo.name, i));
  const remarks = ["Raster preview: only the sun casts sharp shadows; light between surfaces is a rough guess."];
  if (!data.hasLobe) remarks.push("The surface was fitted without a specular lobe.");
  if (!lights.length) remarks.push("The run has no environment.");
  note.textContent = `${data.name} · ${remarks.join(" ")}`;
  element("view").parentElement.style.display = data.photos.length ? "" : "none";
  let maps = null, wanted = false;
  const redraw = () => {
    if (!wanted) {
      wanted = true;
      requestAnimationFrame(draw);
    }
  };
  element("light").oninput = (event) => { chosen.light = +event.target.value; redraw(); };
  element("view").oninput = (event) => { chosen.view = +event.target.value; redraw(); };
  for (const name of ["rotation", "exposure", "curve", "backdrop", "wipe", "spin"]) element(name).oninput = redraw;
  let pressed = null;
  canvas.onpointerdown = (event) => {
    pressed = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointerup = () => { pressed = null; };
  canvas.onpointermove = (event) => {
    if (!pressed) return;
    const [dx, dy] = [event.clientX - pressed[0], event.clientY - pressed[1]];
    pressed = [event.clientX, event.clientY];
    if (event.shiftKey) {
      const slider = element("rotation");
      slider.value = ((+slider.value + 0.4 * dx + 540) % 360) - 180;
    } else if (event.ctrlKey || event.buttons & 4) {
      const scale = orbit.distance / canvas.clientHeight, { yaw } = orbit;
      orbit.target[0] -= scale * dx * Math.cos(yaw);
      orbit.target[2] += scale * dx * Math.sin(yaw);
      orbit.target[1] += scale * dy;
    } else {
      orbit.yaw -= 0.008 * dx;
      orbit.pitch = Math.max(-1.5, Math.min(1.5, orbit.pitch + 0.008 * dy));
    }
    redraw();
  };
  canvas.onwheel = (event) => {
    event.preventDefault();
    orbit.distance = Math.max(0.05 * radius, Math.min(12 * radius, orbit.distance * Math.exp(0.001 * event.deltaY)));
    redraw();
  };
  addEventListener("resize", redraw);

  // ---- Drawing
  function bind(unit_, name, texture, target) {
    gl.activeTexture(gl.TEXTURE0 + unit_);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.uniform1i(target.uniforms[name], unit_);
  }
  let shadows_of = "";
  function draw_shadows(sun) {
    gl.bindFramebuffer(gl.FRAMEBUFFER, shadow_frame);
    gl.drawBuffers([gl.NONE]);
    gl.viewport(0, 0, shadow_size, shadow_size);
    gl.useProgram(shadow.program);
    gl.uniform3fv(shadow.uniforms.low, data.mesh.low);
    gl.uniform3fv(shadow.uniforms.extent, data.mesh.extent);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(2, 4);
    for (let i = 0; i < suns; i++) {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, shadow_map, 0, i);
      gl.clear(gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix4fv(shadow.uniforms.shadow_from_world, false, sun.matrices.slice(16 * i, 16 * i + 16));
      gl.drawElements(gl.TRIANGLES, indices.length, gl.UNSIGNED_INT, 0);
    }
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
  }
  function draw() {
    wanted = false;
    const photo = data.photos[chosen.view];
    // With a photo the picture keeps the photo's shape.
    const stage = element("stage"), [full, tall] = [innerWidth, innerHeight];
    const scale = photo ? Math.min(full / photo.width, tall / photo.height) : 0;
    const [width, height] = photo ? [scale * photo.width, scale * photo.height] : [full, tall];
    Object.assign(stage.style, { inset: "auto", left: `${(full - width) / 2}px`, top: `${(tall - height) / 2}px`, width: `${width}px`, height: `${height}px` });
    const density = devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(width * density));
    canvas.height = Math.max(1, Math.round(height * density));
    element("wipe_label").style.display = photo ? "" : "none";
    const picture = element("photo");
    picture.style.display = photo ? "block" : "none";
    if (photo) {
      if (picture.alt !== photo.name) [picture.src, picture.alt] = [photo.jpeg, photo.name];
      picture.style.clipPath = `inset(0 0 0 ${100 * +element("wipe").value}%)`;
    }
    if (element("spin").checked) {
      const slider = element("rotation");
      slider.value = +slider.value >= 180 ? -180 : +slider.value + 1;
      redraw();
    }
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.09, 0.09, 0.09, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const light = lights[chosen.light];
    if (!maps || !light) return;
    const camera = photo ? photo_camera(photo) : orbit_camera(canvas.width / canvas.height);
    const sun = sun_of(light, (+element("rotation").value * Math.PI) / 180);
    gl.bindVertexArray(array);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    if (light.sun) {
      // Shadows move with the light alone.
      const key = `${chosen.light} ${element("rotation").value}`;
      if (key !== shadows_of) draw_shadows(sun);
      shadows_of = key;
    }
    const set = (target) => {
      gl.useProgram(target.program);
      gl.uniform1f(target.uniforms.rotation, (+element("rotation").value * Math.PI) / 180);
      gl.uniform1f(target.uniforms.exposure, 2 ** +element("exposure").value);
      gl.uniform1i(target.uniforms.curve, +element("curve").value);
      gl.uniform3fv(target.uniforms.sun_towards, sun.towards);
      gl.uniform3fv(target.uniforms.sun_irradiance, sun.irradiance);
      gl.uniform1f(target.uniforms.sun_cosine, sun.cosine);
      bind(0, "level0", light.sharp, target);
    };
    set(surface);
    gl.uniform3fv(surface.uniforms.low, data.mesh.low);
    gl.uniform3fv(surface.uniforms.extent, data.mesh.extent);
    gl.uniform3fv(surface.uniforms.eye, camera.eye);
    gl.uniformMatrix4fv(surface.uniforms.clip_from_world, false, camera.clip);
    gl.uniform3fv(surface.uniforms["harmonics[0]"], turned_harmonics(light, (+element("rotation").value * Math.PI) / 180));
    gl.uniform1f(surface.uniforms.largest, data.mesh.largest);
    gl.uniform1f(surface.uniforms.level_count, data.levels);
    gl.uniform1i(surface.uniforms.has_lobe, data.hasLobe ? 1 : 0);
    bind(1, "levels", light.levels, surface);
    bind(2, "irradiance_map", light.irradiance, surface);
    bind(3, "table", table, surface);
    ["diffuse_map", "specular_map", "width_map"].forEach((name, i) => bind(4 + i, name, maps[i], surface));
    gl.activeTexture(gl.TEXTURE7);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, shadow_map);
    gl.uniform1i(surface.uniforms.shadow_map, 7);
    gl.uniformMatrix4fv(surface.uniforms["shadow_from_world[0]"], false, sun.matrices);
    gl.uniform3fv(surface.uniforms.mean_albedo, data.meanAlbedo || [0.25, 0.25, 0.25]);
    gl.uniform1f(surface.uniforms.shadow_lift, (3 * radius) / shadow_size);
    gl.uniform1i(surface.uniforms.is_ggx, data.lobe === "ggx" ? 1 : 0);
    gl.drawElements(gl.TRIANGLES, indices.length, gl.UNSIGNED_INT, 0);
    set(backdrop);
    gl.uniformMatrix4fv(backdrop.uniforms.world_from_clip, false, inverse(camera.clip));
    gl.uniform1i(backdrop.uniforms.visible, element("backdrop").checked ? 1 : 0);
    gl.bindVertexArray(null);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
  // #light=1&view=0&wipe=1&backdrop=0 opens the page so.
  const asked = new URLSearchParams(location.hash.slice(1));
  if (asked.has("camera")) {
    // A camera of one's own, as those of photos: width, height, focal, centre, rotation (columns), translation.
    const photo = { jpeg: "data:,", name: "camera", ...JSON.parse(asked.get("camera")) };
    chosen.view = data.photos.push(photo) - 1;
    option(element("view"), photo.name, chosen.view);
    element("view").value = chosen.view;
    element("wipe").value = 1;
  }
  for (const [name, value] of asked) {
    const control = element(name);
    if (!control) continue;
    if (control.type === "checkbox") control.checked = value !== "0";
    else control.value = value;
    if (name in chosen) chosen[name] = +value;
  }
  if (asked.has("bare")) for (const name of ["bar", "note"]) element(name).style.display = "none";
  Promise.all(data.maps.map((source, i) => map(source, i < 2))).then((loaded) => {
    maps = loaded;
    redraw();
  }).catch((error) => { note.textContent = `The maps cannot be read: ${error.message}`; });
  redraw();
})();
