// Turned marble and a wooden table.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 2.4, -5.5> right x*4/3 angle 38 look_at <0, 0.9, 0> }
background { rgb <0.75, 0.75, 0.7> }
light_source { <4, 7, -5> rgb 0.9 area_light 2*x, 2*y, 4, 4 adaptive 1 circular orient }
plane { y, 0
  pigment { wood turbulence 0.06 color_map { [0 rgb <0.62, 0.38, 0.2>] [0.8 rgb <0.45, 0.25, 0.12>] [1 rgb <0.36, 0.19, 0.09>] } scale 0.25 rotate y*80 rotate x*3 }
  finish { reflection 0.06 }
}
#declare Vase = lathe { cubic_spline 8, <0.3, -0.3>, <0.35, 0>, <0.8, 0.5>, <0.55, 1.1>, <0.25, 1.5>, <0.45, 1.9>, <0.5, 2>, <0.5, 2.2> }
object { Vase pigment { marble turbulence 0.8 color_map { [0 rgb <0.92, 0.9, 0.85>] [0.7 rgb <0.8, 0.75, 0.7>] [1 rgb <0.25, 0.2, 0.25>] } scale 0.5 rotate z*40 } finish { specular 0.5 roughness 0.02 } translate x*-1 }
object { Vase pigment { granite color_map { [0 rgb <0.15, 0.25, 0.2>] [1 rgb <0.5, 0.8, 0.6>] } scale 0.6 } finish { specular 0.5 roughness 0.02 } scale <0.8, 0.7, 0.8> translate <1.1, 0, 0.2> }
