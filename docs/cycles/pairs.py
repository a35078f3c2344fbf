"""Renders glTF assets by Lumbre and by Blender Cycles 5, and compares the pictures.

    $BPY_PYTHON docs/cycles/pairs.py LUMBRE ASSETS OUT [--spp N] [--size N] [NAME …]

BPY_PYTHON is a Python 3.11 with `pip install bpy==5.0.1` (which brings numpy); LUMBRE is the program, ASSETS a folder of the Khronos sample
assets (NAME/glTF-Binary/NAME.glb or NAME/glTF/NAME.gltf), OUT a folder for what is made. Each asset is copied there with a camera (its own
where it has one) and a sun; both programs read the same copy, under the same sky. OUT gets a pair of pictures for each asset,
Lumbre's on the left, and figures.md: the means over the pixels of the model and how far they are apart.
"""

import argparse
import json
import math
import os
import shutil
import struct
import subprocess
import sys
import zlib

import bpy
import numpy as np

# Those that are looked at from the front, being walls of samples.
WALLS = {
    "AnisotropyStrengthTest", "AttenuationTest", "ClearCoatTest", "MetalRoughSpheresNoTextures", "NegativeScaleTest", "SpecularTest",
    "TransmissionRoughnessTest", "VertexColorTest", "EmissiveStrengthTest", "TextureSettingsTest",
}
NAMES = [
    "Box", "BoxVertexColors", "RiggedSimple", "MetalRoughSpheresNoTextures", "AnisotropyStrengthTest", "SpecularTest", "ClearCoatTest",
    "AttenuationTest", "TransmissionRoughnessTest", "Suzanne", "Fox", "EmissiveStrengthTest", "VertexColorTest", "NegativeScaleTest",
]
SUN = 1.5
BOUNCES = 16


def source(assets, name):
    for place in (f"{name}/glTF-Binary/{name}.glb", f"{name}/glTF/{name}.gltf", f"{name}/glTF-Embedded/{name}.gltf"):
        if os.path.exists(os.path.join(assets, place)):
            return os.path.join(assets, place)
    raise SystemExit(f"no asset {name} in {assets}")


def parts(path):
    """The JSON of a glTF, and the binary chunk of a GLB."""
    data = open(path, "rb").read()
    if data[:4] != b"glTF":
        return json.loads(data), None
    length = struct.unpack("<I", data[12:16])[0]
    rest = data[20 + length:]
    return json.loads(data[20:20 + length]), rest[8:8 + struct.unpack("<I", rest[:4])[0]] if rest else None


def write_glb(path, document, binary):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary is not None:
        binary += b"\0" * (-len(binary) % 4)
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    open(path, "wb").write(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def looking(forward):
    """The rotation (x, y, z, w) of a node whose -z looks along `forward`, with y up."""
    z = -np.array(forward, float) / np.linalg.norm(forward)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    m = np.column_stack([x, np.cross(z, x), z])
    w = 0.5 * math.sqrt(max(0.0, 1.0 + m[0, 0] + m[1, 1] + m[2, 2]))
    return [(m[2, 1] - m[1, 2]) / (4 * w), (m[0, 2] - m[2, 0]) / (4 * w), (m[1, 0] - m[0, 1]) / (4 * w), w]


def read_into_blender(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)
    # Animations stand still in both.
    for thing in list(bpy.data.objects) + [k for k in bpy.data.shape_keys]:
        thing.animation_data_clear()


def corners():
    """Every vertex as the scene has it, in glTF's axes."""
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for instance in graph.object_instances:
        if instance.object.type == "MESH":
            matrix = np.array(instance.matrix_world)
            mesh = instance.object.data
            points = np.empty(3 * len(mesh.vertices))
            mesh.vertices.foreach_get("co", points)
            points = points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
            found.append(points[:, [0, 2, 1]] * [1, 1, -1])
    return np.concatenate(found)


def staged(name, path, folder):
    """A copy of an asset with a camera and a sun."""
    document, binary = parts(path)
    used = set(document.get("extensionsUsed", []))
    for node in document.get("nodes", []):
        # Its own lights would have their own sizes in Blender.
        node.get("extensions", {}).pop("KHR_lights_punctual", None)
    document.get("extensions", {}).pop("KHR_lights_punctual", None)
    document.pop("animations", None)
    # glTF's default material is a rough metal; Blender has another for meshes without any.
    bare = [p for mesh in document.get("meshes", []) for p in mesh["primitives"] if "material" not in p]
    if bare:
        materials = document.setdefault("materials", [])
        for primitive in bare:
            primitive["material"] = len(materials)
        materials.append({"pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": 1.0}})
    # Cycles shows backs whatever the file says.
    for material in document.get("materials", []):
        material["doubleSided"] = True
    nodes = document.setdefault("nodes", [])
    scene = document.setdefault("scenes", [{"nodes": [0]}])[document.get("scene", 0)]
    read_into_blender(path)
    points = corners()
    low, high = points.min(0), points.max(0)
    middle = 0.5 * (low + high)
    forward = -np.array((0.12, 0.10, 1.0) if name in WALLS else (0.58, 0.42, 1.0))
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    arm = points - middle
    slope = 0.93 * math.tan(math.radians(18.0))
    distance = max(np.max(np.abs(arm @ side) / slope - arm @ forward) for side in (right, up))
    document.setdefault("cameras", []).append(
        {"type": "perspective", "perspective": {"yfov": math.radians(36.0), "aspectRatio": 1.0, "znear": distance / 1000}}
    )
    place = middle - distance * forward
    scene["nodes"].append(len(nodes))
    nodes.append({
        "camera": len(document["cameras"]) - 1, "name": "the camera", "translation": list(place), "rotation": looking(forward),
    })
    document.setdefault("extensions", {})["KHR_lights_punctual"] = {"lights": [{"type": "directional", "intensity": SUN}]}
    scene["nodes"].append(len(nodes))
    nodes.append({"extensions": {"KHR_lights_punctual": {"light": 0}}, "rotation": looking((0.5, -1.0, -0.7))})
    document["extensionsUsed"] = sorted(used | {"KHR_lights_punctual"})
    # Files beside it stay where they are: the copy brings its own.
    for kind in ("buffers", "images"):
        for entry in document.get(kind, []):
            uri = entry.get("uri")
            if uri and not uri.startswith("data:"):
                import urllib.parse
                shutil.copy(os.path.join(os.path.dirname(path), urllib.parse.unquote(uri)), folder)
    copy = os.path.join(folder, name + ".glb")
    write_glb(copy, document, binary)
    return copy


def sky(path):
    """A sky that is the same all around: from 0.25 below to 0.9 above."""
    width, height = 64, 32
    rows = []
    for y in range(height):
        t = 0.5 + 0.5 * math.cos(math.pi * (y + 0.5) / height)
        t = t * t * (3 - 2 * t)
        colour = [0.25 + t * (c - 0.25) for c in (0.78, 0.84, 0.95)]
        rows.append(np.tile(np.array(colour, np.float32), (width, 1)))
    picture = np.array(rows, np.float32)
    with open(path, "wb") as file:
        # Radiance, without runs.
        file.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width))
        most = picture.max(2)
        mantissa, exponent = np.frexp(most)
        scale = np.where(most > 0, mantissa * 256.0 / np.maximum(most, 1e-30), 0)
        rgbe = np.dstack([picture * scale[..., None], exponent + 128]).astype(np.uint8)
        file.write(rgbe.tobytes())


def read_pfm(path):
    with open(path, "rb") as file:
        assert file.readline().strip() == b"PF"
        width, height = map(int, file.readline().split())
        order = "<" if float(file.readline()) < 0 else ">"
        data = np.frombuffer(file.read(), order + "f4").reshape(height, width, 3)
    return data[::-1].astype(np.float64)


def by_lumbre(lumbre, copy, hdr, out, size, spp, *more):
    command = [lumbre, "render", copy, "-o", out, "--size", f"{size}x{size}", "--spp", str(spp), "--env", hdr, "--background", "env",
               "--ground", "none", "--camera", "the camera", "--max-depth", str(BOUNCES), *more]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    return read_pfm(out)


def by_cycles(copy, hdr, out, size, spp):
    read_into_blender(copy)
    scene = bpy.context.scene
    for thing in bpy.data.objects:
        if thing.type == "LIGHT":
            thing.data.energy, thing.data.angle = SUN, 0.0
        if thing.type == "CAMERA" and thing.name.startswith("the camera"):
            scene.camera = thing
    world = bpy.data.worlds.new("sky")
    scene.world = world
    world.use_nodes = True
    nodes = world.node_tree.nodes
    picture = nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.load(hdr)
    world.node_tree.links.new(picture.outputs[0], nodes["Background"].inputs[0])
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", spp, False, False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = BOUNCES
    cycles.transparent_max_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", 1.5
    render = scene.render
    render.resolution_x = render.resolution_y = size
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.filepath = out
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(out)
    pixels = np.empty(size * size * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(size, size, image.channels)[::-1, :, :3].astype(np.float64)


def write_png(path, linear):
    """Both pictures side by side on the sRGB curve."""
    c = np.clip(linear, 0, 1)
    c = np.where(c < 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 1e-9) ** (1 / 2.4) - 0.055)
    rows = (c * 255 + 0.5).astype(np.uint8)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", rows.shape[1], rows.shape[0], 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")
    open(path, "wb").write(b"\x89PNG\r\n\x1a\n" + body)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("lumbre")
    arguments.add_argument("assets")
    arguments.add_argument("out")
    arguments.add_argument("names", nargs="*")
    arguments.add_argument("--spp", type=int, default=128)
    arguments.add_argument("--size", type=int, default=256)
    given = arguments.parse_intermixed_args()
    out = os.path.abspath(given.out)
    os.makedirs(out, exist_ok=True)
    hdr = os.path.join(out, "sky.hdr")
    sky(hdr)
    lines = ["| asset | mean of Lumbre | mean of Cycles | difference | of red, green, blue |", "|---|---|---|---|---|"]
    for name in given.names or NAMES:
        copy = staged(name, source(given.assets, name), out)
        at = lambda file: os.path.join(out, name + file)
        ours = by_lumbre(os.path.abspath(given.lumbre), copy, hdr, at(".pfm"), given.size, given.spp)
        depth = by_lumbre(os.path.abspath(given.lumbre), copy, hdr, at(".depth.pfm"), given.size, 4, "--integrator", "depth")
        theirs = by_cycles(copy, hdr, at(".exr"), given.size, given.spp)
        mask = depth[..., 0] > 0
        a, b = ours[mask].mean(0), theirs[mask].mean(0)
        each = ", ".join(f"{100 * (x / y - 1):+.1f}" for x, y in zip(a, b))
        lines.append(f"| {name} | {a.mean():.4f} | {b.mean():.4f} | {100 * (a.mean() / b.mean() - 1):+.1f} % | {each} |")
        print(lines[-1], flush=True)
        write_png(at(".png"), np.concatenate([ours, theirs], 1))
        np.savez_compressed(at(".npz"), ours=ours, theirs=theirs, mask=mask)
    open(os.path.join(out, "figures.md"), "w").write("\n".join(lines) + "\n")


main()
