//! Leaves of facets: those of two by two cells of a grid, or a handful of a mesh's that share vertices.

use fearless_simd::{f32x8, mask32x8, prelude::*, u32x8};

use super::{Batch, Best, Leaf};
use crate::bound::{Near, Plane, facet_bounds, load};
use crate::contact::{Pose, Spot, height_well_within, touch_seen};
use crate::cutter::Cutter;
use crate::lanes::{LANES, Lanes, lanes};
use crate::simd::Set;
use crate::vector::{Interval, Point};

/// Facets in a leaf: those of two by two cells.
pub(crate) const FACETS: usize = LANES;

/// Facets that lie together.
#[derive(Debug, Clone)]
#[repr(align(32))]
pub(crate) struct FacetLeaf {
    /// The corners of each facet from the middle on, in single precision: what the bounds need. Free
    /// slots repeat the first facet.
    near: [[[f32; FACETS]; 3]; 3],
    middle: Point,
    /// Largest distance of a corner from the middle, along any axis, mm.
    size: f32,
    count: u32,
    /// The corners as places among all points: what is solved exactly.
    corners: [[u32; FACETS]; 3],
    ids: [u64; FACETS],
}

impl FacetLeaf {
    /// Of one to [`FACETS`] facets with their numbers.
    pub fn new(points: &[Point], facets: &[([u32; 3], u64)]) -> Self {
        let mut leaf = Self {
            near: [[[0.0; FACETS]; 3]; 3],
            middle: [0.0; 3],
            size: 0.0,
            count: facets.len() as u32,
            corners: [[0; FACETS]; 3],
            ids: [Best::NOBODY; FACETS],
        };
        // By corner and axis.
        let mut at = [[[0.0; FACETS]; 3]; 3];
        for slot in 0..FACETS {
            let (corners, id) = *facets.get(slot).unwrap_or(&facets[0]);
            leaf.ids[slot] = id;
            let places = leaf.corners.iter_mut().zip(corners);
            for (at, (place, corner)) in at.iter_mut().zip(places) {
                place[slot] = corner;
                let p = points[corner as usize];
                for k in 0..3 {
                    at[k][slot] = p[k];
                }
            }
        }
        for k in 0..3 {
            let corners = at.each_ref().map(|axes| &axes[k]);
            let Interval { low, high } = range(corners);
            leaf.middle[k] = (low + high) / 2.0;
            leaf.size = leaf.size.max((high - leaf.middle[k]) as f32);
            for (near, corner) in leaf.near.iter_mut().zip(corners) {
                near[k] = corner.map(|c| (c - leaf.middle[k]) as f32);
            }
        }
        leaf
    }

    /// The corners of all of them, as the bounds see them.
    #[inline(always)]
    fn corners_near<S: Set>(&self, simd: S) -> [[f32x8<S>; 3]; 3] {
        [
            load(simd, &self.near[0]),
            load(simd, &self.near[1]),
            load(simd, &self.near[2]),
        ]
    }

    /// Raises `best` to the facet in a slot; returns whether that did.
    #[inline(never)]
    fn solve(
        &self,
        points: &[Point],
        cutter: &Cutter,
        pose: &Pose,
        slot: usize,
        margin: f64,
        best: &mut Best,
    ) -> bool {
        let places = self.corners.map(|places| places[slot]);
        let corners = places.map(|place| points[place as usize]);
        let seen = [
            pose.face(corners[0]),
            pose.face(corners[1]),
            pose.face(corners[2]),
        ];
        let Some((touch, spot)) = touch_seen(cutter, corners, seen, best.height) else {
            return false;
        };
        let raised = best.raise(touch, self.ids[slot]);
        if raised {
            let height = |corner: usize| height_well_within(cutter, seen[corner]);
            let lower = |end| height(end).is_some_and(|h| h < touch.height - margin);
            best.held = match spot {
                Spot::Corner(i) if height(i).is_some() => [places[i]; 2],
                Spot::Edge(i, j) if lower(i) && lower(j) => [places[i], places[j]],
                _ => Best::NONE,
            };
        }
        raised
    }

    /// The facets that may be higher than `best`, or as high elsewhere; `ceiling` touches F where that is.
    ///
    /// F is nowhere above the ceiling. Where a facet has what holds the cutter up, and the ceiling is lower than
    /// `best` over its other vertices, it is touched there as well, at the same height to the last bit, and
    /// nowhere higher; of such facets the lowest number counts. Where it has but one end of an edge that holds
    /// the cutter up, which is lower, it is lower throughout. All by a margin that is far above the rounding of
    /// heights.
    #[inline(always)]
    fn open<S: Set>(
        &self,
        simd: S,
        pose: &Pose,
        near: &Near,
        ceiling: &Plane,
        corners: &[[f32x8<S>; 3]; 3],
        best: &mut Best,
    ) -> Lanes {
        let roof = near.roof(ceiling, pose, self.middle, best.base());
        let over = [
            roof.over(simd, corners[0]),
            roof.over(simd, corners[1]),
            roof.over(simd, corners[2]),
        ];
        let highest = over[0].max(over[1]).max(over[2]);
        let open = highest.simd_ge(0.0).to_bitmask() & ((1 << self.count) - 1);
        let nowhere = f32x8::splat(simd, f32::NEG_INFINITY);
        let mut others = nowhere;
        let mut has = [mask32x8::splat(simd, false); 2];
        for (over, places) in over.into_iter().zip(&self.corners) {
            let places = u32x8::from_slice(simd, places);
            let held = [places.simd_eq(best.held[0]), places.simd_eq(best.held[1])];
            has = [has[0] | held[0], has[1] | held[1]];
            others = others.max((held[0] | held[1]).select(nowhere, over));
        }
        let no_higher = open & others.simd_lt(-near.rounding).to_bitmask();
        for slot in lanes(no_higher & (has[0] & has[1]).to_bitmask()) {
            best.id = best.id.min(self.ids[slot]);
        }
        open & !(no_higher & (has[0] | has[1]).to_bitmask())
    }
}

/// The range of one coordinate of facets, given by their corners.
fn range([a, b, c]: [&[f64; FACETS]; 3]) -> Interval {
    // Facet by facet first, which is vectors; comparisons are one instruction, and nothing here is NaN.
    let less = |a: f64, b: f64| if a < b { a } else { b };
    let greater = |a: f64, b: f64| if a > b { a } else { b };
    let low: [f64; FACETS] = std::array::from_fn(|i| less(less(a[i], b[i]), c[i]));
    let high: [f64; FACETS] = std::array::from_fn(|i| greater(greater(a[i], b[i]), c[i]));
    Interval {
        low: low.into_iter().fold(low[0], less),
        high: high.into_iter().fold(high[0], greater),
    }
}

impl Leaf for FacetLeaf {
    type Ceiling = Plane;

    #[inline(always)]
    fn ceiling(cutter: &Cutter, pose: &Pose, place: [f64; 2]) -> Self::Ceiling {
        Plane::at(cutter, pose, place)
    }

    #[inline(always)]
    fn search<S: Set>(
        &self,
        simd: S,
        points: &[Point],
        batch: &mut Batch<Self::Ceiling>,
        alive: Lanes,
    ) -> (u64, Lanes) {
        let cutter = batch.cutter;
        let corners = self.corners_near(simd);
        let mut nears = [Near::default(); LANES];
        let mut open = [0; LANES];
        let mut some = 0;
        for lane in lanes(alive) {
            let (pose, best) = (&batch.starts[lane].pose, &mut batch.best[lane]);
            let [d, y, z] = pose.face(self.middle);
            let near = Near::new(cutter, pose, [d, y - best.base(), z], self.size);
            open[lane] = self.open(simd, pose, &near, &batch.ceilings[lane], &corners, best);
            nears[lane] = near;
            some |= u64::from(open[lane] != 0) << lane;
        }
        let mut evaluated = 0;
        let mut bounds = [f32x8::splat(simd, 0.0); LANES];
        for lane in lanes(some) {
            evaluated += u64::from(open[lane].count_ones());
            bounds[lane] = simd.piece(
                #[inline(always)]
                || facet_bounds(simd, cutter, &nears[lane], &corners),
            );
            open[lane] &= bounds[lane].simd_ge(0.0).to_bitmask();
        }
        let mut raised = 0;
        for lane in lanes(some) {
            let (mut open, bounds, near) = (open[lane], bounds[lane], &nears[lane]);
            let (pose, best) = (&batch.starts[lane].pose, &mut batch.best[lane]);
            let base = best.base();
            // The most promising one is solved first; it may rule out the others.
            while open != 0 {
                let mut highest = (f32::NEG_INFINITY, 0);
                for slot in lanes(open) {
                    if bounds[slot] > highest.0 {
                        highest = (bounds[slot], slot);
                    }
                }
                let (bound, slot) = highest;
                if f64::from(bound) < best.height - base {
                    break;
                }
                open &= !(1 << slot);
                let margin = f64::from(near.rounding);
                if self.solve(points, cutter, pose, slot, margin, best) {
                    raised |= 1 << lane;
                    let [d, _, z] = pose.face(best.contact);
                    let ceiling = Plane::at(cutter, pose, [d, z]);
                    batch.ceilings[lane] = ceiling;
                    if open != 0 {
                        open &= self.open(simd, pose, near, &ceiling, &corners, best);
                    }
                }
            }
        }
        (evaluated, raised)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::touch_facet;
    use crate::leaf::Start;
    use crate::simd::{Simd as Level, with_simd};
    use proptest::prelude::*;

    /// The highest facet of a leaf by its search at the second of two positions.
    fn search(
        level: Level,
        leaf: &FacetLeaf,
        points: &[Point],
        cutter: &Cutter,
        starts: &[Start],
    ) -> Best {
        let mut best = [Best::above(f64::NEG_INFINITY); LANES];
        let ceiling = FacetLeaf::ceiling(cutter, &starts[1].pose, starts[1].place);
        let mut batch = Batch {
            cutter,
            starts,
            best: &mut best,
            ceilings: [ceiling; LANES],
        };
        with_simd!(level.token(), simd => leaf.search(simd, points, &mut batch, 2));
        best[1]
    }

    /// A pyramid of six sides under the cutter, numbered in some order: its apex, an edge or a side is touched.
    #[derive(Debug)]
    struct Pyramid {
        points: Vec<Point>,
        facets: Vec<([u32; 3], u64)>,
    }

    impl Pyramid {
        fn new(apex: Point, feet: &[[f64; 2]], order: &[u64], turned: &[usize]) -> Self {
            let foot = |(k, &[size, drop]): (usize, &[f64; 2])| {
                let angle = (k as f64 * 60.0).to_radians();
                let (c, s) = (libm::cos(angle), libm::sin(angle));
                [apex[0] + size * c, apex[1] - drop, apex[2] + size * s]
            };
            let mut points = vec![apex];
            points.extend(feet.iter().enumerate().map(foot));
            let side = |k: usize| {
                let mut corners = [0, 1 + k as u32, 1 + (k as u32 + 1) % 6];
                corners.rotate_left(turned[k]);
                (corners, order[k])
            };
            Self {
                points,
                facets: (0..6).map(side).collect(),
            }
        }
    }

    fn pyramids() -> impl Strategy<Value = Pyramid> {
        let feet = prop::collection::vec([0.1..3.0_f64, -0.02..1.0_f64], 6);
        let order = Just((0..6).collect::<Vec<u64>>()).prop_shuffle();
        let turned = prop::collection::vec(0..3_usize, 6);
        let apex = [-4.0..4.0_f64, 0.0..30.0, -10.0..10.0];
        (apex, feet, order, turned).prop_map(|(a, f, o, t)| Pyramid::new(a, &f, &o, &t))
    }

    fn at(x: f64) -> Start {
        Start {
            pose: Pose {
                x,
                cos: 1.0,
                sin: 0.0,
            },
            floor: f64::NEG_INFINITY,
            place: [0.0; 2],
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn the_first_of_the_highest_facets_is_found(
            pyramid in pyramids(),
            x in -1.0..1.0_f64,
            which in 0..3_usize,
        ) {
            let cutter = [
                Cutter::torus(40.0, 8.0),
                Cutter::ball(10.0),
                Cutter::cylinder(20.0, 30.0),
            ][which].clone().expect("valid");
            let starts = [at(0.0), at(x)];
            let Pyramid { points, facets } = &pyramid;
            let leaf = FacetLeaf::new(points, facets);
            let mut brute = Best::above(f64::NEG_INFINITY);
            for &(corners, id) in facets {
                let corners = corners.map(|c| points[c as usize]);
                if let Some(touch) = touch_facet(&cutter, &starts[1].pose, corners) {
                    brute.raise(touch, id);
                }
            }
            for level in Level::available() {
                let best = search(level, &leaf, points, &cutter, &starts);
                prop_assert_eq!(best.height.to_bits(), brute.height.to_bits(), "{}", level);
                prop_assert_eq!((best.id, best.contact), (brute.id, brute.contact), "{}", level);
            }
        }
    }

    /// A second look at an apex that holds the cutter up takes no facet's solution.
    #[test]
    fn the_facets_around_what_holds_the_cutter_up_are_not_open() {
        let pyramid = Pyramid::new(
            [0.0, 20.0, 0.0],
            &[[1.0, 0.5]; 6],
            &[5, 4, 3, 0, 1, 2],
            &[0; 6],
        );
        let cutter = Cutter::torus(40.0, 8.0).expect("valid");
        let leaf = FacetLeaf::new(&pyramid.points, &pyramid.facets);
        for level in Level::available() {
            let mut best = search(level, &leaf, &pyramid.points, &cutter, &[at(0.0), at(0.01)]);
            assert_eq!((best.id, best.held), (0, [0; 2]));
            let pose = at(0.01).pose;
            let [d, y, z] = pose.face(leaf.middle);
            let near = Near::new(&cutter, &pose, [d, y - best.base(), z], leaf.size);
            let [d, _, z] = pose.face(best.contact);
            let ceiling = Plane::at(&cutter, &pose, [d, z]);
            best.id = 7;
            let open = with_simd!(level.token(), simd => {
                let corners = leaf.corners_near(simd);
                leaf.open(simd, &pose, &near, &ceiling, &corners, &mut best)
            });
            assert_eq!((open, best.id), (0, 0), "{level}");
        }
    }
}
