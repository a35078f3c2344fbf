//! Sixteen triangles with a ray each, against each alone, and the numbers of sixteen rays.

use lumbre_geometry::Ray;
use lumbre_math::DVec3;

use super::scenes::Random;
use crate::intersect::watertight::{self, EdgeTest, Met, Pairs, Shear};
use crate::intersect::{Dispatch, Isa, Simd};
use crate::simd::{LANES, Row};

struct Meeting<'a>(&'a Pairs<'a>);

impl Dispatch for Meeting<'_> {
    type Output = Met;

    #[inline(always)]
    fn run<L: Simd>(self) -> Met {
        self.0.meet()
    }
}

/// What a lane is made of: a direction, an origin and corners, by the order of the axes.
fn lane(random: &mut Random) -> (DVec3, [f64; 3], [[f32; 3]; 3]) {
    let scale = [1.0, 1e-12, 3e7][random.below(3)];
    let kind = random.below(6);
    let (direction, origin) = if kind < 2 {
        (DVec3::Z, (scale * random.vector()).as_vec3().as_dvec3())
    } else {
        (random.vector().with_z(1.0 + random.unit()), scale * random.vector())
    };
    let middle = origin + scale * 2.0 * direction;
    let place = |random: &mut Random| (middle + 0.8 * scale * random.vector()).as_vec3().to_array();
    let mut corners = [place(random), place(random), place(random)];
    match kind {
        // The ray goes exactly through a corner, or the triangle lies along it.
        0 => (corners[1][0], corners[1][1]) = (origin.x as f32, origin.y as f32),
        1 => {
            for corner in &mut corners {
                corner[0] = origin.x as f32;
            }
        }
        // A point, and a needle.
        2 => corners[1] = corners[0],
        3 => corners[2] = [0, 1, 2].map(|axis| 0.5 * (corners[0][axis] + corners[1][axis])),
        _ => {}
    }
    (direction, origin.to_array(), corners)
}

#[test]
fn sixteen_pairs_meet_as_each_alone() {
    let mut random = Random(171);
    let (mut inside, mut outside, mut uncertain) = (0, 0, 0);
    for _ in 0..if cfg!(miri) { 20 } else { 3_000 } {
        let (mut from, mut along) = ([Row::of(0.0); 3], [Row::of(0.0); 3]);
        let mut rows_of_corners = [[Row::of(0.0); 3]; 3];
        let lanes: Vec<_> = (0..LANES).map(|_| lane(&mut random)).collect();
        for (i, (direction, origin, corners)) in lanes.iter().enumerate() {
            for axis in 0..3 {
                from[axis].0[i] = origin[axis];
                along[axis].0[i] = direction.to_array()[axis];
                for (rows, corner) in rows_of_corners.iter_mut().zip(corners) {
                    rows[axis].0[i] = corner[axis];
                }
            }
        }
        let pairs = Pairs {
            origin: from.each_ref(),
            mesh_origin: [0.0; 3],
            direction: along.each_ref(),
            corners: &rows_of_corners,
        };
        for isa in Isa::all() {
            let met = isa.run(Meeting(&pairs));
            for (i, (direction, origin, corners)) in lanes.iter().enumerate() {
                // Its third axis is the largest and not negative, so that the order stays.
                let shear = Shear::new(direction);
                let (edge_test, crossing) = watertight::edge_test(&shear, origin, corners);
                let met = (met.t.0[i], met.local[0].0[i], met.local[1].0[i]);
                match edge_test {
                    EdgeTest::Inside => {
                        let (t, local) = (crossing.t(&shear), crossing.local());
                        let expected = (t, local.x, local.y);
                        assert_eq!(bits(met), bits(expected), "{isa:?}");
                        inside += 1;
                    }
                    EdgeTest::Outside => {
                        assert!(met.0.is_nan(), "{isa:?}");
                        outside += 1;
                    }
                    EdgeTest::Uncertain => {
                        assert!(met.0.is_nan(), "{isa:?}");
                        uncertain += 1;
                    }
                }
            }
        }
    }
    assert!(
        cfg!(miri) || inside > 5_000 && outside > 5_000 && uncertain > 500,
        "{inside} {outside} {uncertain}"
    );
}

fn bits((t, u, v): (f64, f64, f64)) -> [u64; 3] {
    [t.to_bits(), u.to_bits(), v.to_bits()]
}

struct Columns<'a>(&'a [Ray; LANES]);

impl Dispatch for Columns<'_> {
    type Output = [Row<f64>; 8];

    #[inline(always)]
    fn run<L: Simd>(self) -> [Row<f64>; 8] {
        let mut columns = [Row::of(f64::NAN); 8];
        L::columns(self.0, &mut columns);
        columns
    }
}

#[test]
fn the_numbers_of_rays_stand_side_by_side_at_every_level() {
    let number = |ray: usize, column: usize| (100 * column + ray) as f64;
    let rays = std::array::from_fn(|i| {
        let three = |first: usize| DVec3::from_array([0, 1, 2].map(|axis| number(i, first + axis)));
        Ray::new(three(0), three(3)).with_range(number(i, 6), number(i, 7)).at_time(-1.0)
    });
    let expected: [Row<f64>; 8] =
        std::array::from_fn(|column| Row(std::array::from_fn(|i| number(i, column))));
    for isa in Isa::all() {
        assert_eq!(isa.run(Columns(&rays)), expected, "{isa:?}");
    }
}
