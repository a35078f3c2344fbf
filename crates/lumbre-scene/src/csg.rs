//! CSG whose surfaces keep their own materials.

use std::sync::Arc;

use lumbre_geometry::{Csg, PlacedShape, Shape};
use lumbre_math::Transform;

use crate::build::{Builder, emission};
use crate::mesh::QuadOrder;
use crate::solid::MeshSolid;
use crate::surface::{ColourRamp, CsgForm, Form, SurfaceEntry};
use crate::{BuildError, CsgDesc, CsgOperation, GeometryDesc, ShapeDesc, mesh};

/// Resolves a CSG in the space of its tree. `builder` provides the materials.
///
/// # Errors
/// [`BuildError::Csg`], naming the part at fault, and the errors of [`crate::mesh::bake`].
pub(crate) fn build(
    builder: &mut Builder,
    shape: u32,
    desc: CsgDesc,
    tree_from_csg: &Transform,
    reverse: bool,
) -> Result<CsgForm, BuildError> {
    let mut leaves = Vec::new();
    let csg = combine(builder, shape, desc, tree_from_csg, reverse, &mut leaves, 0)?;
    debug_assert_eq!(csg.leaves().len(), leaves.len());
    Ok(CsgForm { csg, leaves })
}

fn combine(
    builder: &mut Builder,
    shape: u32,
    desc: CsgDesc,
    tree_from_csg: &Transform,
    reverse: bool,
    leaves: &mut Vec<SurfaceEntry>,
    depth: usize,
) -> Result<Csg, BuildError> {
    let wrong = |reason: String| BuildError::Csg { shape, reason };
    // Including its solids, and unions of them as operands.
    if depth + 2 > Csg::MAX_DEPTH {
        return Err(wrong(format!("csg shapes hold csg shapes to a depth of more than {}", Csg::MAX_DEPTH)));
    }
    if desc.operands.len() < 2 {
        return Err(wrong(format!("found {} operands, expected two or more", desc.operands.len())));
    }
    let mut operands = Vec::with_capacity(desc.operands.len());
    for (position, parts) in desc.operands.into_iter().enumerate() {
        let mut solids = Vec::with_capacity(parts.len());
        for part in Arc::unwrap_or_clone(parts) {
            solids.push(solid(builder, part, tree_from_csg, reverse, leaves, depth)?);
        }
        let operand = match solids.len() {
            0 => return Err(wrong(format!("operand {position} holds no shape"))),
            1 => solids.swap_remove(0),
            _ => Csg::union(solids).map_err(|e| wrong(e.to_string()))?,
        };
        operands.push(operand);
    }
    let combined = match desc.operation {
        CsgOperation::Union => Csg::union(operands),
        CsgOperation::Intersection => Csg::intersection(operands),
        CsgOperation::Difference => Csg::difference(operands),
    };
    combined.map_err(|e| wrong(e.to_string()))
}

/// One shape of an operand. Its surfaces are appended to `leaves` in the geometry's order.
fn solid(
    builder: &mut Builder,
    desc: ShapeDesc,
    tree_from_csg: &Transform,
    reverse: bool,
    leaves: &mut Vec<SurfaceEntry>,
    depth: usize,
) -> Result<Csg, BuildError> {
    let shape = desc.index;
    let wrong = |reason: String| BuildError::Csg { shape, reason };
    let mut entry = builder.entry(&desc)?;
    entry.reverse ^= reverse;
    if let Some(light) = builder.wanted_light(&desc, &entry) {
        if light.power.is_some() {
            return Err(wrong("a part of a csg cannot shine by power, for its area is not known".to_owned()));
        }
        entry.emission = Some(emission(light, || 0.0));
    }
    let placement = *tree_from_csg * desc.world_from_object;
    let mut leaf = |entry: SurfaceEntry, exact: Shape| {
        let leaf = Csg::leaf(PlacedShape::new(exact, placement)).map_err(|e| wrong(e.to_string()))?;
        leaves.extend(std::iter::repeat_n(entry, leaf.leaves().len()));
        Ok(leaf)
    };
    match desc.geometry {
        GeometryDesc::Exact(exact) => leaf(entry, exact),
        GeometryDesc::Coloured(coloured) => {
            entry.form = Form::Coloured(Box::new(ColourRamp::new(&coloured, &placement)));
            leaf(entry, coloured.shape)
        }
        GeometryDesc::Mesh(mesh) => {
            let origin = crate::placed_bounds::near(&crate::placed_bounds::mesh_bounds(&mesh, &placement));
            // It is closed as it is written, and would not be with parts.
            let baked = mesh::bake(shape, mesh, &placement, origin, QuadOrder::Around, false)?;
            if !baked.patches.is_empty() {
                return Err(wrong("a mesh in a csg must have flat faces".to_owned()));
            }
            let solid = MeshSolid::new(baked.attributes.mesh.clone()).map_err(|e| wrong(e.to_string()))?;
            leaves.push(SurfaceEntry { form: Form::Mesh(baked.attributes), ..entry });
            Csg::solid(Arc::new(solid)).map_err(|e| wrong(e.to_string()))
        }
        GeometryDesc::BilinearMesh(_) => Err(wrong("a bilinear mesh is no solid".to_owned())),
        GeometryDesc::Curves(_) => Err(wrong("a curve is no solid".to_owned())),
        GeometryDesc::Custom(_) => Err(wrong("custom geometry is not known to be a solid".to_owned())),
        GeometryDesc::Csg(inner) => {
            let reverse = entry.reverse;
            combine(builder, shape, inner, &placement, reverse, leaves, depth + 1)
        }
    }
}

/// The exact shape of a CSG, for the tree.
pub(crate) fn shape_of(form: &CsgForm) -> PlacedShape {
    PlacedShape::new(Shape::from(form.csg.clone()), Transform::IDENTITY)
}
