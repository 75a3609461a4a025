// Where the surface is seen from and lit from: the camera that turns about it, cameras of photos, the sun of a turned light.
// Matrices are columns of four, as WebGL takes them.
function cameras_of(mesh) {
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
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => a.map((value) => value / Math.hypot(...a));
  const centre = mesh.low.map((value, i) => value + 0.5 * mesh.extent[i]);
  const radius = 0.5 * Math.hypot(...mesh.extent);
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
  // Harmonics of the whole light: of the sky and of a sun that shines from one place.
  function with_sun(sky, { towards, irradiance }) {
    const [x, y, z] = [towards[2], towards[0], towards[1]];
    const values = [0.2820948, 0.4886025 * y, 0.4886025 * z, 0.4886025 * x, 1.0925484 * x * y, 1.0925484 * y * z,
      0.3153916 * (3 * z * z - 1), 1.0925484 * x * z, 0.5462742 * (x * x - y * y)];
    return sky.map((own, index) => own + irradiance[index % 3] * values[Math.floor(index / 3)]);
  }
  return { orbit, radius, inverse, orbit_camera, photo_camera, sun_of, turned_harmonics, with_sun };
}
