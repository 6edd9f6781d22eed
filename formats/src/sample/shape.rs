//! The shape of a last: what a last maker measures along it, and the cross-sections these make.
//!
//! Stations run from 0 at the back of the heel to 1 at the tip of the toe. Widths and heights are
//! those of a last with a ball width of 90 and a cone height of 87 mm; a style scales them.
//! x runs from heel to toe, z up, and y towards the inner side of the foot.

use horma_core::Point;

use super::LastStyle;
use super::loft::{Table, at};

/// From the middle to the widest point of the inner side, mm: hollow at the waist, full at the
/// inner ball (0.75), and bent inwards from there.
const INNER: &Table = &[
    (0.0, 31.0),
    (0.15, 31.5),
    (0.25, 30.5),
    (0.35, 28.5),
    (0.45, 28.5),
    (0.55, 32.5),
    (0.63, 40.0),
    (0.7, 45.0),
    (0.75, 46.0),
    (0.82, 44.5),
    (0.9, 40.5),
    (1.0, 35.0),
];
/// The same on the outer side, whose ball lies further back (0.67).
const OUTER: &Table = &[
    (0.0, 31.0),
    (0.15, 31.0),
    (0.25, 31.5),
    (0.35, 33.0),
    (0.45, 36.0),
    (0.55, 42.0),
    (0.62, 46.0),
    (0.67, 46.5),
    (0.73, 44.8),
    (0.82, 39.5),
    (0.9, 34.0),
    (1.0, 28.0),
];
/// How far the feather edge lies inside the widest point of the inner side, mm: most at the shank.
const INNER_INSET: &Table = &[
    (0.0, 4.0),
    (0.15, 4.5),
    (0.25, 7.0),
    (0.4, 14.0),
    (0.5, 13.0),
    (0.6, 8.0),
    (0.7, 5.5),
    (0.85, 3.5),
    (1.0, 2.0),
];
/// The same on the outer side.
const OUTER_INSET: &Table = &[
    (0.0, 4.0),
    (0.15, 4.5),
    (0.25, 5.5),
    (0.4, 7.5),
    (0.5, 7.0),
    (0.6, 5.0),
    (0.7, 4.0),
    (0.85, 3.0),
    (1.0, 2.0),
];
/// Height of the bottom over the ground from the heel seat to the ball, of the heel height.
const PITCH: &Table = &[
    (0.0, 1.0),
    (0.1, 0.96),
    (0.2, 0.89),
    (0.3, 0.75),
    (0.4, 0.53),
    (0.5, 0.28),
    (0.6, 0.08),
    (0.68, 0.0),
    (1.0, 0.0),
];
/// Height of the bottom over the ground from the ball to the toe, of the toe spring.
const SPRING: &Table = &[
    (0.0, 0.0),
    (0.66, 0.0),
    (0.75, 0.08),
    (0.85, 0.32),
    (0.93, 0.66),
    (1.0, 1.0),
];
/// Height of the top over the bottom, mm: the cone, its front (0.38), the instep, the vamp, the
/// toe box.
const HEIGHT: &Table = &[
    (0.0, 77.0),
    (0.1, 78.0),
    (0.25, 82.0),
    (0.36, 86.5),
    (0.395, 85.0),
    (0.45, 76.5),
    (0.5, 67.5),
    (0.6, 54.0),
    (0.7, 43.5),
    (0.8, 34.5),
    (0.9, 26.5),
    (1.0, 19.0),
];
/// Height of the widest point over the bottom, mm.
const WIDEST: &Table = &[
    (0.0, 18.0),
    (0.15, 19.0),
    (0.4, 24.0),
    (0.55, 19.0),
    (0.7, 14.5),
    (0.85, 11.0),
    (1.0, 9.0),
];
/// How much of the section's upper half is that of the cone, the rest being that of the vamp.
const CONE_SHARE: &Table = &[
    (0.0, 1.0),
    (0.3, 1.0),
    (0.42, 0.75),
    (0.52, 0.35),
    (0.64, 0.0),
    (1.0, 0.0),
];
/// How far the top lies towards the inner side, mm: the ridge of the instep.
const RIDGE: &Table = &[
    (0.0, 0.0),
    (0.3, 0.0),
    (0.5, 5.0),
    (0.65, 10.0),
    (0.8, 8.0),
    (1.0, 2.0),
];
/// How far the feather edge lies above the middle of the bottom, mm; below it at the shank.
const CROWN: &Table = &[
    (0.0, 1.0),
    (0.2, 0.8),
    (0.4, -1.0),
    (0.55, -0.5),
    (0.68, 1.5),
    (0.85, 1.0),
    (1.0, 0.3),
];

/// Upper half of a section from below the widest point to the middle of the top: of the half width,
/// and of the height between the two. The vamp is a vault.
const VAMP: [(f64, f64); 5] = [
    (0.985, 0.32),
    (0.9, 0.58),
    (0.7, 0.8),
    (0.43, 0.94),
    (0.18, 0.99),
];
/// The same for the cone: drawn in, with a plateau on top.
const CONE: [(f64, f64); 5] = [
    (0.93, 0.27),
    (0.75, 0.51),
    (0.55, 0.75),
    (0.44, 0.95),
    (0.36, 1.0),
];

/// Ball width and cone height that the tables are for, mm.
const BALL_WIDTH: f64 = 90.0;
const CONE_HEIGHT: f64 = 87.0;

/// Distances of sections from the end of the heel and from that of the toe, mm: close where the
/// surface turns round the end. The first leaves a slit, inside the holder.
const ENDS: [f64; 9] = [0.05, 0.5, 1.5, 3.2, 6.0, 10.3, 15.8, 22.8, 31.0];
/// Sections between those.
const BETWEEN: usize = 22;

/// The spindle meets the back of the heel this far above its seat, and the toe's tip this far above
/// its bottom, mm.
const SPINDLE: (f64, f64) = (18.0, 8.0);

/// The sections, each a ring of poles that begins in the middle of the bottom and climbs the outer
/// side. The spindle is the x axis.
pub(super) fn sections(style: &LastStyle) -> Vec<Vec<Point>> {
    let end = ENDS[ENDS.len() - 1];
    let pitch = (style.length - 2.0 * end) / (BETWEEN + 1) as f64;
    let heel = ENDS.into_iter();
    let between = (1..=BETWEEN).map(|i| end + pitch * i as f64);
    let toe = ENDS.into_iter().rev().map(|d| style.length - d);
    heel.chain(between)
        .chain(toe)
        .map(|x| section(style, x))
        .collect()
}

fn section(style: &LastStyle, x: f64) -> Vec<Point> {
    let t = x / style.length;
    let toe = style.length - x;
    let (wide, high) = (
        style.ball_width / BALL_WIDTH,
        style.cone_height / CONE_HEIGHT,
    );
    let spindle = (style.heel_height + SPINDLE.0) * (1.0 - t) + (style.toe_spring + SPINDLE.1) * t;

    // The whole section, relative to the spindle, and then what the rounding of the ends leaves.
    let whole_bottom =
        style.heel_height * at(PITCH, t) + style.toe_spring * at(SPRING, t) - spindle;
    let whole_height = high * at(HEIGHT, t);
    let bottom = whole_bottom * rounding(x, 12.0, 2.5, 5.0) * rounding(toe, 16.0, 2.2, 4.0);
    let top = (whole_bottom + whole_height)
        * rounding(x, 14.0, 1.25, 2.2)
        * rounding(toe, 24.0, 2.0, 2.3);
    let width = wide * rounding(x, 34.0, 2.0, 2.1) * rounding(toe, 52.0, 2.1, 2.3);
    let height = top - bottom;
    let widest = bottom + at(WIDEST, t) * high * height / whole_height;
    let crown = at(CROWN, t) * width;
    let cone = at(CONE_SHARE, t);

    let side = |half: f64, inset: f64| -> Vec<(f64, f64)> {
        let (w, feather) = (half * width, (half - inset) * width);
        let (out, up) = (w - feather, widest - bottom);
        // Poles this close make the feather edge an edge.
        let edge = (0.1 * feather).min(0.05 * height).min(1.2);
        let mut poles = vec![
            (0.4 * feather, bottom + 0.25 * crown),
            (0.78 * feather, bottom + 0.75 * crown),
            (feather - 1.5 * edge, bottom + crown),
            (feather, bottom + crown + 0.4 * edge),
            (
                feather + 0.12 * out,
                bottom + crown + 0.07 * up + 0.8 * edge,
            ),
            (feather + 0.46 * out, bottom + 0.5 * crown + 0.33 * up),
            (feather + 0.86 * out, bottom + 0.68 * up),
            (w, widest + 0.06 * (top - widest)),
        ];
        poles.extend(VAMP.iter().zip(CONE).map(|(vamp, over)| {
            let mix = |a: f64, b: f64| a + cone * (b - a);
            (
                w * mix(vamp.0, over.0),
                widest + (top - widest) * mix(vamp.1, over.1),
            )
        }));
        poles
    };
    let outer = side(at(OUTER, t), at(OUTER_INSET, t));
    let inner = side(at(INNER, t), at(INNER_INSET, t));
    let ridge = at(RIDGE, t) * width;
    let pole = |(y, z): (f64, f64)| {
        let above = ((z - widest) / (top - widest)).max(0.0);
        [x, y + ridge * above * above, z]
    };
    let ring = std::iter::once((0.0, bottom))
        .chain(outer.into_iter().map(|(y, z)| (-y, z)))
        .chain(std::iter::once((0.0, top)))
        .chain(inner.into_iter().rev());
    ring.map(pole).collect()
}

/// How much of a measure is left at a distance `d` from an end that is rounded over a `reach`: 0 at
/// the end and 1 beyond the reach. The powers say how blunt; 2 and 2 is an ellipse.
fn rounding(d: f64, reach: f64, p: f64, q: f64) -> f64 {
    if d >= reach {
        return 1.0;
    }
    libm::pow(1.0 - libm::pow(1.0 - d / reach, p), 1.0 / q)
}
