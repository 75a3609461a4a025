"""Unwraps meshes with xatlas and prints the figures that `examples/atlas_quality.rs` prints for ours.

    python3 -m venv VENV && VENV/bin/pip install numpy trimesh xatlas
    VENV/bin/python tests/xatlas_compare.py RESOLUTION GUTTER MESH.obj...

Distortions are taken per triangle from the map between the surface and the texture, averaged by surface area; xatlas
may mirror charts, which is counted as no fault. `padding` is the gutter, the other options are its defaults.
"""

import sys
import time

import numpy as np
import trimesh
import xatlas


def mean_and_95(values, weights):
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    index = min(np.searchsorted(below, 0.95 * below[-1]), len(values) - 1)
    return float((values * weights).sum() / weights.sum()), float(values[order][index])


def distortion(space, texture):
    """Ratio of singular values and relative area of each triangle; corners as [n, 3, 3] and [n, 3, 2]."""
    along, other = space[:, 1] - space[:, 0], space[:, 2] - space[:, 0]
    normal = np.cross(along, other)
    double_area = np.linalg.norm(normal, axis=1)
    length = np.linalg.norm(along, axis=1)
    good = (double_area > 0) & (length > 0)
    along, other, double_area, length = along[good], other[good], double_area[good], length[good]
    x = (other * along).sum(1) / length
    y = double_area / length
    inverse = np.zeros((len(x), 2, 2))
    inverse[:, 0, 0] = 1 / length
    inverse[:, 0, 1] = -x / (length * y)
    inverse[:, 1, 1] = 1 / y
    sides = np.stack([texture[good, 1] - texture[good, 0], texture[good, 2] - texture[good, 0]], axis=2)
    values = np.linalg.svd(sides @ inverse, compute_uv=False)
    ratio = np.minimum(values[:, 0] / np.maximum(values[:, 1], 1e-30), 1e6)
    area, texture_area = double_area / 2, np.abs(np.linalg.det(sides)) / 2
    relative = texture_area / area * (area.sum() / texture_area.sum())
    stretch = np.minimum(np.maximum(relative, 1 / np.maximum(relative, 1e-30)), 1e6)
    return mean_and_95(ratio, area), mean_and_95(stretch, area), float(texture_area.sum())


def row(path, resolution, gutter):
    scene = trimesh.load(path, process=False, force="mesh")
    # One vertex a position: xatlas would cut along every seam the file has.
    points, names = np.unique(np.asarray(scene.vertices, np.float32), axis=0, return_inverse=True)
    faces = names.reshape(-1)[np.asarray(scene.faces)].astype(np.uint32)
    # xatlas drops triangles below an absolute area: edges of mean length 1 keep it from that.
    corners = points[faces].astype(float)
    points = (points - points.mean(0)) / np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean()
    start, processor = time.time(), time.process_time()
    atlas = xatlas.Atlas()
    atlas.add_mesh(points.astype(np.float32), faces)
    options = xatlas.PackOptions()
    options.padding, options.resolution, options.bilinear = gutter, resolution, True
    atlas.generate(xatlas.ChartOptions(), options)
    seconds, processor = time.time() - start, time.process_time() - processor
    vertices, triangles, uvs = atlas[0]
    size = np.array([atlas.width, atlas.height], float)
    texture = uvs.astype(float)[triangles] * size
    angle, area, texels = distortion(points[vertices].astype(float)[triangles], texture)
    share = texels / (atlas.width * atlas.height * atlas.atlas_count)
    name = path.rsplit("/", 1)[-1].rsplit(".", 1)[0]
    print(
        f"| {name} | {len(triangles)} | {atlas.chart_count} | {angle[0]:.4f} | {angle[1]:.3f} | {area[0]:.4f} "
        f"| {area[1]:.3f} | {100 * share:.1f} % | {atlas.width}x{atlas.height} x {atlas.atlas_count} | {seconds:.2f} | {processor:.2f} |",
        flush=True,
    )


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    print("| mesh | triangles | charts | angle mean | angle 95 % | area mean | area 95 % | area in the atlas | atlas | seconds | processor seconds |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for mesh in sys.argv[3:]:
        row(mesh, int(sys.argv[1]), int(sys.argv[2]))
