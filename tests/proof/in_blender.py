"""Imports exports into Blender and renders them by Cycles from the run's cameras: in_blender.py JOB.json"""
import json
import os
import runpy
import sys

import bpy
import numpy as np
from mathutils import Matrix

from pictures import write_pictures

# Blender's world is z up: its importers turn +y there.
Z_UP = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))


def empty():
    bpy.ops.wm.read_factory_settings(use_empty=True)


def world_of(path):
    world = bpy.data.worlds.new("environment")
    world.use_nodes = True
    nodes = world.node_tree.nodes
    background = next(node for node in nodes if node.bl_idname == "ShaderNodeBackground")
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(path)
    texture.image.colorspace_settings.name = "Linear Rec.709"
    world.node_tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    bpy.context.scene.world = world


def import_glb(folder):
    name = next(name for name in os.listdir(folder) if name.endswith(".glb"))
    bpy.ops.import_scene.gltf(filepath=os.path.join(folder, name), export_import_convert_lighting_mode="RAW")
    for light in [thing for thing in bpy.data.objects if thing.type == "LIGHT"]:
        bpy.data.objects.remove(light)
    world_of(os.path.join(folder, "environment.exr"))


def import_glb_with_sun(folder):
    name = next(name for name in os.listdir(folder) if name.endswith(".glb"))
    bpy.ops.import_scene.gltf(filepath=os.path.join(folder, name), export_import_convert_lighting_mode="RAW")
    world_of(os.path.join(folder, "environment_without_sun.exr"))


def import_script(folder):
    runpy.run_path(os.path.join(folder, "import_patina.py"))


def import_usd(folder):
    # The importer turns a dome light into the world of a scene that has one, as a new file of Blender does.
    bpy.context.scene.world = bpy.data.worlds.new("world")
    name = next(name for name in os.listdir(folder) if name.endswith(".usda"))
    bpy.ops.wm.usd_import(filepath=os.path.join(folder, name), import_lights=True, create_world_material=True)


IMPORTERS = {"glb": import_glb, "glb_sun": import_glb_with_sun, "script": import_script, "usd": import_usd}


def camera_of(view):
    camera = bpy.data.cameras.new("camera")
    thing = bpy.data.objects.new("camera", camera)
    bpy.context.scene.collection.objects.link(thing)
    world_from_camera = Matrix(view["w2c"]).inverted() @ Matrix.Diagonal((1, -1, -1, 1))
    thing.matrix_world = Z_UP @ world_from_camera
    camera.sensor_fit = "HORIZONTAL"
    camera.sensor_width = 36.0
    width, height = view["width"], view["height"]
    camera.lens = view["K"][0][0] * 36.0 / width
    camera.shift_x = (0.5 * width - view["K"][0][2]) / width
    camera.shift_y = (view["K"][1][2] - 0.5 * height) / width
    camera.clip_start, camera.clip_end = 1e-3, 1e5
    bpy.context.scene.camera = thing
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = width, height


def cycles(samples, depth):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_percentage = 100
    scene.render.film_transparent = True
    settings = scene.cycles
    settings.device = "CPU"
    settings.samples = samples
    settings.use_adaptive_sampling = False
    settings.use_denoising = False
    settings.pixel_filter_type = "BOX"
    settings.blur_glossy = 0.0
    settings.sample_clamp_direct = settings.sample_clamp_indirect = 0.0
    # Depth counts as Mitsuba's: 2 is direct light.
    settings.max_bounces = settings.diffuse_bounces = settings.glossy_bounces = depth - 2
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGBA"
    scene.view_settings.view_transform = "Raw"


def rendered(path):
    bpy.context.scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1, :, :3]


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        job = json.load(file)
    for task in job["tasks"]:
        empty()
        IMPORTERS[task["kind"]](task["folder"])
        if bpy.context.scene.world is None:
            print(f'{task["out"]}: the importer made no world', flush=True)
        cycles(task["samples"], job["depth"])
        for view in job["views"]:
            camera_of(view)
            pictures = []
            for seed in range(task["repeats"]):
                bpy.context.scene.cycles.seed = seed
                pictures.append(rendered(f'{task["out"]}_{view["name"]}.exr'))
            os.remove(f'{task["out"]}_{view["name"]}.exr')
            write_pictures(task["out"], view["name"], pictures)


main()
