// A knot swept by a ball.
#version 3.7;
global_settings { assumed_gamma 1 }
camera { location <0, 3, -6> right x*4/3 angle 40 look_at <0, 0.1, 0> }
background { rgb <0.9, 0.88, 0.85> }
light_source { <-4, 8, -4> rgb 0.9 }
light_source { <5, 3, -3> rgb 0.25 shadowless }
plane { y, -1 pigment { rgb <0.6, 0.6, 0.65> } }
sphere_sweep { cubic_spline 27,
  #for (I, -1, 25) <(1.3 + 0.55*cos(3*I*pi/12))*cos(2*I*pi/12), 0.6*sin(3*I*pi/12), (1.3 + 0.55*cos(3*I*pi/12))*sin(2*I*pi/12)>, 0.26 #end
  pigment { onion sine_wave frequency 2 color_map { [0 rgb <0.1, 0.4, 0.6>] [1 rgb <0.85, 0.9, 0.9>] } }
  finish { specular 0.5 roughness 0.02 reflection { 0.02, 0.25 } }
}
