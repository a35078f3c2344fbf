//! Surfaces that are nowhere to be seen.

use lumbre_shading::{FloatTexture, Texture};

/// Whether a surface of this alpha is invisible everywhere. In glTF and OBJ it then emits nothing. In pbrt-v4's
/// language the light of a constant alpha of 0 stays: such a scene has a lamp that no ray hits.
pub(crate) fn is_unseen(alpha: Option<&FloatTexture>) -> bool {
    match alpha {
        Some(Texture::Constant(alpha)) => *alpha <= 0.0,
        Some(Texture::Product(factors)) => factors.iter().any(|factor| is_unseen(Some(factor))),
        Some(Texture::Step { input, edge, values: [below, _] }) => {
            *below <= 0.0 && *edge > 0.0 && is_unseen(Some(input))
        }
        _ => false,
    }
}
