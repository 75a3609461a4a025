"""Camera, texture and light of the Mitsuba scene against plain numpy, on any exchange folder."""
import argparse
import sys

import numpy as np

import exchange_scene as ex


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    options = parser.parse_args()
    mi, dr = ex.start()
    folder, random, count = ex.Folder(options.scene), np.random.default_rng(3), 20000
    light = folder.light()
    world, real = ex.scene(folder, light), lambda a: mi.Float(np.ascontiguousarray(a, np.float32))
    errors = {}
    # Camera: an off-centre principal point tells signs apart.
    view = dict(folder.views[0])
    view["K"] = np.array(view["K"]) + np.array([[0, 0, 7.5], [0, 0, -11.25], [0, 0, 0]])
    x, y = random.uniform(0, view["width"], count), random.uniform(0, view["height"], count)
    place = mi.Point2f(real(x / view["width"]), real(y / view["height"]))
    ray, _ = ex.sensor(view).sample_ray(0.0, 0.5, place, [0.5, 0.5])
    rotation = np.array(view["w2c"])[:3, :3]
    expected = rotation.T @ np.linalg.inv(view["K"]) @ np.stack([x, y, np.ones(count)])
    errors["ray direction"] = np.abs(np.array(ray.d) - expected / np.linalg.norm(expected, axis=0)).max()
    # Texture: read back at the uv of hits; Mitsuba's v is one minus the file's.
    place = mi.Point2f(real(random.random(count)), real(random.random(count)))
    ray, _ = ex.sensor(folder.views[0]).sample_ray(0.0, 0.5, place, [0.5, 0.5])
    si = world.ray_intersect(ray)
    hit, uv = np.array(si.is_valid()).astype(bool), np.array(si.uv)
    rho_d = folder.maps["diffuse"]
    height, width = rho_d.shape[:2]
    c, r = uv[0] * width - 0.5, uv[1] * height - 0.5
    expected = bilinear(rho_d, np.clip(r, 0, height - 1), np.clip(c, 0, width - 1))
    got = np.array(mi.load_dict(ex.texture(rho_d)).eval(si)).T
    errors["texture"] = np.abs(got - expected)[hit].max()
    # Light: radiance along random directions, the poles included.
    d = random.normal(size=(3, count))
    d[:, :200] *= [[1e-3], [1], [1e-3]]
    d /= np.linalg.norm(d, axis=0)
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi = mi.Vector3f(*(real(-a) for a in d))
    got = np.array(world.environment().eval(si)).T
    height, width = light.shape[:2]
    c = np.arctan2(d[0], -d[2]) / (2 * np.pi) % 1 * width - 0.5
    r = np.clip(np.arccos(np.clip(d[1], -1, 1)) / np.pi * height - 0.5, 0, height - 1)
    errors["light"] = np.abs(got - bilinear(light, r, c, wrap=True)).max() / light.max()
    for name, error in errors.items():
        print(f"{name}: {error:.1e}")
    # Asked this way round, an error that is not a number counts as too large.
    sys.exit(int(not all(error <= 2e-3 for error in errors.values())))


def bilinear(image, r, c, wrap=False):
    height, width = image.shape[:2]
    r0, c0 = np.minimum(np.floor(r).astype(int), height - 2), np.floor(c).astype(int)
    c0 = c0 if wrap else np.minimum(c0, width - 2)
    fr, fc = (r - r0)[:, None], (c - c0)[:, None]
    at = lambda i, j: image[i, j % width]
    row = lambda i: at(i, c0) * (1 - fc) + at(i, c0 + 1) * fc
    return row(r0) * (1 - fr) + row(r0 + 1) * fr


main()
