"""Gives an OBJ texture coordinates with xatlas: unwrap.py IN.obj OUT.obj [--size 256].

Normals are the mean over the faces of a vertex, weighted by their angles.
"""
import argparse

import numpy as np
import xatlas

import exchange_scene as ex


def read_obj(path):
    positions, faces = [], []
    for line in open(path):
        words = line.split()
        if words[:1] == ["v"]:
            positions.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(word.split("/")[0]) for word in words[1:]]
            corners = [corner - 1 if corner > 0 else len(positions) + corner for corner in corners]
            faces.extend([corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1))
    return np.array(positions), np.array(faces)


def angle_weighted_normals(positions, faces):
    normals = np.zeros_like(positions)
    corners = positions[faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-30)
    for k in range(3):
        a, b = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(1))
        np.add.at(normals, faces[:, k], flat * angle[:, None])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-30), [[0.0, 1.0, 0.0]])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source")
    parser.add_argument("target")
    parser.add_argument("--size", type=int, default=256, help="texels a side")
    options = parser.parse_args()
    positions, faces = read_obj(options.source)
    normals = angle_weighted_normals(positions, faces)
    # xatlas takes the resolution as a hint: ask for less until the result fits.
    for asked in range(options.size, options.size // 2, -2):
        atlas, pack = xatlas.Atlas(), xatlas.PackOptions()
        atlas.add_mesh(positions.astype(np.float32), faces.astype(np.uint32))
        pack.resolution, pack.padding, pack.bilinear = asked, 2, True
        atlas.generate(xatlas.ChartOptions(), pack)
        if atlas.atlas_count == 1 and max(atlas.width, atlas.height) <= options.size:
            break
    else:
        raise SystemExit("the charts do not fit the map: raise --size")
    old, triangles, uv = atlas[0]
    with ex.replacing(options.target) as temporary, open(temporary, "w") as out:
        for p in positions[old]:
            out.write("v %.9g %.9g %.9g\n" % tuple(p))
        # Texels of the packing are texels of the map: the rest of the map stays empty.
        for p in uv * [atlas.width / options.size, atlas.height / options.size]:
            out.write("vt %.9g %.9g\n" % tuple(p))
        for p in normals[old]:
            out.write("vn %.9g %.9g %.9g\n" % tuple(p))
        for triangle in triangles + 1:
            out.write("f " + " ".join(f"{k}/{k}/{k}" for k in triangle) + "\n")
    print(f"{options.target}: {len(triangles)} triangles, {atlas.chart_count} charts, {atlas.width} x {atlas.height}")


if __name__ == "__main__":
    main()
