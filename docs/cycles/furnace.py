"""What Cycles gives back of a white light from all around, off a ball of white brushed metal: 1 would be all of it.

    $BPY_PYTHON docs/cycles/furnace.py

BPY_PYTHON is as for pairs.py. Prints the mean over the ball for some roughnesses and anisotropies.
"""

import os
import tempfile

import bpy
import numpy as np

SIZE = 64


def share(roughness, anisotropy):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64, radius=1.0)
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("metal")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    inputs = nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (1, 1, 1, 1)
    inputs["Metallic"].default_value = 1.0
    inputs["Roughness"].default_value = roughness
    inputs["Anisotropic"].default_value = anisotropy
    tangent = nodes.new("ShaderNodeTangent")
    tangent.direction_type, tangent.axis = "RADIAL", "Z"
    material.node_tree.links.new(tangent.outputs[0], inputs["Tangent"])
    ball.data.materials.append(material)
    world = bpy.data.worlds.new("white")
    scene.world = world
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (1, 1, 1, 1)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", 1.2
    place = bpy.data.objects.new("camera", camera)
    place.location, place.rotation_euler = (0, -5, 0), (np.pi / 2, 0, 0)
    scene.collection.objects.link(place)
    scene.camera = place
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = 256, False, False
    scene.cycles.sample_clamp_indirect = 0.0
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = os.path.join(tempfile.mkdtemp(), "ball.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.empty(SIZE * SIZE * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(SIZE, SIZE, image.channels)[..., 1].mean()


for roughness in (0.2, 0.5, 0.8):
    print(f"roughness {roughness}:", ", ".join(f"{share(roughness, a):.3f} at anisotropy {a}" for a in (0.0, 0.5, 1.0)))
