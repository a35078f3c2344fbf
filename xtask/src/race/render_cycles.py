"""Renders a scene of the race by Blender's Cycles."""

import math
import time

import bpy
import numpy as np
from mathutils import Matrix, Vector

from worker import SCENE, THREADS, base_below_coat, path, read_ply, serve

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
cycles = scene.cycles
cycles.device = "CPU"
cycles.use_adaptive_sampling = False
cycles.use_denoising = False
cycles.use_light_tree = True
cycles.max_bounces = SCENE["bounces"]
cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = SCENE["bounces"]
# Nothing that darkens or blurs what is hard to find.
cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
cycles.blur_glossy = 0
cycles.light_sampling_threshold = 0
cycles.caustics_reflective = cycles.caustics_refractive = True
cycles.pixel_filter_type = "BOX"
scene.render.use_persistent_data = True
scene.render.threads_mode = "FIXED"
scene.render.threads = THREADS
scene.render.resolution_x = scene.render.resolution_y = SCENE["size"]
scene.render.resolution_percentage = 100
scene.view_settings.view_transform = "Raw"
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"


def four(colour):
    return (*colour, 1)


def material(m, emission):
    made = bpy.data.materials.new("m")
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    if emission:
        node = tree.nodes.new("ShaderNodeEmission")
        strength = max(emission)
        node.inputs["Color"].default_value = four([e / strength for e in emission])
        # Only the outer side shines.
        side = tree.nodes.new("ShaderNodeNewGeometry")
        factor = tree.nodes.new("ShaderNodeMath")
        factor.operation = "MULTIPLY_ADD"
        factor.inputs[1].default_value = -strength
        factor.inputs[2].default_value = strength
        tree.links.new(side.outputs["Backfacing"], factor.inputs[0])
        tree.links.new(factor.outputs[0], node.inputs["Strength"])
        made.cycles.emission_sampling = "FRONT"
    elif m["kind"] == "diffuse":
        node = tree.nodes.new("ShaderNodeBsdfDiffuse")
        node.inputs["Color"].default_value = four(m["reflectance"])
    elif m["kind"] == "metal":
        node = tree.nodes.new("ShaderNodeBsdfMetallic")
        node.fresnel_type = "PHYSICAL_CONDUCTOR"
        node.distribution = "GGX"
        node.inputs["IOR"].default_value = (1, 1, 1)
        node.inputs["Extinction"].default_value = [2 * (r / (1 - r)) ** 0.5 for r in m["reflectance"]]
        node.inputs["Roughness"].default_value = math.sqrt(m["alpha"])
    elif m["kind"] == "coated":
        node = tree.nodes.new("ShaderNodeBsdfPrincipled")
        node.distribution = "GGX"
        node.inputs["Base Color"].default_value = four(base_below_coat(m))
        node.inputs["IOR"].default_value = m["eta"]
        node.inputs["Roughness"].default_value = math.sqrt(m["alpha"])
    elif m["kind"] == "glass":
        node = tree.nodes.new("ShaderNodeBsdfGlass")
        node.distribution = "GGX"
        node.inputs["IOR"].default_value = m["eta"]
        node.inputs["Roughness"].default_value = 0
    tree.links.new(node.outputs[0], output.inputs[0])
    return made


def add(item):
    points, faces = read_ply(item["ply"])
    mesh = bpy.data.meshes.new("mesh")
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.ravel())
    mesh.loops.add(3 * len(faces))
    mesh.loops.foreach_set("vertex_index", faces.ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.shade_flat()
    mesh.materials.append(material(SCENE["materials"][item["material"]], item["emission"]))
    scene.collection.objects.link(bpy.data.objects.new("object", mesh))


for item in SCENE["objects"]:
    add(item)

world = bpy.data.worlds.new("world")
world.use_nodes = True
scene.world = world
background = world.node_tree.nodes["Background"]
background.inputs["Color"].default_value = (0, 0, 0, 1)
if SCENE["sky"]:
    tree = world.node_tree
    place = tree.nodes.new("ShaderNodeTexCoord")
    turn = tree.nodes.new("ShaderNodeMapping")
    # From y up to z up, and from -z in the middle of the picture to +x.
    turn.inputs["Rotation"].default_value = (math.radians(90), 0, math.radians(-90))
    sky = tree.nodes.new("ShaderNodeTexEnvironment")
    sky.image = bpy.data.images.load(path(SCENE["sky"]))
    tree.links.new(place.outputs["Generated"], turn.inputs["Vector"])
    tree.links.new(turn.outputs[0], sky.inputs["Vector"])
    tree.links.new(sky.outputs["Color"], background.inputs["Color"])
    world.cycles.sampling_method = "AUTOMATIC"

eye, target = Vector(SCENE["camera"]["eye"]), Vector(SCENE["camera"]["target"])
lens = bpy.data.cameras.new("camera")
lens.angle = math.radians(SCENE["camera"]["fov"])
lens.clip_start, lens.clip_end = 0.001, 10000
camera = bpy.data.objects.new("camera", lens)
back = (eye - target).normalized()
right = Vector((0, 1, 0)).cross(back).normalized()
up = back.cross(right)
camera.matrix_world = Matrix((right, up, back)).transposed().to_4x4()
camera.matrix_world.translation = eye
scene.collection.objects.link(camera)
scene.camera = camera


def whole(spp, seed):
    """A render with everything around it."""
    cycles.samples = spp
    cycles.seed = seed
    scene.render.filepath = path("cycles.exr")
    start = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    return time.perf_counter() - start


whole(1, 0)
# What comes before and after the samples is in this.
one = min(whole(1, seed) for seed in (1, 2, 3))


def render(spp, seed, _way):
    seconds = max(whole(spp, seed + 10) - one, 0) * spp / max(spp - 1, 1)
    picture = bpy.data.images.load(path("cycles.exr"))
    picture.colorspace_settings.name = "Non-Color"
    pixels = np.empty(SCENE["size"] ** 2 * 4, np.float32)
    picture.pixels.foreach_get(pixels)
    bpy.data.images.remove(picture)
    return pixels.reshape(SCENE["size"], SCENE["size"], 4)[::-1, :, :3], spp, seconds


serve(f"Cycles of Blender {bpy.app.version_string}", render)
