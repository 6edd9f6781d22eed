//! Diagrams out: curves over two logarithmic axes, as SVG.
//!
//! Nothing is computed about the curves.

use crate::svg::{self, escaped, line, push, text};

/// A diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// What it shows.
    pub title: String,
    /// Of what, and how it came about.
    pub subtitle: String,
    /// What the horizontal axis counts, with its unit.
    pub x: String,
    /// What the vertical axis measures, with its unit.
    pub y: String,
    /// The curves, in the order of the legend.
    pub curves: Vec<Curve>,
}

/// A curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// Its colour, a number below [`COLORS`].
    pub color: usize,
    /// Whether the line is broken.
    pub dashed: bool,
    /// Points, from left to right; only positive ones can be shown.
    pub points: Vec<[f64; 2]>,
}

/// Number of colours that a curve can have.
pub const COLORS: usize = 4;

/// Size of the picture, and the frame in it: left, top, right, bottom.
const SIZE: [f64; 2] = [720.0, 480.0];
const FRAME: [f64; 4] = [72.0, 112.0, 696.0, 424.0];

const STYLE: &str = "\
.grid{stroke:#d8dee4;fill:none}\
.curve{fill:none;stroke-width:2.2;stroke-linejoin:round}.dashed{stroke-dasharray:7 4}\
.c0{stroke:#0969da}.c1{stroke:#bc4c00}.c2{stroke:#1a7f37}.c3{stroke:#8c959f}\
.d0{fill:#0969da}.d1{fill:#bc4c00}.d2{fill:#1a7f37}.d3{fill:#8c959f}\
@media (prefers-color-scheme:dark){.grid{stroke:#30363d}\
.c0{stroke:#58a6ff}.c1{stroke:#f0883e}.c2{stroke:#3fb950}.c3{stroke:#8b949e}\
.d0{fill:#58a6ff}.d1{fill:#f0883e}.d2{fill:#3fb950}.d3{fill:#8b949e}}";

/// Draws a diagram.
pub fn svg(plot: &Plot) -> String {
    let [_, height] = SIZE;
    let [left, top, right, bottom] = FRAME;
    let mut out = svg::begin(SIZE, &plot.title, STYLE);
    text(&mut out, "title", "start", [left, 32.0], &plot.title);
    text(&mut out, "minor", "start", [left, 53.0], &plot.subtitle);
    let values = |k: usize| {
        let points = plot.curves.iter().flat_map(|c| &c.points);
        points.map(move |p| p[k]).filter(|v| shown(*v))
    };
    let x = Axis::over(values(0), [left, right]);
    let y = Axis::over(values(1), [bottom, top]);
    for tick in &x.ticks {
        let at = x.at(tick.exponent());
        line(&mut out, "grid", [at, top], [at, bottom]);
        let label = tick.label();
        text(&mut out, "minor", "middle", [at, bottom + 20.0], &label);
    }
    for tick in &y.ticks {
        let at = y.at(tick.exponent());
        line(&mut out, "grid", [left, at], [right, at]);
        let label = tick.label();
        text(&mut out, "minor", "end", [left - 8.0, at + 4.5], &label);
    }
    svg::frame(&mut out, FRAME);
    let middle = [(left + right) / 2.0, (top + bottom) / 2.0];
    text(&mut out, "", "middle", [middle[0], height - 14.0], &plot.x);
    push(
        &mut out,
        format_args!(
            "<text text-anchor=\"middle\" transform=\"translate(22 {}) rotate(-90)\">{}</text>\n",
            middle[1],
            escaped(&plot.y)
        ),
    );
    legend(&mut out, plot);
    for curve in &plot.curves {
        let shown = curve.points.iter().filter(|p| p.iter().all(|v| shown(*v)));
        let places: Vec<[f64; 2]> = shown.map(|p| [x.place(p[0]), y.place(p[1])]).collect();
        draw(&mut out, curve, &places);
    }
    out.push_str("</svg>\n");
    out
}

/// Whether a logarithmic axis can show it.
fn shown(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

/// A logarithmic axis, from tick to tick.
struct Axis {
    ticks: Vec<Tick>,
    ends: [f64; 2],
}

impl Axis {
    fn over(values: impl Iterator<Item = f64>, ends: [f64; 2]) -> Self {
        let span = values.fold(None, |span: Option<(f64, f64)>, v| {
            Some(span.map_or((v, v), |(low, high)| (low.min(v), high.max(v))))
        });
        let (low, high) = span.unwrap_or((1.0, 10.0));
        // A hair beyond a tick does not ask for another one.
        let (low, high) = (low.log10() + 0.02, high.log10() - 0.02);
        let first = low.floor() as i32;
        let last = (high.ceil() as i32).max(first + 1);
        // Within two decades there is room for what lies between.
        let digits: &[u8] = if last - first > 2 { &[1] } else { &[1, 2, 5] };
        let within = |decade| digits.iter().map(move |&digit| Tick { digit, decade });
        let mut ticks: Vec<Tick> = (first..=last).flat_map(within).collect();
        while ticks.len() > 2 && ticks[1].exponent() <= low {
            ticks.remove(0);
        }
        while ticks.len() > 2 && ticks[ticks.len() - 2].exponent() >= high {
            ticks.pop();
        }
        Self { ticks, ends }
    }

    fn place(&self, value: f64) -> f64 {
        self.at(value.log10())
    }

    fn at(&self, exponent: f64) -> f64 {
        let end = |tick: Option<&Tick>| tick.map_or(0.0, |t| t.exponent());
        let (low, high) = (end(self.ticks.first()), end(self.ticks.last()));
        let share = (exponent - low) / (high - low);
        self.ends[0] + (self.ends[1] - self.ends[0]) * share
    }
}

/// A labelled value of an axis: a digit times a power of ten.
#[derive(Clone, Copy)]
struct Tick {
    digit: u8,
    decade: i32,
}

impl Tick {
    fn exponent(self) -> f64 {
        f64::from(self.decade) + f64::from(self.digit).log10()
    }

    fn label(self) -> String {
        match self.digit {
            1 => power(self.decade),
            digit if (-3..=2).contains(&self.decade) => {
                // The shortest text of a sum may be long.
                let places = usize::try_from(-self.decade).unwrap_or(0);
                format!("{:.places$}", f64::from(digit) * 10f64.powi(self.decade))
            }
            digit => format!("{digit}·{}", power(self.decade)),
        }
    }
}

/// A power of ten: in full if it is short.
fn power(exponent: i32) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    if (-2..=3).contains(&exponent) {
        return 10f64.powi(exponent).to_string();
    }
    let sign = if exponent < 0 { "⁻" } else { "" };
    let digits = exponent.unsigned_abs().to_string();
    let raised = digits.bytes().map(|d| RAISED[usize::from(d - b'0')]);
    format!("10{sign}{}", raised.collect::<String>())
}

/// Two curves above each other, then the next two.
fn legend(out: &mut String, plot: &Plot) {
    let [left, top, right, _] = FRAME;
    let columns = plot.curves.len().div_ceil(2).max(1);
    let pitch = ((right - left) / columns as f64).min(190.0);
    for (k, curve) in plot.curves.iter().enumerate() {
        let x = left + pitch * (k / 2) as f64;
        let y = top - 38.0 + 20.0 * (k % 2) as f64;
        draw(out, curve, &[[x, y], [x + 26.0, y]]);
        text(out, "", "start", [x + 33.0, y + 4.5], &curve.name);
    }
}

fn draw(out: &mut String, curve: &Curve, places: &[[f64; 2]]) {
    let color = curve.color % COLORS;
    let dashed = if curve.dashed { " dashed" } else { "" };
    let line = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}"));
    let line = line.collect::<Vec<_>>().join(" ");
    push(
        out,
        format_args!("<polyline class=\"curve c{color}{dashed}\" points=\"{line}\"/>\n"),
    );
    for [x, y] in places {
        push(
            out,
            format_args!("<circle class=\"d{color}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/>\n"),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: Vec<[f64; 2]>) -> String {
        svg(&Plot {
            title: "a < b & c".to_owned(),
            subtitle: String::new(),
            x: "points".to_owned(),
            y: "µs".to_owned(),
            curves: vec![Curve {
                name: "exact".to_owned(),
                color: 1,
                dashed: true,
                points,
            }],
        })
    }

    #[test]
    fn decades_span_the_frame() {
        let [left, top, right, bottom] = FRAME;
        let drawn = plot(vec![[1.0e4, 0.1], [1.0e5, 1.0], [1.0e6, 10.0]]);
        let (x, y) = ((left + right) / 2.0, (top + bottom) / 2.0);
        let line = format!("{left:.1},{bottom:.1} {x:.1},{y:.1} {right:.1},{top:.1}");
        assert!(drawn.contains(&line), "{drawn}");
        assert!(
            drawn.contains(">10⁶<") && drawn.contains(">0.1<"),
            "{drawn}"
        );
        assert!(drawn.contains("a &lt; b &amp; c") && drawn.contains("dashed"));
    }

    #[test]
    fn nothing_and_what_has_no_logarithm_are_drawn_too() {
        for points in [
            vec![],
            vec![[10.0, 5.0]],
            vec![[0.0, -1.0], [1.0, f64::NAN]],
        ] {
            let drawn = plot(points);
            assert!(!drawn.contains("NaN") && !drawn.contains("inf"), "{drawn}");
            assert!(drawn.ends_with("</svg>\n"));
        }
    }

    #[test]
    fn a_short_axis_has_what_lies_between_decades() {
        let labels = |low: f64, high: f64| {
            let axis = Axis::over([low, high].into_iter(), [0.0, 1.0]);
            axis.ticks.iter().map(|t| t.label()).collect::<Vec<_>>()
        };
        assert_eq!(labels(1.0, 8.0), ["1", "2", "5", "10"]);
        assert_eq!(labels(0.03, 0.3), ["0.02", "0.05", "0.1", "0.2", "0.5"]);
        assert_eq!(labels(3.0, 3.0), ["2", "5"]);
        assert_eq!(labels(2.0e4, 4.0e4), ["2·10⁴", "5·10⁴"]);
        assert_eq!(labels(1.0, 1024.0), ["1", "10", "100", "1000"]);
    }

    #[test]
    fn powers_of_ten_are_written_as_people_do() {
        let written = [-3, -2, 0, 3, 4, 12].map(power);
        assert_eq!(written, ["10⁻³", "0.01", "1", "1000", "10⁴", "10¹²"]);
    }
}
