//! Point and spot lights in lanes.

use lumbre_simd::{Double, Mask, Real, UInt, V3};

use super::sample::LaneLightSample;
use super::table::{Table, point};

/// The light of the point or spot light of each active lane.
#[inline(always)]
pub(super) fn sample<R: Real>(
    table: &Table,
    active: R::Mask,
    emitter: R::UInt,
    from: V3<R::Double>,
) -> LaneLightSample<R> {
    let emitter = R::UInt::select(active, emitter, R::UInt::splat(0));
    let rows = table.piece_rows::<R>(emitter, active);
    let position = table.corner::<R>(emitter);
    let arm = (position - from).to_single();
    let squared = arm.length_squared();
    let towards = arm * squared.sqrt().recip();
    // A smooth step between the cosines; a hard edge where there is no room.
    let cosine = -towards.dot(rows.vector(point::AXIS));
    let (start, end) = (rows.number(point::COS_START), rows.number(point::COS_END));
    let x = ((cosine - end) / (start - end)).simd_max(R::zero()).simd_min(R::one());
    let smooth = x * x * (R::splat(3.0) - R::splat(2.0) * x);
    let hard = R::one().or_zero(cosine.simd_ge(end));
    let share = R::select(start.simd_le(end), hard, smooth);
    let radiance = rows.vector(point::INTENSITY) * (share / squared);
    let none = R::Mask::splat(false);
    let nowhere = V3::splat(R::Double::splat(0.0));
    LaneLightSample {
        towards,
        point: position,
        error: nowhere,
        normal: V3::splat(R::zero()),
        infinite: none,
        radiance,
        pdf: R::zero(),
        delta: active,
        source: R::UInt::splat(0),
        valid: active
            & share.simd_gt(R::zero())
            & squared.simd_gt(R::zero())
            & radiance.max_component().is_finite(),
    }
}
