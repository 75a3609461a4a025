"""An exchange folder as a Mitsuba scene: files, cameras, light."""
import contextlib
import json
import os
from pathlib import Path

import numpy as np

mi = dr = None


def start(variant="llvm_ad_rgb"):
    """Chooses the variant and registers our lobe. Call once, before anything else here."""
    global mi, dr
    import drjit
    import mitsuba

    mi, dr = mitsuba, drjit
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Warn)
    import ggx_lobe
    import modct

    modct.register()
    ggx_lobe.register()
    return mi, dr


def read_exr(path):
    """A linear picture as float32 [height, width, channels]."""
    pixels = np.array(mi.Bitmap(str(path)).convert(component_format=mi.Struct.Type.Float32))
    return pixels[..., None] if pixels.ndim == 2 else pixels


@contextlib.contextmanager
def replacing(path):
    """A path beside `path` to write to; what was written takes the place of `path` when the block ends without error.

    Scripts pass over files that exist, so that a file under its own name must be whole, whenever a run is cut off. The
    ending is kept: Mitsuba chooses the format of a picture by it.
    """
    path = Path(path)
    temporary = path.with_name(f"{path.stem}.{os.getpid()}.tmp{path.suffix}")
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_exr(path, pixels):
    """Writes float32 [height, width] or [height, width, 1 or 3]."""
    pixels = np.ascontiguousarray(pixels, np.float32)
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    kind = mi.Bitmap.PixelFormat.Y if pixels.shape[2] == 1 else mi.Bitmap.PixelFormat.RGB
    with replacing(path) as temporary:
        mi.Bitmap(pixels, kind).write(str(temporary))


class Folder:
    """The files of an exchange folder."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.facts = json.loads((self.folder / "scene.json").read_text())
        self.views = json.loads((self.folder / "cameras.json").read_text())["views"]
        self.maps = {name: read_exr(self.folder / f"{name}.exr") for name in ("diffuse", "specular", "roughness")}
        self.maps["roughness"] = self.maps["roughness"][..., :1]

    def light(self, name="env"):
        return read_exr(self.folder / f"{name}.exr")[..., :3]

    def light_of_photos(self):
        """What the photos were taken under: env_full.exr where there is one, of which env.exr holds the means."""
        return self.light("env_full" if (self.folder / "env_full.exr").exists() else "env")

    @property
    def background_is_visible(self):
        return self.facts.get("background", "black") == "environment"

    def name_of_view(self, index):
        return Path(self.views[index]["file"]).stem

    def save_facts(self, **facts):
        self.facts.update(facts)
        with replacing(self.folder / "scene.json") as temporary:
            temporary.write_text(json.dumps(self.facts, indent=1) + "\n")


def nodes_of_light(radiance):
    """The map Mitsuba needs to interpolate as we do.

    Our rows are texel centres at theta = pi (r + .5) / h, constant beyond the outer two. Mitsuba's rows are nodes at
    theta = pi j / (H - 1), poles included. With H = 2 h + 1 every odd node is one of our centres and every even node
    lies midway between two, where the linear interpolant is their mean: the same piecewise linear function, exactly.
    Columns agree already.
    """
    above = np.concatenate([radiance[:1], radiance])
    below = np.concatenate([radiance, radiance[-1:]])
    rows = np.empty((2 * radiance.shape[0] + 1,) + radiance.shape[1:], np.float32)
    rows[0::2] = 0.5 * (above + below)
    rows[1::2] = radiance
    return rows


def texture(values):
    """A raw bilinear texture, clamped at its border. Mitsuba's OBJ reader turns v over, so rows stay as stored."""
    return {"type": "bitmap", "data": mi.TensorXf(np.ascontiguousarray(values, np.float32)), "raw": True,
            "filter_type": "bilinear", "wrap_mode": "clamp"}


def integrator(depth, hidden):
    return mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 100000, "hide_emitters": hidden})


def scene(folder, light, blend_log_width=False):
    """The surface and a light as a Mitsuba scene. `blend_log_width`: taps blend ln a, as Patina's tracer does; an
    exchange folder means r itself."""
    maps = dict(folder.maps)
    if blend_log_width:
        maps["roughness"] = 0.5 * np.log(np.clip(maps["roughness"], 2.5e-5, 1.0))
    lobe = {"type": folder.facts.get("lobe", "modct"), "log_width": blend_log_width,
            "lobe_strength": float(folder.facts.get("lobe_strength", 1.0))}
    return mi.load_dict({
        "type": "scene",
        "surface": {"type": "obj", "filename": str(folder.folder / "mesh.obj"),
                    "lobe": lobe | {name: texture(values) for name, values in maps.items()}},
        "light": {"type": "envmap", "bitmap": mi.Bitmap(nodes_of_light(light))},
    })


def sensor(view, sampler="independent"):
    """A camera of cameras.json with a box filter. Mitsuba's axes are x left, y up, z forward."""
    k = np.array(view["K"], float)
    if abs(k[0, 0] - k[1, 1]) > 1e-5 * k[0, 0] or abs(k[0, 1]) > 1e-9:
        raise SystemExit(f"{view['file']}: Mitsuba's perspective camera needs square pixels without skew")
    width, height = view["width"], view["height"]
    world_from_camera = np.linalg.inv(np.array(view["w2c"], float)) @ np.diag([-1.0, -1.0, 1.0, 1.0])
    return mi.load_dict({
        "type": "perspective", "fov_axis": "x", "fov": float(np.degrees(2 * np.arctan2(0.5 * width, k[0, 0]))),
        # Measured (check_conventions.py): the offsets are those of the film against the principal point.
        "principal_point_offset_x": float(0.5 - k[0, 2] / width),
        "principal_point_offset_y": float(0.5 - k[1, 2] / height),
        "near_clip": 1e-3, "far_clip": 1e5, "to_world": mi.ScalarTransform4f(world_from_camera),
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"},
                 "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": sampler},
    })


def render(world, how, camera, samples, batches, seed):
    """Mean and variance of the mean over independent batches of `samples / batches` samples, float64."""
    each = max(1, samples // batches)
    total = total_of_squares = 0.0
    for batch in range(batches):
        picture = mi.render(world, sensor=camera, integrator=how, spp=each, seed=seed * batches + batch)
        picture = np.array(picture, np.float64)[..., :3]
        total, total_of_squares = total + picture, total_of_squares + picture**2
    mean = total / batches
    if batches == 1:
        return mean, None
    spread = np.maximum(total_of_squares / batches - mean**2, 0.0)
    return mean, spread / (batches - 1)


def chosen_views(text, count):
    """`0,3,8-11` as indices; all of them when nothing is given. Ends the script where there is no such view."""
    if not text:
        return list(range(count))
    chosen = []
    for piece in text.split(","):
        first, _, last = piece.partition("-")
        indices = range(int(first), int(last or first) + 1)
        if not indices or indices[-1] >= count:
            raise SystemExit(f"there are no views {piece}: the scene has {count}, counted from 0")
        chosen.extend(indices)
    return chosen
