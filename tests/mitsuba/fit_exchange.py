"""Fits maps and light of an exchange folder with Mitsuba: prb gradients and Adam, from start values that are given.

    fit_exchange.py SCENE --out DIR --start START --seconds 600 --at 10,20,40,80,160,320 [--views 1,2,3-7] [--seed 1]

START holds diffuse.exr, specular.exr, roughness.exr and env.exr; their sizes are those of the result. At the first step
that ends after each of the times, and at the end, DIR/NNN gets the same four files and DIR/snapshots.jsonl a line:

    {"folder": "000", "due": 10.0, "seconds": 10.4, "cpu_seconds": 17.1, "step": 9, "stage": "all",
     "peak_bytes": ..., "non_finite": 0}

Seconds count from the start of the process, imports and compilation of kernels included; writing these files is not
counted. `patina bench fit` runs this script beside the program's own methods.
"""
import time

IMPORTED = time.time()

import argparse
import json
import os
import resource
from pathlib import Path

import numpy as np

import exchange_scene as ex

MAPS = {"diffuse": (0.0, 1.0), "specular": (0.0, 1.0), "roughness": (2e-3, 1.0)}
NAME_OF_LIGHT = "env"


class Clock:
    """Wall-clock seconds since the process began, without what is left out on purpose."""

    def __init__(self, began):
        self.began, self.left_out = began, 0.0

    def seconds(self):
        return time.time() - self.began - self.left_out

    def without(self, work):
        start = time.time()
        result = work()
        self.left_out += time.time() - start
        return result


class LightNodes:
    """From our rows to Mitsuba's nodes and back: `data` also repeats a column on either side."""

    def __init__(self, height, width):
        self.height, self.width = height, width
        self.columns = np.arange(-1, width + 1) % width

    def data(self, radiance):
        return np.ascontiguousarray(ex.nodes_of_light(radiance)[:, self.columns], np.float32)

    def pulled(self, d_data):
        """The transpose of `data`: derivatives by nodes as derivatives by our texels."""
        columns = np.zeros((d_data.shape[0], self.width, d_data.shape[2]))
        np.add.at(columns, (slice(None), self.columns), d_data)
        d_radiance, between = columns[1::2].copy(), 0.5 * columns[0::2]
        # A node between two rows is their mean; those at the poles have the one row twice.
        d_radiance += between[:-1] + between[1:]
        d_radiance[0] += between[0]
        d_radiance[-1] += between[-1]
        return d_radiance


class Adam:
    """Kingma and Ba 2015."""

    def __init__(self, beta1=0.9, beta2=0.99):
        self.beta1, self.beta2, self.step_count, self.moments = beta1, beta2, 0, {}

    def begin_step(self):
        self.step_count += 1

    def direction(self, name, gradient):
        first, second = self.moments.setdefault(name, [np.zeros_like(gradient), np.zeros_like(gradient)])
        first += (1 - self.beta1) * (gradient - first)
        second += (1 - self.beta2) * (gradient * gradient - second)
        mean = first / (1 - self.beta1**self.step_count)
        return mean / (np.sqrt(second / (1 - self.beta2**self.step_count)) + 1e-10)


class Problem:
    """The scene whose maps and light move, and the loss of a view."""

    def __init__(self, mi, dr, folder, start, depth, hidden):
        self.mi, self.dr, self.folder = mi, dr, folder
        self.values = {name: start[name].astype(np.float32) for name in MAPS}
        self.values[NAME_OF_LIGHT] = start[NAME_OF_LIGHT].astype(np.float32)
        self.nodes = LightNodes(*start[NAME_OF_LIGHT].shape[:2])
        folder.maps = {name: self.values[name] for name in MAPS}
        # Whether there is a lobe is for the fit to find out.
        folder.facts["lobe_strength"] = 1.0
        folder.facts["lobe"] = "modct"
        self.world = ex.scene(folder, self.values[NAME_OF_LIGHT])
        self.integrator = mi.load_dict({"type": "prb", "max_depth": depth, "rr_depth": 100000, "hide_emitters": hidden})
        self.parameters = mi.traverse(self.world)
        self.keys = {name: f"surface.bsdf.{name}.data" for name in MAPS} | {NAME_OF_LIGHT: "light.data"}
        self.parameters.keep(list(self.keys.values()))
        self.sensors, self.photos = {}, {}

    def photo(self, view):
        if view not in self.photos:
            picture = ex.read_exr(self.folder.folder / self.folder.views[view]["file"])[..., :3]
            self.photos[view] = self.mi.TensorXf(np.ascontiguousarray(picture))
            self.sensors[view] = ex.sensor(self.folder.views[view])
        return self.photos[view], self.sensors[view]

    def hand_over(self):
        """Puts the values into the scene. A leaf asks for its derivative before it is handed over: the light's would
        be lost otherwise, since the scene works on a copy."""
        self.leaves = {}
        for name, key in self.keys.items():
            data = self.nodes.data(self.values[name]) if name == NAME_OF_LIGHT else self.values[name]
            leaf = self.mi.TensorXf(np.ascontiguousarray(data))
            self.dr.enable_grad(leaf)
            self.leaves[name] = leaf
            self.parameters[key] = leaf
        self.parameters.update()

    def gradient(self, views, samples, seed):
        """Derivatives of the mean squared error of some views. Picture and derivative use other random numbers each,
        so that their product has no bias."""
        self.hand_over()
        for place, view in enumerate(views):
            photo, sensor = self.photo(view)
            number = 2 * (seed + place)
            picture = self.mi.render(self.world, self.parameters, sensor=sensor, integrator=self.integrator,
                                     spp=samples, spp_grad=samples, seed=number, seed_grad=number + 1)
            loss = self.dr.mean(self.dr.square(picture - photo), axis=None) / len(views)
            # What leads from the leaves to the scene is needed again by the next view.
            self.dr.backward(loss, flags=self.dr.ADFlag.ClearVertices)
        gradient = {name: np.array(self.dr.grad(leaf), np.float64) for name, leaf in self.leaves.items()}
        gradient[NAME_OF_LIGHT] = self.nodes.pulled(gradient[NAME_OF_LIGHT])
        return gradient


class Snapshots:
    """What is written on the way."""

    def __init__(self, folder, due, clock):
        self.folder, self.due, self.clock, self.count = Path(folder), sorted(due), clock, 0
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / "snapshots.jsonl").write_text("")

    def offer(self, values, step, non_finite, is_end=False):
        seconds = self.clock.seconds()
        passed = [due for due in self.due if due <= seconds]
        if not passed and not is_end:
            return
        self.due = [due for due in self.due if due > seconds]
        usage = resource.getrusage(resource.RUSAGE_SELF)
        name = f"{self.count:03d}"
        row = {"folder": name, "due": None if is_end else passed[-1], "seconds": seconds,
               "cpu_seconds": usage.ru_utime + usage.ru_stime, "step": step, "stage": "all",
               "peak_bytes": usage.ru_maxrss * 1024, "non_finite": non_finite}
        self.count += 1

        def write():
            for key, pixels in values.items():
                ex.write_exr(self.folder / name / f"{key}.exr", pixels)
            with open(self.folder / "snapshots.jsonl", "a") as lines:
                lines.write(json.dumps(row) + "\n")

        self.clock.without(write)
        print(f"mitsuba: step {step}, {seconds:.1f} s", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--out", required=True)
    parser.add_argument("--start", required=True)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--at", default="10,20,40,80,160,320")
    parser.add_argument("--views", default="", help="views to fit to, such as 0,3,8-11; all when not given")
    parser.add_argument("--names", default="", help="the same by the stems of their files, such as 0000,0007")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--began", type=float, help="when the process was started, in seconds since 1970")
    parser.add_argument("--depth", type=int, help="as Mitsuba counts; default from scene.json")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--views-per-step", type=int, default=1)
    parser.add_argument("--rate", type=float, default=0.02, help="step size of the maps")
    parser.add_argument("--rate-light", type=float, default=0.1,
                        help="step size of the light, times its mean at the start")
    parser.add_argument("--final-rate", type=float, default=0.05,
                        help="share of the step sizes that is left at the end")
    options = parser.parse_args()
    clock = Clock(options.began or IMPORTED)

    mi, dr = ex.start()
    if options.threads:
        dr.set_thread_count(options.threads)
    start = {name: ex.read_exr(Path(options.start) / f"{name}.exr") for name in [*MAPS, NAME_OF_LIGHT]}
    start["roughness"] = start["roughness"][..., :1]
    folder = ex.Folder(options.scene)
    depth, hidden = options.depth or folder.facts["max_depth"], not folder.background_is_visible
    problem = Problem(mi, dr, folder, start, depth, hidden)
    views = ex.chosen_views(options.views, len(folder.views))
    if options.names:
        names, stems = set(options.names.split(",")), [folder.name_of_view(index) for index in range(len(folder.views))]
        # Fitted to fewer photos than the program's own methods, it could not be compared with them.
        if not names <= set(stems):
            raise SystemExit(f"no views are called {', '.join(sorted(names - set(stems)))}")
        views = [index for index, stem in enumerate(stems) if stem in names]
    snapshots = Snapshots(options.out, [float(at) for at in options.at.split(",") if at], clock)

    rates = dict.fromkeys(MAPS, options.rate)
    rates[NAME_OF_LIGHT] = options.rate_light * float(start[NAME_OF_LIGHT].mean())
    bounds = MAPS | {NAME_OF_LIGHT: (0.0, np.inf)}
    adam, random, order, step, non_finite = Adam(), np.random.default_rng(options.seed), [], 0, 0
    while clock.seconds() < options.seconds:
        while len(order) < options.views_per_step:
            order.extend(random.permutation(views).tolist())
        chosen, order = order[:options.views_per_step], order[options.views_per_step:]
        seed = (options.seed * 1_000_003 + step * options.views_per_step) % (1 << 30)
        gradient = problem.gradient(chosen, options.spp, seed)
        # The step sizes fall along a cosine in time, whatever a step costs.
        progress = min(1.0, clock.seconds() / options.seconds)
        rate = options.final_rate + (1 - options.final_rate) * 0.5 * (1 + np.cos(np.pi * progress))
        adam.begin_step()
        for name, value in problem.values.items():
            bad = ~np.isfinite(gradient[name])
            non_finite += int(bad.sum())
            gradient[name][bad] = 0.0
            value -= (rate * rates[name] * adam.direction(name, gradient[name])).astype(np.float32)
            np.clip(value, *bounds[name], out=value)
        step += 1
        snapshots.offer(problem.values, step, non_finite)
    snapshots.offer(problem.values, step, non_finite, is_end=True)


main()
