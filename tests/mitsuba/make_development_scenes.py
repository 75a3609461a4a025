"""Makes the development scenes: exchange folders with their truth, each as linear EXR and as 8-bit sRGB.

    make_development_scenes.py --data DATA -o OUT [--scale full|quarter] [--scenes NAME,...]

DATA holds `meshes/` and `envmaps/`. OUT gets a folder a scene, and NAME-srgb8, which differs in its photos alone; its
scene.json names by `judged_by` the folder whose linear pictures judge it. OUT/sheets shows each at a glance. Finished
scenes stay. What stands where is told in `development_scenes.py`; nothing is drawn by chance.
"""
import argparse
import json
import shutil
from pathlib import Path

import numpy as np

import exchange_scene as ex
import scene_atlas
import scene_objects
from development_scenes import HOLD_OUT_EVERY, RECIPES, SCALES
from fill_exchange import fill_folder
from resample_light import means

ROWS_OF_MODEL = 32
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# The brightest surface but for a few per cent of its pixels, so that highlights clip in 8 bits as in a photograph.
EXPOSED_TO, EXPOSED_SHARE = 0.9, 0.98
FIELD_OF_VIEW_DEGREES = 40.0
# Distance of the cameras in radii of what they look at.
DISTANCE = 3.5


def cameras(recipe, scale, positions):
    """A spiral of even density by the golden angle between two elevations, looking at the middle of the objects."""
    low, high = positions.min(0), positions.max(0)
    centre = (low + high) / 2
    distance = DISTANCE * np.linalg.norm(positions - centre, axis=1).max()
    sines = np.sin(np.radians(recipe.elevation))
    focal = scale.width / 2 / np.tan(np.radians(FIELD_OF_VIEW_DEGREES) / 2)
    views = []
    for index in range(scale.views):
        height = sines[0] + (sines[1] - sines[0]) * (index + 0.5) / scale.views
        azimuth, flat = index * np.pi * (3 - np.sqrt(5)), np.sqrt(1 - height * height)
        outwards = np.array([flat * np.cos(azimuth), height, flat * np.sin(azimuth)])
        forward = -outwards
        right = np.cross(forward, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        camera_from_world = np.eye(4)
        camera_from_world[:3, :3], camera_from_world[:3, 3] = rotation, -rotation @ (centre + distance * outwards)
        views.append({"file": f"views/{index:04d}.exr", "width": scale.width, "height": scale.height,
                      "K": [[focal, 0, scale.width / 2], [0, focal, scale.height / 2], [0, 0, 1]],
                      "w2c": camera_from_world.tolist(), "held_out": index % HOLD_OUT_EVERY == HOLD_OUT_EVERY // 2})
    return views


def write_mesh(path, mesh, names):
    with ex.replacing(path) as temporary, open(temporary, "w") as out:
        for word, name in (("v", "positions"), ("vt", "uvs"), ("vn", "normals")):
            out.writelines(f"{word} " + " ".join("%.9g" % x for x in row) + "\n" for row in mesh[name])
        last = -1
        for triangle, part in zip(mesh["faces"] + 1, mesh["part"]):
            if part != last:
                out.write(f"g {names[part]}\n")
                last = part
            out.write("f " + " ".join(f"{k}/{k}/{k}" for k in triangle) + "\n")


def lights(data, recipe):
    """The light of the photos at full size, its means, and the means of the other; mean luminances are 1."""
    read = lambda name: ex.read_exr(data / "envmaps" / f"{name}_1k.hdr")[..., :3].astype(np.float64)
    full = read(recipe.light)
    coarse, mean = means(full, ROWS_OF_MODEL)
    other, other_mean = means(read(recipe.other_light), ROWS_OF_MODEL)
    return full / (mean @ LUMINANCE), coarse / (mean @ LUMINANCE), other / (other_mean @ LUMINANCE)


def exposure(folder, light):
    """The factor of the light that exposes the surface, from a rough look through every fourth camera."""
    world, how, seen = ex.scene(folder, light), ex.integrator(folder.facts["max_depth"], True), []
    for index in range(0, len(folder.views), 4):
        picture, _ = ex.render(world, how, ex.sensor(folder.views[index]), 16, 1, 90_000 + index)
        seen.append(picture.max(2)[picture.max(2) > 0])
    return EXPOSED_TO / float(np.quantile(np.concatenate(seen), EXPOSED_SHARE))


def make(mi, dr, recipe, scale, data, out):
    objects = []
    for name, x, z, radius in recipe.objects:
        objects.extend(scene_objects.placed(scene_objects.parts_of(data, name), x, z, radius))
    looked_at = np.concatenate([part["positions"] for part in objects])
    half_width = max(1.15 * np.abs(looked_at[:, [0, 2]]).max(), 0.6 * looked_at[:, 1].max())
    ground = [scene_objects.ground(recipe.ground, half_width)] if recipe.ground else []
    parts = ground + objects
    mesh, charts = scene_atlas.unwrap(parts, scale.map_size)
    maps = scene_atlas.baked(mi, mesh, parts, scale.map_size, data)
    write_mesh(out / "mesh.obj", mesh, [f"part{number}" for number in range(len(parts))])
    for name in ("diffuse", "specular", "roughness"):
        ex.write_exr(out / f"{name}.exr", maps[name])
    ex.write_exr(out / "texel_covered.exr", maps["covered"])
    (out / "cameras.json").write_text(
        json.dumps({"convention": "opencv", "views": cameras(recipe, scale, looked_at)}, indent=1))
    facts = {"name": recipe.name, "max_depth": 4, "background": recipe.background, "rough_pow": 1.0,
             "g_mode": "half_alpha" if recipe.lobe == "modct" else "smith_ggx", "lobe": recipe.lobe,
             "lobe_strength": 1.0, "vertices": len(mesh["positions"]), "triangles": len(mesh["faces"]),
             "texture": scale.map_size, "charts": charts}
    (out / "scene.json").write_text(json.dumps(facts, indent=1) + "\n")
    folder = ex.Folder(out)
    full, coarse, other = lights(data, recipe)
    factor = exposure(folder, full if recipe.light_is_full else coarse)
    if recipe.light_is_full:
        ex.write_exr(out / "env_full.exr", full * factor)
    ex.write_exr(out / "env.exr", coarse * factor)
    ex.write_exr(out / "env_heldout.exr", other * factor)
    relit = [index for index, view in enumerate(folder.views) if view["held_out"]]
    fill_folder(mi, dr, folder, scale.samples, relit, sampler="multijitter")
    folder.save_facts(noise=noise(folder, scale.samples))


def noise(folder, samples):
    """Standard deviation of a surface pixel of a photo over their root mean square: view 0, photographed again."""
    world, how = ex.scene(folder, folder.light_of_photos()), ex.integrator(folder.facts["max_depth"], True)
    again, _ = ex.render(world, how, ex.sensor(folder.views[0], "multijitter"), samples, max(1, samples // 64), 77)
    name = "views_black" if folder.background_is_visible else "views"
    first, surface = ex.read_exr(folder.folder / name / "0000.exr"), again.max(2) > 0
    difference = np.sqrt(np.mean((again - first)[surface] ** 2) / 2)
    return round(float(difference / np.sqrt(np.mean(again[surface] ** 2))), 5)


def encoded(picture):
    x = np.clip(picture, 0.0, 1.0)
    return (255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055) + 0.5).astype(np.uint8)


def write_png(mi, path, pixels):
    with ex.replacing(path) as temporary:
        mi.Bitmap(np.ascontiguousarray(pixels)).write(str(temporary))


def make_twin(mi, source, twin):
    """The same with 8-bit photos."""
    twin.mkdir(parents=True, exist_ok=True)
    for path in sorted(source.iterdir()):
        if path.is_file() and path.name not in ("cameras.json", "scene.json"):
            shutil.copyfile(path, twin / path.name)
    for name in ("coverage", "relight"):
        shutil.copytree(source / name, twin / name, dirs_exist_ok=True)
    folder = ex.Folder(source)
    views = []
    for view in folder.views:
        path = Path(view["file"]).with_suffix(".png")
        write_png(mi, twin / path, encoded(ex.read_exr(source / view["file"])[..., :3]))
        views.append(view | {"file": str(path)})
    (twin / "cameras.json").write_text(json.dumps({"convention": "opencv", "views": views}, indent=1))
    facts = folder.facts | {"name": folder.facts["name"] + "-srgb8", "judged_by": f"../{source.name}"}
    (twin / "scene.json").write_text(json.dumps(facts, indent=1) + "\n")


def write_sheet(mi, source, path):
    """Six photos above two relit pictures, diffuse, F0, roughness and light, at the height of a photo."""
    folder = ex.Folder(source)
    height, width = folder.views[0]["height"], folder.views[0]["width"]

    def tile(pixels):
        pixels = np.repeat(pixels, 3, 2) if pixels.shape[2] == 1 else pixels[..., :3]
        row = np.arange(height) * pixels.shape[0] // height
        column = np.arange(width) * pixels.shape[1] // width
        return pixels[row][:, column]

    some = [index * (len(folder.views) - 1) // 5 for index in range(6)]
    above = [ex.read_exr(source / folder.views[index]["file"]) for index in some]
    below = [ex.read_exr(p) for p in sorted((source / "relight").iterdir())[:2]]
    below += [folder.maps["diffuse"], folder.maps["specular"], folder.maps["roughness"], folder.light()]
    rows = [np.concatenate([tile(picture) for picture in row], 1) for row in (above, below)]
    write_png(mi, path, encoded(np.concatenate(rows)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with meshes/ and envmaps/")
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--scale", choices=list(SCALES), default="full")
    parser.add_argument("--samples", type=int, help="paths a pixel; default by the scale")
    parser.add_argument("--scenes", default="", help="names, with commas; all when not given")
    options = parser.parse_args()
    wanted = [name for name in options.scenes.split(",") if name]
    unknown = set(wanted) - {recipe.name for recipe in RECIPES}
    if unknown:
        raise SystemExit(f"no scenes are called {', '.join(sorted(unknown))}")
    mi, dr = ex.start()
    scale = SCALES[options.scale]
    if options.samples:
        scale = type(scale)(scale.width, scale.height, scale.views, scale.map_size, options.samples)
    for recipe in RECIPES:
        if wanted and recipe.name not in wanted:
            continue
        source, twin = options.out / recipe.name, options.out / f"{recipe.name}-srgb8"
        # Its description is the last file of a twin.
        if (twin / "scene.json").exists():
            print(f"{recipe.name}: is there", flush=True)
            continue
        source.mkdir(parents=True, exist_ok=True)
        make(mi, dr, recipe, scale, options.data, source)
        make_twin(mi, source, twin)
        write_sheet(mi, source, options.out / "sheets" / f"{recipe.name}.png")
        facts = ex.Folder(source).facts
        print(f"{recipe.name}: {facts['triangles']} triangles, {facts['charts']} charts, {facts['texels_seen']:.2f} of "
              f"the texels seen, noise {facts['noise']}", flush=True)


main()
