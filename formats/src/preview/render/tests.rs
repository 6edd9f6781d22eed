use super::*;

/// A square of two triangles at height `z`, `half` wide on each side of the middle.
fn square(half: f64, z: f64) -> [[Point; 3]; 2] {
    let corner = |x: f64, y: f64| [x * half, y * half, z];
    let [a, b, c, d] =
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| corner(x, y));
    [[a, b, c], [a, c, d]]
}

fn picture(triangles: &[[Point; 3]], lines: &[Polyline]) -> Pixmap {
    let picture = Pixmap::decode_png(&png(triangles, lines)).expect("a picture");
    assert_eq!((picture.width(), picture.height()), SIZE);
    picture
}

/// How many pixels have much more of the line's red than a part or a background has.
fn red(picture: &Pixmap) -> usize {
    let pixels = picture.pixels().iter();
    pixels.filter(|p| p.red() > 150 && p.green() < 60).count()
}

const RED: Colour = [220, 0, 0];

fn line(points: &[Option<Point>]) -> Polyline<'_> {
    Polyline {
        points,
        colour: RED,
        width: 3.0,
    }
}

#[test]
fn a_line_shows_in_front_of_the_part_and_not_behind_it() {
    let part = square(50.0, 0.0);
    let at = |z: f64| [-20.0, -10.0, 0.0, 10.0, 20.0].map(|x| Some([x, 0.0, z]));
    assert!(red(&picture(&part, &[line(&at(1.0))])) > 500);
    assert_eq!(red(&picture(&part, &[line(&at(-1.0))])), 0);
}

#[test]
fn a_line_is_interrupted_where_nothing_is_touched() {
    let part = square(50.0, 0.0);
    let whole: Vec<_> = (-20..=20).map(|x| Some([f64::from(x), 0.0, 1.0])).collect();
    let mut broken = whole.clone();
    broken[10..31].fill(None);
    let (whole, broken) = (
        picture(&part, &[line(&whole)]),
        picture(&part, &[line(&broken)]),
    );
    assert!(red(&broken) * 10 < red(&whole) * 6);
}

#[test]
fn the_nearer_facet_is_seen_whichever_comes_first() {
    let (near, far) = (square(30.0, 10.0), square(50.0, 0.0));
    let one = picture(&[near, far].concat(), &[]);
    let other = picture(&[far, near].concat(), &[]);
    assert!(one.data() == other.data());
}

#[test]
fn nonsense_is_left_out() {
    let part = square(50.0, 0.0);
    let bad = [
        [[f64::NAN; 3]; 3],
        [[0.0; 3]; 3],
        [[0.0; 3], [f64::INFINITY, 0.0, 0.0], [1.0; 3]],
    ];
    let path = [Some([f64::NAN, 0.0, 0.0]), None];
    let with = picture(&[part.as_slice(), bad.as_slice()].concat(), &[line(&path)]);
    assert!(with.data() == picture(&part, &[]).data());
    picture(&[], &[]);
}
