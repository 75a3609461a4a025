"""Exports a run and has other programs open, check and render it; see README.md."""
import argparse
import json
import os
import shutil
import subprocess
import sys
import urllib.parse

import numpy as np

import measure

HERE = os.path.dirname(os.path.abspath(__file__))
# As Mitsuba counts: three surface hits on the longest path.
DEPTH = 4


def run(*command, **keywords):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, **keywords)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}")
    return done.stdout


def read_exr(path):
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    picture = np.array(mi.Bitmap(str(path)).convert(component_format=mi.Struct.Type.Float32), dtype=np.float64)
    return picture if picture.ndim == 3 else picture[..., None]


def write_exr(path, picture):
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    mi.Bitmap(picture.astype(np.float32)).write(str(path))


def write_png(path, picture, white):
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    bytes_ = (255 * measure.tone_mapped(np.maximum(picture, 0.0), white) + 0.5).astype(np.uint8)
    mi.Bitmap(np.ascontiguousarray(bytes_)).write(str(path))


def lights(own):
    """The lights of the proof on the grid of the run's own."""
    height, width = own.shape[:2]
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = 2 * np.pi * (np.arange(width) + 0.5) / width
    up, east, south = (np.cos(theta)[:, None] + 0 * phi, np.sin(theta)[:, None] * np.sin(phi),
                       -np.sin(theta)[:, None] * np.cos(phi))
    lamp = lambda x, y, z, width_: np.exp((east * x + up * y + south * z - 1.0) / width_)
    sky = 0.15 * np.clip(0.6 + up, 0.1, None)[..., None] * np.array([0.8, 0.9, 1.0])
    sky = sky + 6.0 * lamp(0.6, 0.64, 0.48, 0.02)[..., None] * np.array([1.0, 0.85, 0.6])
    sky = sky + 1.5 * lamp(-0.8, 0.36, -0.48, 0.08)[..., None] * np.array([0.5, 0.7, 1.0])
    texel = np.full_like(own, 0.05)
    texel[height // 4, width // 5] = 120.0
    return {"own": own, "sky": sky, "texel": texel}


def turned(light, how):
    return light[:, ::-1] if how == "mirrored" else np.roll(light, light.shape[1] * how // 4, axis=1)


class Ours:
    """Pictures by our path tracer, with the variance of each pixel's mean."""

    def __init__(self, patina, views, samples):
        self.patina, self.views, self.samples = patina, views, samples

    def render(self, folder, samples=None):
        out = os.path.join(folder, "render")
        run("nice", "-n", "19", self.patina, "render", folder, "--hide-background", "--samples", samples or self.samples,
            "--bounces", DEPTH - 1, "--aov", "shaded,variance,coverage", "-o", out, "--views", *self.views)
        layer = lambda view, name: read_exr(os.path.join(out, f"{view}_{name}.exr"))
        return {view: {name: layer(view, name) for name in ("shaded", "variance", "coverage")} for view in self.views}


def run_with(source, light, target):
    """The run under another light."""
    shutil.rmtree(target, ignore_errors=True)
    os.makedirs(target)
    for name in os.listdir(source):
        if os.path.isfile(os.path.join(source, name)) and name != "checkpoint":
            shutil.copy(os.path.join(source, name), target)
    write_exr(os.path.join(target, "env.exr"), light)


def compare(label, pictures, reference, out, results):
    rows = []
    for view, ours in reference.items():
        counted = ours["coverage"][..., 0] > 0.999
        picture, true = pictures[view].mean(0).astype(np.float64), ours["shaded"][..., :3]
        rmse, factor = measure.relative_rmse(picture, true, counted)
        rows.append((rmse, factor, measure.ssim(factor * picture, true, counted)))
        white = np.quantile(true[counted], 0.98)
        difference = np.where(counted[..., None], 0.5 * white + 2 * (factor * picture - true), 0.0)
        side_by_side = np.concatenate([true, factor * picture, difference], axis=1)
        write_png(os.path.join(out, "pictures", f"{label.replace(' ', '_')}_{view}.png"), side_by_side, white)
    rmse, factor, ssim = np.array(rows).mean(0)
    results[label] = {"rmse": rmse, "factor": factor, "ssim": ssim}
    print(f"{label:28s} rmse {100 * rmse:6.2f} %   factor {factor:6.3f}   ssim {ssim:6.4f}", flush=True)


def page_pictures(export, views, out):
    """Screenshots of the page by headless Chromium from the run's cameras, decoded to linear values."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    pictures = {}
    for view in views:
        rotation = np.array(view["w2c"])[:3, :3]
        camera = {"width": view["width"], "height": view["height"], "focal": [view["K"][0][0], view["K"][1][1]],
                  "centre": [view["K"][0][2], view["K"][1][2]], "rotation": rotation.T.ravel().tolist(),
                  "translation": np.array(view["w2c"])[:3, 3].tolist()}
        # Four times the size: one pixel of the camera is the mean of sixteen, as the path tracer's box is.
        scale = 4
        path = os.path.join(out, f"web_{view['name']}.png")
        address = (f"file://{export}/web/index.html#bare=1&backdrop=0&light=0&camera="
                   + urllib.parse.quote(json.dumps(camera)))
        run("chromium", "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
            "--hide-scrollbars", f"--window-size={scale * view['width']},{scale * view['height']}",
            "--virtual-time-budget=20000", f"--screenshot={path}", address)
        bytes_ = np.array(mi.Bitmap(path))[..., :3].astype(np.float64) / 255
        linear = np.where(bytes_ <= 0.04045, bytes_ / 12.92, ((bytes_ + 0.055) / 1.055) ** 2.4)
        height, width = view["height"], view["width"]
        linear = linear[: scale * height, : scale * width].reshape(height, scale, width, scale, 3).mean((1, 3))
        pictures[view["name"]] = linear[None]
    return pictures


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--patina", required=True)
    parser.add_argument("--renderer", help="another build of patina for reference pictures")
    parser.add_argument("--run", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--node", help="folder with node_modules/gltf-validator")
    parser.add_argument("--views", type=int, default=2)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--only", default="mitsuba,blender,files,web")
    options = parser.parse_args()
    only = options.only.split(",")
    out = os.path.abspath(options.out)
    os.makedirs(os.path.join(out, "pictures"), exist_ok=True)
    results = {}

    # Export the run under each light.
    exports = {}
    for name, light in lights(read_exr(os.path.join(options.run, "env.exr"))[..., :3]).items():
        folder = os.path.join(out, f"run_{name}")
        run_with(options.run, light, folder)
        exports[name] = os.path.join(out, f"export_{name}")
        run(options.patina, "export", folder, "--to", "glb,usd,mitsuba,blender,materialx,web", "--cameras",
            "-o", exports[name])
    with open(os.path.join(exports["own"], "cameras.json"), encoding="utf-8") as file:
        views = json.load(file)["views"]
    for view in views:
        view["name"] = os.path.splitext(os.path.basename(view["file"]))[0]
    views = views[:: max(1, len(views) // options.views)][: options.views]

    if "files" in only:
        for kind in ("usd", "materialx"):
            results[kind] = json.loads(run(sys.executable, os.path.join(HERE, "check_files.py"), kind, exports["own"]))
            print(kind, json.dumps(results[kind]), flush=True)
        if options.node:
            glb = next(os.path.join(exports["own"], "glb", name) for name in os.listdir(os.path.join(exports["own"], "glb"))
                       if name.endswith(".glb"))
            script = ("const v=require('gltf-validator'),fs=require('fs');"
                      "v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r=>console.log(JSON.stringify(r.issues)))")
            results["gltf-validator"] = json.loads(run("node", "-e", script, glb, cwd=options.node))
            print("gltf-validator", json.dumps(results["gltf-validator"]), flush=True)

    # Our pictures, those of a turned light among them.
    ours = Ours(options.renderer or options.patina, [view["name"] for view in views], options.samples)
    reference = {name: ours.render(os.path.join(out, f"run_{name}")) for name in exports}
    texel = read_exr(os.path.join(out, "run_texel", "env.exr"))[..., :3]
    wrong = {}
    for how in (1, 2, 3, "mirrored"):
        folder = os.path.join(out, "run_turned")
        run_with(options.run, turned(texel, how), folder)
        wrong[how] = ours.render(folder, samples=32)

    def judge(program, name, pictures):
        compare(f"{program} {name}", pictures, reference[name], out, results)
        if name == "texel":
            errors = {how: np.mean([measure.relative_rmse(pictures[view].mean(0).astype(np.float64), pair["shaded"][..., :3],
                                                          pair["coverage"][..., 0] > 0.999)[0]
                                    for view, pair in other.items()]) for how, other in wrong.items()}
            results[f"{program} {name}"]["turned"] = float(min(errors.values()))
            print(f"{'':28s} least rmse of a turned light {100 * min(errors.values()):.1f} %", flush=True)

    pictures_of = lambda prefix: {view["name"]: np.load(f"{prefix}_{view['name']}.npy") for view in views}
    if "mitsuba" in only:
        tasks = [{"scene": os.path.join(folder, "mitsuba", f"{scene}.xml"), "repeats": 8, "samples": options.samples // 8,
                  "out": os.path.join(out, f"mitsuba_{scene}_{name}")}
                 for name, folder in exports.items() for scene in ("scene", "scene_exact")]
        with open(os.path.join(out, "mitsuba.json"), "w", encoding="utf-8") as file:
            json.dump({"depth": DEPTH, "views": views, "tasks": tasks}, file)
        run("nice", "-n", "19", sys.executable, os.path.join(HERE, "in_mitsuba.py"), os.path.join(out, "mitsuba.json"))
        for name in exports:
            judge("mitsuba-principled", name, pictures_of(os.path.join(out, f"mitsuba_scene_{name}")))
            exact = pictures_of(os.path.join(out, f"mitsuba_scene_exact_{name}"))
            judge("mitsuba-exact", name, exact)
            z = [measure.z_scores(pair["shaded"][..., :3], pair["variance"][..., :3], exact[view],
                                  pair["coverage"][..., 0] > 0.999) for view, pair in reference[name].items()]
            mean, squares, far = np.array(z).mean(0)
            results[f"mitsuba-exact {name}"] |= {"z_mean": mean, "z_squares": squares, "z_beyond_5": far}
            print(f"{'':28s} z mean {mean:+.3f}  squares {squares:.3f}  beyond 5: {100 * far:.3f} %", flush=True)
    if "blender" in only:
        tasks = [{"kind": kind, "folder": os.path.join(folder, kind), "samples": options.samples,
                  "out": os.path.join(out, f"cycles_{kind}_{name}")}
                 for name, folder in exports.items() for kind in ("glb", "blender", "usd")]
        with open(os.path.join(out, "blender.json"), "w", encoding="utf-8") as file:
            json.dump({"depth": DEPTH, "views": views, "tasks": tasks}, file)
        log = run("nice", "-n", "19", sys.executable, os.path.join(HERE, "in_blender.py"), os.path.join(out, "blender.json"))
        print("\n".join(line for line in log.splitlines() if "made no world" in line))
        for kind in ("glb", "blender", "usd"):
            for name in exports:
                judge(f"cycles-{kind}", name, pictures_of(os.path.join(out, f"cycles_{kind}_{name}")))
    if "web" in only:
        pictures = page_pictures(exports["own"], views, out)
        # The page clips at white: the reference is clipped alike before the two are compared.
        clipped = {view: pair | {"shaded": np.clip(pair["shaded"][..., :3], 0.0, 1.0)} for view, pair in reference["own"].items()}
        compare("web own", pictures, clipped, out, results)
    with open(os.path.join(out, "proof.json"), "w", encoding="utf-8") as file:
        json.dump(results, file, indent=1)


main()
