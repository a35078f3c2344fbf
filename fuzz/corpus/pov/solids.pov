#version 3.7; global_settings { assumed_gamma 1 }
camera { orthographic location <0, 1, -5> look_at 0 angle 40 }
light_source { <2, 3, -5> 1 media_attenuation on }
media { absorption 0.01 }
sphere_sweep { b_spline 4, -x, 0.3, 0, 0.4, x, 0.2, x+y, 0.3 }
julia_fractal { <-0.1, 0, -0.8, 0> hypercomplex cube max_iteration 5 precision 20 slice <0, 0, 0.1, 1>, 0.1 }
quartic { <1, 0, 0, 0, 2, 0, 0, 2, 0, -2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 2, 0, 2, 0, 0, 0, 0, 1, 0, 2, 0, 0.5> }
blob { threshold 0.5 sphere { 0, 1, 1 } cylinder { -x, x, 0.4, 0.7 } }
box { -1, 1 hollow pigment { object { sphere { 0, 1.2 } rgbt 1, rgbt x } }
  interior { ior 1.2 media { emission 0.1 scattering { 5, 0.2 eccentricity 0.3 }
    density { spherical density_map { [0 rgb 0] [1 rgb 2] } } } } }
plane { y, -1 pigment { average pigment_map { [magnet 1 julia <0.5, 0.3>, 9] [2 bozo] } } }
