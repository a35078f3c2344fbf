//! OBJ files as scenes.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lumbre_image::{Encoding, Rgb};
use lumbre_math::Vec2;
use lumbre_scene::{
    AreaLightDesc, GeometryDesc, Listing, MaterialId, NamedMaterial, SceneDesc, ShapeDesc, WithoutLight,
    freeing,
};
use lumbre_shading::{
    FloatTexture, ImageFilter, ImageTexture, Mapping2d, Material, MaterialKind, MipMap, MipMapOptions,
    PrincipledParams, Roughness, Spectrum, SpectrumTexture, Texture, VolumeParams, Wrap,
};

use super::{MtlMaterial, MtlTexture, ObjThin, read_mtl, read_obj};
use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, nearest_name, quoted};
use crate::image::open_scene_image;
use crate::input::Input;
use crate::origin::placed;
use crate::ply::{push_thin, unsaid_material};
use crate::standing::up_of;
use crate::unseen::is_unseen;

/// Reads the OBJ file `path` with its materials and textures, each mesh a shape; y is up, or z where the meshes plainly
/// stand on a plane of z.
///
/// A material with any of the PBR keys (`Pr`, `Pm`, `Ps`, `Pc`, `aniso` and their maps) becomes the principled
/// one, clear when `illum` is 6 or 7. Of the others, those with `illum` 6 or 7 become glass, those with
/// specular colour only a metal, those with specular colour and `illum` 2 or more a coated diffuse one, and the
/// rest diffuse. `Pr` is the square root of the microfacet α; without it, `Ns` determines α (α² = 2 / (Ns + 2),
/// as in B. Walter and others, "Microfacet models for refraction", EGSR 2007). `Ke` emits on both sides.
/// Missing files and textures give warnings.
///
/// # Errors
/// As for [`Input::open`], [`read_obj`] and [`read_mtl`]; for textures only limits.
pub fn open_obj(
    path: &Path,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    obj_scene(Input::open(path, budget)?, path.parent().unwrap_or(Path::new("")), budget, diagnostics)
}

/// [`open_obj`] of a file that is open; others are found relative to `folder`.
pub(crate) fn obj_scene(
    input: Input<'_>,
    folder: &Path,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    let obj = read_obj(&input, input.name(), budget, diagnostics)?;
    drop(input);
    let mut builder = Builder { budget, diagnostics, images: HashMap::new(), listing: Listing::default() };
    let mut finished: Vec<Finished> = vec![];
    let of_meshes = obj.meshes.iter().filter_map(|mesh| mesh.material.as_ref());
    let of_thin = obj.thin.iter().filter_map(|thin| thin.material.as_ref());
    let used: HashSet<&str> = of_meshes.chain(of_thin).map(|(name, _)| name.as_str()).collect();
    // Unused ones have no number.
    let mut names: HashMap<String, Option<usize>> = HashMap::new();
    let mut opened: HashSet<PathBuf> = HashSet::new();
    for (library, place) in &obj.libraries {
        for (folder, material) in builder.library(folder, library, place, &mut opened)? {
            // The first definition of a name counts, as does the first library.
            if names.contains_key(&material.name) {
                continue;
            }
            if !used.contains(material.name.as_str()) {
                names.insert(material.name, None);
                continue;
            }
            // Itself, its name thrice, and its textures, as if all were its own.
            let textures = match is_principled(&material) {
                true => 16 * size_of::<FloatTexture>(),
                false => 4 * size_of::<SpectrumTexture>(),
            };
            let each = size_of::<Finished>()
                + size_of::<NamedMaterial>()
                + size_of::<Material>()
                + size_of::<PrincipledParams>()
                + textures
                + 3 * material.name.len();
            budget.bytes(each as u64, "materials")?;
            names.insert(material.name.clone(), Some(finished.len()));
            finished.push(builder.material(&folder, &material)?);
        }
    }
    let listing = std::mem::take(&mut builder.listing);
    let mut scene = SceneDesc { listing, ..SceneDesc::default() };
    for finished in &finished {
        let material = finished.material.clone();
        scene.materials.push(NamedMaterial { name: Some(finished.name.clone()), material });
    }
    // For meshes without vertex colours, and with them.
    let mut unsaid = [None; 2];
    scene.shapes = budget.vec(obj.meshes.len() as u64, "meshes")?;
    let mut find = |material: &Option<(String, Place)>| {
        let (name, place) = material.as_ref()?;
        let found = names.get(name).copied().flatten();
        if found.is_none() {
            builder.diagnostics.warn("unknown material, taken for grey", |said| {
                let near = nearest_name(name, names.keys().map(String::as_str));
                let said = said.at(place.clone()).found(quoted(name));
                Diagnostic { suggestion: near.map(str::to_owned), ..said }
            });
        }
        found
    };
    let world_from_object = placed(obj.origin);
    (scene.up, scene.up_is_guessed) = up_of(obj.meshes.iter().map(|mesh| &*mesh.mesh), obj.origin);
    for mesh in freeing(obj.meshes) {
        let named = find(&mesh.material);
        let id = named.unwrap_or_else(|| {
            let has_colours = mesh.mesh.colours.is_some();
            *unsaid[usize::from(has_colours)].get_or_insert_with(|| {
                scene.materials.push(unsaid_material(has_colours));
                scene.materials.len() - 1
            })
        });
        let finished = named.map(|i| &finished[i]);
        scene.shapes.push(ShapeDesc {
            index: scene.shapes.len() as u32,
            geometry: GeometryDesc::Mesh(mesh.mesh),
            world_from_object,
            reverse_orientation: false,
            material: Some(MaterialId(id as u32)),
            boundary: None,
            area_light: finished.and_then(|f| f.light.clone()),
            alpha: finished.and_then(|f| f.alpha.clone()),
        });
    }
    for ObjThin { material, thin } in &obj.thin {
        let named = find(material);
        let id = named.map(|id| MaterialId(id as u32));
        push_thin(&mut scene, thin, obj.size, id, world_from_object, budget)?;
    }
    scene.shapes.shrink_to_fit();
    scene.without_light = match finished.iter().any(|finished| finished.lights_the_scene()) {
        true => WithoutLight::Studio,
        // The studio stays, in addition to faint emission.
        false => WithoutLight::StudioUnlessStaged,
    };
    Ok(scene)
}

struct Finished {
    name: String,
    material: Arc<Material>,
    light: Option<AreaLightDesc>,
    alpha: Option<Arc<FloatTexture>>,
}

impl Finished {
    /// Whether it emits as a lamp does. Much less than white paper in the studio is an accent, such as a display,
    /// or a little blue that an exporter left behind.
    fn lights_the_scene(&self) -> bool {
        const FAINT: f32 = 0.5;
        self.light.as_ref().is_some_and(|light| light.radiance.max_component() > FAINT)
    }
}

struct Builder<'a> {
    budget: &'a Budget,
    diagnostics: &'a mut Diagnostics,
    /// The opened images, by file, whether they store numbers rather than colours, and whether they are
    /// clamped.
    images: HashMap<(PathBuf, bool, bool), Option<Arc<MipMap>>>,
    listing: Listing,
}

impl Builder<'_> {
    /// The materials of the files that `mtllib` names, each with its folder: one name with spaces, or several
    /// names.
    fn library(
        &mut self,
        folder: &Path,
        names: &str,
        place: &Place,
        opened: &mut HashSet<PathBuf>,
    ) -> Result<Vec<(PathBuf, MtlMaterial)>, FormatError> {
        let whole = existing(folder, names, self.budget);
        let paths = if self.budget.is_file(&whole) {
            vec![whole]
        } else {
            names.split_ascii_whitespace().map(|name| existing(folder, name, self.budget)).collect()
        };
        let mut materials = vec![];
        for path in paths {
            // Read once, however often it is named.
            if !opened.insert(path.clone()) {
                continue;
            }
            let input = match Input::open(&path, self.budget) {
                Ok(input) => input,
                Err(error @ FormatError::Io { .. }) => {
                    let said = Diagnostic::warning("material file is left out").at(place.clone());
                    self.diagnostics.push(said.because(error));
                    continue;
                }
                Err(e) => return Err(e.included_from(place.clone())),
            };
            let read = read_mtl(&input, input.name(), self.budget, self.diagnostics);
            let read = read.map_err(|e| e.included_from(place.clone()))?;
            let folder = path.parent().unwrap_or(Path::new("")).to_owned();
            materials.extend(read.into_iter().map(|material| (folder.clone(), material)));
        }
        Ok(materials)
    }

    fn material(&mut self, folder: &Path, m: &MtlMaterial) -> Result<Finished, FormatError> {
        let diffuse = m.diffuse.unwrap_or(if m.diffuse_map.is_some() { Rgb::WHITE } else { Rgb::splat(0.5) });
        let specular = m.specular.unwrap_or(Rgb::BLACK);
        let illumination = m.illumination.unwrap_or(2);
        let reflectance = match &m.diffuse_map {
            // Some programs write black where an image decides.
            Some(map) if diffuse.is_black() => self.colours(folder, map, Rgb::WHITE)?,
            Some(map) => self.colours(folder, map, diffuse)?,
            None => Arc::new(Texture::Constant(diffuse.clamp(0.0, 1.0))),
        };
        let is_mirror = diffuse.is_black() && m.diffuse_map.is_none() && !specular.is_black();
        let is_glossy = !specular.is_black() && illumination >= 2;
        let eta = m.refraction.filter(|&eta| 1.0 < eta && eta <= 10.0).unwrap_or(1.5);
        let roughness = shininess_roughness(m);
        let is_clear = matches!(illumination, 6 | 7);
        let kind = if is_principled(m) {
            let params = self.principled(folder, m, reflectance, eta)?;
            let transmission = constant(if is_clear { 1.0 } else { 0.0 });
            MaterialKind::Principled(Box::new(PrincipledParams { transmission, ..params }))
        } else if is_clear {
            MaterialKind::Dielectric { eta, roughness: Roughness::smooth() }
        } else if is_mirror && illumination >= 2 {
            let reflectance = Arc::new(Texture::Constant(specular.clamp(0.0, 1.0)));
            MaterialKind::ConductorReflectance { reflectance, roughness }
        } else if is_glossy {
            MaterialKind::CoatedDiffuse {
                reflectance,
                roughness,
                thickness: constant(0.01),
                eta,
                g: constant(0.0),
                albedo: Arc::new(Texture::Constant(Spectrum::BLACK)),
                max_depth: 10,
                samples: 1,
            }
        } else {
            MaterialKind::Diffuse { reflectance }
        };
        let mut material = Material::new(kind);
        if let Some(map) = &m.bump_map {
            let heights = self.image(folder, map, true)?;
            material.displacement = heights.map(|image| {
                let scale = map.bump_multiplier * map.range[1];
                Arc::new(Texture::Image(ImageTexture { scale, ..image }))
            });
        }
        if let Some(map) = &m.normal_map {
            material.normal_map = self.image(folder, map, true)?;
        }
        let alpha = match &m.opacity_map {
            Some(map) => self.image(folder, map, true)?.map(|image| Arc::new(Texture::Image(image))),
            None => m.opacity.filter(|&d| d < 1.0).map(|d| constant(d.max(0.0))),
        };
        let radiance = m.emission.unwrap_or(if m.emission_map.is_some() { Rgb::WHITE } else { Rgb::BLACK });
        let radiance = radiance.map(|c| c.max(0.0));
        let light = if radiance.is_black() || is_unseen(alpha.as_deref()) {
            None
        } else {
            let image = match &m.emission_map {
                Some(map) => {
                    if map.scale != [1.0; 2] || map.offset != [0.0; 2] {
                        let said = "-s and -o of a map of emission are not used";
                        self.diagnostics.warn(said, |said| said.at(map.place.clone()));
                    }
                    self.image(folder, map, false)?.map(|texture| texture.image)
                }
                None => None,
            };
            Some(AreaLightDesc {
                radiance,
                image,
                by_vertices: false,
                two_sided: true,
                power: None,
                spectrum: None,
            })
        };
        Ok(Finished { name: m.name.clone(), material: Arc::new(material), light, alpha })
    }

    /// The PBR keys. A map replaces its number, as is usual for these keys.
    fn principled(
        &mut self,
        folder: &Path,
        m: &MtlMaterial,
        base_color: Arc<SpectrumTexture>,
        ior: f32,
    ) -> Result<PrincipledParams, FormatError> {
        let roughness = m.roughness.unwrap_or_else(|| shininess_alpha(m).sqrt());
        let sheen = self.numbers(folder, &m.sheen_map, m.sheen.unwrap_or(0.0))?;
        let white = Arc::new(Texture::Constant(Rgb::WHITE));
        Ok(PrincipledParams {
            base_color,
            ior,
            metallic: self.numbers(folder, &m.metallic_map, m.metallic.unwrap_or(0.0))?,
            roughness: self.numbers(folder, &m.roughness_map, roughness)?,
            anisotropy: constant(m.anisotropy.unwrap_or(0.0)),
            anisotropy_rotation: m.anisotropy_rotation.unwrap_or(0.0) * std::f32::consts::TAU,
            clearcoat: constant(m.clearcoat.unwrap_or(0.0)),
            clearcoat_roughness: constant(m.clearcoat_roughness.unwrap_or(0.0)),
            sheen_color: match *sheen {
                Texture::Constant(v) => Arc::new(Texture::Constant(Rgb::splat(v))),
                _ => Arc::new(Texture::Scale { texture: white, scale: sheen }),
            },
            sheen_roughness: constant(0.5),
            volume: Some(VolumeParams::default()),
            ..PrincipledParams::default()
        })
    }

    /// A map of numbers, or a number if it cannot be read.
    fn numbers(
        &mut self,
        folder: &Path,
        map: &Option<Box<MtlTexture>>,
        number: f32,
    ) -> Result<Arc<FloatTexture>, FormatError> {
        let image = match map {
            Some(map) => self.image(folder, map, true)?,
            None => None,
        };
        Ok(image.map_or_else(|| constant(number), |image| Arc::new(Texture::Image(image))))
    }

    fn colours(
        &mut self,
        folder: &Path,
        map: &MtlTexture,
        factor: Rgb,
    ) -> Result<Arc<SpectrumTexture>, FormatError> {
        let Some(image) = self.image(folder, map, false)? else {
            return Ok(Arc::new(Texture::Constant(factor.clamp(0.0, 1.0))));
        };
        let image = Arc::new(Texture::Image(image));
        if factor == Rgb::WHITE {
            return Ok(image);
        }
        Ok(Arc::new(Texture::Product([image, Arc::new(Texture::Constant(factor))])))
    }

    /// A texture; `None`, with a warning, when it cannot be read.
    fn image(
        &mut self,
        folder: &Path,
        map: &MtlTexture,
        holds_numbers: bool,
    ) -> Result<Option<ImageTexture>, FormatError> {
        if map.range[0] != 0.0 {
            self.diagnostics.warn("base of -mm of a texture is not used", |said| said.at(map.place.clone()));
        }
        let path = existing(folder, &map.file, self.budget);
        let key = (path, holds_numbers, map.clamp);
        let image = match self.images.get(&key) {
            Some(image) => image.clone(),
            None => {
                let image = self.open(&key.0, holds_numbers, map)?;
                self.images.insert(key, image.clone());
                image
            }
        };
        Ok(image.map(|image| ImageTexture {
            mapping: Mapping2d::Uv { scale: Vec2::from(map.scale), delta: Vec2::from(map.offset) },
            image,
            scale: map.range[1],
            invert: false,
        }))
    }

    fn open(
        &mut self,
        path: &Path,
        holds_numbers: bool,
        map: &MtlTexture,
    ) -> Result<Option<Arc<MipMap>>, FormatError> {
        let file = match open_scene_image(path, self.budget, self.diagnostics) {
            Ok(file) => file,
            Err(e @ FormatError::Limit { .. }) => return Err(e.included_from(map.place.clone())),
            Err(e) => {
                let said = Diagnostic::warning("texture is left out").at(map.place.clone());
                self.diagnostics.push(said.because(e));
                return Ok(None);
            }
        };
        self.listing.add_texture(&map.file, file.bitmap.width(), file.bitmap.height());
        // The pyramid takes another third.
        self.budget.bytes(file.bitmap.bytes() as u64 / 3, "texture")?;
        let bitmap = if holds_numbers { file.bitmap.with_encoding(Encoding::Linear) } else { file.bitmap };
        let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
        let options = MipMapOptions { wrap, filter: ImageFilter::Trilinear };
        Ok(Some(Arc::new(MipMap::new(Arc::new(bitmap), options))))
    }
}

/// Whether it has any of the PBR keys.
fn is_principled(m: &MtlMaterial) -> bool {
    let numbers = [m.roughness, m.metallic, m.sheen, m.clearcoat, m.anisotropy];
    numbers.iter().any(Option::is_some)
        || [&m.roughness_map, &m.metallic_map, &m.sheen_map].iter().any(|map| map.is_some())
}

/// α from the exponent of the highlight.
fn shininess_alpha(m: &MtlMaterial) -> f32 {
    m.shininess.map_or(0.0, |shininess| (2.0 / (shininess.max(0.0) + 2.0)).sqrt())
}

fn shininess_roughness(m: &MtlMaterial) -> Roughness {
    Roughness::isotropic(shininess_alpha(m), false)
}

fn constant(value: f32) -> Arc<FloatTexture> {
    Arc::new(Texture::Constant(value))
}

/// The file of a name, where `\` may separate folders, as on Windows.
fn existing(folder: &Path, name: &str, budget: &Budget) -> PathBuf {
    let path = folder.join(name);
    if !budget.exists(&path) && name.contains('\\') { folder.join(name.replace('\\', "/")) } else { path }
}
