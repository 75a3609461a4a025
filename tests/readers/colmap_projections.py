"""Writes tests/readers/colmap_projections.json: where pycolmap projects points through every model it has.

    pip install pycolmap numpy
    python tests/readers/colmap_projections.py 60 > tests/readers/colmap_projections.json

The number of points a model is the first argument; the committed file holds few, a run of the lab takes 1000.
"""

import json
import sys

import numpy as np
import pycolmap

WIDTH, HEIGHT = 1200, 900
FOCAL, CENTRE = [800.0, 790.0], [605.3, 441.7]
# What follows the focal lengths and the principal point; models with one focal length are marked.
MODELS = {
    "SIMPLE_PINHOLE": (1, []),
    "PINHOLE": (2, []),
    "SIMPLE_RADIAL": (1, [0.12]),
    "RADIAL": (1, [0.12, -0.05]),
    "OPENCV": (2, [0.1, -0.04, 2e-3, -1e-3]),
    "OPENCV_FISHEYE": (2, [0.03, -0.01, 4e-3, -1e-3]),
    "FULL_OPENCV": (2, [0.4, 0.02, 2e-3, -1e-3, 1e-3, 0.45, 0.05, 2e-3]),
    "FOV": (2, [0.9]),
    "SIMPLE_RADIAL_FISHEYE": (1, [0.03]),
    "RADIAL_FISHEYE": (1, [0.03, -0.01]),
    "THIN_PRISM_FISHEYE": (2, [0.03, -0.01, 1e-3, 5e-4, 2e-3, -1e-4, 1e-3, -2e-3]),
    "RAD_TAN_THIN_PRISM_FISHEYE": (
        2,
        [0.03, -0.01, 2e-3, -1e-4, 1e-5, -1e-6, 1e-3, 5e-4, 1e-3, -1e-4, 5e-4, 2e-4],
    ),
    "SIMPLE_DIVISION": (1, [-0.2]),
    "DIVISION": (2, [-0.2]),
    "SIMPLE_FISHEYE": (1, []),
    "FISHEYE": (2, []),
    "EUCM": (2, [0.6, 1.1]),
}


def main():
    count = int(sys.argv[1])
    random = np.random.default_rng(1)
    written = []
    for model, (focal_count, rest) in MODELS.items():
        if not hasattr(pycolmap.CameraModelId, model):
            print(f"pycolmap {pycolmap.__version__} has no {model}", file=sys.stderr)
            continue
        params = FOCAL[:focal_count] + CENTRE + rest
        camera = pycolmap.Camera(model=model, width=WIDTH, height=HEIGHT, params=params)
        angles = 0.6 * np.sqrt(random.uniform(size=count))
        turns = random.uniform(0, 2 * np.pi, size=count)
        depths = random.uniform(0.5, 9.0, size=count)
        points = []
        for angle, turn, depth in zip(angles, turns, depths):
            point = depth * np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
            point = np.round(point, 9)
            place = np.asarray(camera.img_from_cam(point[None])).ravel()
            points.append([*point.tolist(), *np.round(place, 7).tolist()])
        written.append({"model": model, "params": params, "points": points})
    rows = [json.dumps(camera) for camera in written]
    print("[\n" + ",\n".join(rows) + "\n]")


if __name__ == "__main__":
    main()
