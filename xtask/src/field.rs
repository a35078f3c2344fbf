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

    /// A material of the field: a colour under a mirror of up to 20 %.
    fn material(&mut self) -> String {
        let colour = [0; 3].map(|_| self.next() * 0.8 + 0.2);
        let mirror = 0.2 * self.next();
        mirrored(
            &format!("\"rgb reflectance\" [{}]", triple(colour.map(|c| 0.7 * c / (1.0 - mirror)))),
            mirror,
        )
    }
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

/// The scene.
pub(crate) fn scene() -> String {
    let mut random = Random(7);
    let mut out = String::from(HEAD);
    let mut number = 0;
    for i in -12..=12 {
        for j in -12..=12 {
            let (x, z) = (f64::from(i) * 0.7, f64::from(j) * 0.7);
            let kind = (random.next() * 6.0) as u32;
            let shape = match kind {
                0 => format!("Shape \"sphere\" \"point3 center\" [{x:.2} 0.25 {z:.2}] \"float radius\" 0.25"),
                1 => format!(
                    "Shape \"box\" \"point3 p0\" [{:.2} 0 {:.2}] \"point3 p1\" [{:.2} 0.4 {:.2}]",
                    x - 0.2,
                    z - 0.2,
                    x + 0.2,
                    z + 0.2
                ),
                2 => format!(
                    "Shape \"cylinder\" \"point3 p0\" [{x:.2} 0 {z:.2}] \"point3 p1\" [{:.2} 0.6 {z:.2}] \
                     \"float radius\" 0.15 \"bool caps\" true",
                    x + 0.1
                ),
                3 => format!(
                    "Shape \"cone\" \"point3 p0\" [{x:.2} 0 {z:.2}] \"point3 p1\" [{x:.2} 0.6 {z:.2}] \
                     \"float radius\" 0.25 \"float topradius\" 0.05 \"bool caps\" true"
                ),
                4 => {
                    let turn = (90.0 * random.next()).to_radians();
                    format!(
                        "Shape \"torus\" \"point3 center\" [{x:.2} 0.25 {z:.2}] \"vector3 axis\" [0 {:.6} {:.6}] \
                         \"float majorradius\" 0.2 \"float minorradius\" 0.08",
                        turn.cos(),
                        turn.sin()
                    )
                }
                _ => format!(
                    "Shape \"triangle\" \"point3 p0\" [{:.2} 0 {z:.2}] \"point3 p1\" [{:.2} 0 {z:.2}] \
                     \"point3 p2\" [{x:.2} 0.6 {:.2}]",
                    x - 0.3,
                    x + 0.3,
                    z + 0.1
                ),
            };
            let material = random.material().replace("#d", &format!("d{number}"));
            let _ = writeln!(out, "AttributeBegin\n{material}  {shape}\nAttributeEnd");
            number += 1;
        }
    }
    out
}

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
