//! Scenes that are wrong: each is refused at its place, none makes the reader stop in another way.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::changed;
use lumbre_formats::{Budget, Diagnostics, Limits, ReadOptions, open_scene, pbrt};
use lumbre_scene::SceneDesc;

fn read_within(text: &[u8], limits: Limits) -> (Result<SceneDesc, String>, u64) {
    let mut diagnostics = Diagnostics::new();
    let budget = Budget::new(limits);
    let scene = pbrt::read_bytes("s.pbrt", text, None, &budget, &mut diagnostics);
    (scene.map_err(|e| e.to_diagnostic().to_string()), diagnostics.warnings())
}

fn read(text: &[u8]) -> Result<SceneDesc, String> {
    read_within(text, Limits::default()).0
}

/// The first line of what is said about a scene that is wrong.
fn first_line(text: &[u8]) -> String {
    match read(text) {
        Ok(_) => "read".to_owned(),
        Err(message) => message.lines().next().unwrap_or_default().to_owned(),
    }
}

#[test]
fn each_mistake_is_found_at_its_place() {
    let mut wrong = vec![];
    for (text, expected) in CASES {
        let found = first_line(text.as_bytes());
        let expected = format!("error: s.pbrt:{expected}");
        if found != expected {
            wrong.push(format!("{text}\n  found    {found}\n  expected {expected}"));
        }
    }
    assert!(CASES.len() >= 40);
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), CASES.len(), wrong.join("\n"));
}

/// Scenes with the place and the message of their mistake.
const CASES: &[(&str, &str)] = &[
    // Files and words.
    ("", "1:1: the scene has no WorldBegin"),
    ("  \n# nothing\n", "1:1: the scene has no WorldBegin"),
    (
        "\u{FEFF}WorldBegin\r\n\r\n  \"x\"",
        "3:3: no directive before this (found string \"x\"; expected a directive such as Shape)",
    ),
    ("WorldBegin \0", "1:12: stray byte (found 0x00; expected text)"),
    (
        "WorldBegin\nShape \"sphere",
        "2:7: string without an end on its line (found \"sphere\"; expected a closing quote)",
    ),
    (
        "WorldBegin Shape \"sp\\here\"",
        "1:18: unknown escape in a string (found \"\\\\h\"; expected one of \\b \\f \\n \\r \\t \\\\ \\' \\\")",
    ),
    ("WorldBegin ]", "1:12: no directive before this (found ]; expected a directive such as Shape)"),
    // Where directives stand.
    ("Shape \"sphere\"", "1:1: Shape stands before WorldBegin; it belongs after it"),
    ("WorldBegin\n Camera \"perspective\"", "2:2: Camera stands after WorldBegin; it belongs before it"),
    ("WorldBegin WorldBegin", "1:12: WorldBegin stands after WorldBegin; it belongs before it"),
    ("WorldBegin AttributeEnd", "1:12: AttributeEnd without AttributeBegin"),
    ("WorldBegin\n AttributeBegin\n  ObjectBegin \"a\"", "3:3: ObjectBegin without its ObjectEnd"),
    (
        "WorldBegin AttributeBegin ObjectEnd",
        "1:27: ObjectEnd inside AttributeBegin (found AttributeBegin at s.pbrt:1:12; expected AttributeEnd)",
    ),
    ("WorldBegin ObjectBegin \"a\" ObjectBegin \"b\"", "1:28: ObjectBegin inside the object \"a\""),
    (
        "WorldBegin ObjectBegin \"a\" ObjectInstance \"a\" ObjectEnd",
        "1:28: ObjectInstance inside the object \"a\"",
    ),
    // Transforms.
    ("WorldBegin Translate 1 2", "1:25: the file ends too early (expected 3 numbers)"),
    ("WorldBegin Translate 1 two 3", "1:24: wrong argument of Translate (found \"two\"; expected 3 numbers)"),
    (
        "WorldBegin Translate 1 1e400 3",
        "1:24: wrong argument of Translate (found 1e400; expected a finite number)",
    ),
    ("WorldBegin Translate 1 nan 3", "1:24: wrong argument of Translate (found \"nan\"; expected 3 numbers)"),
    ("WorldBegin Scale 1 0 1", "1:12: Scale makes a transform that cannot be inverted"),
    ("WorldBegin Rotate 30 0 0 0", "1:12: Rotate makes a transform that cannot be inverted"),
    ("WorldBegin\nLookAt 1 2 3 1 2 3 0 1 0", "2:1: LookAt from a point to itself: eye and target are equal"),
    ("LookAt 1 2 3 4 5 6 3 3 3", "1:1: LookAt with its up vector along the line of sight"),
    (
        "Transform [1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1]",
        "1:1: Transform makes a transform that cannot be inverted",
    ),
    (
        "Transform [1 0 0 0 0 1 0 0 0 0 1 0 0 0 0]",
        "1:41: wrong argument of Transform (found ]; expected 16 numbers)",
    ),
    ("Scale 1e200 1 1 Scale 1e200 1 1", "1:17: Scale makes a transform that cannot be inverted"),
    (
        "WorldBegin ActiveTransform Start",
        "1:28: wrong argument of ActiveTransform (found \"Start\"; expected StartTime, EndTime or All)",
    ),
    (
        "ColorSpace \"rec202\"",
        "1:12: unknown colour space (found \"rec202\"; expected srgb, dci-p3, rec2020, aces2065-1; did you mean \"rec2020\"?)",
    ),
    // Parameters.
    ("WorldBegin Shape", "1:17: the file ends too early (expected a type in quotes)"),
    (
        "WorldBegin Shape sphere",
        "1:18: wrong argument of Shape (found \"sphere\"; expected a type in quotes)",
    ),
    (
        "WorldBegin Shape \"sphere\" \"radius\" 2",
        "1:27: wrong declaration of a parameter (found \"radius\"; expected a type and a name such as \"float radius\")",
    ),
    (
        "WorldBegin Shape \"sphere\" \"flaot radius\" 2",
        "1:27: unknown type of parameter \"radius\" (found \"flaot\"; expected bool, float, integer, point2, vector2, point3, vector3, normal, string, texture, rgb, blackbody, spectrum; did you mean \"float\"?)",
    ),
    (
        "WorldBegin Shape \"sphere\" \"float radius\" \"big\"",
        "1:42: wrong value for parameter \"radius\" (found string \"big\"; expected a number)",
    ),
    (
        "WorldBegin Shape \"sphere\" \"float radius\" [1 2]",
        "1:27: wrong value for parameter \"radius\" (found 2 numbers; expected one number)",
    ),
    (
        "WorldBegin Shape \"sphere\" \"float radius\" []",
        "1:27: wrong value for parameter \"radius\" (found 0 numbers; expected one number)",
    ),
    ("WorldBegin Shape \"sphere\" \"float radius\" [2", "1:44: the file ends too early (expected \"]\")"),
    (
        "WorldBegin Shape \"sphere\" \"float radius\"",
        "1:41: the file ends too early (expected a value for parameter \"radius\")",
    ),
    (
        "WorldBegin Shape \"sphere\" \"float radius\" Shape",
        "1:42: wrong value for parameter \"radius\" (found \"Shape\"; expected a number)",
    ),
    (
        "WorldBegin Shape \"sphere\" \"string radius\" \"2\"",
        "1:27: wrong type of parameter \"radius\" (found string \"2\"; expected float or integer)",
    ),
    (
        "WorldBegin Shape \"sphere\" \"float radius\" inf",
        "1:27: wrong value for parameter \"radius\" (found inf; expected a finite number)",
    ),
    (
        "WorldBegin Shape \"cylinder\" \"bool caps\" 1",
        "1:41: wrong value for parameter \"caps\" (found 1; expected true or false)",
    ),
    (
        "Film \"rgb\" \"integer xresolution\" 1.5",
        "1:34: wrong value for parameter \"xresolution\" (found 1.5; expected a whole number)",
    ),
    (
        "Film \"rgb\" \"integer xresolution\" 3000000000",
        "1:34: wrong value for parameter \"xresolution\" (found 3000000000; expected a whole number)",
    ),
    (
        "Film \"rgb\" \"integer yresolution\" 0",
        "1:12: parameter \"yresolution\" of film \"rgb\" is out of range (found 0; expected 1 or more)",
    ),
    (
        "Film \"rgb\" \"integer pixelbounds\" [5 5 0 9]",
        "1:12: pixelbounds hold no pixel of the film (found 5 5 0 9; expected x0 x1 y0 y1 within 0 1280 0 720)",
    ),
    (
        "Film \"rgb\" \"float iso\" -3",
        "1:12: parameter \"iso\" of film \"rgb\" is out of range (found -3; expected more than 0)",
    ),
    (
        "Camera \"perspective\" \"float fov\" 180",
        "1:22: parameter \"fov\" of camera \"perspective\" is out of range (found 180; expected more than 0 and less than 180 degrees)",
    ),
    (
        "Camera \"perspective\" \"float shutteropen\" 2",
        "1:1: the shutter closes before it opens (found 1; expected shutterclose after shutteropen = 2)",
    ),
    (
        "Camera \"spherical\" \"string mapping\" \"equalare\"",
        "1:20: wrong value for parameter \"mapping\" (found string \"equalare\"; expected one of equalarea, equirectangular; did you mean \"equalarea\"?)",
    ),
    (
        "Sampler \"sobol\" \"integer pixelsamples\" -4",
        "1:17: parameter \"pixelsamples\" of sampler \"sobol\" is out of range (found -4; expected 1 or more)",
    ),
    ("Option \"seed\" 1.5", "1:8: wrong value of the option \"seed\" (found \"1.5\"; expected an integer)"),
    (
        "Attribute \"shap\" \"float radius\" 2",
        "1:11: unknown kind of Attribute (found \"shap\"; expected shape, light, material, medium, texture; did you mean \"shape\"?)",
    ),
    // Shapes.
    (
        "WorldBegin Shape \"sphere\" \"float radius\" -2",
        "1:27: parameter \"radius\" of shape \"sphere\" is out of range (found -2; expected a finite number greater than 0)",
    ),
    (
        "WorldBegin Shape \"disk\" \"float innerradius\" 3",
        "1:25: parameter \"innerradius\" of shape \"disk\" is out of range (found 3; expected from 0 to less than radius)",
    ),
    (
        "WorldBegin Shape \"cone\" \"point3 apex\" [1 2 3]",
        "1:12: a cone with an apex or an axis has no \"float angle\"",
    ),
    (
        "WorldBegin Shape \"quadric\" \"float coefficients\" [1 2 3]",
        "1:28: wrong value for parameter \"coefficients\" (found 3 numbers; expected 10 numbers)",
    ),
    ("WorldBegin Shape \"triangle\" \"point3 p0\" [1 2 3]", "1:12: a triangle has no \"point3 p1\""),
    ("WorldBegin Shape \"trianglemesh\"", "1:12: a trianglemesh has no \"point3 P\""),
    (
        "WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1]",
        "1:33: wrong value for parameter \"P\" (found 8 numbers; expected three numbers each)",
    ),
    (
        "WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 3]",
        "1:64: index 2 of the trianglemesh is out of range (found 3; expected 0 to 2)",
    ),
    (
        "WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1]",
        "1:64: wrong number of indices (found 2; expected a multiple of 3)",
    ),
    (
        "WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1e39 0]",
        "1:33: wrong value for parameter \"P\" (found 9 numbers; expected numbers of single precision)",
    ),
    (
        "WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 nan]",
        "1:61: wrong value for parameter \"P\" (found \"nan\"; expected a number)",
    ),
    (
        "WorldBegin Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"normal N\" [0 0 1]",
        "1:64: wrong number of values for parameter \"N\" (found 1; expected 3, as many as points)",
    ),
    (
        "WorldBegin Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]",
        "1:12: a bilinearmesh of other than 4 points has no \"integer indices\"",
    ),
    ("WorldBegin Shape \"curve\"", "1:12: a curve has no \"point3 P\""),
    (
        "WorldBegin Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0]",
        "1:26: wrong value for parameter \"P\" (found 8 numbers; expected three numbers each)",
    ),
    (
        "WorldBegin Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0]",
        "1:26: wrong number of control points: a cubic Bézier curve of n segments has 3 n + 1 control points (found 3)",
    ),
    (
        "WorldBegin Shape \"curve\" \"string basis\" \"bspline\" \"point3 P\" [0 0 0 1 0 0 2 0 0]",
        "1:51: wrong number of control points: a cubic B-spline has 4 control points or more (found 3)",
    ),
    (
        "WorldBegin Shape \"curve\" \"integer degree\" 4 \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "1:26: parameter \"degree\" of shape \"curve\" is out of range (found 4; expected 2 or 3)",
    ),
    (
        "WorldBegin Shape \"curve\" \"string type\" \"round\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "1:26: wrong value for parameter \"type\" (found string \"round\"; expected one of flat, cylinder, ribbon)",
    ),
    (
        "WorldBegin Shape \"curve\" \"string basis\" \"nurbs\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "1:26: wrong value for parameter \"basis\" (found string \"nurbs\"; expected one of bezier, bspline)",
    ),
    (
        "WorldBegin Shape \"curve\" \"float width1\" -2 \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "1:26: parameter \"width1\" of shape \"curve\" is out of range (found -2; expected more than 0)",
    ),
    (
        "WorldBegin Shape \"curve\" \"float width\" 0 \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "1:26: parameter \"width\" of shape \"curve\" is out of range (found 0; expected more than 0)",
    ),
    (
        "WorldBegin Shape \"curve\" \"string type\" \"ribbon\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "1:12: a ribbon has no \"normal N\"",
    ),
    (
        "WorldBegin Shape \"curve\" \"string type\" \"ribbon\" \"normal N\" [0 0 1] \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]",
        "1:49: wrong number of normals (found 1; expected 2, one at each end of each segment)",
    ),
    (
        "WorldBegin Material \"hair\" \"float eta\" 0",
        "1:28: parameter \"eta\" of material \"hair\" is out of range (found 0; expected more than 0)",
    ),
    (
        "WorldBegin Material \"hair\" \"float eumelanin\" -1",
        "1:28: parameter \"eumelanin\" of material \"hair\" is out of range (found -1; expected 0 or more)",
    ),
    (
        "WorldBegin Material \"hair\" \"rgb sigma_a\" [1 -1 0]",
        "1:28: wrong value for parameter \"sigma_a\" (found 1 -1 0; expected 3 numbers that are not negative)",
    ),
    ("WorldBegin Shape \"plymesh\"", "1:12: a plymesh has no \"string filename\""),
    (
        "WorldBegin Shape \"plymesh\" \"string filename\" \"m.ply\"",
        "1:28: no file can be read from here, and the scene asks for \"m.ply\"",
    ),
    (
        "WorldBegin Shape \"loopsubdiv\" \"integer levels\" 30 \"point3 P\" [0 0 0 1 0 0 0 1 0]",
        "1:31: faces of a loopsubdiv: needs 1152921504606846989 elements, limit 4294967296; raise it with --max-elements",
    ),
    (
        "WorldBegin AreaLightSource \"diffuse\"\nShape \"plane\"",
        "2:1: an infinite shape cannot be an area light (that of s.pbrt:1:12); is an AttributeEnd missing?",
    ),
    (
        "WorldBegin Shape \"csg\" \"string operands\" [\"a\" \"b\"]",
        "1:24: object \"a\" is not defined before this csg",
    ),
    (
        "WorldBegin ObjectBegin \"a\" Shape \"sphere\" ObjectEnd ObjectBegin \"b\" Shape \"disk\" ObjectEnd\nShape \"csg\" \"string operands\" [\"a\" \"b\"]",
        "2:13: object \"b\" has a disk that is no solid (expected a closed shape that is whole, such as a sphere or a capped cylinder, a plane, an infinite cylinder, cone or quadric, a closed mesh or csg)",
    ),
    (
        "WorldBegin ObjectBegin \"a\" Shape \"sphere\" Shape \"csg\" \"string operands\" [\"a\" \"a\"]",
        "1:55: object \"a\" is an operand of a csg inside it",
    ),
    // Names.
    (
        "WorldBegin NamedMaterial \"gold\" MakeNamedMaterial \"god\" \"string type\" \"conductor\"",
        "1:26: material \"gold\" is not defined (did you mean \"god\"?)",
    ),
    (
        "WorldBegin MakeNamedMaterial \"a\" \"string type\" \"diffuse\"\nMakeNamedMaterial \"a\" \"string type\" \"diffuse\"",
        "2:19: material \"a\" is defined twice",
    ),
    (
        "WorldBegin MakeNamedMaterial \"a\" \"rgb reflectance\" [1 1 1]",
        "1:12: material \"a\" has no \"string type\"",
    ),
    ("WorldBegin ObjectInstance \"a\"", "1:27: object \"a\" is not defined"),
    (
        "WorldBegin ObjectBegin \"a\" ObjectEnd ObjectBegin \"a\" ObjectEnd",
        "1:50: object \"a\" is defined twice",
    ),
    (
        "WorldBegin Texture \"t\" \"float\" \"constant\" Texture \"t\" \"float\" \"constant\"",
        "1:43: float texture \"t\" is defined twice",
    ),
    (
        "WorldBegin Texture \"t\" \"int\" \"constant\"",
        "1:24: unknown kind of texture (found \"int\"; expected \"float\" or \"spectrum\")",
    ),
    (
        "WorldBegin Texture \"t\" \"float\" \"constant\" Material \"diffuse\" \"texture reflectance\" \"t\"",
        "1:62: spectrum texture \"t\" is not defined before this (found a float texture of this name; expected a spectrum texture)",
    ),
    ("WorldBegin Texture \"t\" \"spectrum\" \"imagemap\"", "1:12: an imagemap has no \"string filename\""),
    (
        "WorldBegin Texture \"t\" \"spectrum\" \"checkerboard\" \"integer dimension\" 4",
        "1:50: parameter \"dimension\" of texture \"checkerboard\" is out of range (found 4; expected 2 or 3)",
    ),
    (
        "WorldBegin Material \"mix\" \"string materials\" [\"a\" \"b\"]",
        "1:27: material \"a\" is not defined before this mix",
    ),
    (
        "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" MakeNamedMedium \"m\"",
        "1:65: medium \"m\" is defined twice",
    ),
    (
        "MediumInterface \"fog\" WorldBegin MakeNamedMedium \"fogs\" \"string type\" \"homogeneous\"",
        "1:17: medium \"fog\" is not defined (did you mean \"fogs\"?)",
    ),
    (
        "MakeNamedMedium \"m\" \"rgb sigma_a\" [1 1 1]",
        "1:1: medium \"m\" has no type (expected \"string type\" with one of its types)",
    ),
    (
        "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 2",
        "1:1: medium \"m\" has no density (expected \"float density\" with a number for each voxel)",
    ),
    (
        "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" [1 2 3]",
        "1:64: wrong value for parameter \"density\" (found 3 numbers; expected a number for each of 2 × 1 × 1 voxels)",
    ),
    (
        "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" [1 -2]",
        "1:64: wrong value for parameter \"density\" (found -2 at position 1; expected numbers that are not negative)",
    ),
    (
        "MakeNamedMedium \"m\" \"string type\" \"cloud\" \"point3 p1\" [1 0 1]",
        "1:43: the box of this medium is flat (expected p0 and p1 that differ on every axis)",
    ),
    (
        "MakeNamedMedium \"m\" \"string type\" \"rgbgrid\"",
        "1:1: medium \"m\" has neither sigma_a nor sigma_s (expected \"rgb sigma_a\" or \"rgb sigma_s\" of all voxels)",
    ),
    (
        "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"float density\" 1 \"rgb Le\" [1 1 1] \"float temperature\" 900",
        "1:84: a medium has Le and a temperature (expected one of both)",
    ),
    (
        "WorldBegin Material \"measured\"",
        "1:12: material \"measured\" has no file (expected \"string filename\" with a .bsdf file of the RGL material database)",
    ),
    (
        "WorldBegin Material \"subsurface\" \"string name\" \"Skin\"",
        "1:34: unknown medium \"Skin\" (expected the name of a measured medium; did you mean \"Skin1\"?)",
    ),
    (
        "WorldBegin Material \"subsurface\" \"rgb sigma_s\" [1 2 3]",
        "1:34: \"sigma_s\" without \"sigma_a\" (expected both or neither)",
    ),
    (
        "WorldBegin Material \"subsurface\" \"rgb reflectance\" [.5 .5 .5] \"rgb mfp\" [1 0 2]",
        "1:63: parameter \"mfp\" of material \"subsurface\" is out of range (found 0; expected more than 0)",
    ),
    (
        "Camera \"realistic\" WorldBegin",
        "1:1: camera \"realistic\" has no lens (expected \"string lensfile\" with a file of its surfaces)",
    ),
    (
        "Film \"rgb\" \"float diagonal\" 0 WorldBegin",
        "1:12: parameter \"diagonal\" of film \"rgb\" is out of range (found 0; expected more than 0)",
    ),
    // Spectra, materials and lights.
    (
        "WorldBegin Material \"diffuse\" \"rgb reflectance\" [1 -1 0]",
        "1:31: wrong value for parameter \"reflectance\" (found 1 -1 0; expected 3 numbers that are not negative)",
    ),
    (
        "WorldBegin Material \"diffuse\" \"rgb reflectance\" [1 1]",
        "1:31: wrong value for parameter \"reflectance\" (found 2 numbers; expected 3 numbers)",
    ),
    (
        "WorldBegin Material \"diffuse\" \"spectrum reflectance\" \"metal-Ag-et\"",
        "1:31: unknown spectrum \"metal-Ag-et\" (expected the name of a built-in spectrum or of a file; did you mean \"metal-Ag-eta\"?)",
    ),
    (
        "WorldBegin Material \"diffuse\" \"spectrum reflectance\" [400 1 300 2]",
        "1:31: wrong value for parameter \"reflectance\" (found 4 numbers; expected wavelengths that ascend)",
    ),
    (
        "WorldBegin Material \"conductor\" \"rgb reflectance\" [1 1 1] \"rgb eta\" [1 1 1]",
        "1:59: \"reflectance\" excludes \"eta\"",
    ),
    (
        "WorldBegin Material \"dielectric\" \"float eta\" 0",
        "1:34: parameter \"eta\" of material \"dielectric\" is out of range (found 0; expected more than 0)",
    ),
    (
        "WorldBegin LightSource \"point\" \"blackbody I\" -3000",
        "1:32: wrong value for parameter \"I\" (found -3000; expected a temperature in kelvin, more than 0)",
    ),
    (
        "WorldBegin LightSource \"spot\" \"point3 to\" [0 0 0]",
        "1:31: a spot shines from a point to itself: from and to are equal",
    ),
    (
        "WorldBegin LightSource \"spot\" \"float coneangle\" 200",
        "1:31: parameter \"coneangle\" of light \"spot\" is out of range (found 200; expected more than 0 and less than 180 degrees)",
    ),
    (
        "WorldBegin LightSource \"distant\" \"point3 from\" [0 0 1]",
        "1:12: a distant light shines from a point to itself: from and to are equal",
    ),
    (
        "WorldBegin LightSource \"point\" \"float scale\" -1",
        "1:32: parameter \"scale\" of light \"point\" is out of range (found -1; expected 0 or more)",
    ),
    (
        "WorldBegin Include \"other.pbrt\"",
        "1:20: no file can be read from here, and the scene asks for \"other.pbrt\"",
    ),
];

// What hostile input might do to a reader.

const SCENES: [&str; 3] = [
    r#"LookAt 1 2 3  4 5 6  0 1 0 # é
Camera "perspective" "float fov" [ 30 ] "float screenwindow" [-1 1 -1 1]
Film "rgb" "integer xresolution" 30 "string filename" "a\"b.exr"
Sampler "stratified" "integer xsamples" 3
Option "seed" 7
WorldBegin
ColorSpace "rec2020"
Texture "t" "spectrum" "mix" "rgb tex1" [.1 .2 .3] "spectrum tex2" [400 .5 700 .6] "float amount" .25
MakeNamedMaterial "m" "string type" "coateddiffuse" "texture reflectance" "t" "bool remaproughness" false
AttributeBegin
  Attribute "shape" "float radius" 0x1.8p1
  NamedMaterial "m"
  AreaLightSource "diffuse" "blackbody L" 3000 "float power" 12
  Shape "sphere" "float zmin" -inf
AttributeEnd
LightSource "spot" "rgb I" [1 2 3] "point3 from" [1 2 3]
"#,
    r#"WorldBegin
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [0 0 0 1 0 0 1 1 0 0 1 0]
  "normal N" [0 0 1 0 0 1 0 0 1 0 0 1] "point2 uv" [0 0 1 0 1 1 0 1] "integer faceIndices" [3 4]
Shape "loopsubdiv" "integer levels" 1 "integer indices" [0 2 1 0 1 3 1 2 3 2 0 3] "point3 P" [0 0 0 4 0 0 0 4 0 0 0 4]
ObjectBegin "a" Shape "sphere" ObjectEnd ObjectBegin "b" Translate 1 0 0 Shape "box" ObjectEnd
Shape "csg" "string operation" "difference" "string operands" ["a" "b"]
ObjectInstance "a" Rotate 30 1 2 3 ObjectInstance "b"
Shape "quadric" "float coefficients" [1 2 3 0 0 0 0 0 0 -4] Shape "torus" Shape "cone" "bool caps" true
"#,
    r#"Film "image" Sampler "02sequence"
WorldBegin
Texture "t" "color" "checkerboard" "color tex1" [.2 .4 .6] "float uscale" 4
Material "uber" "texture Kd" "t" "rgb opacity" [.5 .5 .5]
Shape "trianglemesh" "point P" [0 0 0 2 0 0 0 3 0] "float uv" [0 0 1 0 0 1] "integer indices" [0 1 2]
LightSource "infinite" "color L" [1 2 3] "integer nsamples" 4
WorldEnd
"#,
];

#[test]
fn a_scene_cut_at_any_byte_is_read_or_refused() {
    for scene in SCENES {
        let whole = read(scene.as_bytes());
        assert!(whole.is_ok(), "{whole:?}");
        let mut refused = 0;
        for end in 0..scene.len() {
            if let Err(message) = read(&scene.as_bytes()[..end]) {
                assert!(message.starts_with("error: s.pbrt:"), "{message}");
                refused += 1;
            }
        }
        assert!(refused > scene.len() / 4, "{refused}");
    }
}

/// Numbers that look random, the same each time (G. Marsaglia, "Xorshift RNGs", Journal of Statistical Software, 2003).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % end
    }
}

#[test]
fn mutated_scenes_are_read_or_refused() {
    let words: [&[u8]; 14] = [
        b"1e400",
        b"nan",
        b"-inf",
        b"\"",
        b"[",
        b"]",
        b"WorldBegin ",
        b" AttributeBegin ",
        b" -1 ",
        b"2147483648",
        b"\\",
        b"\0",
        b"\xFF",
        b" ObjectEnd ",
    ];
    let mut numbers = Numbers(0x9E37_79B9_7F4A_7C15);
    let (mut good, mut bad) = (0, 0);
    let limits = changed(Limits::default(), |it| {
        it.memory = 64 << 20;
        it.elements = 100_000;
    });
    for _ in 0..4000 {
        let mut text = SCENES[numbers.below(SCENES.len())].as_bytes().to_vec();
        for _ in 0..=numbers.below(4) {
            let at = numbers.below(text.len());
            match numbers.below(4) {
                0 => text[at] = numbers.below(256) as u8,
                1 => drop(text.remove(at)),
                2 => {
                    let end = (at + numbers.below(40)).min(text.len());
                    let piece = text[at..end].to_vec();
                    let to = numbers.below(text.len());
                    text.splice(to..to, piece);
                }
                _ => drop(text.splice(at..at, words[numbers.below(words.len())].iter().copied())),
            }
        }
        match read_within(&text, limits).0 {
            Ok(_) => good += 1,
            Err(message) => {
                assert!(message.starts_with("error: s.pbrt"), "{message}");
                bad += 1;
            }
        }
    }
    assert!(good > 400 && bad > 400, "{good} {bad}");
}

/// What came of a scene, within a time that only a fault would pass.
fn quickly(text: &str) -> String {
    let start = Instant::now();
    let found = first_line(text.as_bytes());
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
    found
}

#[test]
fn deep_nesting_is_refused_with_the_flag_that_allows_it() {
    let found = quickly(&format!("WorldBegin {}", "AttributeBegin ".repeat(1_000_000)));
    assert_eq!(
        found,
        "error: s.pbrt:1:3852: AttributeBegin: needs 257 levels of nesting, limit 256; raise it with --max-nesting"
    );
    let limits = changed(Limits::default(), |it| it.nesting = 2_000_000);
    let deep = format!("WorldBegin {}{}", "AttributeBegin ".repeat(100_000), "AttributeEnd ".repeat(100_000));
    assert!(read_within(deep.as_bytes(), limits).0.is_ok());
    assert!(quickly(&format!("WorldBegin {}", "[".repeat(1_000_000))).contains("no directive before this"));
}

#[test]
fn what_doubles_with_each_line_is_stopped() {
    let mut textures = "WorldBegin Texture \"t0\" \"float\" \"constant\" ".to_owned();
    let mut solids = "WorldBegin ObjectBegin \"o0\" Shape \"sphere\" ObjectEnd ".to_owned();
    let mut chain = textures.clone();
    let mut mixed = "WorldBegin MakeNamedMaterial \"m0\" \"string type\" \"diffuse\" ".to_owned();
    for i in 0..70 {
        let next = i + 1;
        textures += &format!(
            "Texture \"t{next}\" \"float\" \"scale\" \"texture tex\" \"t{i}\" \"texture scale\" \"t{i}\"\n"
        );
        chain += &format!("Texture \"t{next}\" \"float\" \"scale\" \"texture tex\" \"t{i}\"\n");
        solids += &format!(
            "ObjectBegin \"o{next}\" Shape \"csg\" \"string operands\" [\"o{i}\" \"o{i}\"] ObjectEnd\n"
        );
        mixed += &format!(
            "MakeNamedMaterial \"m{next}\" \"string type\" \"mix\" \"string materials\" [\"m{i}\" \"m{i}\"]\n"
        );
    }
    assert_eq!(quickly(&textures), "error: s.pbrt:12:1: a texture is made of more than 4096 others");
    assert!(quickly(&chain).ends_with("textures stand in each other more than 64 deep"));
    assert!(quickly(&mixed).ends_with("mixtures stand in each other more than 64 deep"));
    let limits = changed(Limits::default(), |it| it.elements = 100_000);
    let refused = read_within(solids.as_bytes(), limits).0.unwrap_err();
    assert!(refused.contains("operands of a csg") && refused.contains("--max-elements"), "{refused}");
}

#[test]
fn one_very_long_line_and_many_warnings_are_read_in_one_walk() {
    let sphere = "Shape \"sphere\" \"float raduis\" 2 ";
    let start = Instant::now();
    let (scene, warnings) =
        read_within(format!("WorldBegin {}", sphere.repeat(50_000)).as_bytes(), Limits::default());
    assert_eq!((scene.unwrap().shapes.len(), warnings), (50_000, 50_000));
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
    let long = format!("WorldBegin Shape \"{}\" Translate 1 2", "x".repeat(3_000_000));
    assert_eq!(quickly(&long), "error: s.pbrt:1:3000034: the file ends too early (expected 3 numbers)");
}

#[test]
fn an_include_that_comes_back_prints_its_way() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    fs::write(path("a.pbrt"), "WorldBegin\nInclude \"b.pbrt\"").unwrap();
    fs::write(path("b.pbrt"), "Shape \"sphere\"\n  Include \"c.pbrt\"").unwrap();
    fs::write(path("c.pbrt"), "Include \"./a.pbrt\"").unwrap();
    let message = refusal(&path("a.pbrt"));
    let dir_name = dir.path().display();
    assert_eq!(
        message,
        format!(
            "error: {dir_name}/c.pbrt:1:9: a file includes itself (found \"./a.pbrt\")\n  \
             included from {dir_name}/b.pbrt:2:3\n  included from {dir_name}/a.pbrt:2:1"
        )
    );
    // A mistake in an included file has its chain too.
    fs::write(path("c.pbrt"), "\nScale 1 0 1").unwrap();
    let message = refusal(&path("a.pbrt"));
    assert!(message.starts_with(&format!("error: {dir_name}/c.pbrt:2:1: Scale makes")), "{message}");
    assert_eq!(message.lines().count(), 3);
}

fn refusal(path: &Path) -> String {
    open_scene(path, &ReadOptions::default()).unwrap_err().to_diagnostic().to_string()
}

#[test]
fn includes_that_fan_out_stop_at_the_limit_of_files() {
    let dir = tempfile::tempdir().unwrap();
    for i in 0..40 {
        let text = format!("Include \"{}.pbrt\" Include \"{}.pbrt\"", i + 1, i + 1);
        fs::write(dir.path().join(format!("{i}.pbrt")), text).unwrap();
    }
    fs::write(dir.path().join("40.pbrt"), "").unwrap();
    let limits = changed(Limits::default(), |it| it.files = 300);
    let options = changed(ReadOptions::default(), |it| it.limits = limits);
    let error = open_scene(&dir.path().join("0.pbrt"), &options).unwrap_err().to_string();
    assert!(error.contains("--max-files"), "{error}");
}

#[test]
fn repeated_includes_stop_at_the_expansion_limit() {
    let dir = tempfile::tempdir().unwrap();
    // Eight of them are free.
    let size = Limits::FREE_EXPANSION / 8;
    fs::write(dir.path().join("long.pbrt"), " ".repeat(size as usize)).unwrap();
    fs::write(dir.path().join("other.pbrt"), " ".repeat(size as usize / 2)).unwrap();
    let read = |lines: usize, expansion: u64| {
        let text = format!("WorldBegin Include \"other.pbrt\"{}", "\nInclude \"long.pbrt\"".repeat(lines));
        fs::write(dir.path().join("s.pbrt"), text).unwrap();
        let limits = changed(Limits::default(), |it| it.expansion = expansion);
        let options = changed(ReadOptions::default(), |it| it.limits = limits);
        open_scene(&dir.path().join("s.pbrt"), &options).map_err(|error| error.to_string())
    };
    // In line 9 there come to be 17/2 of the size, from 3/2 of it that are stored.
    assert!(read(7, 1).is_ok());
    assert!(read(11, 8).is_ok());
    let error = read(11, 2).unwrap_err();
    let place =
        format!("{}:9:9: Include of \"long.pbrt\" once more: needs ", dir.path().join("s.pbrt").display());
    assert!(error.starts_with(&place) && error.contains("--max-expansion"), "{error}");
}

#[test]
fn files_that_are_not_there_are_errors_where_they_are_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.pbrt");
    let cases = [
        ("WorldBegin\n Include \"gone.pbrt\"", "2:10: gone.pbrt: cannot open"),
        ("WorldBegin\n Include \".\"", "2:10: {folder}/.: cannot read"),
        ("WorldBegin Shape \"plymesh\" \"string filename\" \"gone.ply\"", "1:28: gone.ply: cannot open"),
        (
            "WorldBegin Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"gone.png\" Shape \"sphere\" \"texture alpha\" \"t\"",
            "1:43: gone.png: cannot open",
        ),
        (
            "WorldBegin LightSource \"infinite\" \"string filename\" \"/dev/zero\"",
            "1:35: /dev/zero: cannot read",
        ),
        ("WorldBegin Include \"$HOME/x\"", "1:20: $HOME/x: cannot open"),
        (
            "WorldBegin Material \"diffuse\" \"spectrum reflectance\" \"../x.spd\"",
            "1:31: unknown spectrum \"../x.spd\"",
        ),
    ];
    for (text, expected) in cases {
        fs::write(&path, text).unwrap();
        let message = refusal(&path);
        let folder = dir.path().display().to_string();
        let expected = format!("error: {}:{}", path.display(), expected.replace("{folder}", &folder));
        assert!(message.starts_with(&expected), "{message}\n{expected}");
    }
}

#[test]
fn an_import_closes_what_it_opens_and_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.pbrt");
    fs::write(&path, "WorldBegin AttributeBegin Import \"i.pbrt\" AttributeEnd").unwrap();
    let imported = dir.path().join("i.pbrt");
    fs::write(&imported, "AttributeBegin Shape \"sphere\" AttributeEnd").unwrap();
    assert!(open_scene(&path, &ReadOptions::default()).is_ok());
    fs::write(&imported, "\n AttributeBegin").unwrap();
    assert!(refusal(&path).contains("i.pbrt:2:2: AttributeBegin without its AttributeEnd"));
    fs::write(&imported, "AttributeEnd").unwrap();
    assert!(refusal(&path).contains("i.pbrt:1:1: AttributeEnd in an imported file closes"));
}

#[test]
fn kinds_of_file_are_told_by_their_ending() {
    let cases = [
        (
            "a.xyz",
            "a.xyz: unknown kind of scene file (found \"xyz\"; expected .pbrt, .pbrt.gz, .pov, .gltf, .glb, ",
        ),
        ("noending", "noending: unknown kind of scene file (found no ending; "),
        ("a.glb", "a.glb: cannot open"),
        ("a.PBRT.GZ", "a.PBRT.GZ: cannot open"),
    ];
    for (name, expected) in cases {
        let message = refusal(Path::new(name));
        assert!(message.starts_with(&format!("error: {expected}")), "{message}");
    }
}

#[test]
fn scenes_of_others_are_read_without_a_word() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let shared = ["../shared", "../../shared"].map(|folder| root.join(folder));
    let Some(shared) = shared.iter().find(|folder| folder.join("data/pbrt").exists()) else {
        println!("skipped: no folder of test data");
        return;
    };
    let cases = [
        ("data/pbrt/cornell-box/scene-v4.pbrt", 8, 0),
        ("data/pbrt/cornell-box/scene-v4-ref.pbrt", 8, 0),
        ("data/pbrt/veach-mis/scene-v4.pbrt", 9, 0),
        ("data/pbrt/volumetric-caustic/scene-v4.pbrt", 8, 0),
        ("data/pbrt/coffee/scene-v4.pbrt", 23, 0),
        ("peers/cornell.pbrt", 8, 0),
    ];
    for (name, shapes, warnings) in cases {
        let path = shared.join(name);
        if !path.exists() {
            continue;
        }
        let (scene, diagnostics) = open_scene(&path, &ReadOptions::default()).unwrap();
        assert_eq!(scene.shapes.len(), shapes, "{name}");
        let said = diagnostics.lines();
        assert_eq!(said.len(), warnings, "{said:?}");
        assert!(scene.shapes.iter().any(|shape| shape.area_light.is_some()), "{name}");
    }
}
