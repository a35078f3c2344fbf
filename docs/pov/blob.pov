// Drops that run together.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 2, -5.5> right x*4/3 angle 38 look_at <0, 0.4, 0> }
sky_sphere { pigment { gradient y color_map { [0 rgb <0.9, 0.85, 0.8>] [0.6 rgb <0.3, 0.5, 0.85>] } } }
light_source { <-5, 8, -4> rgb 0.9 }
plane { y, -0.6 pigment { rgb <0.5, 0.45, 0.5> } finish { reflection 0.1 } }
blob {
  threshold 0.5
  #for (I, 0, 6) sphere { <1.2*cos(I*2*pi/7), 0.3*sin(I*5), 1.2*sin(I*2*pi/7)>, 0.9, 1 } #end
  cylinder { <0, -0.4, 0>, <0, 1.4, 0>, 0.6, 1 }
  sphere { <0, 1.6, 0>, 0.8, 1 }
  pigment { rgb <0.9, 0.7, 0.3> }
  finish { ambient 0.05 diffuse 0.35 specular 0.7 roughness 0.02 metallic reflection { 0.4, 0.7 metallic } }
}
