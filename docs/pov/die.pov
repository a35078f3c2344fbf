// A die: a box, rounded by a sphere, with balls cut out of its faces.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <2.6, 2.8, -4.2> right x*4/3 angle 38 look_at <0, -0.1, 0> }
background { rgb <0.45, 0.6, 0.85> }
light_source { <-3, 6, -4> rgb 1 area_light 2*x, 2*z, 4, 4 adaptive 1 circular orient }
plane { y, -1 pigment { rgb <0.25, 0.45, 0.3> } }
#macro Pip(X, Y, Z) sphere { <X, Y, Z>, 0.2 } #end
difference {
  intersection { box { -1, 1 } sphere { 0, 1.42 } }
  union {
    Pip(0, 1, 0)
    Pip(-0.45, -0.45, -1) Pip(0.45, 0.45, -1) Pip(0, 0, -1)
    #for (I, -1, 1) Pip(1, I*0.5, -0.4) Pip(1, I*0.5, 0.4) #end
    pigment { rgb 0.05 }
  }
  pigment { rgb <0.85, 0.1, 0.08> }
  finish { phong 0.6 phong_size 60 reflection { 0.02, 0.3 } }
}
