// A cube with round sides: x⁴ + y⁴ + z⁴ = 1.
#version 3.7;
camera { location <0, 0, -5> look_at 0 }
light_source { <5, 5, -5> 1 }
isosurface {
  function { x*x*x*x + y*y*y*y + z*z*z*z - 1 }
  contained_by { box { -1.1, 1.1 } }
  max_gradient 7
  pigment { rgb 1 }
}
