// A viewer of one fitted surface. Light is read from maps that were blurred by the lobe beforehand, but for the sun of an
// environment, which casts shadows; see convention.txt.
(async () => {
  const element = (name) => document.getElementById(name);
  const canvas = element("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  const note = element("note");
  if (!gl) {
    note.textContent = "This browser has no WebGL 2: the surface cannot be shown.";
    return;
  }
  if (typeof DecompressionStream === "undefined") {
    note.textContent = "This browser is too old: it cannot unpack what the page holds (Chrome 80, Firefox 113, Safari 16.4 or later can).";
    return;
  }
  // What is deflated in the document, wherever it stands, as bytes.
  const unpacked = async (value) => {
    if (value === null || typeof value !== "object") return value;
    if (value.deflated !== undefined) {
      const bytes = Uint8Array.from(atob(value.deflated), (c) => c.charCodeAt(0));
      const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
      return new Uint8Array(await new Response(stream).arrayBuffer());
    }
    if (Array.isArray(value)) return Promise.all(value.map(unpacked));
    return Object.fromEntries(await Promise.all(Object.entries(value).map(async ([name, own]) => [name, await unpacked(own)])));
  };
  const data = await unpacked(JSON.parse(element("document").textContent));
  const words = (bytes) => new Uint16Array(bytes.buffer);

  // ---- Programs
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
  attribute("normal", data.mesh.normals, 4, gl.BYTE, true);
  // Numbers of a vertex that lie side by side, four to an attribute.
  const fours = (names, values) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    names.forEach((name, k) => {
      const place = gl.getAttribLocation(surface.program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 4, gl.BYTE, true, 4 * names.length, 4 * k);
    });
  };
  fours(["direct_a", "direct_b"], data.mesh.direct);
  fours([0, 1, 2, 3, 4, 5, 6].map((k) => `between_${k}`), data.mesh.between);
  attribute("uv", words(data.mesh.uvs), 2, gl.UNSIGNED_SHORT, true);
  const indices = new Uint32Array(data.mesh.indices.buffer);
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

  const { orbit, radius, inverse, orbit_camera, photo_camera, sun_of, turned_harmonics, with_sun } = cameras_of(data.mesh);

  // ---- Controls
  const chosen = { light: 0, view: -1 };
  const option = (select, text, value) => select.add(new Option(text, value));
  lights.forEach((light, i) => option(element("light"), light.name, i));
  option(element("view"), "none", -1);
  data.photos.forEach((photo, i) => option(element("view"), photo.name, i));
  const remarks = ["Raster preview: only the sun casts sharp shadows."];
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
    const sky = turned_harmonics(light, (+element("rotation").value * Math.PI) / 180);
    gl.uniform3fv(surface.uniforms["harmonics[0]"], sky);
    gl.uniform3fv(surface.uniforms["harmonics_with_sun[0]"], with_sun(sky, sun));
    gl.uniform1f(surface.uniforms.largest, data.mesh.largest);
    gl.uniform1f(surface.uniforms.largest_between, data.mesh.largestBetween);
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
})().catch((error) => { document.getElementById("note").textContent = `The page cannot be shown: ${error.message}`; });
