//! Values of options that are one of some names.

use clap::builder::{PossibleValuesParser, TypedValueParser};

/// A parser of one of these names: help and completions list them, and a wrong one is answered with them and the
/// nearest. `from_name` knows all of them.
pub(crate) fn one_of<T: Clone + Send + Sync + 'static>(
    names: &'static [&'static str],
    from_name: fn(&str) -> Option<T>,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(names)
        .try_map(move |name| from_name(&name).ok_or_else(|| format!("\"{name}\" is not known")))
}

#[cfg(test)]
mod tests {
    use lumbre::description::IntegratorKind;
    use lumbre::image::{Metric, ToneMap};
    use lumbre::shading::ShadingNormals;
    use lumbre::{Feature, Ground};

    use crate::denoiser::Choice;
    use crate::render;

    #[test]
    fn every_name_that_is_listed_is_known() {
        assert!(IntegratorKind::NAMES.iter().all(|name| IntegratorKind::from_name(name).is_some()));
        assert!(render::SHADING_NORMALS.iter().all(|name| ShadingNormals::from_name(name).is_some()));
        assert!(ToneMap::NAMES.iter().all(|name| ToneMap::from_name(name).is_some()));
        assert!(Feature::NAMES.iter().all(|name| Feature::from_name(name).is_some()));
        assert!(Metric::NAMES.iter().all(|name| Metric::from_name(name).is_some()));
        assert!(Choice::NAMES.iter().all(|name| Choice::from_name(name).is_some()));
        assert!(Ground::NAMES.iter().all(|name| Ground::from_name(name).is_some()));
    }
}
