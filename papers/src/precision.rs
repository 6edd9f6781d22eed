//! The precision experiments: figures 7 and 8 of the FPGA paper, and the limits in its text.

use horma_formats::plot::{Curve, Plot, Scale};

use crate::cordic::Cordic;
use crate::error::Result;
use crate::fixed::{Format, Rounding};
use crate::multirotator::{MultiRotator, cos_sin};
use crate::report::{Block, Chapter, Claim, Verdict, three};

/// The point that is turned, mm: 100 mm from the axis.
const POINT: [f64; 2] = [60.0, 80.0];
const RADIUS: f64 = 100.0;
/// Coordinates reach to 128 mm: so many bits before the point, the sign included.
const BEFORE_POINT: u32 = 8;

/// Steps of figure 7, and the most increments to a turn of figure 8.
const STEPS: u32 = 720;
const INCREMENTS: u32 = 290;

/// Words that are told of: bits, and bits of sines and cosines after the point.
const ROTATORS: [(u32, u32, &str); 2] = [
    (32, 31, "MultiRotator, 31 bits"),
    (32, 24, "MultiRotator, 24 bits"),
];
/// Coordinates of these bits: so that words have 32, and as many as the MultiRotator's.
const CORDICS: [(u32, &str); 2] = [
    (25, "CORDIC in words of 32 bits"),
    (32, "CORDIC for 32 bits"),
];

/// How far a point is from where it should be, after each step, as a share of its distance from the axis.
pub fn of_rotator(format: Format, rounding: Rounding, degrees: f64, steps: u32) -> Vec<f64> {
    let coordinates = coordinates(format.bits());
    let words = POINT.map(|k| coordinates.word(k));
    let mut rotator = MultiRotator::new(format, rounding, degrees);
    let after = |i| {
        let turned = rotator.rotate(words).map(|w| coordinates.value(w));
        rotator.advance();
        off(turned, degrees * f64::from(i))
    };
    (1..=steps).map(after).collect()
}

/// The same of CORDIC, by an angle.
pub fn of_cordic(cordic: &Cordic, degrees: f64) -> f64 {
    let coordinates = coordinates(cordic.bits());
    let words = POINT.map(|k| coordinates.word(k));
    let turned = cordic.rotate(words, cordic.angle(degrees));
    off(turned.map(|w| coordinates.value(w)), degrees)
}

fn coordinates(bits: u32) -> Format {
    Format::new(bits, bits - BEFORE_POINT).expect("words are longer than 8 bits")
}

/// A relative distance from the point turned by so many degrees.
fn off([x, y]: [f64; 2], degrees: f64) -> f64 {
    let ([px, py], [c, s]) = (POINT, cos_sin(degrees));
    libm::hypot(x - (px * c - py * s), y - (py * c + px * s)) / RADIUS
}

/// Figure 7: relative error after each of 720 steps of 1°.
pub fn figure7() -> Result<Vec<Curve>> {
    let mut curves = Vec::new();
    for (color, (bits, fraction, name)) in ROTATORS.into_iter().enumerate() {
        let errors = of_rotator(Format::new(bits, fraction)?, Rounding::Nearest, 1.0, STEPS);
        curves.push(curve(name, color, (1..).zip(errors)));
    }
    for (color, (bits, name)) in (2..).zip(CORDICS) {
        let cordic = Cordic::new(bits)?;
        let errors = (1..=STEPS).map(|i| (i, of_cordic(&cordic, f64::from(i))));
        curves.push(curve(name, color, errors));
    }
    Ok(curves)
}

/// Figure 8: relative error after a whole turn in so many equal steps, and of CORDIC over the angles of the last
/// of them, at most.
pub fn figure8() -> Result<Vec<Curve>> {
    let step = |n: u32| 360.0 / f64::from(n);
    let mut curves = Vec::new();
    for (color, (bits, fraction, name)) in ROTATORS.into_iter().enumerate() {
        let format = Format::new(bits, fraction)?;
        let last = |n| {
            let errors = of_rotator(format, Rounding::Nearest, step(n), n);
            (n, errors.into_iter().fold(0.0, f64::max))
        };
        curves.push(curve(name, color, (1..=INCREMENTS).map(last)));
    }
    for (color, (bits, name)) in (2..).zip(CORDICS) {
        let cordic = Cordic::new(bits)?;
        let most = |n: u32| {
            let errors = (1..=n).map(|i| of_cordic(&cordic, step(n) * f64::from(i)));
            (n, errors.fold(0.0, f64::max))
        };
        curves.push(curve(name, color, (1..=INCREMENTS).map(most)));
    }
    Ok(curves)
}

fn curve(name: &str, color: usize, points: impl Iterator<Item = (u32, f64)>) -> Curve {
    Curve {
        name: name.to_owned(),
        color,
        dashed: false,
        points: points
            .map(|(i, error)| [f64::from(i), 100.0 * error])
            .collect(),
    }
}

/// What there is to tell.
///
/// # Errors
/// None, for the words above.
pub fn chapter() -> Result<Chapter> {
    let (seven, eight) = (figure7()?, figure8()?);
    let blocks = vec![
        Block::text(
            "A point 100 mm from the axis, in coordinates that reach to 128 mm, is turned and held against \
             doubles. The paper does not say where its words have their points, nor whether 32-bit CORDIC means \
             coordinates or words of 32 bits. So two of each are shown: sines and cosines with 31 bits after the \
             point, and with the 24 that coordinates have; CORDIC for coordinates of 32 bits, in words of 39, and \
             CORDIC in words of 32 bits, for coordinates of 25.",
        ),
        Block::Figure(
            "figure7",
            plot("Figure 7: one point, steps of 1°", "steps", seven.clone()),
        ),
        Block::Figure(
            "figure8",
            plot(
                "Figure 8: a whole turn in equal steps, the largest error",
                "steps to a turn",
                eight.clone(),
            ),
        ),
        Block::table(
            "Relative error, % (which is mm at 100 mm), of sines and cosines with so many bits after the point: the \
             largest of 720 steps",
            &[
                "bits after the point",
                "0.5°, rounded",
                "1°, rounded",
                "0.5°, truncated",
                "1°, truncated",
            ],
            by_fraction()?,
        ),
        Block::Claims(claims(&seven, &eight)?),
    ];
    Ok(Chapter {
        name: "precision",
        title: "Precision: figures 7 and 8",
        source: "the FPGA paper, section Precision experiments vs. CORDIC",
        blocks,
    })
}

/// Errors that are none but of doubles are left out: a logarithmic axis would be all theirs.
fn plot(title: &str, x: &str, mut curves: Vec<Curve>) -> Plot {
    for curve in &mut curves {
        curve.points.retain(|p| p[1] > 1.0e-10);
    }
    Plot {
        title: title.to_owned(),
        subtitle: "against doubles; rounded to the nearest; left out where CORDIC only makes quarter turns, which are exact".to_owned(),
        x: x.to_owned(),
        y: "relative error, %".to_owned(),
        scales: [Scale::Even, Scale::Logarithmic],
        curves,
    }
}

/// The largest relative error of sines and cosines alone, %.
fn largest(fraction: u32, rounding: Rounding, degrees: f64) -> Result<f64> {
    let format = Format::new(fraction + 1, fraction)?;
    let mut rotator = MultiRotator::new(format, rounding, degrees);
    let mut most = 0.0_f64;
    for i in 1..=STEPS {
        let [c, s] = rotator.turned().map(|w| format.value(w));
        let [ec, es] = cos_sin(degrees * f64::from(i));
        most = most.max(libm::hypot(c - ec, s - es));
        rotator.advance();
    }
    Ok(100.0 * most)
}

fn by_fraction() -> Result<Vec<Vec<String>>> {
    let fractions = [11, 13, 15, 17, 19, 20, 21, 22, 23, 24, 25, 27, 29, 31];
    fractions
        .into_iter()
        .map(|fraction| {
            let mut row = vec![fraction.to_string()];
            for rounding in [Rounding::Nearest, Rounding::Truncate] {
                for degrees in [0.5, 1.0] {
                    row.push(three(largest(fraction, rounding, degrees)?));
                }
            }
            Ok(row)
        })
        .collect()
}

/// At how many points one curve is below another, and its mean over the other's.
fn below(curve: &Curve, other: &Curve) -> (usize, f64) {
    let pairs = curve.points.iter().zip(&other.points);
    let sum = |curve: &Curve| curve.points.iter().map(|p| p[1]).sum::<f64>();
    let less = pairs.filter(|(a, b)| a[1] < b[1]).count();
    (less, sum(curve) / sum(other))
}

fn claims(seven: &[Curve], eight: &[Curve]) -> Result<Vec<Claim>> {
    let sixteen = largest(15, Rounding::Nearest, 0.5)?;
    let sixteen_mm = *of_rotator(Format::new(16, 15)?, Rounding::Nearest, 0.5, STEPS)
        .last()
        .unwrap_or(&f64::NAN)
        * RADIUS;
    let coarse = largest(24, Rounding::Nearest, 0.5)?.max(largest(24, Rounding::Nearest, 1.0)?);
    let fine = largest(31, Rounding::Nearest, 0.5)?.max(largest(31, Rounding::Nearest, 1.0)?);
    let whole = libm::ldexp(1.0, -7);
    // What 7.8 µm are 0.002 % of.
    let radius = 390.0;
    let far = radius * coarse / 100.0;
    let linear = {
        let points = &seven[1].points;
        points[719][1] / points[359][1]
    };
    let [(wide, wide_mean), (narrow, narrow_mean)] = [3, 2].map(|k| below(&seven[0], &seven[k]));
    let [(wide8, _), (narrow8, _)] = [3, 2].map(|k| below(&eight[0], &eight[k]));
    Ok(vec![
        Claim::new(
            "figures 7 and 8 themselves",
            "",
            "drawn above",
            Verdict::Lost,
        ),
        Claim::new(
            "16 bits, relative error (15 after the point, rounded, 720 × 0.5°)",
            "up to 0.6 %",
            format!("{} %", three(sixteen)),
            Verdict::of(sixteen <= 0.6 && sixteen > 0.5),
        ),
        Claim::new(
            "16 bits, after the whole turn, at 100 mm",
            "±0.5 mm",
            format!("{} mm", three(sixteen_mm)),
            Verdict::of((sixteen_mm - 0.5).abs() < 0.05),
        ),
        Claim::new(
            "16 bits are not good enough: 0.1 % and 0.1 mm are allowed",
            "yes",
            format!("{} times too much", three(sixteen / 0.1)),
            Verdict::of(sixteen > 0.1),
        ),
        Claim::new(
            "32 bits, relative error (24 after the point, rounded, 720 × 0.5° and 720 × 1°)",
            "below 0.002 %",
            format!(
                "{} %; with 31 after the point {} %",
                three(coarse),
                three(fine)
            ),
            Verdict::of(coarse < 0.002),
        ),
        Claim::new(
            "32 bits, after 720 steps, at 390 mm",
            "±7.8 µm",
            format!("{} µm", three(1000.0 * far)),
            Verdict::of(far <= 7.8e-3),
        ),
        Claim::new(
            "7.8 µm are 0.002 % of",
            "",
            format!(
                "390 mm, more than any last: two bounds, and not one. 0.5 mm and 7.8 µm are 2⁻¹ and 2⁻⁷ mm ({} µm)",
                three(1000.0 * whole)
            ),
            Verdict::Unsaid,
        ),
        Claim::new(
            "the error grows in proportion to the number of steps",
            "yes",
            format!("with 24 bits {} times from 360 to 720 steps", three(linear)),
            Verdict::of((linear - 2.0).abs() < 0.2),
        ),
        Claim::new(
            "figure 7: more precise than CORDIC in words of 32 bits, by up to 60 %",
            "at up to 720 steps",
            format!(
                "at {narrow} of 720 steps; on average {} times its error",
                three(narrow_mean)
            ),
            Verdict::of(narrow == 720),
        ),
        Claim::new(
            "figure 7: more precise than CORDIC for 32 bits",
            "at up to 720 steps",
            format!(
                "at {wide} of 720 steps; on average {} times its error",
                three(wide_mean)
            ),
            Verdict::of(wide == 720),
        ),
        Claim::new(
            "figure 8: more precise for any number of steps to a turn up to 290, CORDIC in words of 32 bits",
            "yes",
            format!("for {narrow8} of 290; for {wide8} if CORDIC is for 32 bits"),
            Verdict::of(narrow8 == 290),
        ),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bits_are_off_by_what_is_in_print() {
        let relative = largest(15, Rounding::Nearest, 0.5).expect("valid");
        assert_eq!(three(relative), "0.543");
        let format = Format::new(16, 15).expect("valid");
        let errors = of_rotator(format, Rounding::Nearest, 0.5, STEPS);
        assert_eq!(three(RADIUS * errors[719]), "0.544");
    }

    #[test]
    fn twenty_four_bits_are_the_fewest_within_both_limits() {
        let worst = |fraction| {
            let of = |degrees| largest(fraction, Rounding::Nearest, degrees).expect("valid");
            of(0.5).max(of(1.0))
        };
        assert!(
            worst(24) < 0.002 && worst(23) > 0.002,
            "{} {}",
            worst(24),
            worst(23)
        );
        assert_eq!(three(worst(24)), "0.00141");
    }
}
