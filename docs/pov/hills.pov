// Hills in fog at a lake.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0.5, 0.35, -0.5> right x*4/3 angle 55 look_at <0.5, 0.1, 0.5> }
sky_sphere { pigment { gradient y color_map { [0 rgb <0.95, 0.8, 0.65>] [0.5 rgb <0.35, 0.5, 0.8>] } } }
light_source { <-6, 4, 1> rgb <1, 0.9, 0.75> parallel point_at 0 }
fog { distance 3 rgb <0.75, 0.75, 0.8> }
height_field {
  function 120, 120 { 0.4 + 0.28*sin(9*x + 2*sin(4*y))*cos(7*y + x) + 0.05*sin(31*x + 17*y) }
  smooth
  pigment { gradient y color_map { [0.25 rgb <0.3, 0.42, 0.2>] [0.5 rgb <0.45, 0.4, 0.3>] [0.7 rgb 0.9] } }
  scale <1, 0.35, 1>
}
plane { y, 0.13 hollow pigment { rgb <0.05, 0.12, 0.16> } normal { ripples 0.05 scale 0.05 } finish { reflection { 0.1, 0.9 falloff 3 } } }
