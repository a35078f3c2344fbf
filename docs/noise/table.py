"""The true error of pictures to a noise target, as docs/noise.md shows it: python3 docs/noise/table.py [--program FILE] [SCENE ...]

Each scene is rendered to the target, with and without the denoiser, and with as many samples everywhere. The reference is two pictures of many
samples with seeds of their own: what they differ by is their own error, which is taken out of that of the others. Errors are relative to the
luminance of a pixel; where the two differ too much to know that, as rare light makes them, to the mean of its neighbourhood.
"""

import argparse
import json
import math
import pathlib
import struct
import subprocess
import tempfile
import time

MATT = 'Material "diffuse" "rgb reflectance" [.6 .6 .6]\n'
ROOM = """AttributeBegin
ReverseOrientation
Shape "box" "point3 p0" [-2 -4 0] "point3 p1" [2 2 3]
AttributeEnd
"""
FLOOR = """Shape "disk" "float radius" 8
AttributeBegin
Translate 0 3 0
Rotate 90 1 0 0
Shape "disk" "float radius" 8
AttributeEnd
"""
BALL = 'AttributeBegin\nTranslate 0 0 .6\nShape "sphere" "float radius" .6\nAttributeEnd\n'


def lamp(radiance, place, radius):
    return (
        f'AttributeBegin\nAreaLightSource "diffuse" "rgb L" [{radiance} {radiance} {radiance}]\nTranslate {place}\n'
        f'Shape "sphere" "float radius" {radius}\nAttributeEnd\n'
    )


def glass(place, radius):
    return f'AttributeBegin\nMaterial "dielectric"\nTranslate {place}\nShape "sphere" "float radius" {radius}\nAttributeEnd\n'


def walls(side):
    """A room of six quads, of which the ceiling has a hole of this side."""
    quad = 'Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [{}]\n'
    low = ["-2 -4 0 2 -4 0 2 2 0 -2 2 0", "-2 2 0 2 2 0 2 2 3 -2 2 3", "-2 -4 0 -2 2 0 -2 2 3 -2 -4 3"]
    low += ["2 2 0 2 -4 0 2 -4 3 2 2 3", "2 -4 0 -2 -4 0 -2 -4 3 2 -4 3"]
    high = [f"-2 -4 3 -2 2 3 {-side} 2 3 {-side} -4 3", f"{side} -4 3 {side} 2 3 2 2 3 2 -4 3"]
    high += [f"{-side} {side} 3 {-side} 2 3 {side} 2 3 {side} {side} 3", f"{-side} -4 3 {-side} {-side} 3 {side} {-side} 3 {side} -4 3"]
    return MATT + "".join(quad.format(corners) for corners in low + high)


# Pixels across, samples of each reference, the target, and the world. Hard ones are small and have a higher target, so that they end.
SCENES = {
    "plain sphere": (64, 512, 0.05, 'LightSource "infinite" "rgb L" [1 1 1]\n' + MATT + FLOOR + BALL),
    "cornell": (64, 512, 0.05, walls(0) + 'AttributeBegin\nAreaLightSource "diffuse" "rgb L" [15 15 15]\nTranslate 0 0 2.99\nRotate 180 1 0 0\n'
        'Shape "disk" "float radius" .5\nAttributeEnd\n' + BALL),
    "lamp behind others": (64, 512, 0.05, lamp(400, "0 0 4", 0.05) + lamp(40000, "0 0 -3", 0.05) + MATT + FLOOR + BALL),
    "bright texels": (64, 512, 0.05, 'LightSource "infinite" "string filename" "sky.pfm"\n' + MATT + FLOOR + BALL),
    "wires": (64, 512, 0.05, 'LightSource "infinite" "rgb L" [.3 .3 .3]\n' + MATT + FLOOR + "".join(
        f'AttributeBegin\nAreaLightSource "diffuse" "rgb L" [60 60 60]\nTranslate {x} 0 .8\nRotate 90 0 1 0\n'
        'Shape "cylinder" "float radius" .004 "float zmin" -.3 "float zmax" .3\nAttributeEnd\n' for x in (-1, 0, 1))),
    "glossy interreflection": (64, 512, 0.05, lamp(60, "0 -1 2.5", 0.2) + 'Material "conductor" "float roughness" .05\n' + FLOOR + BALL),
    "slit": (32, 2048, 0.1, walls(0.02) + lamp(2000, "0 -1 4.5", 0.3) + BALL),
    "door ajar": (32, 2048, 0.1, walls(0.15) + 'LightSource "infinite" "rgb L" [1 1 1]\n' + BALL),
    "dark room, environment": (32, 2048, 0.1, walls(0.6) + 'LightSource "infinite" "string filename" "sky.pfm"\n' + BALL),
    "ball": (32, 16384, 0.1, lamp(200, "0 -1 2.5", 0.1) + MATT + FLOOR + glass("0 0 .6", 0.6)),
    "bulb": (16, 8192, 0.2, lamp(300, "0 0 1.6", 0.08) + glass("0 0 1.6", 0.3) + glass("0 0 1.6", 0.28) + MATT + FLOOR),
    "caustic": (16, 16384, 0.2, 'LightSource "infinite" "rgb L" [.02 .02 .02]\n' + lamp(1000, "0 -1 2.5", 0.1) + glass("0 -1 2.5", 0.24) + MATT + FLOOR),
}
HEAD = """LookAt 0 -3.8 1  0 0 .7  0 0 1
Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" {} "integer yresolution" {} "bool savefp16" false
PixelFilter "box"
Integrator "path" "integer maxdepth" 6
WorldBegin
"""


def read_pfm(path):
    data = path.read_bytes()
    kind, size, scale, rest = data.split(b"\n", 3)
    width, height = map(int, size.split())
    assert kind == b"PF" and float(scale) < 0
    numbers = struct.unpack(f"<{3 * width * height}f", rest)
    return [0.2126 * r + 0.7152 * g + 0.0722 * b for r, g, b in zip(numbers[::3], numbers[1::3], numbers[2::3])]


def mean(values):
    values = list(values)
    return sum(values) / len(values)


def known(one, two, width, floor, agree=0.1, radius=3):
    """The luminance of each pixel by two pictures; the mean of its neighbourhood where they differ too much there to know it."""
    height = len(one) // width
    result = []
    for i, (a, b) in enumerate(zip(one, two)):
        x, y = i % width, i // width
        columns = range(max(x - radius, 0), min(x + radius + 1, width))
        rows = range(max(y - radius, 0), min(y + radius + 1, height))
        near = [v * width + u for v in rows for u in columns]
        luminance = mean((one[j] + two[j]) / 2 for j in near)
        error = math.sqrt(mean((one[j] - two[j]) ** 2 for j in near)) / 2
        result.append((a + b) / 2 if error <= agree * (luminance + floor) else luminance)
    return result


def write_sky(path):
    """A dim sky with one texel that is the sun."""
    width, height = 64, 64
    texels = [0.2] * (3 * width * height)
    at = 3 * (20 * width + 25)
    texels[at : at + 3] = [4000.0] * 3
    path.write_bytes(b"PF\n64 64\n-1.0\n" + struct.pack(f"<{len(texels)}f", *texels))


def run(program, folder, name, *words):
    start = time.monotonic()
    answer = subprocess.run(
        [program, "render", "scene.pbrt", "-o", f"{name}.pfm", "--stats", f"{name}.json", "--progress", "none", *map(str, words)],
        cwd=folder, capture_output=True, text=True,
    )
    assert answer.returncode == 0, answer.stderr
    return read_pfm(folder / f"{name}.pfm"), json.loads((folder / f"{name}.json").read_text()), time.monotonic() - start


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default="lumbre")
    parser.add_argument("--most", type=float, default=600, help="seconds for a picture to the target")
    parser.add_argument("scenes", nargs="*")
    arguments = parser.parse_args()
    print("| scene | size | target | samples a pixel | said | true error | s | denoised | s | as many samples everywhere | s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for name, (width, spp, target, world) in SCENES.items():
        if arguments.scenes and name not in arguments.scenes:
            continue
        height = width * 3 // 4
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            write_sky(folder / "sky.pfm")
            (folder / "scene.pbrt").write_text(HEAD.format(width, height) + world)
            one, two = (run(arguments.program, folder, "reference", "--spp", spp, "--seed", seed)[0] for seed in (11, 12))
            reference = [(a + b) / 2 for a, b in zip(one, two)]
            floor = 0.1 * mean(reference)
            scale = [luminance + floor for luminance in known(one, two, width, floor)]
            own = mean(((a - b) / s) ** 2 for a, b, s in zip(one, two, scale)) / 4

            def error(picture):
                square = mean(((a - b) / s) ** 2 for a, b, s in zip(picture, reference, scale))
                return math.sqrt(max(square - own, 0.0))

            to_target = ("--noise", target, "--time", f"{arguments.most}s")
            picture, stats, seconds = run(arguments.program, folder, "noise", *to_target)
            denoised, _, denoised_seconds = run(arguments.program, folder, "denoised", *to_target, "--denoise")
            each = stats["rays"]["camera"] / (width * height)
            plain, _, plain_seconds = run(arguments.program, folder, "plain", "--spp", max(round(each), 1))
            said = f"{stats['noise']:.3f}" + ("" if stats["noise_target_met"] else ", not met")
            print(
                f"| {name} | {width}x{height} | {target} | {stats['spp']} to {stats['most_spp']}, mean {each:.0f} | {said} | {error(picture):.3f} | {seconds:.1f} "
                f"| {error(denoised):.3f} | {denoised_seconds:.1f} | {error(plain):.3f} | {plain_seconds:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
