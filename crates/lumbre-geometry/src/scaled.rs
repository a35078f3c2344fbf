//! Rays whose direction is so long or so short that its square is no number: solved with a direction of about unit
//! length.

use lumbre_math::DVec3;

use crate::{Ray, Root, Roots, Surface};

/// The first of the roots that `solve` appends.
#[cold]
#[inline(never)]
pub(crate) fn closest(ray: &Ray, solve: impl FnOnce(&Ray, &mut Roots)) -> Option<Root> {
    let mut found = Roots::new();
    roots(ray, &mut found, solve);
    found.first().copied()
}

/// Appends the roots that `solve` finds along the scaled ray, where `t` of the given one is a number in its range.
#[cold]
#[inline(never)]
pub(crate) fn roots(ray: &Ray, out: &mut Roots, solve: impl FnOnce(&Ray, &mut Roots)) {
    let Some((scaled, [one, other])) = ray.with_direction_scaled() else {
        return;
    };
    let mut found = Roots::new();
    solve(&scaled, &mut found);
    let given = found.into_iter().map(|root| Root { t: root.t / one / other, ..root });
    out.extend(given.filter(|root| root.t.is_finite() && ray.contains(root.t)));
}

/// The surface that `solve` finds along the scaled ray.
#[cold]
#[inline(never)]
pub(crate) fn surface(ray: &Ray, root: &Root, solve: impl FnOnce(&Ray, &Root) -> Surface) -> Surface {
    match ray.with_direction_scaled() {
        Some((scaled, [one, other])) => solve(&scaled, &Root { t: root.t * one * other, ..*root }),
        // A direction that is none has no roots: any surface will do.
        None => solve(&Ray::new(ray.origin, DVec3::Z), root),
    }
}

/// The density that `solve` finds along the scaled ray.
#[cold]
#[inline(never)]
pub(crate) fn pdf_direction(ray: &Ray, solve: impl FnOnce(&Ray) -> f64) -> f64 {
    ray.with_direction_scaled().map_or(0.0, |(scaled, _)| solve(&scaled))
}
