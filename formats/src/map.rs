//! `machined.svg`: the deviation of the machined surface from the designed one, unrolled: travel from left
//! to right, the angle at which each place faces the cutter from bottom to top.
//!
//! A pixel is a ray; nothing is smoothed. The picture brings its own scale of colours.

use std::io::Write;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use horma_core::Machined;

use crate::error::Result;
use crate::svg::{self, line, push, text, ticks_between};
use crate::{output, raster};

/// Colours for deviations, as on a run's page: red where gouged, white where nothing is the matter, blue where
/// material is left; the end of the scale and beyond is full colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Deviation at which the colour is full, mm.
    pub end: f64,
}

/// Full colours of gouge and excess, and what lies between.
const GOUGE: [f64; 3] = [192.0, 31.0, 46.0];
const NOTHING: [f64; 3] = [247.0, 247.0, 247.0];
const EXCESS: [f64; 3] = [28.0, 79.0, 156.0];
/// Where nothing is measured.
const MISSING: [u8; 3] = [208, 215, 222];

/// Share of the excesses that the scale holds: some places are out of the cutter's reach, and would take
/// all colour from the rest.
const HELD: f64 = 0.95;
/// Shortest scale, mm: below that all is well, and white.
const SHORTEST: f64 = 1.0e-3;

impl Scale {
    /// One that holds every gouge, and all excesses but a few.
    pub fn of(surface: &Machined) -> Self {
        let mut excesses: Vec<f64> = surface.deviation.iter().flatten().copied().collect();
        excesses.sort_unstable_by(f64::total_cmp);
        let deepest = excesses.first().map_or(0.0, |least| -least);
        let held = (HELD * excesses.len() as f64) as usize;
        let high = excesses.get(held).copied().unwrap_or(0.0);
        Self {
            end: deepest.max(high).max(SHORTEST),
        }
    }

    /// The colour of a deviation.
    pub fn colour(&self, deviation: Option<f64>) -> [u8; 3] {
        let Some(deviation) = deviation else {
            return MISSING;
        };
        let full = if deviation < 0.0 { GOUGE } else { EXCESS };
        let share = (deviation.abs() / self.end).min(1.0);
        std::array::from_fn(|k| (NOTHING[k] + (full[k] - NOTHING[k]) * share).round() as u8)
    }
}

/// Size of the picture, and the frame in it: left, top, right, bottom.
const SIZE: [f64; 2] = [960.0, 560.0];
const FRAME: [f64; 4] = [64.0, 84.0, 936.0, 460.0];
/// Left, top, right and bottom of the scale of colours.
const BAR: [f64; 4] = [300.0, 524.0, 700.0, 536.0];

const STYLE: &str = ".tick{stroke:#57606a}image{image-rendering:pixelated}\
@media (prefers-color-scheme:dark){.tick{stroke:#9da7b3}}";

/// Writes the map to `file`: beside it first, then renamed.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be written.
pub fn save(file: &Path, surface: &Machined) -> Result<()> {
    let svg = svg(surface);
    output::write(file, |out| out.write_all(svg.as_bytes()))
}

fn svg(surface: &Machined) -> String {
    let [left, top, right, bottom] = FRAME;
    let scale = Scale::of(surface);
    let rays = &surface.rays;
    let title = "Deviation of the machined surface";
    let mut out = svg::begin(SIZE, title, STYLE);
    text(&mut out, "title", "start", [left, 32.0], title);
    let subtitle = format!(
        "mm along the normal of the designed surface, on {} by {} rays from the spindle; grey where there is none",
        rays.rows, rays.columns
    );
    text(&mut out, "minor", "start", [left, 54.0], &subtitle);
    let low = rays.from - rays.step / 2.0;
    let high = low + rays.step * f64::from(rays.rows);
    for travel in ticks_between(low, high) {
        let x = left + (right - left) * (travel - low) / (high - low);
        let label = format!("{travel}");
        text(&mut out, "minor", "middle", [x, bottom + 20.0], &label);
        line(&mut out, "tick", [x, bottom], [x, bottom + 5.0]);
    }
    for angle in [0, 90, 180, 270, 360] {
        let y = bottom - (bottom - top) * f64::from(angle) / 360.0;
        let label = format!("{angle}°");
        text(&mut out, "minor", "end", [left - 9.0, y + 4.5], &label);
        line(&mut out, "tick", [left - 5.0, y], [left, y]);
    }
    let middle = (left + right) / 2.0;
    text(
        &mut out,
        "",
        "middle",
        [middle, bottom + 42.0],
        "travel, mm",
    );
    let picture = picture((rays.rows, rays.columns), |x, y| {
        // The last column on top.
        let column = (rays.columns - 1 - y) as usize;
        let ray = x as usize * rays.columns as usize + column;
        scale.colour(surface.deviation[ray])
    });
    image(&mut out, FRAME, &picture);
    bar(&mut out, &scale);
    out.push_str("</svg>\n");
    out
}

/// The scale of colours, with its ends and its middle.
fn bar(out: &mut String, scale: &Scale) {
    let [left, _, right, bottom] = BAR;
    for (share, anchor) in [(-1.0, "start"), (0.0, "middle"), (1.0, "end")] {
        let x = (left + right) / 2.0 + share * (right - left) / 2.0;
        let label = format!("{:.3}", share * scale.end);
        text(out, "minor", anchor, [x, bottom + 16.0], &label);
    }
    text(out, "minor", "end", [left - 10.0, bottom], "gouge");
    text(out, "minor", "start", [right + 10.0, bottom], "excess");
    let steps = 256;
    let colours = picture((steps, 1), |x, _| {
        let share = 2.0 * f64::from(x) / f64::from(steps - 1) - 1.0;
        scale.colour(Some(share * scale.end))
    });
    image(out, BAR, &colours);
}

/// A picture stretched over a frame, with a line around it.
fn image(out: &mut String, frame: [f64; 4], png: &[u8]) {
    let [left, top, right, bottom] = frame;
    let (wide, high) = (right - left, bottom - top);
    push(
        out,
        format_args!(
            "<image x=\"{left}\" y=\"{top}\" width=\"{wide}\" height=\"{high}\" preserveAspectRatio=\"none\" \
             href=\"data:image/png;base64,{}\"/>\n",
            STANDARD.encode(png)
        ),
    );
    svg::frame(out, frame);
}

fn picture(size: (u32, u32), colour: impl Fn(u32, u32) -> [u8; 3]) -> Vec<u8> {
    let (columns, rows) = size;
    let places = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
    let pixels: Vec<[u8; 3]> = places.map(|(x, y)| colour(x, y)).collect();
    raster::png(&pixels, size).expect("a picture of this size can be encoded in memory")
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use horma_core::Rays;

    /// A ring of 3 rows and 8 columns, 10 mm from the spindle: one ray is gouged by half a millimetre,
    /// one meets nothing.
    pub(crate) fn surface() -> Machined {
        let rays = Rays {
            from: 0.5,
            step: 1.0,
            rows: 3,
            columns: 8,
        };
        let mut machined = vec![Some(10.0); rays.len()];
        machined[9] = Some(9.5);
        machined[23] = None;
        let deviation = machined.iter().map(|m| m.map(|m: f64| m - 10.0)).collect();
        Machined {
            rays,
            designed: vec![Some(10.0); rays.len()],
            machined,
            deviation,
        }
    }

    #[test]
    fn a_gouge_is_red_where_it_is() {
        let surface = surface();
        let scale = Scale::of(&surface);
        assert_eq!(scale.end, 0.5);
        assert_eq!(scale.colour(surface.deviation[9]), [192, 31, 46]);
        assert_eq!(scale.colour(surface.deviation[0]), [247, 247, 247]);
        assert_eq!(scale.colour(surface.deviation[23]), MISSING);
        let svg = svg(&surface);
        let start = svg.find("base64,").expect("a picture") + 7;
        let length = svg[start..].find('"').expect("its end");
        let png = STANDARD
            .decode(&svg[start..start + length])
            .expect("base 64");
        let mut reader = png::Decoder::new(std::io::Cursor::new(png))
            .read_info()
            .expect("PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut pixels).expect("a picture");
        // Row 1 from the left, column 1 from below.
        let pixel = |x: usize, y: usize| &pixels[3 * (y * 3 + x)..][..3];
        assert_eq!(pixel(1, 6), [192, 31, 46]);
        assert_eq!(pixel(2, 0), MISSING);
        assert_eq!(pixels.iter().filter(|&&p| p == 247).count(), 3 * 22);
    }
}
