"""Writes meshes by trimesh and PyMeshLab, and what both read of them and of other files.

    python tests/readers/write_meshes.py FOLDER [MESHES...]

FOLDER/meshes.json holds, for each file, triangles, copies (triangles between the corners of an earlier one), area and
bounding box by each reader. Files in the folders MESHES are read too. Polygons are cut into triangles first: a polygon of n
corners has n - 2 of them. One that lies in no plane has an area only once it is cut; what the choice of the cut can change
stands beside the answers.
"""

import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pymeshlab
import trimesh

ENDINGS = {".obj", ".ply", ".stl", ".glb", ".gltf"}


def shapes():
    """Closed and open, one body and several, near the origin and far from it, tiny and large."""
    two = trimesh.util.concatenate(
        [trimesh.creation.box(extents=[1, 2, 3]), trimesh.creation.icosphere(subdivisions=2).apply_translation([4, 0, 1])]
    )
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 20), np.linspace(0, 2, 30), indexing="ij"), axis=-1).reshape(-1, 2)
    height = 0.1 * np.sin(7 * grid[:, 0]) * np.cos(5 * grid[:, 1])
    cells = [(i * 30 + j, (i + 1) * 30 + j, (i + 1) * 30 + j + 1, i * 30 + j + 1) for i in range(19) for j in range(29)]
    faces = [face for a, b, c, d in cells for face in ((a, b, c), (a, c, d))]
    terrain = trimesh.Trimesh(np.column_stack([grid[:, 0], height, grid[:, 1]]), faces, process=False)
    return {
        "sphere": trimesh.creation.icosphere(subdivisions=3, radius=0.7),
        "two_bodies": two,
        "annulus": trimesh.creation.annulus(r_min=0.4, r_max=1.1, height=0.5),
        "terrain": terrain,
        "tiny": trimesh.creation.torus(major_radius=2e-3, minor_radius=5e-4),
        "large": trimesh.creation.capsule(height=300.0, radius=80.0),
    }


def write_by_trimesh(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for name, mesh in shapes().items():
        mesh.export(folder / f"{name}.obj")
        mesh.export(folder / f"{name}_binary.ply", encoding="binary")
        mesh.export(folder / f"{name}_ascii.ply", encoding="ascii")
        mesh.export(folder / f"{name}.glb")
        mesh.export(folder / f"{name}_binary.stl", file_type="stl")
        mesh.export(folder / f"{name}_ascii.stl", file_type="stl_ascii")
    # One mesh placed three times, turned, scaled and nested: only the nodes say where.
    scene = trimesh.Scene()
    part = trimesh.creation.box(extents=[1, 0.5, 0.25])
    turn = trimesh.transformations.rotation_matrix(0.8, [1, 2, 3], [0.1, 0.2, 0.3])
    grow = trimesh.transformations.scale_matrix(1.7)
    shift = trimesh.transformations.translation_matrix([3, -1, 2])
    scene.add_geometry(part, geom_name="part", node_name="first", transform=turn)
    scene.add_geometry(part, geom_name="part", node_name="second", parent_node_name="first", transform=shift)
    scene.add_geometry(part, geom_name="part", node_name="third", parent_node_name="second", transform=grow @ turn)
    scene.export(folder / "nested.glb")
    nested = folder / "nested_gltf"
    nested.mkdir(exist_ok=True)
    for name, data in trimesh.exchange.gltf.export_gltf(scene).items():
        (nested / name).write_bytes(data if isinstance(data, bytes) else data.encode())


def write_by_meshlab(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for name in ["create_dodecahedron", "create_cone", "create_sphere"]:
        meshes = pymeshlab.MeshSet()
        getattr(meshes, name)()
        stem = name.removeprefix("create_")
        meshes.save_current_mesh(str(folder / f"{stem}.obj"), save_vertex_color=True, save_vertex_normal=True)
        meshes.save_current_mesh(str(folder / f"{stem}_binary.ply"), binary=True, save_vertex_quality=True)
        meshes.save_current_mesh(str(folder / f"{stem}_ascii.ply"), binary=False)
        meshes.save_current_mesh(str(folder / f"{stem}_binary.stl"), binary=True)
        meshes.save_current_mesh(str(folder / f"{stem}_ascii.stl"), binary=False)
    # Polygons of four and six corners, each in a plane and convex: however they are cut, the area is one.
    turns = np.arange(6) * np.pi / 3
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    corners = np.vstack([np.column_stack([ring, np.zeros(6)]), np.column_stack([ring, np.full(6, 1.5)])])
    sides = [[i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i] for i in range(6)]
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(corners, face_list_of_indices=[[5, 4, 3, 2, 1, 0], [6, 7, 8, 9, 10, 11], *sides]))
    meshes.save_current_mesh(str(folder / "prism_polygons.obj"), save_polygonal=True)


def figures(corners):
    """Of an array of triangles x corners x axes."""
    corners = np.asarray(corners, dtype=float).reshape(-1, 3, 3)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    _, point = np.unique(corners.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    key = np.sort(point.reshape(-1, 3), axis=1)
    proper = (key[:, 0] != key[:, 1]) & (key[:, 1] != key[:, 2])
    _, first = np.unique(key, axis=0, return_index=True)
    kept = ~proper
    kept[first] = True
    return {
        "triangles": len(corners),
        "copies": int(len(corners) - kept.sum()),
        "area": float(areas[kept].sum()),
        "low": corners.min(axis=(0, 1)).tolist(),
        "high": corners.max(axis=(0, 1)).tolist(),
    }


def area_left_to_cuts(path):
    """Area of an OBJ file's polygons that depends on how they are cut: over the fans from each of their corners."""
    if path.suffix.lower() != ".obj":
        return 0.0
    lines = [line.split() for line in path.read_text(errors="replace").splitlines()]
    points = np.array([[float(word) for word in words[1:4]] for words in lines if words[:1] == ["v"]])
    left = 0.0
    for words in lines:
        if words[:1] != ["f"] or len(words) < 5:
            continue
        indices = [int(word.split("/")[0]) for word in words[1:]]
        polygon = points[[index - 1 if index > 0 else index for index in indices]]
        fans = []
        for _ in polygon:
            polygon = np.roll(polygon, 1, axis=0)
            to = polygon[1:] - polygon[0]
            fans.append(np.linalg.norm(np.cross(to[:-1], to[1:]), axis=1).sum() / 2)
        left += max(fans) - min(fans)
    return left


def by_trimesh(path):
    return figures(trimesh.load_scene(str(path), process=False).to_mesh().triangles)


def by_meshlab(path):
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    # Places as the nodes of a glTF file have them.
    return figures(np.concatenate([mesh.transformed_vertex_matrix()[mesh.face_matrix()] for mesh in meshes]))


READERS = {"trimesh": by_trimesh, "PyMeshLab": by_meshlab}


def main():
    folder = Path(sys.argv[1])
    write_by_trimesh(folder / "meshes" / "trimesh")
    write_by_meshlab(folder / "meshes" / "pymeshlab")
    files = []
    for base in [folder / "meshes", *map(Path, sys.argv[2:])]:
        for path in sorted(base.rglob("*")):
            if path.suffix.lower() not in ENDINGS:
                continue
            said = {}
            for name, read in READERS.items():
                try:
                    said[name] = read(path)
                except Exception as error:
                    said[name] = {"error": f"{type(error).__name__}: {error}"[:200]}
            name, left = str(path.relative_to(base)), area_left_to_cuts(path)
            files.append({"path": str(path.absolute()), "name": name, "area_left_to_cuts": left, "said": said})
    tools = [f"{name} {version(package)}" for name, package in [("trimesh", "trimesh"), ("PyMeshLab", "pymeshlab")]]
    (folder / "meshes.json").write_text(json.dumps({"tools": tools, "files": files}))


if __name__ == "__main__":
    main()
