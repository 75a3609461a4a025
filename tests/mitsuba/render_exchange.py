"""Renders an exchange folder with Mitsuba: NAME.exr and variance/NAME.exr (variance of the mean) per view."""
import argparse
import json
import os
import time
from pathlib import Path

import exchange_scene as ex


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("--out", required=True)
    parser.add_argument("--spp", type=int, default=256, help="samples a pixel, over all seeds together")
    parser.add_argument("--seeds", type=int, default=16, help="independent batches; 1 writes no variance")
    parser.add_argument("--seed", type=int, default=1, help="number of the whole experiment")
    parser.add_argument("--depth", type=int, help="as Mitsuba counts: 2 is direct light only; default from scene.json")
    parser.add_argument("--views", default="", help="such as 0,3,8-11")
    parser.add_argument("--light", default="env", help="env or env_heldout")
    parser.add_argument("--background", choices=["visible", "hidden"], help="default from scene.json")
    parser.add_argument("--blend-log-width", action="store_true", help="taps blend ln a instead of r, as Patina does")
    options = parser.parse_args()
    mi, _ = ex.start()
    folder = ex.Folder(options.scene)
    depth = options.depth or folder.facts["max_depth"]
    hidden = options.background == "hidden" if options.background else not folder.background_is_visible
    how, world = ex.integrator(depth, hidden), ex.scene(folder, folder.light(options.light), options.blend_log_width)
    start, pixels = time.time(), 0
    for index in ex.chosen_views(options.views, len(folder.views)):
        view = folder.views[index]
        mean, variance = ex.render(world, how, ex.sensor(view), options.spp, options.seeds, options.seed * 4096 + index)
        ex.write_exr(f"{options.out}/{folder.name_of_view(index)}.exr", mean)
        path = Path(options.out) / "variance" / f"{folder.name_of_view(index)}.exr"
        if variance is None:
            # That of an earlier run belongs to another picture.
            path.unlink(missing_ok=True)
        else:
            ex.write_exr(path, variance)
        pixels += view["width"] * view["height"]
    seconds = time.time() - start
    samples = max(1, options.spp // options.seeds) * options.seeds
    print(json.dumps({"out": options.out, "depth": depth, "spp": samples, "seeds": options.seeds, "hidden": hidden,
                      "seconds": round(seconds, 2), "Msamples_per_s": round(pixels * samples / seconds / 1e6, 3),
                      "load": os.getloadavg()[0]}))


main()
