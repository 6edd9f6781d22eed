//! A hierarchy over the positions of a path: how it is built.
//!
//! Positions lie on a sheet: a height for each travel and angle. A tile of that sheet is its middle,
//! its half extents in travel and angle, the plane fitted to its heights, and how far they stray from
//! it. A node has up to eight tiles, each a node or a leaf of up to eight positions and
//! the moves that depart from them; both keep their numbers side by side, so that a search takes several at once. `search` is what it is for.

use std::f64::consts::PI;

use super::INTERMEDIATE;
use super::body::Solid;

/// Tiles of a node and positions of a leaf.
pub(super) const WIDTH: usize = 8;

/// A position with the move that departs from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Item {
    /// The number it goes by.
    pub index: usize,
    /// Travel (mm), angle (radians, within one turn) and height (mm).
    pub at: [f64; 3],
    /// What the move adds to them, if there is one.
    pub by: Option<[f64; 3]>,
}

impl Item {
    /// Travel, angle and height `share` of the way along the move.
    pub fn along(&self, by: [f64; 3], share: f64) -> [f64; 3] {
        std::array::from_fn(|k| self.at[k] + by[k] * share)
    }

    /// The ends of what it covers.
    fn ends(&self) -> [[f64; 3]; 2] {
        [self.at, self.by.map_or(self.at, |by| self.along(by, 1.0))]
    }
}

/// One number of each tile; singles, for they only decide where to look.
pub(super) type Lanes = [f32; WIDTH];

/// Where part and cutter stand at some positions, or in the middle of tiles. Positions that there are
/// none of are infinitely far away.
#[derive(Debug, Clone)]
pub(super) struct Stands<T> {
    pub x: [T; WIDTH],
    pub cos: [T; WIDTH],
    pub sin: [T; WIDTH],
    pub height: [T; WIDTH],
}

/// Up to eight positions, and the poses on the moves that depart from them.
#[derive(Debug, Clone)]
pub(super) struct Leaf {
    pub standing: Stands<f64>,
    pub moving: [Stands<f64>; INTERMEDIATE],
    /// The numbers that the positions go by.
    pub index: [usize; WIDTH],
}

/// Up to eight tiles: x = middle ± `half_x`, angle = middle ± `half_angle` (radians), height =
/// middle + `by_x`·Δx + `by_angle`·Δangle ± `residual`.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub middle: Stands<f32>,
    pub half_x: Lanes,
    pub half_angle: Lanes,
    pub by_x: Lanes,
    pub by_angle: Lanes,
    pub residual: Lanes,
    pub children: [Child; WIDTH],
}

/// What a tile holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Child {
    None,
    Node(u32),
    Leaf(u32),
}

/// Positions, made ready to be searched.
#[derive(Debug)]
pub(super) struct Hierarchy<S> {
    pub body: S,
    pub nodes: Vec<Node>,
    pub leaves: Vec<Leaf>,
    pub root: Child,
    /// Greatest magnitude of the numbers that a bound is made of, but for the searched point's.
    pub magnitude: f64,
}

impl<S: Solid> Hierarchy<S> {
    /// Makes positions ready for a cutter's body; their numbers are finite and within bounds.
    pub fn new(body: S, mut items: Vec<Item>) -> Self {
        let mut largest = [0.0_f64; 3];
        for end in items.iter().flat_map(Item::ends) {
            largest = std::array::from_fn(|k| largest[k].max(end[k].abs()));
        }
        let [x, _, height] = largest;
        let heights: f64 = items.iter().map(|i| i.at[2].abs()).sum();
        let mut builder = Builder {
            lever: lever(&body, heights / items.len().max(1) as f64),
            nodes: Vec::new(),
            leaves: Vec::with_capacity(items.len() / WIDTH + 1),
        };
        let root = builder.child(&mut items);
        Self {
            // A fitted plane rises by at most twice as much as the heights it is fitted to.
            magnitude: x + 3.0 * height + body.max_radius() + body.half_width(),
            body,
            nodes: builder.nodes,
            leaves: builder.leaves,
            root,
        }
    }
}

/// How far along a move its pose `k` is.
pub(super) fn share(k: usize) -> f64 {
    (k + 1) as f64 / (INTERMEDIATE + 1) as f64
}

/// An angle in degrees, however often unwound, as radians within one turn.
pub(super) fn turn(degrees: f64) -> f64 {
    // The remainder is exact, so the turns before lose nothing here.
    let angle = (degrees % 360.0).to_radians();
    if angle < 0.0 { angle + 2.0 * PI } else { angle }
}

/// The travel, mm, that raises a clearance as much as a turn by a radian does, so that tiles come out
/// as long as wide where it matters. On a cylinder of radius a, whose wheel of radius m stands at a
/// height h = a + m, a travel t away from the touch is worth t²/2w, w being the profile's radius of
/// curvature, and a turn δ is worth a·h·δ²/2m.
fn lever(body: &impl Solid, height: f64) -> f64 {
    let (w, m) = (body.half_width(), body.max_radius());
    let a = (height - m).max(w);
    (w * a * height.max(w) / m).sqrt()
}

struct Builder {
    /// How much travel, mm, is as much as a radian of turn.
    lever: f64,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

impl Builder {
    fn child(&mut self, items: &mut [Item]) -> Child {
        if items.is_empty() {
            return Child::None;
        }
        if items.len() <= WIDTH {
            self.leaves.push(leaf(items));
            return Child::Leaf(self.leaves.len() as u32 - 1);
        }
        let number = self.nodes.len();
        self.nodes.push(EMPTY);
        let mut parts = [Some(items), None, None, None, None, None, None, None];
        // One becomes two, two become four, four become eight.
        for count in [1, 2, 4] {
            for k in (0..count).rev() {
                if let Some(whole) = parts[k].take() {
                    let (low, high) = self.divide(whole);
                    parts[2 * k] = Some(low);
                    parts[2 * k + 1] = Some(high);
                }
            }
        }
        for (k, part) in parts.into_iter().enumerate() {
            let Some(part) = part.filter(|p| !p.is_empty()) else {
                continue;
            };
            let tile = Tile::new(part);
            let child = self.child(part);
            self.nodes[number].set(k, &tile, child);
        }
        Child::Node(number as u32)
    }

    /// Divides items across their longest extent, into halves of whole leaves; the second is empty
    /// if they fit into one.
    fn divide<'a>(&self, items: &'a mut [Item]) -> (&'a mut [Item], &'a mut [Item]) {
        let half = items.len().div_ceil(WIDTH).div_ceil(2) * WIDTH;
        if half >= items.len() {
            let end = items.len();
            return items.split_at_mut(end);
        }
        let tile = Tile::new(items);
        let [by_x, by_angle] = [tile.by_x, tile.by_angle];
        let by = |k: usize| move |a: &Item, b: &Item| a.at[k].total_cmp(&b.at[k]);
        let extents = [tile.half_x, self.lever * tile.half_angle, tile.residual];
        if extents[2] > extents[0].max(extents[1]) {
            let off = |i: &Item| i.at[2] - by_x * i.at[0] - by_angle * i.at[1];
            items.select_nth_unstable_by(half, |a, b| off(a).total_cmp(&off(b)));
        } else if extents[0] > extents[1] {
            items.select_nth_unstable_by(half, by(0));
        } else {
            items.select_nth_unstable_by(half, by(1));
        }
        items.split_at_mut(half)
    }
}

const NOWHERE: Stands<f64> = Stands {
    x: [f64::INFINITY; WIDTH],
    cos: [0.0; WIDTH],
    sin: [0.0; WIDTH],
    height: [0.0; WIDTH],
};

const EMPTY: Node = Node {
    middle: Stands {
        x: [0.0; WIDTH],
        cos: [0.0; WIDTH],
        sin: [0.0; WIDTH],
        height: [0.0; WIDTH],
    },
    half_x: [0.0; WIDTH],
    half_angle: [0.0; WIDTH],
    by_x: [0.0; WIDTH],
    by_angle: [0.0; WIDTH],
    residual: [0.0; WIDTH],
    children: [Child::None; WIDTH],
};

impl Stands<f64> {
    fn set(&mut self, k: usize, [x, angle, height]: [f64; 3]) {
        (self.sin[k], self.cos[k]) = libm::sincos(angle);
        (self.x[k], self.height[k]) = (x, height);
    }
}

impl Node {
    fn set(&mut self, k: usize, tile: &Tile, child: Child) {
        let (sin, cos) = libm::sincos(tile.angle);
        let middle = &mut self.middle;
        (middle.x[k], middle.height[k]) = (tile.x as f32, tile.height as f32);
        (middle.sin[k], middle.cos[k]) = (sin as f32, cos as f32);
        self.half_x[k] = tile.half_x as f32;
        self.half_angle[k] = tile.half_angle as f32;
        self.by_x[k] = tile.by_x as f32;
        self.by_angle[k] = tile.by_angle as f32;
        self.residual[k] = tile.residual as f32;
        self.children[k] = child;
    }
}

fn leaf(items: &[Item]) -> Leaf {
    let mut leaf = Leaf {
        standing: NOWHERE,
        moving: [NOWHERE; INTERMEDIATE],
        index: [usize::MAX; WIDTH],
    };
    for (lane, item) in items.iter().enumerate() {
        leaf.index[lane] = item.index;
        leaf.standing.set(lane, item.at);
        let Some(by) = item.by else { continue };
        for (k, poses) in leaf.moving.iter_mut().enumerate() {
            poses.set(lane, item.along(by, share(k)));
        }
    }
    leaf
}

/// Steepest plane that is fitted, mm per millimetre or per radian.
const STEEPEST: f64 = 1.0e9;

/// One tile of a [`Node`].
struct Tile {
    x: f64,
    angle: f64,
    height: f64,
    half_x: f64,
    half_angle: f64,
    by_x: f64,
    by_angle: f64,
    residual: f64,
}

impl Tile {
    /// The tile of items, which there are.
    fn new(items: &[Item]) -> Self {
        let mut ends = [[f64::MAX, f64::MIN]; 3];
        for end in items.iter().flat_map(Item::ends) {
            ends = std::array::from_fn(|k| [ends[k][0].min(end[k]), ends[k][1].max(end[k])]);
        }
        let [x, angle, height] = ends.map(|[low, high]| 0.5 * (low + high));
        let [half_x, half_angle, half_height] = ends.map(|[low, high]| 0.5 * (high - low));
        let (by_x, by_angle) = fit(items, x, angle, height)
            // A plane so steep that singles lose it is no better than none.
            .filter(|(a, b)| a.abs().max(b.abs()) < STEEPEST)
            .filter(|(a, b)| a.abs() * half_x + b.abs() * half_angle <= 2.0 * half_height)
            .unwrap_or((0.0, 0.0));
        let (mut low, mut high) = (f64::MAX, f64::MIN);
        // A move is straight, so its ends stray furthest.
        for end in items.iter().flat_map(Item::ends) {
            let off = end[2] - by_x * (end[0] - x) - by_angle * (end[1] - angle);
            (low, high) = (low.min(off), high.max(off));
        }
        Self {
            x,
            angle,
            height: 0.5 * (low + high),
            half_x,
            half_angle,
            by_x,
            by_angle,
            residual: 0.5 * (high - low),
        }
    }
}

/// The slopes by travel and angle of the plane that fits the heights best, in the sense of least
/// squares; any others would do, only less well. `None` if the items do not spread.
fn fit(items: &[Item], x: f64, angle: f64, height: f64) -> Option<(f64, f64)> {
    let n = items.len() as f64;
    let mut sum = [0.0; 3];
    let mut product = [0.0; 5];
    for i in items {
        let (a, b, h) = (i.at[0] - x, i.at[1] - angle, i.at[2] - height);
        sum = [sum[0] + a, sum[1] + b, sum[2] + h];
        let terms = [a * a, a * b, b * b, a * h, b * h];
        product = std::array::from_fn(|k| product[k] + terms[k]);
    }
    let [a, b, h] = sum.map(|s| s / n);
    let aa = product[0] - n * a * a;
    let ab = product[1] - n * a * b;
    let bb = product[2] - n * b * b;
    let ah = product[3] - n * a * h;
    let bh = product[4] - n * b * h;
    let determinant = aa * bb - ab * ab;
    if determinant > 1.0e-9 * aa * bb {
        let by_x = (ah * bb - bh * ab) / determinant;
        let by_angle = (bh * aa - ah * ab) / determinant;
        return Some((by_x, by_angle));
    }
    // A row of positions along one direction, as in a ring or a line.
    if bb > 0.0 && bb >= aa {
        Some((0.0, bh / bb))
    } else if aa > 0.0 {
        Some((ah / aa, 0.0))
    } else {
        None
    }
}
