//! Invertible affine maps that change over time.

use crate::Elementary;
use glam::{DAffine3, DMat3, DVec3};

use crate::quaternion;
use crate::transform::{Transform, inverse_linear};
use crate::vector;

/// An affine map keyed at several times and interpolated by parts: translation and stretch linearly, rotation
/// at constant speed about one axis, by the shorter arc.
///
/// Before the first key and after the last the map is constant. After M. Pharr, W. Jakob, G. Humphreys,
/// "Physically Based Rendering", 4th edition, 2023, "Animating Transformations" (polar decomposition: K.
/// Shoemake, T. Duff, "Matrix Animation and Polar Decomposition", Graphics Interface 1992). Unlike there, there
/// may be more than two keys, and mirrors may move: they are a rotation after a stretch by negative factors.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimatedTransform {
    // At least one, by ascending time.
    keys: Vec<(f64, Transform)>,
    // One between each key and the next.
    segments: Vec<Segment>,
    condition: f64,
}

/// Why keys make no animation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum AnimationError {
    /// There are no keys.
    Empty,
    /// A time is not finite, or not later than the one before.
    Times {
        /// The index of the key.
        key: usize,
    },
    /// The map is a mirror and the one before is not, or the other way round: in between, it would be singular.
    Mirrored {
        /// The index of the key.
        key: usize,
    },
    /// The map's condition number is above 1e8.
    Degenerate {
        /// The index of the key.
        key: usize,
    },
}

impl std::fmt::Display for AnimationError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Empty => f.write_str("an animation without a moment"),
            Self::Times { key } => write!(f, "moment {key} is not later than the one before it"),
            Self::Mirrored { key } => write!(f, "between moment {key} and the one before it lies a mirror"),
            Self::Degenerate { key } => write!(f, "the transform at moment {key} is almost flat"),
        }
    }
}

impl std::error::Error for AnimationError {}

/// The largest condition number of a map.
const MAX_CONDITION: f64 = 1e8;

/// A linear map as a stretch followed by a rotation. The stretch is symmetric and definite.
#[derive(Clone, Copy)]
struct Polar {
    turn: DMat3,
    stretch: DMat3,
    condition: f64,
}

impl Polar {
    /// By Newton's iteration (N. Higham, "Computing the Polar Decomposition", SIAM J. Sci. Stat. Comput. 7(4),
    /// 1986). `None` where the map is almost singular.
    fn new(linear: &DMat3, is_mirror: bool) -> Option<Self> {
        let size = linear.to_cols_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let mut turn = *linear * (1.0 / size);
        for _ in 0..100 {
            let next = 0.5 * (turn + turn.inverse().transpose());
            let change = frobenius(&(next - turn));
            turn = next;
            if change.is_nan() || change < 1e-15 {
                break;
            }
        }
        let stretch = turn.transpose() * *linear;
        let mut stretch = 0.5 * (stretch + stretch.transpose());
        if is_mirror {
            (turn, stretch) = (-1.0 * turn, -1.0 * stretch);
        }
        // The Frobenius norm bounds the spectral norm.
        let condition = frobenius(&stretch) * frobenius(&inverse_linear(&stretch)?);
        (turn.is_finite() && condition <= MAX_CONDITION).then_some(Self { turn, stretch, condition })
    }
}

fn frobenius(m: &DMat3) -> f64 {
    m.to_cols_array().into_iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The interpolation from one key to the next.
#[derive(Clone, Debug, PartialEq)]
struct Segment {
    start: f64,
    duration: f64,
    turn: DMat3,
    /// A unit vector, and the angle about it in radians, in [0, π].
    axis: DVec3,
    angle: f64,
    stretch: DMat3,
    stretch_change: DMat3,
    /// The inverse of a constant stretch.
    unstretch: Option<DMat3>,
    translation: DVec3,
    translation_change: DVec3,
}

impl Segment {
    fn new(start: f64, end: f64, from: &Polar, to: &Polar, translations: [DVec3; 2]) -> Self {
        let turn = quaternion::from_matrix(&(from.turn.transpose() * to.turn));
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let sine = vector::length(turn.xyz());
        let axis = vector::unit(turn.xyz()).unwrap_or(DVec3::Z);
        // Rounding errors of the decomposition are no rotation and no change.
        let angle = if sine < 1e-14 { 0.0 } else { 2.0 * sine.angle_from(turn.w) };
        let change = to.stretch - from.stretch;
        let is_rigid = frobenius(&change) <= 1e-14 * frobenius(&from.stretch);
        Self {
            start,
            duration: end - start,
            turn: from.turn,
            axis,
            angle,
            stretch: from.stretch,
            stretch_change: if is_rigid { DMat3::ZERO } else { change },
            unstretch: if is_rigid { inverse_linear(&from.stretch) } else { None },
            translation: translations[0],
            translation_change: translations[1] - translations[0],
        }
    }

    /// The map at a fraction of the segment.
    fn at(&self, part: f64) -> Transform {
        // Rodrigues' formula.
        let cross = vector::cross_matrix(self.axis);
        let (sin, cos) = (part * self.angle).sine_cosine();
        let turn = self.turn * (DMat3::IDENTITY + sin * cross + (1.0 - cos) * (cross * cross));
        let stretch = self.stretch + part * self.stretch_change;
        // A stretch between two definite ones of the same sign is no flatter than both.
        let unstretch =
            self.unstretch.or_else(|| inverse_linear(&stretch)).unwrap_or_else(|| stretch.inverse());
        let translation = self.translation + part * self.translation_change;
        let inverse = unstretch * turn.transpose();
        Transform::from_parts(
            DAffine3 { matrix3: turn * stretch, translation },
            DAffine3 { matrix3: inverse, translation: -(inverse * translation) },
        )
    }

    /// A bound on the second derivative, by the fraction of the segment, of any point of a box with this centre
    /// and half-size.
    ///
    /// The point is τ(s) + R E(s) S(s) p, where τ and S are linear in s and E = exp(s θ K), |K| = 1. Its second
    /// derivative is R (θ² K² E S p + 2 θ K E S' p), at most θ² |S p| + 2 θ |S' p|; and |S(s) p| is at most
    /// max(|S(0) p|, |S(1) p|).
    fn curvature(&self, center: DVec3, half: DVec3) -> f64 {
        let reach = |m: &DMat3| (*m * center).length() + (m.abs() * half).length();
        let stretched = reach(&self.stretch).max(reach(&(self.stretch + self.stretch_change)));
        self.angle * (self.angle * stretched + 2.0 * reach(&self.stretch_change))
    }
}

impl AnimatedTransform {
    /// The map with these keys.
    ///
    /// # Errors
    /// [`AnimationError`] when there are no keys, times do not ascend, or two neighbours have no invertible
    /// interpolation.
    pub fn new(keys: Vec<(f64, Transform)>) -> Result<Self, AnimationError> {
        if keys.is_empty() {
            return Err(AnimationError::Empty);
        }
        let is_ascending = |i: &usize| keys[*i].0.is_finite() && (*i == 0 || keys[*i - 1].0 < keys[*i].0);
        if let Some(key) = (0..keys.len()).find(|i| !is_ascending(i)) {
            return Err(AnimationError::Times { key });
        }
        let mut parts: Vec<Polar> = Vec::with_capacity(keys.len());
        for (key, (_, map)) in keys.iter().enumerate() {
            if map.is_mirror() != keys[0].1.is_mirror() {
                return Err(AnimationError::Mirrored { key });
            }
            let polar = Polar::new(&map.linear(), map.is_mirror());
            parts.push(polar.ok_or(AnimationError::Degenerate { key })?);
        }
        let condition = parts.iter().fold(1.0, |worst: f64, polar| worst.max(polar.condition));
        let segments = keys.windows(2).zip(parts.windows(2)).map(|(keys, parts)| {
            let translations = [keys[0].1.affine().translation, keys[1].1.affine().translation];
            Segment::new(keys[0].0, keys[1].0, &parts[0], &parts[1], translations)
        });
        Ok(Self { segments: segments.collect(), keys, condition })
    }

    /// The keys, times with maps, in ascending order; at least one.
    pub fn keys(&self) -> &[(f64, Transform)] {
        &self.keys
    }

    /// Whether the map is constant.
    pub fn is_still(&self) -> bool {
        self.keys.iter().all(|(_, map)| *map == self.keys[0].1)
    }

    /// An approximate bound on the condition number over all times.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// The map at a time.
    pub fn at(&self, time: f64) -> Transform {
        let after = self.keys.partition_point(|&(key, _)| key <= time);
        let (last, map) = &self.keys[after.saturating_sub(1)];
        if after == 0 || after == self.keys.len() || *last == time {
            return *map;
        }
        let segment = &self.segments[after - 1];
        segment.at((time - segment.start) / segment.duration)
    }

    /// The maps at which to look at a box, with this centre and half-size, to bound its motion: a list for each
    /// segment, with a bound on the distance of any point of the box from the chord between its places at two
    /// consecutive maps. The bound is at most `tolerance` unless that takes more than 64 steps.
    ///
    /// A curve deviates from its chord by at most an eighth of its largest second derivative by the fraction of
    /// the chord.
    pub fn steps(
        &self,
        center: DVec3,
        half: DVec3,
        tolerance: f64,
    ) -> impl Iterator<Item = (Vec<Transform>, f64)> + '_ {
        self.segments.iter().map(move |segment| {
            let farthest = 0.125 * segment.curvature(center, half);
            let steps = (farthest / tolerance).sqrt().ceil().clamp(1.0, 64.0);
            let maps = (0..=steps as u32).map(|i| segment.at(f64::from(i) / steps)).collect();
            (maps, farthest / (steps * steps))
        })
    }

    /// The map followed by another.
    ///
    /// # Errors
    /// [`AnimationError`] when two keys of the result have no invertible interpolation.
    pub fn then(&self, outer: &Transform) -> Result<Self, AnimationError> {
        Self::new(self.keys.iter().map(|&(time, map)| (time, *outer * map)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    fn some_map(random: &mut RandomStream) -> Transform {
        let mut number = || 4.0 * random.next_f64() - 2.0;
        let axis = DVec3::new(number(), number(), number());
        let turn = Transform::rotate(axis, 180.0 * number()).unwrap();
        let stretch = DVec3::new(number(), number(), number()).abs() + 0.05;
        let slant = Transform::shear(number() * 0.2, 0.1, 0.0, number() * 0.2, 0.0, 0.1).unwrap();
        let shift = Transform::translate(3.0 * DVec3::new(number(), number(), number()));
        shift * turn * slant * Transform::scale(stretch).unwrap()
    }

    fn apart(a: &Transform, b: &Transform) -> f64 {
        let difference = frobenius(&(a.linear() - b.linear()));
        difference + (a.affine().translation - b.affine().translation).length()
    }

    #[test]
    fn a_wheel_turns_evenly_and_a_slide_goes_straight() {
        let key = |degrees: f64, x: f64| {
            Transform::translate(DVec3::new(x, 0.5, 0.0)) * Transform::rotate(DVec3::Y, degrees).unwrap()
        };
        let motion = AnimatedTransform::new(vec![(2.0, key(20.0, 1.0)), (4.0, key(140.0, 5.0))]).unwrap();
        for i in 0..=20 {
            let part = f64::from(i) / 20.0;
            let expected = key(20.0 + 120.0 * part, 1.0 + 4.0 * part);
            assert!(apart(&motion.at(2.0 + 2.0 * part), &expected) < 1e-14);
        }
        assert_eq!(motion.at(-7.0), key(20.0, 1.0));
        assert_eq!(motion.at(4.5), key(140.0, 5.0));
        assert_eq!(motion.at(f64::NAN), key(20.0, 1.0));
        assert!(!motion.is_still());
    }

    #[test]
    fn maps_pass_through_their_keys_and_can_be_undone_between_them() {
        let mut random = RandomStream::new(5);
        let mirror = Transform::scale(DVec3::new(1.0, -1.0, 1.0)).unwrap();
        for round in 0..500 {
            let mut maps = [some_map(&mut random), some_map(&mut random), some_map(&mut random)];
            if round % 3 == 0 {
                maps = maps.map(|map| map * mirror);
            }
            let times = [-1.5, 0.25, 0.75];
            let motion = AnimatedTransform::new(times.into_iter().zip(maps).collect()).unwrap();
            for (time, map) in times.into_iter().zip(&maps) {
                assert_eq!(motion.at(time), *map);
                for near in [time - 1e-9, time + 1e-9] {
                    assert!(apart(&motion.at(near), map) < 2e-7, "{}", apart(&motion.at(near), map));
                }
            }
            for _ in 0..20 {
                let map = motion.at(3.0 * random.next_f64() - 2.0);
                let p = DVec3::new(random.next_f64(), -2.0, 1.5);
                assert!((map.inverse_point(map.point(p)) - p).length() < 1e-12 * motion.condition());
                assert_eq!(map.is_mirror(), round % 3 == 0);
            }
        }
    }

    #[test]
    fn no_point_of_a_box_comes_farther_from_its_chords_than_is_said() {
        let mut random = RandomStream::new(6);
        let mut closest: f64 = 0.0;
        for _ in 0..300 {
            let maps = vec![(0.0, some_map(&mut random)), (1.0, some_map(&mut random))];
            let motion = AnimatedTransform::new(maps).unwrap();
            let mut number = || 2.0 * random.next_f64() - 1.0;
            let (center, half) =
                (DVec3::new(number(), number(), number()), DVec3::new(0.3, 0.1, 0.5 + 0.4 * number()));
            let p = center + half * DVec3::new(number(), number(), number());
            for tolerance in [10.0, 0.3, 0.01] {
                let (maps, distance) = motion.steps(center, half, tolerance).next().unwrap();
                assert!(distance <= tolerance || maps.len() == 65);
                let steps = (maps.len() - 1) as f64;
                for i in 0..=200 {
                    let part = f64::from(i) / 200.0;
                    let step = ((part * steps) as usize).min(maps.len() - 2);
                    let (from, to) = (maps[step].point(p), maps[step + 1].point(p));
                    let chord = from.lerp(to, part * steps - step as f64);
                    let away = (motion.at(part).point(p) - chord).length();
                    assert!(away <= distance + 1e-12, "{away} {distance}");
                    closest = closest.max(away / distance);
                }
            }
        }
        // It is not much too large either.
        assert!(closest > 0.5, "{closest}");
    }

    #[test]
    fn what_is_no_animation_is_refused() {
        let still = Transform::IDENTITY;
        let mirror = Transform::scale(DVec3::new(1.0, 1.0, -1.0)).unwrap();
        let flat = Transform::scale(DVec3::new(1.0, 1e-9, 1.0)).unwrap();
        let error = |keys: Vec<(f64, Transform)>| AnimatedTransform::new(keys).unwrap_err();
        assert_eq!(error(vec![]), AnimationError::Empty);
        assert_eq!(error(vec![(0.0, still), (0.0, still)]), AnimationError::Times { key: 1 });
        assert_eq!(error(vec![(0.0, still), (f64::NAN, still)]), AnimationError::Times { key: 1 });
        assert_eq!(error(vec![(0.0, still), (1.0, mirror)]), AnimationError::Mirrored { key: 1 });
        assert_eq!(error(vec![(0.0, flat), (1.0, still)]), AnimationError::Degenerate { key: 0 });
        let constant = AnimatedTransform::new(vec![(0.0, mirror), (1.0, mirror)]).unwrap();
        assert!(constant.is_still());
        assert!(apart(&constant.at(0.3), &mirror) < 1e-15);
    }
}
