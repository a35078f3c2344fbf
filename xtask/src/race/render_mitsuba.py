"""Renders a scene of the race by Mitsuba 3, in the variant that is named."""

import time

import mitsuba as mi
import numpy as np

from worker import SCENE, THREADS, VARIANT, path, serve

mi.set_variant(VARIANT)
mi.set_log_level(mi.LogLevel.Error)
import drjit as dr
from mitsuba import ScalarTransform4f as To

dr.set_thread_count(THREADS)


def rgb(value):
    return {"type": "rgb", "value": value}


def material(m):
    if m["kind"] == "glass":
        return {"type": "dielectric", "int_ior": m["eta"], "ext_ior": 1.0}
    if m["kind"] == "diffuse":
        bsdf = {"type": "diffuse", "reflectance": rgb(m["reflectance"])}
    elif m["kind"] == "metal":
        # An index of 1 and this absorption reflect so much at normal incidence, as pbrt's conductor does.
        k = [2 * (r / (1 - r)) ** 0.5 for r in m["reflectance"]]
        bsdf = {"type": "roughconductor", "distribution": "ggx", "alpha": m["alpha"], "eta": rgb([1, 1, 1]), "k": rgb(k)}
    elif m["kind"] == "coated":
        bsdf = {
            "type": "roughplastic",
            "distribution": "ggx",
            "alpha": m["alpha"],
            "int_ior": m["eta"],
            "ext_ior": 1.0,
            "nonlinear": True,
            "diffuse_reflectance": rgb(m["reflectance"]),
        }
    elif m["kind"] == "principled":
        # Of the index of refraction 1.5, as glTF has it; its roughness is the root of alpha, too.
        bsdf = {
            "type": "principled",
            "base_color": rgb(m["base"]),
            "metallic": m["metallic"],
            "roughness": m["roughness"],
            "eta": 1.5,
        }
    return {"type": "twosided", "bsdf": bsdf}


def medium(volume):
    nx, ny, nz = volume["cells"]
    density = np.fromfile(path(volume["density"]), dtype="<f4").reshape(nz, ny, nx, 1)
    low, high = np.array(volume["low"]), np.array(volume["high"])
    box = To().translate(low.tolist()).scale((high - low).tolist())
    grid = {"type": "gridvolume", "grid": mi.VolumeGrid(density), "to_world": box, "raw": True}
    return {
        "type": "heterogeneous",
        "sigma_t": grid,
        "scale": volume["extinction"],
        "albedo": {"type": "constvolume", "value": rgb(volume["albedo"])},
        "phase": {"type": "hg", "g": volume["g"]},
    }


def describe():
    volume = SCENE["volume"]
    kind = "volpath" if volume else "path"
    scene = {"type": "scene", "integrator": {"type": kind, "max_depth": SCENE["bounces"] + 1}}
    if volume:
        scene["volume"] = {
            "type": "ply",
            "filename": path(volume["hull"]),
            "face_normals": True,
            "bsdf": {"type": "null"},
            "interior": medium(volume),
        }
    hair = SCENE["hair"]
    if hair:
        scene["hair"] = {
            "type": "bsplinecurve",
            "filename": path(hair["strands"]),
            "bsdf": {
                "type": "hair",
                "sigma_a": rgb(hair["sigma_a"]),
                "longitudinal_roughness": hair["beta"][0],
                "azimuthal_roughness": hair["beta"][1],
                "scale_tilt": hair["alpha"],
                "int_ior": hair["eta"],
                "ext_ior": 1.0,
            },
        }
    for i, m in enumerate(SCENE["materials"]):
        scene[f"material{i}"] = material(m)
    for i, o in enumerate(SCENE["objects"]):
        shape = {
            "type": "ply",
            "filename": path(o["ply"]),
            "face_normals": not o["smooth"],
            "bsdf": {"type": "ref", "id": f"material{o['material']}"},
        }
        if o["emission"]:
            shape["emitter"] = {"type": "area", "radiance": rgb(o["emission"])}
        scene[f"object{i}"] = shape
    if SCENE["sky"]:
        # The middle of the picture lies towards +z: half a turn.
        scene["sky"] = {"type": "envmap", "filename": path(SCENE["sky"]), "to_world": To().rotate([0, 1, 0], 180)}
    return scene


def sensor(sampler, spp):
    camera, size = SCENE["camera"], SCENE["size"]
    return mi.load_dict(
        {
            "type": "perspective",
            "fov": camera["fov"],
            "to_world": To().look_at(origin=camera["eye"], target=camera["target"], up=[0, 1, 0]),
            "sampler": {"type": sampler, "sample_count": spp},
            "film": {
                "type": "hdrfilm",
                "width": size,
                "height": size,
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
        }
    )


scene = mi.load_dict(describe())
# Wavefronts of more samples a pixel may not fit the memory.
AT_MOST = 256
warm = set()


def render(spp, seed, sampler):
    parts = -(-spp // AT_MOST)
    view = sensor(sampler, spp // parts)
    # Some samplers take the next number that suits them.
    each = view.sampler().sample_count()

    def part(number):
        start = time.perf_counter()
        pixels = np.array(mi.render(scene, sensor=view, spp=each, seed=number))
        return pixels, time.perf_counter() - start

    if (sampler, parts) not in warm and VARIANT.startswith("llvm"):
        # Compiles the kernel, which is kept.
        part(seed + 7919)
        warm.add((sampler, parts))
    total, seconds = 0.0, 0.0
    for k in range(parts):
        pixels, time_taken = part(1000 * seed + k)
        total, seconds = total + pixels, seconds + time_taken
    return total / parts, parts * each, seconds


serve(f"Mitsuba {mi.__version__}", render)
