#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 1, -5> look_at 0 angle 40 }
light_source { <2, 3, -5> rgb 1 spotlight radius 10 falloff 20 point_at 0 }
#macro Ball(P, R) sphere { P, R pigment { rgb <R, 0.5, 0> } } #end
#declare I = 0;
#while (I < 3) Ball(<I, 0, 0>, 0.3 + I/10) #declare I = I + 1; #end
difference { box { -1, 1 } cylinder { -2*y, 2*y, 0.4 } texture { pigment { marble turbulence 0.5 color_map { [0 rgb 1] [1 rgb <0,0,1>] } } normal { bumps 0.3 } finish { phong 0.5 reflection { 0.1, 0.4 falloff 2 } } } }
#declare F = function(x, y) { sin(x) + sum(i, 1, 3, y/i) };
#declare S = spline { cubic_spline 0, x, 1, y, 2, z, 3, x };
torus { 1, F(0.1, 0.2) translate S(1.5) rotate <10, 20, 30> clipped_by { plane { y, 0 } } }
