"""Renders a scene of the race by LuxCore."""

import time

import numpy as np
import pyluxcore

from worker import SCENE, THREADS, base_below_coat, path, serve

pyluxcore.Init()
scene = pyluxcore.Scene()
size = SCENE["size"]


def give(values):
    properties = pyluxcore.Properties()
    for name, value in values.items():
        properties.Set(pyluxcore.Property(name, value))
    scene.Parse(properties)


def material(name, m, emission):
    prefix = f"scene.materials.{name}."
    if m["kind"] == "diffuse":
        values = {"type": "matte", "kd": m["reflectance"]}
    elif m["kind"] == "metal":
        # Its microfacets are Schlick's, and roughness is given by the square root of alpha.
        values = {
            "type": "metal2",
            "fresnel": f"fresnel-{name}",
            "uroughness": m["alpha"],
            "vroughness": m["alpha"],
        }
        texture = f"scene.textures.fresnel-{name}."
        give({texture + "type": "fresnelcolor", texture + "kr": m["reflectance"]})
    elif m["kind"] == "coated":
        normal = ((m["eta"] - 1) / (m["eta"] + 1)) ** 2
        values = {
            "type": "glossy2",
            "kd": base_below_coat(m),
            "ks": [normal] * 3,
            "uroughness": m["alpha"],
            "vroughness": m["alpha"],
        }
    elif m["kind"] == "glass":
        values = {"type": "glass", "kr": [1.0] * 3, "kt": [1.0] * 3, "interiorior": m["eta"], "exteriorior": 1.0}
    if emission:
        values["emission"] = emission
    give({prefix + key: value for key, value in values.items()})


camera = SCENE["camera"]
give(
    {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": camera["eye"],
        "scene.camera.lookat.target": camera["target"],
        "scene.camera.up": [0.0, 1.0, 0.0],
        "scene.camera.fieldofview": camera["fov"],
        # Its rows are counted from one: the window moves down by a pixel.
        "scene.camera.screenwindow": [-1.0, 1.0, -1.0 - 2.0 / size, 1.0 - 2.0 / size],
    }
)
for i, item in enumerate(SCENE["objects"]):
    material(f"m{i}", SCENE["materials"][item["material"]], item["emission"])
    give({f"scene.shapes.s{i}.type": "mesh", f"scene.shapes.s{i}.ply": path(item["ply"])})
    give({f"scene.objects.o{i}.shape": f"s{i}", f"scene.objects.o{i}.material": f"m{i}"})


def integrator(way):
    """The settings of a way to render."""
    if way == "bidirectional":
        depth = SCENE["bounces"] + 1
        return {"renderengine.type": "BIDIRCPU", "light.maxdepth": depth, "path.maxdepth": depth}
    settings = {"renderengine.type": "PATHCPU"}
    if way == "photons":
        cache = "path.photongi."
        settings |= {
            cache + "sampler.type": "METROPOLIS",
            cache + "photon.maxcount": 20000000,
            cache + "photon.maxdepth": SCENE["bounces"] + 1,
            cache + "indirect.enabled": False,
            cache + "caustic.enabled": True,
            cache + "caustic.maxsize": 1000000,
            cache + "caustic.lookup.radius": 0.02,
        }
    return settings


def render(spp, seed, way):
    properties = pyluxcore.Properties()
    for name, value in integrator(way).items():
        properties.Set(pyluxcore.Property(name, value))
    for name, value in {
        "renderengine.seed": seed + 1,
        "sampler.type": "SOBOL",
        "sampler.sobol.adaptive.strength": 0.0,
        "native.threads.count": THREADS,
        "path.pathdepth.total": SCENE["bounces"] + 1,
        "path.pathdepth.diffuse": SCENE["bounces"] + 1,
        "path.pathdepth.glossy": SCENE["bounces"] + 1,
        "path.pathdepth.specular": SCENE["bounces"] + 1,
        "path.clamping.variance.maxvalue": 0.0,
        "film.width": size,
        "film.height": size,
        "film.filter.type": "NONE",
        "film.imagepipelines.0.0.type": "NOP",
        "film.outputs.0.type": "RGB_IMAGEPIPELINE",
        "film.outputs.0.index": 0,
        "film.outputs.0.filename": "out.exr",
        "batch.haltspp": spp,
    }.items():
        properties.Set(pyluxcore.Property(name, value))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties, scene))
    start = time.perf_counter()
    # Fills the cache of photons.
    session.Start()
    filled = time.perf_counter() - start if way == "photons" else 0.0
    while not session.HasDone():
        time.sleep(0.005)
        session.UpdateStats()
    session.UpdateStats()
    stats = session.GetStats()
    seconds = filled + stats.Get("stats.renderengine.time").GetFloat()
    taken = stats.Get("stats.renderengine.pass").GetInt()
    pixels = np.zeros(size * size * 3, np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB_IMAGEPIPELINE, pixels, 0)
    session.Stop()
    return pixels.reshape(size, size, 3)[::-1], taken, seconds


serve(f"LuxCore {pyluxcore.Version()}", render)
