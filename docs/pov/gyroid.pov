// A gyroid within a ball: the surface of a function.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 1.5, -4> right x*4/3 angle 40 look_at 0 }
background { rgb <0.08, 0.1, 0.14> }
light_source { <-3, 5, -4> rgb <1, 0.95, 0.9> }
light_source { <5, 1, -2> rgb <0.2, 0.3, 0.5> }
isosurface {
  function { abs(sin(5*x)*cos(5*y) + sin(5*y)*cos(5*z) + sin(5*z)*cos(5*x)) - 0.25 }
  contained_by { sphere { 0, 1.2 } }
  max_gradient 10 accuracy 0.001
  pigment { gradient y color_map { [0 rgb <0.9, 0.3, 0.2>] [1 rgb <0.95, 0.8, 0.3>] } scale 2.4 translate y*-1.2 }
  finish { specular 0.4 roughness 0.03 }
}
plane { y, -1.3 pigment { hexagon rgb 0.5, rgb 0.4, rgb 0.3 scale 0.5 } }
