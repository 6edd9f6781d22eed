//! What pictures in SVG have in common: their paper, their text, their lines.
//!
//! A picture brings its own background and follows the reader's choice of light or dark. Text is text, in
//! the reader's font. Nothing here knows what is drawn.

use std::fmt::Write;

const STYLE: &str = "\
text{font-family:system-ui,sans-serif;font-size:13px;fill:#24292f}\
.title{font-size:17px;font-weight:600}.minor{fill:#57606a}\
.paper{fill:#ffffff}.frame{stroke:#57606a;fill:none}\
@media (prefers-color-scheme:dark){\
text{fill:#e6edf3}.minor{fill:#9da7b3}.paper{fill:#0d1117}.frame{stroke:#9da7b3}}";

/// The beginning of a picture of this size, with a style of its own besides the common one. It ends with
/// `</svg>`.
pub(crate) fn begin([width, height]: [f64; 2], title: &str, style: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\" role=\"img\">\n\
         <title>{}</title>\n<style>{STYLE}{style}</style>\n\
         <rect class=\"paper\" width=\"{width}\" height=\"{height}\"/>\n",
        escaped(title)
    )
}

/// A line around a frame: left, top, right, bottom.
pub(crate) fn frame(out: &mut String, [left, top, right, bottom]: [f64; 4]) {
    let (wide, high) = (right - left, bottom - top);
    push(
        out,
        format_args!(
            "<rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{wide}\" height=\"{high}\"/>\n"
        ),
    );
}

pub(crate) fn line(out: &mut String, class: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) {
    push(
        out,
        format_args!(
            "<line class=\"{class}\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/>\n"
        ),
    );
}

pub(crate) fn text(out: &mut String, class: &str, anchor: &str, [x, y]: [f64; 2], content: &str) {
    let content = escaped(content);
    push(
        out,
        format_args!(
            "<text class=\"{class}\" text-anchor=\"{anchor}\" x=\"{x:.1}\" y=\"{y:.1}\">{content}</text>\n"
        ),
    );
}

pub(crate) fn push(out: &mut String, what: std::fmt::Arguments) {
    // A string takes everything.
    let _ = out.write_fmt(what);
}

/// Text as SVG and HTML take it.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// A few round numbers in an interval.
pub(crate) fn ticks_between(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / 8.0;
    let decade = 10.0_f64.powf(rough.log10().floor());
    let round = [1.0, 2.0, 5.0, 10.0].map(|k| k * decade);
    let step = round.into_iter().find(|&s| s >= rough).unwrap_or(rough);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    // Back and forth, so that 0.3 does not show as 0.30000000000000004.
    let tick = |k: i64| (k as f64 * step * 1.0e9).round() / 1.0e9;
    (first..=last).map(tick).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(ticks_between(-3.0, 247.0), [0.0, 50.0, 100.0, 150.0, 200.0]);
        assert_eq!(
            ticks_between(0.0, 0.8),
            [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
        );
    }
}
