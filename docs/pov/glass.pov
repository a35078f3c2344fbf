// A glass ball and a glass ring on tiles.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 2.2, -5> right x*4/3 angle 42 look_at <0, 0.5, 0> }
background { rgb <0.6, 0.7, 0.9> }
light_source { <-4, 7, -3> rgb 0.9 }
plane { y, 0 pigment { checker rgb <0.85, 0.8, 0.7>, rgb <0.25, 0.3, 0.4> scale 0.6 } }
#declare Glass = material {
  texture { pigment { rgbf <0.95, 1, 0.97, 0.95> } finish { ambient 0 diffuse 0 specular 0.6 roughness 0.005 reflection { 0, 1 fresnel } conserve_energy } }
  interior { ior 1.5 fade_distance 1.5 fade_power 1001 fade_color rgb <0.4, 0.8, 0.6> }
}
sphere { <-0.9, 0.9, 0>, 0.9 material { Glass } }
torus { 0.6, 0.25 rotate x*70 rotate y*-30 translate <1, 0.83, -0.3> material { Glass } }
sphere { <0.4, 0.35, 1.4>, 0.35 pigment { rgb <0.9, 0.4, 0.1> } finish { phong 0.5 } }
