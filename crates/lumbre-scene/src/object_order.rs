//! The order in which objects are built.

use crate::{BuildError, ObjectDesc};

/// The maximal depth of nested objects.
const MAX_NESTING: usize = 64;

/// An order of building objects in which nested ones come first.
pub(crate) fn inside_out(objects: &[ObjectDesc]) -> Result<Vec<usize>, BuildError> {
    #[derive(Clone, Copy, PartialEq)]
    enum Mark {
        New,
        Open,
        Done,
    }
    let mut marks = vec![Mark::New; objects.len()];
    let mut order = Vec::with_capacity(objects.len());
    for start in 0..objects.len() {
        // The objects being visited, with the position in each.
        let mut open = vec![(start, 0)];
        if marks[start] != Mark::New {
            continue;
        }
        marks[start] = Mark::Open;
        while let Some((object, next)) = open.last_mut() {
            let Some(instance) = objects[*object].instances.get(*next) else {
                marks[*object] = Mark::Done;
                order.push(*object);
                open.pop();
                continue;
            };
            *next += 1;
            let inner = instance.object.0 as usize;
            match marks.get(inner) {
                None => {
                    return Err(BuildError::NoSuchObject { object: instance.object.0, count: objects.len() });
                }
                Some(Mark::Done) => {}
                Some(Mark::Open) => {
                    return Err(BuildError::ObjectCycle { name: objects[inner].name.clone() });
                }
                Some(Mark::New) => {
                    marks[inner] = Mark::Open;
                    open.push((inner, 0));
                }
            }
        }
    }
    let mut depths = vec![0_usize; objects.len()];
    for &object in &order {
        let inner = objects[object].instances.iter().map(|i| depths[i.object.0 as usize] + 1);
        depths[object] = inner.max().unwrap_or(0);
        if depths[object] >= MAX_NESTING {
            let name = objects[object].name.clone();
            return Err(BuildError::NestedTooDeeply { name, limit: MAX_NESTING });
        }
    }
    Ok(order)
}
