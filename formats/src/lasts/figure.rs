//! A last's sections with its landmarks, as SVG: the median plane, the ball, the cone heel line.

use std::path::Path;

use horma_core::{Landmark, Sections};

use crate::error::Result;
use crate::output;
use crate::svg::{self, push, text};

const SIZE: [f64; 2] = [760.0, 650.0];
const STYLE: &str = "\
.curve{fill:none;stroke:#0969da;stroke-width:1.6;stroke-linejoin:round}\
.mark{fill:#bc4c00}@media (prefers-color-scheme:dark){.curve{stroke:#58a6ff}.mark{fill:#f0883e}}";
/// Pixels for each mm.
const SCALE: f64 = 2.2;

/// Draws the sections.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be written.
pub fn save(file: &Path, sections: &Sections) -> Result<()> {
    let drawn = svg(sections);
    output::write(file, |out| std::io::Write::write_all(out, drawn.as_bytes()))
}

fn svg(sections: &Sections) -> String {
    let mut out = svg::begin(SIZE, "Sections of the last", STYLE);
    text(
        &mut out,
        "title",
        "start",
        [20.0, 30.0],
        "Median plane, heel to toe",
    );
    let place = frame(&sections.median, [90.0, 60.0]);
    curve(&mut out, &sections.median, &place);
    for (landmark, at) in Landmark::ALL.iter().zip(sections.landmarks) {
        let [x, y] = place([at[0], at[2]]);
        push(
            &mut out,
            format_args!("<circle class=\"mark\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\"/>\n"),
        );
        let name = landmark.name().replace('_', " ");
        // The ball's places and the tread lie close together from here.
        let (anchor, right, below) = match landmark {
            Landmark::BallOuter => ("end", -8.0, 4.0),
            Landmark::Tread => ("start", 6.0, 18.0),
            _ => ("start", 6.0, -6.0),
        };
        text(&mut out, "", anchor, [x + right, y + below], &name);
    }
    for (title, points, left) in [
        ("Ball girth", &sections.ball, 90.0),
        ("Cone heel line", &sections.cone_heel, 420.0),
    ] {
        text(&mut out, "title", "start", [left - 70.0, 330.0], title);
        curve(&mut out, points, frame(points, [left, 350.0]));
    }
    out + "</svg>\n"
}

/// Where points of a plane are drawn, those of a curve with its upper left corner here.
fn frame(points: &[[f64; 2]], [left, top]: [f64; 2]) -> impl Fn([f64; 2]) -> [f64; 2] + use<> {
    let least = points.iter().map(|p| p[0]).fold(f64::INFINITY, f64::min);
    let most = points
        .iter()
        .map(|p| p[1])
        .fold(f64::NEG_INFINITY, f64::max);
    let wide = points.iter().map(|p| p[0] - least).fold(1.0, f64::max);
    let scale = SCALE.min(600.0 / wide);
    move |[x, y]| [left + scale * (x - least), top + scale * (most - y)]
}

fn curve(out: &mut String, points: &[[f64; 2]], place: impl Fn([f64; 2]) -> [f64; 2]) {
    let corner = |&p: &[f64; 2]| {
        let [x, y] = place(p);
        format!("{x:.1},{y:.1}")
    };
    let mut corners: Vec<String> = points.iter().map(corner).collect();
    corners.dedup();
    push(
        out,
        format_args!(
            "<polygon class=\"curve\" points=\"{}\"/>\n",
            corners.join(" ")
        ),
    );
}
