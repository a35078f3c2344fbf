#version 3.7;
global_settings { assumed_gamma 1 max_trace_level 4 radiosity { count 9 } }
#fopen F "f" write #write(F, 1.5, ",", <1, -2, 3>, ",\"text\"\n", 2) #fclose F
#fopen F "f" read #read(F, A, B, C) #ifdef (F) #read(F, D) #end
#local M = mesh { triangle { 0, x, y uv_vectors 0, u, v } smooth_triangle { x, z, y, z, x+y, -z } inside_vector z }
camera { mesh_camera { 2 0 mesh { M } mesh { M translate A*x } } location <0, 0, -.01> direction -z }
#macro Once(V, W) #local W = V.x; #ifndef (Never) function { V.y*x + W } #end #end
#declare G = Once(B, E)
#declare P = function { pigment { bozo turbulence 0.3 } }
#declare T = function { transform { rotate 10*y inverse } }
#declare Q = function { pattern { crackle metric 1 } }
isosurface { function { y - G(x, y, z)*0.1 + P(x, y, z).gray*T(x, 0, z).x - pow(abs(Q(x, y, z)), 1.5)*select(z, 1, 2) }
  contained_by { sphere { 0, 1 } } threshold 0.1 max_gradient 3 evaluate 1, 2, 0.5 open }
height_field { function 5, 4 { x*y } smooth water_level 0.1 normal { bump_map { function 4, 4 { x } bump_size 2 } } }
lathe { cubic_spline 4, <0, -1>, <1, 0>, <0.5, 1>, <0, 2> }
prism { conic_sweep linear_spline 0, 1, 4, <0, 0>, <1, 0>, <0, 1>, <0, 0> }
sor { 4, <0, -1>, <1, 0>, <0.5, 1>, <0, 2> open }
#switch (C = "text" ? 1 : 2) #range (0, 1) sphere { 0, 1 } #break #else #error "no" #end
