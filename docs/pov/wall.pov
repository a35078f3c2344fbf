// A wall of bricks under two spotlights.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 1.4, -4.5> right x*4/3 angle 45 look_at <0, 1.1, 0> }
light_source { <-1.6, 3, -2> rgb <1, 0.8, 0.55>*1.2 spotlight point_at <-0.8, 1, 0> radius 18 falloff 32 }
light_source { <1.6, 3, -2> rgb <0.5, 0.65, 1>*1.2 spotlight point_at <0.8, 1, 0> radius 18 falloff 32 }
light_source { <0, 2, -6> rgb 0.12 }
plane { z, 0
  hollow
  texture {
    pigment { brick pigment { rgb 0.55 } pigment { bozo turbulence 0.4 color_map { [0 rgb <0.6, 0.25, 0.15>] [1 rgb <0.4, 0.15, 0.1>] } scale 0.2 } brick_size <0.5, 0.2, 0.3> mortar 0.025 }
    normal { brick normal { granite 0.05 }, normal { bumps 0.4 scale 0.04 } brick_size <0.5, 0.2, 0.3> mortar 0.025 }
  }
  translate y*0.01
}
plane { y, 0 pigment { rgb 0.35 } finish { reflection 0.1 } }
sphere { <0, 0.5, -0.9>, 0.5 pigment { crackle solid color_map { [0 rgb <0.9, 0.8, 0.2>] [1 rgb <0.2, 0.5, 0.4>] } scale 0.25 } finish { phong 0.7 } }
