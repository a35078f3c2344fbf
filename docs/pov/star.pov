// A prism with a star for its outline.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0.5, 3.5, -5> right x*4/3 angle 34 look_at <0, 0.2, 0> }
background { rgb <0.85, 0.8, 0.75> }
light_source { <-4, 7, -3> rgb 0.85 area_light 1.5*x, 1.5*z, 4, 4 adaptive 1 circular orient }
plane { y, 0 pigment { rgb <0.6, 0.55, 0.5> } }
difference {
  prism { linear_sweep 0, 0.6, 11,
    #for (I, 0, 10) #local R = (mod(I, 2) = 0 ? 1.5 : 0.65); <R*sin(I*pi/5), R*cos(I*pi/5)> #end
  }
  torus { 0.75, 0.18 translate y*0.6 }
  pigment { wood turbulence 0.05 color_map { [0 rgb <0.8, 0.6, 0.35>] [1 rgb <0.55, 0.33, 0.15>] } scale 0.3 rotate x*85 }
  finish { specular 0.2 roughness 0.05 }
}
