//! Diagrams out: curves over two axes, each even or logarithmic, as SVG.
//!
//! Nothing is computed about the curves.

use crate::svg::{self, escaped, line, push, text, ticks_between};

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
    /// How each of the two is divided.
    pub scales: [Scale; 2],
    /// The curves, in the order of the legend.
    pub curves: Vec<Curve>,
}

/// How an axis is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Equal lengths for equal differences.
    Even,
    /// Equal lengths for equal ratios; only positive values can be shown.
    Logarithmic,
    /// Only upwards, beside an even axis: the lengths of that one, and a picture as high as it takes.
    ToScale,
}

/// A curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Its name in the legend, where one without a name is left out.
    pub name: String,
    /// Its colour, a number below [`COLORS`].
    pub color: usize,
    /// Whether the line is broken.
    pub dashed: bool,
    /// Points, in order; with a mark at each if there are few, and a fine line if there are very many.
    pub points: Vec<[f64; 2]>,
}

/// Number of colours that a curve can have.
pub const COLORS: usize = 4;

/// Most points of a curve that has a mark at each.
const MARKED: usize = 40;

/// Room above and below what is to scale, of its height, so that nothing runs along the frame.
const ROOM: f64 = 0.04;

/// Most points of a curve that is not fine.
const BOLD: usize = 1000;

/// How a fine line differs.
const FINE: &str = " style=\"stroke-width:0.8\"";

/// Size of the picture, and the frame in it: left, top, right, bottom; unless it is to scale.
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
    let [left, top, right, bottom] = FRAME;
    let values = |k: usize| {
        let scale = plot.scales[k];
        let points = plot.curves.iter().flat_map(|c| &c.points);
        points.map(move |p| p[k]).filter(move |v| scale.shows(*v))
    };
    let [x_scale, y_scale] = plot.scales;
    let x = Axis::over(x_scale, values(0), [left, right]);
    let mut y = Axis::over(y_scale, values(1), [bottom, top]);
    if y_scale == Scale::ToScale {
        y.ends[0] = (top + (right - left) * y.length() / x.length()).round();
    }
    let below = y.ends[0] - bottom;
    let (bottom, size) = (bottom + below, [SIZE[0], SIZE[1] + below]);
    let mut out = svg::begin(size, &plot.title, STYLE);
    text(&mut out, "title", "start", [left, 32.0], &plot.title);
    text(&mut out, "minor", "start", [left, 53.0], &plot.subtitle);
    for (place, label) in &x.ticks {
        let at = x.at(*place);
        line(&mut out, "grid", [at, top], [at, bottom]);
        text(&mut out, "minor", "middle", [at, bottom + 20.0], label);
    }
    for (place, label) in &y.ticks {
        let at = y.at(*place);
        line(&mut out, "grid", [left, at], [right, at]);
        text(&mut out, "minor", "end", [left - 8.0, at + 4.5], label);
    }
    svg::frame(&mut out, [left, top, right, bottom]);
    let middle = [(left + right) / 2.0, (top + bottom) / 2.0];
    text(&mut out, "", "middle", [middle[0], size[1] - 14.0], &plot.x);
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
        let points = curve.points.iter();
        let shown = points.filter(|p| x_scale.shows(p[0]) && y_scale.shows(p[1]));
        let places: Vec<[f64; 2]> = shown.map(|p| [x.place(p[0]), y.place(p[1])]).collect();
        draw(&mut out, curve, &places);
    }
    out.push_str("</svg>\n");
    out
}

impl Scale {
    /// Whether it can show a value.
    fn shows(self, value: f64) -> bool {
        value.is_finite() && (self != Self::Logarithmic || value > 0.0)
    }

    /// Where equal lengths are equal differences.
    fn place(self, value: f64) -> f64 {
        match self {
            Self::Even | Self::ToScale => value,
            Self::Logarithmic => value.log10(),
        }
    }
}

/// An axis: its labels by their places, and which places its ends are.
struct Axis {
    scale: Scale,
    ticks: Vec<(f64, String)>,
    span: [f64; 2],
    ends: [f64; 2],
}

impl Axis {
    fn over(scale: Scale, values: impl Iterator<Item = f64>, ends: [f64; 2]) -> Self {
        let span = values.fold(None, |span: Option<(f64, f64)>, v| {
            Some(span.map_or((v, v), |(low, high)| (low.min(v), high.max(v))))
        });
        match scale {
            Scale::Even => Self::even(span.unwrap_or((0.0, 1.0)), ends),
            Scale::ToScale => {
                let (low, high) = span.unwrap_or((0.0, 1.0));
                let room = ROOM * (high - low);
                Self::even((low - room, high + room), ends)
            }
            Scale::Logarithmic => Self::logarithmic(span.unwrap_or((1.0, 10.0)), ends),
        }
    }

    /// From end to end of what is shown.
    fn even((low, high): (f64, f64), ends: [f64; 2]) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        let ticks = ticks_between(low, high);
        Self {
            scale: Scale::Even,
            ticks: ticks.into_iter().map(|t| (t, t.to_string())).collect(),
            span: [low, high],
            ends,
        }
    }

    /// From tick to tick.
    fn logarithmic((low, high): (f64, f64), ends: [f64; 2]) -> Self {
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
        let end = |tick: Option<&Tick>| tick.map_or(0.0, |t| t.exponent());
        Self {
            scale: Scale::Logarithmic,
            span: [end(ticks.first()), end(ticks.last())],
            ticks: ticks
                .into_iter()
                .map(|t| (t.exponent(), t.label()))
                .collect(),
            ends,
        }
    }

    fn place(&self, value: f64) -> f64 {
        self.at(self.scale.place(value))
    }

    /// From end to end of what is shown.
    fn length(&self) -> f64 {
        self.span[1] - self.span[0]
    }

    fn at(&self, place: f64) -> f64 {
        let share = (place - self.span[0]) / self.length();
        self.ends[0] + (self.ends[1] - self.ends[0]) * share
    }
}

/// A labelled value of a logarithmic axis: a digit times a power of ten.
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
    let named = plot.curves.iter().filter(|c| !c.name.is_empty());
    let columns = named.clone().count().div_ceil(2).max(1);
    let pitch = ((right - left) / columns as f64).min(190.0);
    for (k, curve) in named.enumerate() {
        let x = left + pitch * (k / 2) as f64;
        let y = top - 38.0 + 20.0 * (k % 2) as f64;
        draw(out, curve, &[[x, y], [x + 26.0, y]]);
        text(out, "", "start", [x + 33.0, y + 4.5], &curve.name);
    }
}

fn draw(out: &mut String, curve: &Curve, places: &[[f64; 2]]) {
    let color = curve.color % COLORS;
    let dashed = if curve.dashed { " dashed" } else { "" };
    let fine = if places.len() > BOLD { FINE } else { "" };
    let line = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}"));
    let line = line.collect::<Vec<_>>().join(" ");
    push(
        out,
        format_args!("<polyline class=\"curve c{color}{dashed}\"{fine} points=\"{line}\"/>\n"),
    );
    if places.len() > MARKED {
        return;
    }
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

    fn plot(scales: [Scale; 2], points: Vec<[f64; 2]>) -> String {
        svg(&Plot {
            title: "a < b & c".to_owned(),
            subtitle: String::new(),
            x: "points".to_owned(),
            y: "µs".to_owned(),
            scales,
            curves: vec![Curve {
                name: "exact".to_owned(),
                color: 1,
                dashed: true,
                points,
            }],
        })
    }

    const LOGARITHMIC: [Scale; 2] = [Scale::Logarithmic; 2];

    #[test]
    fn an_even_axis_goes_from_end_to_end() {
        let [left, top, right, bottom] = FRAME;
        let points: Vec<[f64; 2]> = (0..=50)
            .map(|k| [f64::from(k), f64::from(k - 25)])
            .collect();
        let drawn = plot([Scale::Even; 2], points);
        let (x, y) = ((left + right) / 2.0, (top + bottom) / 2.0);
        assert!(
            drawn.contains(&format!("{left:.1},{bottom:.1} ")),
            "{drawn}"
        );
        assert!(drawn.contains(&format!(" {x:.1},{y:.1} ")), "{drawn}");
        assert!(drawn.contains(">-20<") && drawn.contains(">40<"), "{drawn}");
        let marks = drawn.matches("<circle").count();
        assert_eq!(marks, 2, "those of the legend and no more");
    }

    #[test]
    fn a_picture_to_scale_is_as_high_as_it_takes() {
        let [left, top, right, _] = FRAME;
        for ratio in [0.5, 2.0] {
            let corners = vec![[0.0, 0.0], [10.0, 10.0 * ratio]];
            let drawn = plot([Scale::Even, Scale::ToScale], corners);
            let high = (right - left) * ratio * (1.0 + 2.0 * ROOM);
            let height = SIZE[1] - FRAME[3] + (top + high).round();
            assert!(drawn.contains(&format!("height=\"{height}\"")), "{drawn}");
            let room = high.round() * ROOM / (1.0 + 2.0 * ROOM);
            let (low, high) = (top + high.round() - room, top + room);
            let line = format!("{left:.1},{low:.1} {right:.1},{high:.1}");
            assert!(drawn.contains(&line), "{drawn}");
        }
    }

    #[test]
    fn only_what_has_a_name_is_in_the_legend_and_many_points_are_fine() {
        let curve = |name: &str, points| Curve {
            name: name.to_owned(),
            color: 0,
            dashed: false,
            points: vec![[1.0, 2.0]; points],
        };
        let drawn = svg(&Plot {
            title: String::new(),
            subtitle: String::new(),
            x: String::new(),
            y: String::new(),
            scales: [Scale::Even; 2],
            curves: vec![curve("", BOLD + 1), curve("named", BOLD)],
        });
        assert_eq!(drawn.matches("<polyline").count(), 3, "{drawn}");
        assert_eq!(drawn.matches(FINE).count(), 1, "{drawn}");
    }

    #[test]
    fn decades_span_the_frame() {
        let [left, top, right, bottom] = FRAME;
        let drawn = plot(LOGARITHMIC, vec![[1.0e4, 0.1], [1.0e5, 1.0], [1.0e6, 10.0]]);
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
            for scales in [LOGARITHMIC, [Scale::Even; 2], [Scale::Even, Scale::ToScale]] {
                let drawn = plot(scales, points.clone());
                assert!(!drawn.contains("NaN") && !drawn.contains("inf"), "{drawn}");
                assert!(drawn.ends_with("</svg>\n"));
            }
        }
    }

    #[test]
    fn a_short_axis_has_what_lies_between_decades() {
        let labels = |low: f64, high: f64| {
            let values = [low, high].into_iter();
            let axis = Axis::over(Scale::Logarithmic, values, [0.0, 1.0]);
            axis.ticks.into_iter().map(|t| t.1).collect::<Vec<_>>()
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
