use super::*;

/// A square of two triangles at height `z`, `half` wide on each side of the middle.
fn square(half: f64, z: f64) -> [[Point; 3]; 2] {
    let corner = |x: f64, y: f64| [x * half, y * half, z];
    let [a, b, c, d] =
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| corner(x, y));
    [[a, b, c], [a, c, d]]
}

fn picture(triangles: &[[Point; 3]], lines: &[Polyline]) -> Vec<Colour> {
    let corners = (0..triangles.len() as u32 * 3).collect::<Vec<_>>();
    let sheet = Sheet {
        points: triangles.as_flattened().to_vec(),
        normals: Vec::new(),
        triangles: corners.as_chunks().0.to_vec(),
    };
    decoded(&png(&[sheet], lines))
}

fn decoded(file: &[u8]) -> Vec<Colour> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file))
        .read_info()
        .expect("a picture");
    assert_eq!(reader.info().size(), SIZE);
    let mut bytes = vec![0; (SIZE.0 * SIZE.1 * 3) as usize];
    reader.next_frame(&mut bytes).expect("whole");
    bytes.as_chunks().0.to_vec()
}

/// How many pixels have much more of the line's red than a part or a background has.
fn red(picture: &[Colour]) -> usize {
    let pixels = picture.iter();
    pixels.filter(|p| p[0] > 150 && p[1] < 60).count()
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
    assert!(one == other);
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
    assert!(with == picture(&part, &[]));
    picture(&[], &[]);
}

#[test]
fn a_line_is_as_wide_as_it_is_wanted_and_has_no_knots() {
    let mean = |steps: i32, width: f32| {
        let at = |i: i32| Some([f64::from(i) / f64::from(steps), 0.1, 0.0]);
        let points: Vec<_> = (-steps..=steps).map(at).collect();
        let black = Polyline {
            points: &points,
            colour: [0; 3],
            width,
        };
        let bare = picture(
            &[],
            &[Polyline {
                width: 0.0,
                ..black
            }],
        );
        let drawn = picture(&[], &[black]);
        let share = |(b, d): (&Colour, &Colour)| 1.0 - f64::from(d[1]) / f64::from(b[1]);
        bare.iter().zip(&drawn).map(share).sum::<f64>()
    };
    let thin = mean(1, 0.8);
    let wide = mean(1, 1.6) / thin;
    assert!((wide - 2.0).abs() < 0.05, "{wide}");
    let pieces = mean(400, 0.8) / thin;
    assert!((pieces - 1.0).abs() < 0.05, "{pieces}");
}

#[test]
fn a_smooth_sheet_is_lit_smoothly_and_a_crease_is_not() {
    let [a, b] = square(50.0, 0.0);
    let flat = picture(&[a, b], &[]);
    let sheet = |normals: [Point; 4]| Sheet {
        points: vec![a[0], a[1], a[2], b[2]],
        normals: normals.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let up = [0.0, 0.0, 1.0];
    let leaning = unit([0.3, 0.0, 1.0]).expect("a direction");
    let colours = |sheet: Sheet| {
        let picture = decoded(&png(&[sheet], &[]));
        picture
            .into_iter()
            .collect::<std::collections::HashSet<_>>()
            .len()
    };
    assert!(decoded(&png(&[sheet([up; 4])], &[])) == flat);
    let plain = colours(sheet([up; 4]));
    assert!(colours(sheet([up, leaning, leaning, up])) > plain + 10);
    assert_eq!(colours(sheet([[1.0, 0.0, 0.0]; 4])), plain);
}
