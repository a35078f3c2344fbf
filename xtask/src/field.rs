//! A field of 625 exact shapes on a chequered plane, drawn by a small generator of random numbers.
//!
//! It has the shapes, sizes, colours, camera, light and reflectances of a scene that POV-Ray users time their machines
//! with in spirit: spheres, boxes, cylinders, cones, tori and triangles, one in each cell of a grid. The random numbers
//! are those of a linear congruential generator (multiplier 1812433253, increment 12345, modulus 2^32), so that a
//! scene written for POV-Ray with `seed(7)` shows the same field.

use std::fmt::Write;

/// The generator behind the field.
struct Random(u32);

impl Random {
    /// Uniform in [0, 1].
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_812_433_253).wrapping_add(12_345);
        f64::from(self.0) / f64::from(u32::MAX)
    }

    /// A colour, and how much of the light a mirror above it reflects: up to 20 %.
    fn coat(&mut self) -> ([f64; 3], f64) {
        ([0; 3].map(|_| self.next() * 0.8 + 0.2), 0.2 * self.next())
    }
}

/// One shape of the field.
struct Cell {
    x: f64,
    z: f64,
    form: Form,
    colour: [f64; 3],
    mirror: f64,
}

enum Form {
    Sphere,
    Box,
    Cylinder,
    Cone,
    /// Turned about the x axis by this many degrees.
    Torus(f64),
    Triangle,
}

/// All shapes of the field, in the order in which their random numbers are drawn.
fn cells() -> Vec<Cell> {
    let mut random = Random(7);
    let mut cells = Vec::new();
    for i in -12..=12 {
        for j in -12..=12 {
            let form = match (random.next() * 6.0) as u32 {
                0 => Form::Sphere,
                1 => Form::Box,
                2 => Form::Cylinder,
                3 => Form::Cone,
                4 => Form::Torus(90.0 * random.next()),
                _ => Form::Triangle,
            };
            let (colour, mirror) = random.coat();
            cells.push(Cell { x: f64::from(i) * 0.7, z: f64::from(j) * 0.7, form, colour, mirror });
        }
    }
    cells
}

fn triple(v: [f64; 3]) -> String {
    format!("{:.6} {:.6} {:.6}", v[0], v[1], v[2])
}

/// A diffuse surface under a mirror that reflects `mirror` of the light whatever the angle.
fn mirrored(reflectance: &str, mirror: f64) -> String {
    format!(
        "  MakeNamedMaterial \"#d\" \"string type\" \"diffuse\" {reflectance}\n  \
           Material \"mix\" \"string materials\" [\"#d\" \"mirror\"] \"float amount\" {mirror:.6}\n"
    )
}

/// The scene in the language of pbrt.
pub(crate) fn scene() -> String {
    let mut out = String::from(HEAD);
    for (number, Cell { x, z, form, colour, mirror }) in cells().into_iter().enumerate() {
        let shape = match form {
            Form::Sphere => {
                format!("Shape \"sphere\" \"point3 center\" [{x:.2} 0.25 {z:.2}] \"float radius\" 0.25")
            }
            Form::Box => format!(
                "Shape \"box\" \"point3 p0\" [{:.2} 0 {:.2}] \"point3 p1\" [{:.2} 0.4 {:.2}]",
                x - 0.2,
                z - 0.2,
                x + 0.2,
                z + 0.2
            ),
            Form::Cylinder => format!(
                "Shape \"cylinder\" \"point3 p0\" [{x:.2} 0 {z:.2}] \"point3 p1\" [{:.2} 0.6 {z:.2}] \
                 \"float radius\" 0.15 \"bool caps\" true",
                x + 0.1
            ),
            Form::Cone => format!(
                "Shape \"cone\" \"point3 p0\" [{x:.2} 0 {z:.2}] \"point3 p1\" [{x:.2} 0.6 {z:.2}] \
                 \"float radius\" 0.25 \"float topradius\" 0.05 \"bool caps\" true"
            ),
            Form::Torus(degrees) => {
                let turn = degrees.to_radians();
                format!(
                    "Shape \"torus\" \"point3 center\" [{x:.2} 0.25 {z:.2}] \"vector3 axis\" [0 {:.6} {:.6}] \
                     \"float majorradius\" 0.2 \"float minorradius\" 0.08",
                    turn.cos(),
                    turn.sin()
                )
            }
            Form::Triangle => format!(
                "Shape \"triangle\" \"point3 p0\" [{:.2} 0 {z:.2}] \"point3 p1\" [{:.2} 0 {z:.2}] \
                 \"point3 p2\" [{x:.2} 0.6 {:.2}]",
                x - 0.3,
                x + 0.3,
                z + 0.1
            ),
        };
        let reflectance = triple(colour.map(|c| 0.7 * c / (1.0 - mirror)));
        let material = mirrored(&format!("\"rgb reflectance\" [{reflectance}]"), mirror);
        let material = material.replace("#d", &format!("d{number}"));
        let _ = writeln!(out, "AttributeBegin\n{material}  {shape}\nAttributeEnd");
    }
    out
}

/// The same field in the language of POV-Ray 3.7, whose axes are those of pbrt.
pub(crate) fn pov_scene() -> String {
    let mut out = String::from(POV_HEAD);
    for Cell { x, z, form, colour, mirror } in cells() {
        let shape = match form {
            Form::Sphere => format!("sphere {{ <{x:.2}, 0.25, {z:.2}>, 0.25"),
            Form::Box => {
                let [x0, x1, z0, z1] = [x - 0.2, x + 0.2, z - 0.2, z + 0.2];
                format!("box {{ <{x0:.2}, 0, {z0:.2}>, <{x1:.2}, 0.4, {z1:.2}>")
            }
            Form::Cylinder => format!("cylinder {{ <{x:.2}, 0, {z:.2}>, <{:.2}, 0.6, {z:.2}>, 0.15", x + 0.1),
            Form::Cone => format!("cone {{ <{x:.2}, 0, {z:.2}>, 0.25, <{x:.2}, 0.6, {z:.2}>, 0.05"),
            Form::Torus(degrees) => {
                format!("torus {{ 0.2, 0.08 rotate <{degrees:.6}, 0, 0> translate <{x:.2}, 0.25, {z:.2}>")
            }
            Form::Triangle => {
                let (x0, x1, z1) = (x - 0.3, x + 0.3, z + 0.1);
                format!("triangle {{ <{x0:.2}, 0, {z:.2}>, <{x1:.2}, 0, {z:.2}>, <{x:.2}, 0.6, {z1:.2}>")
            }
        };
        let [r, g, b] = colour;
        let _ = writeln!(
            out,
            "{shape} pigment {{ rgb <{r:.6}, {g:.6}, {b:.6}> }} finish {{ ambient 0 diffuse 0.7 reflection {mirror:.6} }} }}"
        );
    }
    out
}

/// The lamp has the sides, and lights the middle of the field as much, as that of the other scene.
const POV_HEAD: &str = "#version 3.7;
global_settings { assumed_gamma 1.0 max_trace_level 8 }
camera { perspective location <0, 4, -9> look_at <0, 0.7, 0> angle 45 right x*16/9 }
background { rgb <0.5, 0.6, 0.8> }
light_source { <6, 9, -6> rgb 1.2 area_light <1, 0, 0>, <0, 1, 0>, 4, 4 adaptive 1 jitter }
plane { y, 0
  pigment { checker rgb 0.9, rgb 0.25 scale 0.8 }
  finish { ambient 0 diffuse 0.7 reflection 0.1 }
}
";

const HEAD: &str = r#"# 625 exact shapes on a plane, written by `cargo xtask field`.
Film "rgb" "integer xresolution" 1280 "integer yresolution" 720 "string filename" "field.png"
Sampler "sobol" "integer pixelsamples" 4
PixelFilter "box"
Integrator "whitted" "integer maxdepth" 8
LookAt 0 4 -9  0 0.7 0  0 1 0
Camera "perspective" "float fov" 26.231288
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.8]
# A square lamp of side 1 that faces the middle of the field.
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [531.143 531.143 531.143]
  Shape "bilinearmesh" "point3 P" [5.893672 8.642566 -6.600779   6.600779 8.642566 -5.893672
    5.399221 9.357434 -6.106328   6.106328 9.357434 -5.399221]
AttributeEnd
MakeNamedMaterial "mirror" "string type" "conductor" "rgb reflectance" [1 1 1]
Texture "tiles" "spectrum" "checkerboard" "string mapping" "planar" "vector3 v1" [1.25 0 0] "vector3 v2" [0 0 1.25]
  "rgb tex1" [0.7 0.7 0.7] "rgb tex2" [0.194444 0.194444 0.194444]
MakeNamedMaterial "tiled" "string type" "diffuse" "texture reflectance" "tiles"
AttributeBegin
  Material "mix" "string materials" ["tiled" "mirror"] "float amount" 0.1
  Shape "plane" "normal normal" [0 1 0]
AttributeEnd
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_has_625_shapes_in_both_languages() {
        let kept = std::fs::read_to_string(xtask::command::root().join("scenes/field/field.pbrt")).unwrap();
        assert!(scene() == kept, "scenes/field/field.pbrt is another field");
        assert_eq!(pov_scene().matches(" pigment ").count() - 1, 625);
    }
}
