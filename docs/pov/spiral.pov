// A stair that turns, made in a loop.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 3.4, -6.5> right x*4/3 angle 38 look_at <0, 1.5, 0> }
background { rgb <0.5, 0.65, 0.85> }
light_source { <-4, 8, -5> rgb 0.9 area_light 2*x, 2*z, 4, 4 adaptive 1 circular orient }
plane { y, 0 pigment { rgb <0.55, 0.6, 0.5> } }
cylinder { 0, y*3.4, 0.25 pigment { rgb 0.8 } finish { reflection { 0.05, 0.3 } } }
#for (I, 0, 23)
  box { <0.2, 0, -0.25>, <1.5, 0.1, 0.25>
    translate y*(0.14*I) rotate y*(-22*I)
    pigment { rgb <0.5 + 0.4*sin(I*0.4), 0.4, 0.5 + 0.4*cos(I*0.4)> }
  }
  sphere { <1.4, 0.14*I + 0.55, 0>, 0.06 rotate y*(-22*I) pigment { rgb <0.9, 0.75, 0.3> } finish { specular 0.6 metallic } }
#end
