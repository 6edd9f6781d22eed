//! How far from the designed surface a path stays: where, and how often.

use horma_core::{Clearances, Point};

/// Most samples that are shown.
const MOST: usize = 250_000;

/// Bounds between classes of clearances, mm: gouges are negative.
pub(super) const BOUNDS: [f64; 21] = [
    -1.0, -0.5, -0.2, -0.1, -0.05, -0.02, -0.01, -0.005, -0.002, -0.001, 0.001, 0.002, 0.005, 0.01,
    0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0,
];

/// Clearances of the designed surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    /// Samples of the surface that are shown, mm: of so many that follow each other the one that
    /// strays most.
    pub points: Vec<Point>,
    /// Clearance of each, mm: negative in a gouge.
    pub clearances: Vec<f64>,
    /// How many samples there are.
    pub of: u64,
    /// How many of all samples are below the first bound of classes, between each two, and above the last.
    pub classes: Vec<u64>,
}

/// What is shown of clearances.
pub(super) fn errors(all: &Clearances) -> Errors {
    let Clearances { points, normal } = all;
    let mut classes = vec![0; BOUNDS.len() + 1];
    for &clearance in normal {
        classes[BOUNDS.partition_point(|&bound| bound <= clearance)] += 1;
    }
    let every = normal.len().div_ceil(MOST).max(1);
    let farthest = |first: usize, run: &[f64]| {
        let by_size = |a: &usize, b: &usize| run[*a].abs().total_cmp(&run[*b].abs());
        (0..run.len()).max_by(by_size).map(|i| first + i)
    };
    let runs = normal.chunks(every).enumerate();
    let kept: Vec<usize> = runs
        .filter_map(|(n, run)| farthest(n * every, run))
        .collect();
    Errors {
        points: kept.iter().map(|&i| points[i]).collect(),
        clearances: kept.iter().map(|&i| normal[i]).collect(),
        of: normal.len() as u64,
        classes,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_is_in_a_class_and_the_worst_are_shown() {
        let count = MOST + 10;
        let mut normal: Vec<f64> = (0..count).map(|i| (i % 3) as f64 * 0.004).collect();
        normal[1001] = -0.3;
        normal[1002] = 7.0;
        let points = (0..count).map(|i| [i as f64, 0.0, 0.0]).collect();
        let shown = errors(&Clearances { points, normal });
        assert_eq!(shown.classes.iter().sum::<u64>(), count as u64);
        assert_eq!(shown.of, count as u64);
        let class = |bound: f64| BOUNDS.iter().position(|&b| b == bound).expect("a bound");
        assert_eq!(shown.classes[class(-0.2)], 1);
        assert_eq!(shown.classes[BOUNDS.len()], 1);
        assert!(shown.points.len() <= MOST && shown.points.len() == shown.clearances.len());
        let at = |clearance: f64| shown.clearances.iter().position(|&c| c == clearance);
        assert_eq!(shown.points[at(-0.3).expect("shown")][0], 1001.0);
        assert_eq!(shown.points[at(7.0).expect("shown")][0], 1002.0);
    }
}
