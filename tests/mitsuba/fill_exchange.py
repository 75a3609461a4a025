"""Renders the pictures an exchange folder lacks, in place; a picture that is there already stays.

  views/      at scene.json's max_depth, with the background as scene.json says
  views_black/ the same with a black background, written with a new picture of views/ that shows the environment
  views_d2/   direct light only (with --direct N for the first N views)
  relight/    under env_heldout.exr

Files have the names of their views. Two things are no renderings, and every run replaces them: they cost little, and
their rays depend on mesh and cameras alone, so that a second run gives the same.

  coverage/   share of the pixel that the surface covers (64 samples)
  texel_seen.exr  texels in the bilinear footprint of a camera ray that meets a front, over the views not held out;
              Patina's export writes it by 4 rays a pixel, which misses texels that these 64 find

spp_ref in scene.json is the number of samples of the last run that made a picture; other runs leave it as it is.
"""
import argparse
import importlib.metadata
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
    # Before anything is rendered, so that a slip in the list ends the run at once.
    relit = ex.chosen_views(options.relight_views, len(folder.views))
    fill_folder(mi, dr, folder, options.spp, relit, options.direct)


def fill_folder(mi, dr, folder, spp, relit, direct=0, sampler="independent"):
    depth, count = folder.facts["max_depth"], len(folder.views)
    hidden, visible_only = ex.integrator(depth, True), ex.integrator(1, False)
    batches = max(1, spp // 64)

    def fill(name, world, how, views, seed):
        start = time.time()
        path_of = {index: folder.folder / name / f"{folder.name_of_view(index)}.exr" for index in views}
        missing = [index for index, path in path_of.items() if not path.exists()]
        if missing:
            # Said before the first of them: the rest of a run that was cut off may find nothing left to render.
            folder.save_facts(spp_ref=spp // batches * batches, roughness_interpolation="linear",
                              rendered_by=f"mitsuba {importlib.metadata.version('mitsuba')}")
        for index in missing:
            path, camera = path_of[index], ex.sensor(folder.views[index], sampler)
            picture, _ = ex.render(world, how, camera, spp, batches, seed * 4096 + index)
            shown = folder.background_is_visible
            if shown and name in ("views", "relight"):
                # The light itself is what paths of depth 1 carry; both parts have the same expectation as one render.
                # The black picture goes first: where the other is found, this one is not made again.
                if name == "views":
                    ex.write_exr(folder.folder / "views_black" / path.name, picture)
                picture = picture + ex.render(world, visible_only, camera, 256, 1, (seed + 7) * 4096 + index)[0]
            ex.write_exr(path, picture)
        print(f"{name}: {len(missing)} of {len(views)} pictures made, {time.time() - start:.1f} s, "
              f"load {os.getloadavg()[0]:.1f}", flush=True)

    world = ex.scene(folder, folder.light_of_photos())
    fill("views", world, hidden, range(count), 11)
    fill("views_d2", world, ex.integrator(2, True), range(min(direct, count)), 12)
    if (folder.folder / "env_heldout.exr").exists():
        other = ex.scene(folder, folder.light("env_heldout"))
        fill("relight", other, hidden, relit, 13)
    else:
        print("relight: left out, there is no env_heldout.exr", flush=True)
    coverage_and_texels(folder, world, mi, dr)


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
        path = folder.folder / "coverage" / f"{folder.name_of_view(index)}.exr"
        ex.write_exr(path, (covered / 64).reshape(rows, columns))
    ex.write_exr(folder.folder / "texel_seen.exr", seen.astype(np.float32))
    folder.save_facts(texels_seen=float(seen.mean()))
    print(f"texels seen: {seen.mean():.3f}")


if __name__ == "__main__":
    main()
