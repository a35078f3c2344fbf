//! Names in a glTF that one can choose from.

use lumbre_scene::AnimationListing;

use super::accessor::Accessor;
use super::file::{File, List};
use super::json::Read;

/// All animations, in the order of their indices. They were checked before.
pub(super) fn animations(file: &File<'_>) -> Read<Vec<AnimationListing>> {
    let mut list = vec![];
    for animation in file.list(List::Animations) {
        let name = animation.string_at("name")?.map(Into::into);
        let mut end: Option<f64> = None;
        for sampler in animation.need("samplers")?.array()? {
            // The specification requires the bounds of times.
            if let Some([_, [last]]) = Accessor::named(file, sampler.need("input")?)?.bounds()? {
                end = Some(end.map_or(last, |end| end.max(last)));
            }
        }
        list.push(AnimationListing { name, end });
    }
    Ok(list)
}

/// The names of all material variants.
pub(super) fn variants(file: &File<'_>) -> Read<Vec<String>> {
    let names = file.list(List::Variants).iter();
    names.map(|variant| Ok(variant.need("name")?.string()?.into_owned())).collect()
}
