"""Meshes of the development scenes: OBJ, glTF and city models as parts in one world, +y up.

A part is a dict: `positions`, `normals`, `uvs` (or none), `faces`, and `finish`, a name of `scene_materials.py` or the
files of a glTF material. Objects of one radius stand on y = 0.
"""
import json
from pathlib import Path

import numpy as np

FILES = {"bunny": "common/stanford-bunny.obj", "cow": "common/cow.obj", "teapot": "common/teapot.obj",
         "teddy": "teddy/teddy.obj", "spot": "spot_textured/spot.obj"}
GLTF = {"bottle": "gltf/WaterBottle/WaterBottle.gltf", "avocado": "gltf/Avocado/Avocado.gltf",
        "helmet": "gltf/FlightHelmet_bevy/FlightHelmet.gltf"}
CITIES = {"delft": ("city/delft_derived.obj", 14), "suburb": ("city/3dbag_sub_derived.obj", 7)}
NUMBERS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def parts_of(data, name):
    """The parts of a named object, scaled to a bounding radius of 1 in x and z and y together, standing on y = 0."""
    meshes = Path(data) / "meshes"
    if name in GLTF:
        parts = gltf_parts(meshes / GLTF[name])
    elif name in CITIES:
        parts = [city_block(meshes / CITIES[name][0], CITIES[name][1])]
    else:
        parts = [obj_part(meshes / FILES[name], name)]
    low = np.min([part["positions"].min(0) for part in parts], 0)
    high = np.max([part["positions"].max(0) for part in parts], 0)
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    radius = np.linalg.norm(high - low) / 2
    for part in parts:
        part["positions"] = (part["positions"] - foot) / radius
    return parts


def placed(parts, x, z, radius):
    for part in parts:
        part["positions"] = part["positions"] * radius + [x, 0.0, z]
    return parts


def ground(finish, half_width, cells=8):
    """A square below the objects, a hair under y = 0 so that feet do not fight with it."""
    ticks = np.linspace(-half_width, half_width, cells + 1)
    x, z = np.meshgrid(ticks, ticks, indexing="ij")
    positions = np.stack([x.ravel(), np.full(x.size, -0.002), z.ravel()], 1)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)[None]).ravel()
    a, b, c, d = corner, corner + 1, corner + cells + 2, corner + cells + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return {"positions": positions, "normals": np.tile([0.0, 1.0, 0.0], (len(positions), 1)), "uvs": None,
            "faces": faces, "finish": finish}


def read_obj(path):
    """Positions, texture coordinates (v as in the file), and triangles as rows of (position, uv) indices, by group."""
    positions, uvs, groups = [], [], [["", []]]
    for line in open(path):
        words = line.split()
        if words[:1] == ["v"]:
            positions.append([float(word) for word in words[1:4]])
        elif words[:1] == ["vt"]:
            uvs.append([float(word) for word in words[1:3]])
        elif words[:1] in (["g"], ["o"]):
            groups.append([" ".join(words[1:]), []])
        elif words[:1] == ["f"]:
            corners = []
            for word in words[1:]:
                pieces = word.split("/")
                corners.append((int(pieces[0]) - 1, int(pieces[1]) - 1 if len(pieces) > 1 and pieces[1] else -1))
            groups[-1][1].extend([corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1))
    return np.array(positions), np.array(uvs), [(name, np.array(faces)) for name, faces in groups if faces]


def obj_part(path, finish):
    """One surface with normals by the angles of faces; equal positions are one, so that patches join smoothly."""
    from unwrap import angle_weighted_normals

    positions, uvs, groups = read_obj(path)
    corners = np.concatenate([faces for _, faces in groups])
    welded, same = np.unique(np.round(positions, 6), axis=0, return_inverse=True)
    same = same.ravel()
    faces = same[corners[..., 0]]
    alive = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    faces, corners = faces[alive], corners[alive]
    normals = angle_weighted_normals(welded, faces)
    if not len(uvs):
        return {"positions": welded, "normals": normals, "uvs": None, "faces": faces, "finish": finish}
    pairs, index = np.unique(np.stack([faces.ravel(), corners[..., 1].ravel()], 1), axis=0, return_inverse=True)
    return {"positions": welded[pairs[:, 0]], "normals": normals[pairs[:, 0]], "uvs": uvs[pairs[:, 1]],
            "faces": index.reshape(-1, 3), "finish": finish}


def city_block(path, count):
    """The `count` buildings that stand closest together, with flat normals; the files have +z up and metres. Sheds and
    blocks that fill a street are left out."""
    positions, _, groups = read_obj(path)
    groups = [faces[..., 0] for name, faces in groups if name.startswith("Building")]
    sizes = [np.ptp(positions[np.unique(faces)], axis=0) for faces in groups]
    groups = [faces for faces, size in zip(groups, sizes) if size[2] > 4.0 and size[:2].max() < 40.0]
    centres = np.array([positions[np.unique(faces)].mean(0)[:2] for faces in groups])
    distances = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    order = np.argsort(distances, axis=1, kind="stable")[:, :count]
    reach = np.take_along_axis(distances, order, 1)[:, -1]
    corners = []
    for index in order[np.argmin(reach)]:
        corner = positions[groups[index]].copy()
        corner[..., 2] -= corner[..., 2].min()
        corners.append(corner)
    corners = np.concatenate(corners)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1)
    alive = length > 1e-6
    corners, across = corners[alive], across[alive] / length[alive, None]
    # Floors are never seen, and would lie in the ground.
    floor = (across[:, 1] < -0.9) & (corners[..., 1].max(1) < 0.1)
    corners, across = corners[~floor], across[~floor]
    return {"positions": corners.reshape(-1, 3), "normals": np.repeat(across, 3, 0), "uvs": None,
            "faces": np.arange(3 * len(corners)).reshape(-1, 3), "finish": "buildings"}


def gltf_parts(path):
    """Primitives with their materials. Blended ones are left out: the model has no glass."""
    document = json.loads(path.read_text())
    buffers = [(path.parent / buffer["uri"]).read_bytes() for buffer in document["buffers"]]

    def accessor(index):
        own = document["accessors"][index]
        view = document["bufferViews"][own["bufferView"]]
        kind, width = np.dtype(NUMBERS[own["componentType"]]), WIDTHS[own["type"]]
        start = view.get("byteOffset", 0) + own.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        rows = np.ndarray((own["count"], width), kind, buffers[view["buffer"]], start, (stride, kind.itemsize))
        return rows.astype(np.int64 if own["type"] == "SCALAR" else np.float64)

    def picture(texture):
        if texture is None:
            return None
        return path.parent / document["images"][document["textures"][texture["index"]]["source"]]["uri"]

    parts = []
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            material = document["materials"][primitive["material"]]
            if material.get("alphaMode") == "BLEND":
                continue
            reflectance = material["pbrMetallicRoughness"]
            names = primitive["attributes"]
            # glTF counts v from the top.
            uvs = accessor(names["TEXCOORD_0"]) * [1.0, -1.0] + [0.0, 1.0]
            files = (picture(reflectance["baseColorTexture"]), picture(reflectance["metallicRoughnessTexture"]))
            parts.append({"positions": accessor(names["POSITION"]), "normals": accessor(names["NORMAL"]), "uvs": uvs,
                          "faces": accessor(primitive["indices"]).reshape(-1, 3), "finish": files})
    return parts
