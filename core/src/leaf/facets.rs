//! Leaves of facets: those of two by four cells of a grid, or a handful of a mesh's that share vertices.

use fearless_simd::{Simd, f32x16, prelude::*, u8x64, u32x16};

use super::sight::Sight;
use super::{Batch, Best, Leaf, margin};
use crate::bound::{Dome, Spots, load};
use crate::contact::{Pose, Spot, height_well_within, touch_seen};
use crate::cutter::Cutter;
use crate::lanes::{LANES, Lanes, lanes};
use crate::simd::Set;
use crate::vector::{Interval, Point};

/// Facets in a leaf at most, and vertices that they may have: two vectors of each.
pub(crate) const FACETS: usize = 2 * LANES;
pub(crate) const VERTICES: usize = 2 * LANES;

/// Facets that lie together.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct FacetLeaf {
    /// The vertices from the middle on, in single precision: what the bounds need. Free slots repeat the first.
    near: [[f32; VERTICES]; 3],
    pub middle: Point,
    /// Largest distance of a vertex from the middle, along any axis, mm.
    pub size: f32,
    /// Squares of the longest edges along the spindle and across it, mm².
    pub edge: [f32; 2],
    /// The vertices of each facet, a bit for each; none of free slots.
    masks: [u32; FACETS],
    /// The vertices as places among all points, whose coordinates are what is solved exactly.
    pub places: [u32; VERTICES],
    /// The first, second and third corner of each facet, each the places of a vertex's four bytes among those of
    /// all: by these one permutation picks the corners of all facets.
    corners: [[[u8; 4]; FACETS]; 3],
    numbers: [u64; FACETS],
}

impl FacetLeaf {
    /// Of one to [`FACETS`] facets with their numbers. Their corners are slots of `vertices`, which are places among
    /// `points`, at most [`VERTICES`], and each a corner of some facet.
    pub fn new(points: &[Point], vertices: &[u32], facets: &[([u8; 3], u64)]) -> Self {
        let mut leaf = Self {
            near: [[0.0; VERTICES]; 3],
            middle: [0.0; 3],
            size: 0.0,
            edge: [0.0; 2],
            masks: [0; FACETS],
            places: [vertices[0]; VERTICES],
            corners: [[bytes(0); FACETS]; 3],
            numbers: [Best::NOBODY; FACETS],
        };
        leaf.places[..vertices.len()].copy_from_slice(vertices);
        for (k, near) in leaf.near.iter_mut().enumerate() {
            let at = leaf.places.map(|place| points[place as usize][k]);
            let Interval { low, high } = Interval::of(at);
            leaf.middle[k] = (low + high) / 2.0;
            *near = at.map(|c| (c - leaf.middle[k]) as f32);
            leaf.size = leaf.size.max((high - leaf.middle[k]) as f32);
        }
        for (slot, &(corners, number)) in facets.iter().enumerate() {
            for (all, corner) in leaf.corners.iter_mut().zip(corners) {
                all[slot] = bytes(corner);
            }
            leaf.masks[slot] = corners.iter().fold(0, |mask, c| mask | 1 << c);
            leaf.numbers[slot] = number;
            for k in 0..3 {
                let [a, b] = [corners[k], corners[(k + 1) % 3]].map(usize::from);
                let [x, y, z] = leaf.near.each_ref().map(|axis| axis[b] - axis[a]);
                leaf.edge = [leaf.edge[0].max(x * x), leaf.edge[1].max(y * y + z * z)];
            }
        }
        leaf
    }

    /// The vertices.
    #[inline(always)]
    pub fn vertices<S: Simd>(&self, simd: S) -> [f32x16<S>; 3] {
        load(simd, &self.near)
    }

    /// The first, second or third corner of each facet under a dome, given the vertices.
    #[inline(always)]
    pub fn at_corners<S: Simd>(&self, simd: S, which: usize, vertices: &Spots<S>) -> Spots<S> {
        let places = u8x64::from_slice(simd, self.corners[which].as_flattened());
        Spots {
            height: vertices.height.swizzle_dyn(places),
            d: vertices.d.swizzle_dyn(places),
            w: vertices.w.swizzle_dyn(places),
        }
    }

    /// The facets that have any of some vertices.
    #[inline(always)]
    pub fn having<S: Simd>(&self, simd: S, vertices: Lanes) -> Lanes {
        let masks = u32x16::from_slice(simd, &self.masks);
        (masks & vertices as u32).simd_gt(0).to_bitmask()
    }

    /// The slots of a vertex.
    #[inline(always)]
    fn slots<S: Simd>(&self, simd: S, vertex: u32) -> Lanes {
        let places = u32x16::from_slice(simd, &self.places);
        places.simd_eq(vertex).to_bitmask()
    }

    /// The corners of the facet in a slot, as slots of vertices.
    #[inline(always)]
    fn corners(&self, slot: usize) -> [usize; 3] {
        [0, 1, 2].map(|k| usize::from(self.corners[k][slot][0] / 4))
    }

    /// Raises `best` to the facet in a slot; returns whether that did.
    #[inline(never)]
    fn solve(
        &self,
        points: &[Point],
        cutter: &Cutter,
        pose: &Pose,
        slot: usize,
        best: &mut Best,
    ) -> bool {
        let places = self.corners(slot).map(|c| self.places[c]);
        let corners = places.map(|place| points[place as usize]);
        let seen = [
            pose.face(corners[0]),
            pose.face(corners[1]),
            pose.face(corners[2]),
        ];
        let Some((touch, spot)) = touch_seen(cutter, corners, seen, best.height) else {
            return false;
        };
        let raised = best.raise(touch, self.numbers[slot]);
        if raised {
            let margin = margin(cutter, pose, best.height);
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

    /// Those of the `open` facets that may be higher than `best`, or as high elsewhere, given how high the plane
    /// that touches F where that is is over the vertices.
    ///
    /// F is nowhere above the plane. Where a facet has what holds the cutter up, and the plane is lower than `best`
    /// over its other vertices, it is touched there as well, at the same height to the last bit, and nowhere
    /// higher; of such facets the lowest number counts. Where it has but one end of an edge that holds
    /// the cutter up, which is lower, it is lower throughout. All by a margin that is far above the rounding of
    /// heights.
    #[inline(always)]
    pub fn beside<S: Simd>(&self, simd: S, open: Lanes, level: Lanes, best: &mut Best) -> Lanes {
        let held = [
            self.slots(simd, best.held[0]),
            self.slots(simd, best.held[1]),
        ];
        if held == [0; 2] {
            return open;
        }
        let no_higher = open & !self.having(simd, level & !(held[0] | held[1]));
        let has = [self.having(simd, held[0]), self.having(simd, held[1])];
        for slot in lanes(no_higher & has[0] & has[1]) {
            best.id = best.id.min(self.numbers[slot]);
        }
        open & !(no_higher & (has[0] | has[1]))
    }
}

/// The places of a vertex's four bytes among those of all vertices.
fn bytes(slot: u8) -> [u8; 4] {
    [0, 1, 2, 3].map(|byte| 4 * slot + byte)
}

impl Leaf for FacetLeaf {
    type Sight = Sight;

    #[inline(always)]
    fn expect(sight: &mut Sight, cutter: &Cutter, pose: &Pose, place: [f64; 2]) {
        sight.dome = Dome::at(cutter, pose, place);
    }

    #[inline(always)]
    fn search<S: Set>(
        &self,
        simd: S,
        points: &[Point],
        batch: &mut Batch<Sight>,
        alive: Lanes,
    ) -> (u64, Lanes) {
        let cutter = batch.cutter;
        let mut some = 0;
        for lane in lanes(alive) {
            let (pose, best) = (&batch.starts[lane].pose, &mut batch.best[lane]);
            let sight = &mut batch.sights[lane];
            let points = Some(points).filter(|_| batch.floors);
            sight.look(simd, self, points, cutter, pose, best);
            some |= u64::from(sight.open != 0) << lane;
        }
        let mut evaluated = 0;
        for lane in lanes(some) {
            let sight = &mut batch.sights[lane];
            evaluated += u64::from(sight.open.count_ones());
            sight.bound(simd, self, &batch.best[lane]);
        }
        let mut raised = 0;
        for lane in lanes(some) {
            let (pose, best) = (&batch.starts[lane].pose, &mut batch.best[lane]);
            let sight = &mut batch.sights[lane];
            // The most promising one is solved first; it may rule out the others.
            while let Some(slot) = sight.most_promising(best) {
                sight.open &= !(1 << slot);
                if self.solve(points, cutter, pose, slot, best) {
                    raised |= 1 << lane;
                    let [d, _, z] = pose.face(best.contact);
                    sight.dome = Dome::at(cutter, pose, [d, z]);
                    let left = sight.open;
                    if left != 0 {
                        sight.look(simd, self, None, cutter, pose, best);
                        sight.open &= left;
                        sight.bound(simd, self, best);
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
        floors: bool,
    ) -> Best {
        let mut best = [Best::above(f64::NEG_INFINITY); LANES];
        let mut sights = [Sight::default(); LANES];
        FacetLeaf::expect(&mut sights[1], cutter, &starts[1].pose, starts[1].place);
        let mut batch = Batch {
            cutter,
            starts,
            best: &mut best,
            sights,
            floors,
        };
        with_simd!(level.token(), simd => leaf.search(simd, points, &mut batch, 2));
        best[1]
    }

    /// A pyramid of six sides under the cutter, numbered in some order: its apex, an edge or a side is touched.
    #[derive(Debug)]
    struct Pyramid {
        points: Vec<Point>,
        facets: Vec<([u8; 3], u64)>,
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
                let mut corners = [0, 1 + k as u8, 1 + (k as u8 + 1) % 6];
                corners.rotate_left(turned[k]);
                // Of several rows.
                (corners, order[k] << 31)
            };
            Self {
                points,
                facets: (0..6).map(side).collect(),
            }
        }

        fn leaf(&self) -> FacetLeaf {
            FacetLeaf::new(&self.points, &[0, 1, 2, 3, 4, 5, 6], &self.facets)
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
            let leaf = pyramid.leaf();
            let mut brute = Best::above(f64::NEG_INFINITY);
            for &(corners, id) in facets {
                let corners = corners.map(|c| points[usize::from(c)]);
                if let Some(touch) = touch_facet(&cutter, &starts[1].pose, corners) {
                    brute.raise(touch, id);
                }
            }
            for level in Level::available() {
                for floors in [true, false] {
                    let best = search(level, &leaf, points, &cutter, &starts, floors);
                    prop_assert_eq!(best.height.to_bits(), brute.height.to_bits(), "{}", level);
                    prop_assert_eq!((best.id, best.contact), (brute.id, brute.contact), "{}", level);
                }
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
        let leaf = pyramid.leaf();
        for level in Level::available() {
            let starts = [at(0.0), at(0.01)];
            let mut best = search(level, &leaf, &pyramid.points, &cutter, &starts, true);
            assert_eq!((best.id, best.held), (0, [0; 2]));
            let pose = at(0.01).pose;
            let [d, _, z] = pose.face(best.contact);
            let mut sight = Sight::default();
            FacetLeaf::expect(&mut sight, &cutter, &pose, [d, z]);
            best.id = 7;
            let points = &pyramid.points;
            with_simd!(level.token(), simd => {
                sight.look(simd, &leaf, Some(points), &cutter, &pose, &mut best);
            });
            assert_eq!((sight.open, best.id), (0, 0), "{level}");
        }
    }
}
