"""Builds mesh, material and world of a Patina export in Blender 4.2 to 5.

    blender --python import_patina.py

The script adds to the open scene; it reads the files that lie beside it. Without Blender's own start-up scene:
    blender --factory-startup --python import_patina.py -- --empty

The material is a Diffuse BSDF plus a Principled BSDF that holds the lobe alone: the fitted model itself, but for the lobe's
shape. With `-- --one-shader` it is one Principled BSDF, for exporters and bakers that know no other. That one takes from
diffuse light what its lobe reflects, most at grazing angles, which no map makes up for.
"""
import json
import os
import sys

import bpy

FOLDER = os.path.dirname(os.path.abspath(__file__))


def path(name):
    return os.path.join(FOLDER, name)


def image(name):
    """A map that holds linear values."""
    loaded = bpy.data.images.load(path(name), check_existing=True)
    loaded.colorspace_settings.name = "Linear Rec.709"
    return loaded


def input_named(node, *names):
    """The first input of a node that has one of these names: some changed between versions."""
    for name in names:
        if name in node.inputs:
            return node.inputs[name]
    raise KeyError(f"{node.bl_idname} has none of the inputs {names}")


def material(facts):
    made = bpy.data.materials.new(facts["name"])
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = next(node for node in nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    # Light that bounces between microfacets is no part of the model that was fitted.
    shader.distribution = "GGX"
    shader.inputs["Metallic"].default_value = 0.0

    def texture(name, row, is_data=False):
        node = nodes.new("ShaderNodeTexImage")
        node.image = image(name)
        if is_data:
            node.image.colorspace_settings.name = "Non-Color"
        node.extension = "EXTEND"
        node.location = (-420, 300 - 290 * row)
        return node.outputs["Color"]

    level = input_named(shader, "Specular IOR Level", "Specular")
    if not facts["has_lobe"]:
        level.default_value = 0.0
        links.new(texture("diffuse.exr", 0), shader.inputs["Base Color"])
        return made
    links.new(texture("roughness.exr", 1, is_data=True), shader.inputs["Roughness"])
    if "--one-shader" in sys.argv:
        shader.inputs["IOR"].default_value = facts["ior"]
        level.default_value = 0.5
        links.new(texture("base_color.exr", 0), shader.inputs["Base Color"])
        links.new(texture("specular_tint.exr", 2), input_named(shader, "Specular Tint"))
        if facts["has_metals"]:
            links.new(texture("metallic.exr", 3, is_data=True), shader.inputs["Metallic"])
        return made
    # As a metal the shader is Schlick's rise from the F0 of its base colour, and nothing beneath: the lobe alone.
    shader.inputs["Metallic"].default_value = 1.0
    tint = input_named(shader, "Specular Tint")
    # What tints the rise towards grazing angles; a number up to Blender 3.
    tint.default_value = (1.0, 1.0, 1.0, 1.0) if hasattr(tint.default_value, "__len__") else 0.0
    links.new(texture("specular.exr", 2), shader.inputs["Base Color"])
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    links.new(texture("diffuse.exr", 0), diffuse.inputs["Color"])
    both = nodes.new("ShaderNodeAddShader")
    links.new(diffuse.outputs[0], both.inputs[0])
    links.new(shader.outputs[0], both.inputs[1])
    output = next(node for node in nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    for node, place in [(diffuse, (10, 480)), (both, (320, 300)), (output, (520, 300))]:
        node.location = place
    links.new(both.outputs[0], output.inputs["Surface"])
    return made


def surface(facts):
    before = set(bpy.data.objects)
    bpy.ops.wm.obj_import(filepath=path("mesh.obj"), forward_axis="NEGATIVE_Z", up_axis="Y")
    made = next(iter(set(bpy.data.objects) - before))
    made.name = facts["name"]
    made.data.materials.clear()
    made.data.materials.append(material(facts))
    return made


def world(facts):
    if not facts["has_environment"]:
        return
    made = bpy.data.worlds.new(facts["name"])
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    background = next(node for node in nodes if node.bl_idname == "ShaderNodeBackground")
    # The map is stored with +x in its centre, which is where Blender looks for it.
    node = nodes.new("ShaderNodeTexEnvironment")
    node.image = image("environment.exr")
    node.location = (-320, 300)
    links.new(node.outputs["Color"], background.inputs["Color"])
    bpy.context.scene.world = made


def main():
    with open(path("material.json"), encoding="utf-8") as file:
        facts = json.load(file)
    if "--empty" in sys.argv:
        for thing in list(bpy.data.objects):
            bpy.data.objects.remove(thing)
    made = surface(facts)
    world(facts)
    # What the maps hold is shown as it is, without a film look.
    bpy.context.scene.view_settings.view_transform = "Standard"
    return made


main()
