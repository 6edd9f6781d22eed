//! The figures as diagrams. A colour is a distribution; what is not measured is dashed.

use horma_core::Distribution;
use horma_formats::plot::{Curve, Plot, Scale};

use super::Experiment;
use super::model::{Fit, Projection};
use super::summary::Summary;
use crate::args::Search;

/// Colour of what belongs to no distribution.
const PLAIN: usize = 3;

/// Every diagram that there is something for, with the name of its file.
pub(super) fn all(
    experiment: &Experiment,
    summaries: &[Summary],
    fits: &[Fit],
    projections: &[Projection],
) -> Vec<(String, Plot)> {
    let mut found = Vec::new();
    let mut searches: Vec<Search> = Vec::new();
    for summary in summaries {
        if !searches.contains(&summary.search) {
            searches.push(summary.search);
        }
    }
    let plot = |title: &str, x: &str, y: &str, curves: Vec<Curve>| Plot {
        title: title.to_owned(),
        subtitle: format!("{}; {} cores", experiment.subject, experiment.cores),
        x: x.to_owned(),
        y: y.to_owned(),
        scales: [Scale::Logarithmic; 2],
        curves,
    };
    if let Some(fit) = fits.first() {
        let title = "Rows of an extent, and the papers' model";
        let curves = rows(summaries, fit);
        found.push((
            "rows.svg".to_owned(),
            plot(title, "extents", "rows", curves),
        ));
    }
    if let Some(&search) = searches.first() {
        let by = |name, dashed, value| curves(summaries, search, name, dashed, value);
        let mut bytes = by("from master", false, |s| s.to_workers / 1.0e6);
        bytes.extend(by("between", true, |s| s.between_workers / 1.0e6));
        let title = "Bytes of rows, tasks and surfaces";
        found.push(("bytes.svg".to_owned(), plot(title, "workers", "MB", bytes)));
    }
    for search in searches {
        let by = |name, dashed, value| curves(summaries, search, name, dashed, value);
        let mut time = by("wall", false, |s| s.wall.median);
        time.extend(by("CPU", true, |s| s.critical));
        let title = format!("Time to the path, {search} search");
        let name = format!("time-{search}.svg");
        found.push((name, plot(&title, "workers", "s", time)));

        let mut speedup = by("wall", false, |s| s.speedup);
        speedup.extend(by("CPU", true, |s| s.critical_speedup));
        let most = summaries.iter().map(Summary::workers).max().unwrap_or(1);
        speedup.push(ideal(&[1.0, f64::from(most)]));
        let title = format!("Speed-up against one process, {search} search");
        let name = format!("speedup-{search}.svg");
        found.push((name, plot(&title, "workers", "times as fast", speedup)));

        let mut projected: Vec<Curve> = by("", false, |s| s.critical_speedup);
        let of_search = projections.iter().filter(|p| p.search == search);
        projected.extend(of_search.map(|projection| {
            Curve {
                name: format!("{}, projected", projection.way),
                color: color(projection.way),
                dashed: true,
                points: projection
                    .points
                    .iter()
                    .map(|p| [f64::from(p.workers), p.speedup])
                    .collect(),
            }
        }));
        projected.push(ideal(&powers().collect::<Vec<_>>()));
        let network = experiment.network;
        let title = format!("Projection, not measured: {search} search");
        let mut plot = plot(
            &title,
            "workers, a machine each",
            "times as fast",
            projected,
        );
        plot.subtitle = format!(
            "on lines of {} Gbit/s and {} µs one way; solid: measured, by CPU critical path",
            network.gbit, network.latency_us
        );
        found.push((format!("projection-{search}.svg"), plot));
    }
    found
}

/// What was measured and what was fitted: extents have the same rows by every distribution.
fn rows(summaries: &[Summary], fit: &Fit) -> Vec<Curve> {
    let alike = summaries.iter().filter(|s| s.is(fit.search, fit.way));
    let curve = |name: String, color, dashed, points| Curve {
        name,
        color,
        dashed,
        points,
    };
    let measured = alike.map(|s| [s.extents, s.rows]).collect();
    let model = powers().map(|p| [p, fit.rows_of(p)]).collect();
    let share = powers().map(|p| [p, fit.rows / p]).collect();
    vec![
        curve("measured".to_owned(), color(fit.way), false, measured),
        curve(
            format!("{:.0}/p + {:.1}", fit.rows, fit.overlap),
            1,
            true,
            model,
        ),
        curve("n/p".to_owned(), PLAIN, true, share),
    ]
}

/// A curve for each distribution of a search, against the number of workers.
fn curves(
    summaries: &[Summary],
    search: Search,
    name: &str,
    dashed: bool,
    value: fn(&Summary) -> f64,
) -> Vec<Curve> {
    let mut found: Vec<Curve> = Vec::new();
    for way in Distribution::ALL {
        let alike = summaries.iter().filter(|s| s.is(search, way));
        let points: Vec<[f64; 2]> = alike.map(|s| [f64::from(s.workers()), value(s)]).collect();
        if points.iter().any(|[_, y]| *y > 0.0) {
            found.push(Curve {
                name: match name {
                    "" => way.to_string(),
                    _ => format!("{way}, {name}"),
                },
                color: color(way),
                dashed,
                points,
            });
        }
    }
    found
}

fn ideal(workers: &[f64]) -> Curve {
    Curve {
        name: "ideal".to_owned(),
        color: PLAIN,
        dashed: true,
        points: workers.iter().map(|&p| [p, p]).collect(),
    }
}

fn powers() -> impl Iterator<Item = f64> {
    (0..=10).map(|k| f64::from(1 << k))
}

fn color(way: Distribution) -> usize {
    match way {
        Distribution::Overlap => 0,
        Distribution::Halo => 1,
        Distribution::Surface => 2,
    }
}
