"""What the scripts of all programs share: the scene, meshes, pictures, and the talk with the race."""

import json
import os
import sys

import numpy

FOLDER, THREADS, VARIANT = sys.argv[1], int(sys.argv[2]), sys.argv[3]
with open(os.path.join(FOLDER, "scene.json")) as file:
    SCENE = json.load(file)


def path(name):
    return os.path.join(FOLDER, name)


def read_ply(name):
    """Points and triangles of a .ply as the race writes it."""
    with open(path(name), "rb") as file:
        counts = []
        while (line := file.readline().decode().strip()) != "end_header":
            if line.startswith("element"):
                counts.append(int(line.split()[2]))
        points = numpy.frombuffer(file.read(12 * counts[0]), "<f4").reshape(-1, 3)
        faces = numpy.frombuffer(file.read(), numpy.dtype([("n", "u1"), ("i", "<i4", 3)]), counts[1])
    return points, faces["i"]


def write_pfm(name, pixels):
    """Pixels as rows from the top."""
    height, width, _ = pixels.shape
    with open(name, "wb") as file:
        file.write(f"PF\n{width} {height}\n-1.0\n".encode())
        file.write(numpy.ascontiguousarray(pixels[::-1], "<f4").tobytes())


def base_below_coat(material):
    """What a Lambert surface must reflect to look like one below a dielectric that sends a part of the light back to it."""
    eta = material["eta"]
    # The diffuse reflectance of the boundary from inside: Egan and Hilgeman, "Optical properties of inhomogeneous materials", 1979.
    inside = -1.440 / eta**2 + 0.710 / eta + 0.668 + 0.0636 * eta
    return [r * (1 - inside) / (1 - r * inside) for r in material["reflectance"]]


def answer(value):
    print("race: " + json.dumps(value), flush=True)


def serve(version, render):
    """Answers each request, a line of JSON, until there are no more. render(spp, seed, way) -> (pixels, spp, seconds)."""
    answer({"version": version})
    for line in sys.stdin:
        request = json.loads(line)
        pixels, spp, seconds = render(request["spp"], request["seed"], request["way"])
        write_pfm(request["out"], pixels)
        answer({"spp": spp, "seconds": seconds})
