"""Times Mitsuba on an exchange folder: one JSON object a repetition, with a list for each sampler.

    [camera rays, bounce rays, shadow rays, path samples, noise, seconds to 1 % noise, gradient samples,
     gradient over picture]

Rays and samples in millions a second; noise is the standard deviation of a pixel in percent of the pictures' mean, from
the difference to the pictures of the repetition before; seconds are those of a megapixel, as variance times time. Rays
and gradients do not depend on the sampler and are null but for the first. The first pass of each compiles and is not
counted. `patina bench tracer` runs this beside the program's own tracer.
"""
import argparse
import json
import time

import numpy as np

import exchange_scene as ex

SAMPLERS = ["independent", "multijitter"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--most-views", type=int, default=4)
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--depth", type=int, help="as Mitsuba counts; default from scene.json")
    options = parser.parse_args()
    mi, dr = ex.start()
    if options.threads:
        dr.set_thread_count(options.threads)
    folder = ex.Folder(options.scene)
    depth, hidden = options.depth or folder.facts["max_depth"], not folder.background_is_visible
    world = ex.scene(folder, folder.light())
    views = folder.views[:options.most_views]
    sensors = [ex.sensor(view) for view in views]
    pixels = sum(view["width"] * view["height"] for view in views)

    def seconds(work):
        dr.sync_thread()
        start = time.perf_counter()
        work()
        dr.sync_thread()
        return time.perf_counter() - start

    # Rays with their numbers in memory, as a tracer that is asked for single rays gets them.
    camera, bounce, shadow = [], [], []
    for number, (view, sensor) in enumerate(zip(views, sensors)):
        columns, rows = view["width"], view["height"]
        x, y = np.tile(np.arange(columns), rows), np.repeat(np.arange(rows), columns)
        place = mi.Point2f(*(mi.Float(p.astype(np.float32)) for p in ((x + 0.5) / columns, (y + 0.5) / rows)))
        ray, _ = sensor.sample_ray(0.0, 0.5, place, mi.Point2f(0.5, 0.5))
        dr.eval(ray)
        camera.append(ray)
        si = world.ray_intersect(ray)
        front = dr.compress(si.is_valid() & (dr.dot(si.n, -ray.d) > 0))
        hit = dr.gather(mi.SurfaceInteraction3f, si, front)
        random = np.random.default_rng(number)
        for rays in (bounce, shadow):
            uv = mi.Point2f(*(mi.Float(random.random(dr.width(front), np.float32)) for _ in range(2)))
            out = hit.spawn_ray(mi.Frame3f(hit.n).to_world(mi.warp.square_to_cosine_hemisphere(uv)))
            dr.eval(out)
            rays.append(out)
    counts = [sum(dr.width(ray.d) for ray in rays) for rays in (camera, bounce, shadow)]

    def closest(rays):
        for ray in rays:
            dr.eval(world.ray_intersect_preliminary(ray).t)

    def occluded():
        for ray in shadow:
            dr.eval(world.ray_test(ray))

    path = ex.integrator(depth, hidden)
    prb = mi.load_dict({"type": "prb", "max_depth": depth, "rr_depth": 100000, "hide_emitters": hidden})

    sensors_of = {name: [ex.sensor(view, name) for view in views] for name in SAMPLERS}

    def pictures(name, seed):
        made = []
        for number, sensor in enumerate(sensors_of[name]):
            made.append(mi.render(world, sensor=sensor, integrator=path, spp=options.spp, seed=seed * 64 + number))
            dr.eval(made[-1])
        return made

    def noise(made, before):
        """Standard deviation of a pixel over the mean."""
        joined = lambda pictures: np.concatenate([np.array(picture, np.float64).ravel() for picture in pictures])
        made, before = joined(made), joined(before)
        return np.sqrt(0.5 * np.mean((made - before)**2)) / np.mean(0.5 * (made + before))

    parameters = mi.traverse(world)
    keys = [f"surface.bsdf.{name}.data" for name in ("diffuse", "specular", "roughness")] + ["light.data"]
    parameters.keep(keys)

    def gradients(seed):
        leaves = []
        for key in keys:
            leaf = mi.TensorXf(parameters[key])
            dr.enable_grad(leaf)
            parameters[key] = leaf
            leaves.append(leaf)
        parameters.update()
        for number, sensor in enumerate(sensors):
            picture = mi.render(world, parameters, sensor=sensor, integrator=prb, spp=options.spp,
                                seed=2 * (seed * 64 + number), seed_grad=2 * (seed * 64 + number) + 1)
            dr.backward(dr.mean(dr.square(picture - 0.25), axis=None), flags=dr.ADFlag.ClearVertices)
        for leaf in leaves:
            dr.eval(dr.grad(leaf))

    before = {}
    for repetition in range(options.repetitions + 1):
        # More rays at once than a view has would flatter nobody: launches are what a fit would do.
        rays = [count / seconds(work) / 1e6 for count, work in
                zip(counts, (lambda: closest(camera), lambda: closest(bounce), occluded))]
        rows = {}
        for name in SAMPLERS:
            made = []
            rate = pixels * options.spp / seconds(lambda: made.extend(pictures(name, repetition))) / 1e6
            if repetition > 0:
                deviation = noise(made, before[name])
                rows[name] = [rate, 100 * deviation, options.spp / rate * (deviation / 0.01)**2]
            before[name] = made
        gradient = pixels * options.spp / seconds(lambda: gradients(repetition)) / 1e6
        if repetition > 0:
            first = SAMPLERS[0]
            print(json.dumps({name: rays + row + [gradient, row[0] / gradient] if name == first else
                              [None] * 3 + row + [None] * 2 for name, row in rows.items()}), flush=True)


main()
