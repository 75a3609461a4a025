"""Renders exported Mitsuba scenes from the run's cameras: in_mitsuba.py JOB.json"""
import json
import os
import sys

import mitsuba as mi
import numpy as np

from pictures import write_pictures

mi.set_variant("llvm_ad_rgb")


def sensor_of(view, samples):
    intrinsics, camera_from_world = np.array(view["K"]), np.array(view["w2c"])
    # Mitsuba's camera: x left, y up, z forward.
    to_world = np.linalg.inv(camera_from_world) @ np.diag([-1.0, -1.0, 1.0, 1.0])
    width, height = view["width"], view["height"]
    fov = 2 * np.degrees(np.arctan(0.5 * width / intrinsics[0, 0]))
    return mi.load_dict({
        "type": "perspective", "fov": fov, "fov_axis": "x", "near_clip": 1e-3, "far_clip": 1e5,
        "to_world": mi.ScalarTransform4f(to_world),
        "principal_point_offset_x": (intrinsics[0, 2] - 0.5 * width) / width,
        "principal_point_offset_y": (intrinsics[1, 2] - 0.5 * height) / height,
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"},
                 "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": "independent", "sample_count": samples},
    })


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        job = json.load(file)
    integrator = mi.load_dict({"type": "path", "max_depth": job["depth"], "rr_depth": 1000, "hide_emitters": True})
    for task in job["tasks"]:
        folder = os.path.dirname(task["scene"])
        if folder not in sys.path:
            sys.path.insert(0, folder)
            import patina_lobe  # noqa: F401
        scene = mi.load_file(task["scene"])
        for view in job["views"]:
            sensor = sensor_of(view, task["samples"])
            pictures = [np.array(mi.render(scene, sensor=sensor, integrator=integrator, spp=task["samples"], seed=seed))
                        for seed in range(task["repeats"])]
            write_pictures(task["out"], view["name"], pictures)


main()
