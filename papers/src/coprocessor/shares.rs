//! What the inner loop spends its time on: figure 4 of the FPGA paper, on this machine.

use std::hint::black_box;
use std::time::Instant;

use horma_core::Point;

use crate::multirotator::cos_sin;

/// Seconds of each task over the same points, the shortest of many turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shares {
    /// A row vector times a matrix.
    pub transform: f64,
    /// Eq. (2).
    pub distance: f64,
    /// Comparison and assignment.
    pub compare: f64,
    /// Sine and cosine anew for each point, which the software of figure 10 had in its rotations.
    pub sines: f64,
}

/// How often each task has its turn.
const TURNS: u32 = 100;

/// Measures, for a torus of such radii that reaches all points along the spindle.
pub fn measure(points: &[Point], [major, minor]: [f64; 2]) -> Shares {
    // Every point within the tool's width, so that each takes both roots.
    let points: Vec<Point> = points.iter().map(|&[x, y, z]| [x % minor, y, z]).collect();
    let mut shortest = [f64::INFINITY; 4];
    let mut seen = vec![[0.0; 3]; points.len()];
    let mut distances = vec![0.0; points.len()];
    for turn in 0..TURNS {
        let degrees = black_box(f64::from(turn) * 18.0);
        let [c, s] = cos_sin(degrees);
        let m = black_box([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c], [0.0, 0.0, 0.0]]);
        let transform = timed(|| {
            for (&[x, y, z], seen) in points.iter().zip(&mut seen) {
                *seen = [
                    x * m[0][0] + y * m[1][0] + z * m[2][0] + m[3][0],
                    x * m[0][1] + y * m[1][1] + z * m[2][1] + m[3][1],
                    x * m[0][2] + y * m[1][2] + z * m[2][2] + m[3][2],
                ];
            }
        });
        black_box(&mut seen);
        let distance = timed(|| {
            for (&[x, y, z], distance) in seen.iter().zip(&mut distances) {
                let radius = major + (minor * minor - x * x).sqrt();
                *distance = -y - (radius * radius - z * z).sqrt();
            }
        });
        black_box(&mut distances);
        let compare = timed(|| {
            let mut least = f64::INFINITY;
            for &distance in &distances {
                if distance < least {
                    least = distance;
                }
            }
            black_box(least);
        });
        let sines = timed(|| {
            for &[_, y, z] in &points {
                let [c, s] = cos_sin(black_box(degrees));
                black_box([y * c - z * s, y * s + z * c]);
            }
        });
        let times = [transform, distance, compare, sines];
        for (shortest, time) in shortest.iter_mut().zip(times) {
            *shortest = shortest.min(time);
        }
    }
    let [transform, distance, compare, sines] = shortest;
    Shares {
        transform,
        distance,
        compare,
        sines,
    }
}

fn timed(work: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    work();
    begin.elapsed().as_secs_f64()
}
