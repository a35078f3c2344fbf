//! Tests of the shapes through their interface, in one binary, which links once.

mod contract;
mod conventions;
mod csg;
mod curves;
mod exactness;
mod explain;
mod explain_flat;
mod explain_formulas;
mod extremes;
mod nearest;
mod precision;
mod solid_angle;
mod tori;
mod triangles;
mod vectors;
