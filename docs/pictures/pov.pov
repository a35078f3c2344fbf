// A ball in a carved box.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 2.2, -6> right x*4/3 angle 40 look_at <0, 0.3, 0> }
background { rgb <0.5, 0.6, 0.8> }
light_source { <4, 7, -6> rgb 0.9 area_light 2*x, 2*z, 5, 5 adaptive 2 circular orient }
plane { y, -1 pigment { checker rgb <0.8, 0.75, 0.7>, rgb <0.35, 0.3, 0.3> } finish { reflection 0.1 } }
difference {
  box { -1, 1 }
  sphere { 0, 1.3 }
  pigment { marble turbulence 0.6 color_map { [0 rgb <0.9, 0.85, 0.8>] [1 rgb <0.4, 0.2, 0.15>] } scale 0.5 }
  finish { specular 0.4 roughness 0.02 }
  rotate y*30
}
sphere { 0, 0.8 pigment { rgb <0.9, 0.6, 0.2> } normal { bumps 0.2 scale 0.2 } finish { phong 0.6 reflection { 0.05, 0.4 } } }
