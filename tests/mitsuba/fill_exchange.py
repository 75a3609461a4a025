"""Renders everything an exchange folder lacks, in place; what is there already stays.

  views/      at scene.json's max_depth, with the background as scene.json says
  views_black/ the same with a black background, where the background is the environment
  views_d2/   direct light only (with --direct N for the first N views)
  relight/    under env_heldout.exr, number of the view as the name
  coverage/   share of the pixel that the surface covers (64 samples)
  texel_seen.exr  texels in the bilinear footprint of a camera ray that meets a front, over the views not held out
"""
import argparse
import os
import time

import numpy as np

import exchange_scene as ex


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--relight-views", default="", help="default: all; such as 0,6,12-15")
    parser.add_argument("--direct", type=int, default=0)
    options = parser.parse_args()
    mi, dr = ex.start()
    folder = ex.Folder(options.scene)
    depth, count = folder.facts["max_depth"], len(folder.views)
    hidden, visible_only = ex.integrator(depth, True), ex.integrator(1, False)

    def fill(name, world, how, views, seed):
        start = time.time()
        for index in views:
            path = folder.folder / name / f"{index:04d}.exr"
            if path.exists():
                continue
            camera = ex.sensor(folder.views[index])
            picture, _ = ex.render(world, how, camera, options.spp, max(1, options.spp // 64), seed * 4096 + index)
            shown = folder.background_is_visible
            if shown and name in ("views", "relight"):
                # The light itself is what paths of depth 1 carry; both parts have the same expectation as one render.
                if name == "views":
                    ex.write_exr(folder.folder / "views_black" / path.name, picture)
                picture = picture + ex.render(world, visible_only, camera, 256, 1, (seed + 7) * 4096 + index)[0]
            ex.write_exr(path, picture)
        print(f"{name}: {len(views)} pictures, {time.time() - start:.1f} s, load {os.getloadavg()[0]:.1f}", flush=True)

    world = ex.scene(folder, folder.light())
    fill("views", world, hidden, range(count), 11)
    fill("views_d2", world, ex.integrator(2, True), range(min(options.direct, count)), 12)
    if (folder.folder / "env_heldout.exr").exists():
        other = ex.scene(folder, folder.light("env_heldout"))
        fill("relight", other, hidden, ex.chosen_views(options.relight_views, count), 13)
    coverage_and_texels(folder, world, mi, dr)
    folder.save_facts(spp_ref=options.spp, rendered_by="mitsuba 3.9.1", roughness_interpolation="linear")


def coverage_and_texels(folder, world, mi, dr):
    height, width = folder.maps["diffuse"].shape[:2]
    seen = np.zeros((height, width), bool)
    for index, view in enumerate(folder.views):
        columns, rows = view["width"], view["height"]
        random, camera = np.random.default_rng(index), ex.sensor(view)
        covered = np.zeros(rows * columns)
        x, y = np.tile(np.arange(columns), rows), np.repeat(np.arange(rows), columns)
        for _ in range(64):
            place = [(p + random.random(p.size)) / size for p, size in ((x, columns), (y, rows))]
            place = mi.Point2f(*(mi.Float(p.astype(np.float32)) for p in place))
            ray, _ = camera.sample_ray(0.0, 0.5, place, mi.Point2f(0.5, 0.5))
            si = world.ray_intersect(ray)
            hit = np.array(si.is_valid()).astype(bool)
            covered += hit
            if view.get("held_out"):
                continue
            front = hit & (np.array(dr.dot(si.n, -ray.d)) > 0)
            uv = np.array(si.uv)[:, front]
            column, row = np.floor(uv[0] * width - 0.5).astype(int), np.floor(uv[1] * height - 0.5).astype(int)
            for right in (0, 1):
                for down in (0, 1):
                    seen[np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1)] = True
        ex.write_exr(folder.folder / "coverage" / f"{index:04d}.exr", (covered / 64).reshape(rows, columns))
    ex.write_exr(folder.folder / "texel_seen.exr", seen.astype(np.float32))
    folder.save_facts(texels_seen=float(seen.mean()))
    print(f"texels seen: {seen.mean():.3f}")


main()
