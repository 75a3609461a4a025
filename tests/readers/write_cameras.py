"""Writes a COLMAP model of every lens that pycolmap knows, as text and as binary, and where pycolmap projects points.

    python tests/readers/write_cameras.py FOLDER COUNT

FOLDER/cameras/MODEL_text and MODEL_binary are scenes of one photo; FOLDER/cameras.json holds the answers. The photo says
where it was taken: red and green of a pixel are x and y of its centre, over 1024, so that an undistorted photo tells where
each of its pixels came from.
"""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pycolmap
from colmap_projections import CENTRE, FOCAL, HEIGHT, MODELS, WIDTH

SCALE = 1024.0
# Models that no photo of one pinhole can be made of: they must be refused by name.
REFUSED = {"EQUIRECTANGULAR": [1200.0, 900.0]}
# Nearer to the border than this a place counts as neither inside nor outside.
MARGIN = 1.0


def write_photo(path):
    """A PFM, which starts with the lowest row."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    picture = np.stack([(columns + 0.5) / SCALE, (rows + 0.5) / SCALE, np.zeros_like(rows)], axis=-1)
    with path.open("wb") as file:
        file.write(f"PF\n{WIDTH} {HEIGHT}\n-1.0\n".encode())
        file.write(np.ascontiguousarray(picture[::-1].astype("<f4")).tobytes())


def write_mesh(path):
    corners = "-1 -1 6\n1 -1 6\n0 1 6\n"
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    path.write_text(header + f"element face 1\nproperty list uchar int vertex_indices\nend_header\n{corners}3 0 2 1\n")


def write_scene(folder, camera, pose, photo, is_binary):
    model, images = folder / "sparse" / "0", folder / "images"
    model.mkdir(parents=True, exist_ok=True)
    images.mkdir(exist_ok=True)
    if not (images / "photo.pfm").exists():
        os.link(photo, images / "photo.pfm")
    write_mesh(folder / "mesh.ply")
    reconstruction = pycolmap.Reconstruction()
    reconstruction.add_camera_with_trivial_rig(camera)
    image = pycolmap.Image(name="photo.pfm", camera_id=camera.camera_id, image_id=1)
    reconstruction.add_image_with_trivial_frame(image, pose)
    (reconstruction.write_binary if is_binary else reconstruction.write_text)(str(model))


def on_photo(camera, rays):
    return np.array(camera.img_from_cam(rays), dtype=float).reshape(-1, 2)


def rays_of(camera, places):
    plane = np.array(camera.cam_from_img(places), dtype=float).reshape(len(places), -1)
    rays = plane if plane.shape[1] == 3 else np.hstack([plane, np.ones((len(plane), 1))])
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def answers(camera, pinhole, pose, count, random):
    # Places all over the photo, their points at any depth; those that pycolmap's own inverse does not find are not asked.
    places = random.uniform([MARGIN, MARGIN], [WIDTH - MARGIN, HEIGHT - MARGIN], size=(3 * count, 2))
    rays = rays_of(camera, places)
    found = (np.linalg.norm(on_photo(camera, rays) - places, axis=1) < 1e-4) & (rays[:, 2] > 0.05)
    rays = rays[found][:count] * random.uniform(0.5, 9.0, size=(len(rays[found][:count]), 1))
    world_from_camera = pose.inverse()
    world = np.array([world_from_camera * ray for ray in rays])
    seen = np.array([pose * point for point in world])
    points = np.hstack([world, on_photo(camera, seen), on_photo(pinhole, seen)])

    # Pixels of the pinhole's picture that the photo holds: where they come from.
    pixels = np.stack([random.integers(0, WIDTH, size=8 * count), random.integers(0, HEIGHT, size=8 * count)], axis=-1)
    rays = rays_of(pinhole, pixels + 0.5)
    places = on_photo(camera, rays)
    inside = np.all((places > MARGIN) & (places < [WIDTH - MARGIN, HEIGHT - MARGIN]), axis=1)
    pixels, rays, places = pixels[inside], rays[inside], places[inside]
    found = np.linalg.norm(rays_of(camera, places) - rays, axis=1) < 1e-6
    pixels, places = pixels[found][:count], places[found][:count]
    return points.tolist(), np.hstack([pixels, places]).tolist()


def main():
    folder, count = Path(sys.argv[1]), int(sys.argv[2])
    random = np.random.default_rng(1)
    (folder / "cameras").mkdir(parents=True, exist_ok=True)
    photo = folder / "cameras" / "photo.pfm"
    write_photo(photo)
    axis = np.array([0.2, -0.9, 0.4]) / np.linalg.norm([0.2, -0.9, 0.4])
    pose = pycolmap.Rigid3d(pycolmap.Rotation3d(0.7 * axis), np.array([0.3, -0.2, 0.9]))
    known = [name for name in pycolmap.CameraModelId.__members__ if name != "INVALID"]
    written = []
    for model in known:
        focal_count, rest = MODELS.get(model, (0, []))
        params = FOCAL[:focal_count] + CENTRE + rest if model in MODELS else REFUSED.get(model)
        if params is None:
            written.append({"model": model, "untried": True})
            continue
        camera = pycolmap.Camera(camera_id=1, model=model, width=WIDTH, height=HEIGHT, params=params)
        pinhole = pycolmap.Camera(
            model="PINHOLE", width=WIDTH, height=HEIGHT, params=[FOCAL[0], FOCAL[focal_count - 1], *CENTRE]
        )
        for kind in ["text", "binary"]:
            write_scene(folder / "cameras" / f"{model}_{kind}", camera, pose, photo, kind == "binary")
        if model in REFUSED:
            written.append({"model": model, "refused": True})
            continue
        points, pixels = answers(camera, pinhole, pose, count, random)
        written.append({"model": model, "points": points, "pixels": pixels})
    missing = [model for model in [*MODELS, *REFUSED] if model not in known]
    (folder / "cameras.json").write_text(
        json.dumps({"version": pycolmap.__version__, "scale": SCALE, "missing": missing, "models": written})
    )


if __name__ == "__main__":
    main()
