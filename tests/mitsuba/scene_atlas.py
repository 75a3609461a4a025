"""One atlas over all parts of a scene, and finishes baked onto it."""
import numpy as np
import xatlas

import scene_materials

# Places a texel is asked at, a side; their mean is the texel.
OVERSAMPLING = 4
# Root of the share of a packing that charts usually fill.
FILLED = 0.75


def unwrap(parts, size):
    """The parts as one mesh with an atlas of `size` texels; a dict as in scene_objects, with `part` of each triangle."""
    atlas, pack, charts = xatlas.Atlas(), xatlas.PackOptions(), xatlas.ChartOptions()
    area = 0.0
    for part in parts:
        atlas.add_mesh(part["positions"].astype(np.float32), part["faces"].astype(np.uint32),
                       part["normals"].astype(np.float32))
        a, b, c = (part["positions"][part["faces"][:, corner]] for corner in range(3))
        area += np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    charts.max_cost = 4.0
    # One packing whose side is about that of the maps, stretched to it: with a fixed side xatlas would open a second
    # page. The padding is a texel more than needed for the stretch.
    pack.resolution, pack.texels_per_unit = 0, FILLED * size / np.sqrt(area)
    pack.padding, pack.bilinear = 3, True
    atlas.generate(charts, pack)
    if atlas.atlas_count != 1:
        raise SystemExit("the charts do not fit one map")
    scale = 1.0 / max(atlas.width, atlas.height)
    joined = {name: [] for name in ("positions", "normals", "uvs", "source_uvs", "faces", "part")}
    count = 0
    for number, part in enumerate(parts):
        old, triangles, uv = atlas[number]
        joined["positions"].append(part["positions"][old])
        joined["normals"].append(part["normals"][old])
        joined["uvs"].append(uv * [atlas.width * scale, atlas.height * scale])
        own = part["uvs"]
        joined["source_uvs"].append(np.zeros((len(old), 2)) if own is None else own[old])
        joined["faces"].append(triangles.astype(np.int64) + count)
        joined["part"].append(np.full(len(triangles), number))
        count += len(old)
    joined = {name: np.concatenate(values) for name, values in joined.items()}
    return joined, atlas.chart_count


def rasterised(mi, mesh, size):
    """Triangle (or -1) and barycentric coordinates at the centres of `size` squared places of the atlas."""
    flat = np.concatenate([mesh["uvs"], np.zeros((len(mesh["uvs"]), 1))], 1).astype(np.float32)
    shape = mi.Mesh("atlas", len(flat), len(mesh["faces"]))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mi.Float(flat.ravel())
    parameters["faces"] = mi.UInt32(mesh["faces"].astype(np.uint32).ravel())
    parameters.update()
    world = mi.load_dict({"type": "scene", "atlas": shape})
    row, column = np.divmod(np.arange(size * size), size)
    u, v = (column + 0.5) / size, 1.0 - (row + 0.5) / size
    origin = mi.Point3f(mi.Float(u.astype(np.float32)), mi.Float(v.astype(np.float32)), 1.0)
    hit = world.ray_intersect_preliminary(mi.Ray3f(origin, mi.Vector3f(0, 0, -1)))
    valid, place = np.array(hit.is_valid()).astype(bool), np.array(hit.prim_uv)
    triangle = np.where(valid, np.array(hit.prim_index).astype(int), -1)
    return triangle, np.stack([1 - place[0] - place[1], place[0], place[1]], 1)


def baked(mi, mesh, parts, size, data):
    """Maps `diffuse`, `specular`, `roughness` and `covered`: means over the places of a texel that lie in a chart;
    texels outside of all charts repeat their neighbours."""
    fine = size * OVERSAMPLING
    triangle, weights = rasterised(mi, mesh, fine)
    inside = np.flatnonzero(triangle >= 0)
    corners, weights = mesh["faces"][triangle[inside]], weights[inside]
    blended = lambda name: np.einsum("nk,nkd->nd", weights, mesh[name][corners])
    p, n, uvs, part = blended("positions"), blended("normals"), blended("source_uvs"), mesh["part"][triangle[inside]]
    values = np.zeros((len(inside), 7))
    for number, own in enumerate(parts):
        those = part == number
        finish = scene_materials.finish_of(mi, own, data)
        diffuse, f0, r = scene_materials.maps_of(*finish(p[those], n[those], uvs[those]))
        values[those] = np.concatenate([diffuse, f0, r[:, None]], 1)
    row, column = np.divmod(inside, fine)
    texel = row // OVERSAMPLING * size + column // OVERSAMPLING
    count = np.bincount(texel, minlength=size * size)
    sums = np.stack([np.bincount(texel, values[:, k], size * size) for k in range(7)], 1)
    maps = (sums / np.maximum(count, 1)[:, None]).reshape(size, size, 7)
    covered = (count > 0).reshape(size, size)
    maps = padded(maps, covered)
    return {"diffuse": maps[..., :3], "specular": maps[..., 3:6], "roughness": maps[..., 6:],
            "covered": covered.astype(np.float32)}


def padded(maps, known):
    """Texels that are not known, from the outside of charts inwards to each other: the mean of known neighbours."""
    maps, known = maps.copy(), known.copy()
    steps = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)]
    while not known.all():
        around, weight = np.pad(maps * known[..., None], ((1, 1), (1, 1), (0, 0))), np.pad(known, 1).astype(float)
        rows, columns = known.shape
        shift = lambda x, dy, dx: x[1 + dy:1 + dy + rows, 1 + dx:1 + dx + columns]
        total, count = sum(shift(around, *s) for s in steps), sum(shift(weight, *s) for s in steps)
        new = ~known & (count > 0)
        maps[new] = total[new] / count[new][:, None]
        known |= new
    return maps
