//! The figures as Markdown to read, and every run as CSV to reckon with.

use std::fmt::Write;

use horma_proto::VERSION;

use super::super::table::{header, three};
use super::Experiment;
use super::model::{Fit, Projection};
use super::runs::Run;
use super::summary::{self, PHASES, Summary};

/// All tables, and the diagrams by file and title.
pub(super) fn markdown(
    experiment: &Experiment,
    summaries: &[Summary],
    fits: &[Fit],
    projections: &[Projection],
    diagrams: &[(&str, &str)],
) -> String {
    let network = experiment.network;
    let sections = [
        heading(experiment, summaries),
        section(
            "Time",
            "Wall time from the start of the processes to the path, s: median, and range. CPU in s. The \
             critical path is the CPU time of the master and of the busiest worker. Speed-up and \
             efficiency are against one process, by wall time and by critical path. Imbalance: how \
             much more CPU time than the average the busiest worker took. By brute force a position looks at \
             all rows that its extent has, and at fewer the more extents there are: so it gains more \
             than the number of workers.",
            &times(summaries),
        ),
        section(
            "Phases",
            "Wall time, s; from receive to digitize the average over workers, which share the cores \
             there are.",
            &phases(summaries),
        ),
        section(
            "Bytes",
            "MB from the master to workers, from worker to worker, and of results.",
            &bytes(summaries),
        ),
        section(
            "Rows: m = n/p + o",
            "The papers' model: of n rows each of p extents has its share and the overlap o, fitted. \
             Residual: how far the mean of an extent's rows is from it, at most.",
            &models(fits),
        ),
        section(
            "Projection",
            &format!(
                "**Not measured.** What the measured work and bytes give for workers on a machine each, \
                 with lines of {} Gbit/s and {} µs one way, master, busiest worker and lines one after \
                 the other: straight lines through the medians above, with the greatest imbalance among \
                 them. Without congestion, stragglers, or limits of memory.",
                network.gbit, network.latency_us
            ),
            &projected(projections),
        ),
        pictures(diagrams),
    ];
    sections.join("\n\n") + "\n"
}

fn heading(experiment: &Experiment, summaries: &[Summary]) -> String {
    let rounds = experiment.runs.last().map_or(0, |r| r.round);
    let cores = experiment.cores;
    let most = summaries.iter().map(Summary::workers).max().unwrap_or(1);
    let few = if cores < most as usize {
        format!(
            " **There are {cores} cores for up to {most} workers, which take turns on them: where \
             there are more workers than cores, go by the critical path.**"
        )
    } else {
        String::new()
    };
    format!(
        "# Scaling\n\n```sh\n{}\n```\n\nhorma {VERSION}: {}{}. {cores} cores; load in the minute before: {:.1}. Rounds: \
         {rounds}, in each of which every case took its turn, a thread to each worker, and gave the path \
         of one process to the last bit.{few}",
        experiment.command, experiment.subject, experiment.thinned, experiment.load
    )
}

fn pictures(diagrams: &[(&str, &str)]) -> String {
    let lines = diagrams
        .iter()
        .map(|(file, title)| format!("![{title}]({file})"));
    format!("## Diagrams\n\n{}", lines.collect::<Vec<_>>().join("\n\n"))
}

fn section(title: &str, note: &str, table: &[Vec<String>]) -> String {
    let table = match table {
        [] | [_] => "For this, at least two numbers of workers have to be measured.".to_owned(),
        _ => piped(table),
    };
    format!("## {title}\n\n{note}\n\n{table}")
}

fn times(summaries: &[Summary]) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "search",
        "distribution",
        "workers",
        "wall",
        "range",
        "speed-up",
        "efficiency",
        "master CPU",
        "worker CPU",
        "busiest",
        "imbalance",
        "critical path",
        "its speed-up",
        "its efficiency",
    ])];
    table.extend(summaries.iter().map(|s| {
        let mut row = names(s);
        row.push(three(s.wall.median));
        row.push(format!("{}–{}", three(s.wall.low), three(s.wall.high)));
        row.extend([three(s.speedup), percent(s.efficiency()), three(s.own_cpu)]);
        row.extend(s.worker_cpu.map(three));
        row.extend([percent(s.imbalance), three(s.critical)]);
        row.extend([three(s.critical_speedup), percent(s.critical_efficiency())]);
        row
    }));
    table
}

fn phases(summaries: &[Summary]) -> Vec<Vec<String>> {
    let mut head = header(&["search", "distribution", "workers"]);
    head.extend(header(&PHASES));
    let mut table = vec![head];
    table.extend(summaries.iter().map(|s| {
        let mut row = names(s);
        row.extend(s.phases.map(|seconds| format!("{seconds:.3}")));
        row
    }));
    table
}

fn bytes(summaries: &[Summary]) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "search",
        "distribution",
        "workers",
        "to workers",
        "between",
        "results",
        "rows of an extent",
    ])];
    let clusters = summaries.iter().filter(|s| s.cluster.is_some());
    table.extend(clusters.map(|s| {
        let mut row = names(s);
        let mb = [s.to_workers, s.between_workers, s.of_results].map(|b| three(b / 1.0e6));
        row.extend(mb);
        row.push(format!("{:.1}", s.rows));
        row
    }));
    table
}

fn models(fits: &[Fit]) -> Vec<Vec<String>> {
    let mut table = vec![header(&["search", "distribution", "n", "o", "residual"])];
    table.extend(fits.iter().map(|f| {
        let mut row = vec![f.search.to_string(), f.way.to_string()];
        row.extend([f.rows, f.overlap, f.residual].map(|rows| format!("{rows:.1}")));
        row
    }));
    table
}

fn projected(projections: &[Projection]) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "search",
        "distribution",
        "workers",
        "master s",
        "worker s",
        "network s",
        "speed-up",
        "efficiency",
    ])];
    for projection in projections {
        // Every second power of two is enough to read.
        let points = projection
            .points
            .iter()
            .filter(|p| p.workers.ilog2() % 2 == 0);
        table.extend(points.map(|p| {
            let mut row = vec![projection.search.to_string(), projection.way.to_string()];
            row.push(p.workers.to_string());
            row.extend([p.master, p.worker, p.network, p.speedup].map(three));
            row.push(percent(p.speedup / f64::from(p.workers)));
            row
        }));
    }
    table
}

fn names(summary: &Summary) -> Vec<String> {
    let (way, workers) = match summary.cluster {
        None => ("one process".to_owned(), "-".to_owned()),
        Some((way, workers)) => (way.to_string(), workers.to_string()),
    };
    vec![summary.search.to_string(), way, workers]
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

/// A table of Markdown that can be read as it is.
fn piped(table: &[Vec<String>]) -> String {
    let columns = table.first().map_or(0, Vec::len);
    let length = |text: &String| text.chars().count();
    let width = |k: usize| table.iter().map(|row| length(&row[k])).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(c, &w)| format!("{c:>w$}"));
        format!("| {} |", cells.collect::<Vec<_>>().join(" | "))
    };
    let rule: Vec<String> = widths
        .iter()
        .map(|w| format!("{}:", "-".repeat(w.max(&2) - 1)))
        .collect();
    let mut lines: Vec<String> = table.iter().map(line).collect();
    lines.insert(1, line(&rule));
    lines.join("\n")
}

/// Every run, one a line.
pub(super) fn csv(runs: &[Run]) -> String {
    let mut out = "round,search,distribution,workers,positions,wall_s,own_cpu_s,worker_cpu_mean_s,\
                   worker_cpu_max_s,rows_sent,extents,rows_of_extents,bytes_to_workers,\
                   bytes_between_workers,bytes_of_results"
        .to_owned();
    for phase in PHASES {
        out += &format!(",{phase}_s");
    }
    out.push('\n');
    for run in runs {
        let (way, workers) = match run.case.cluster {
            None => ("one process".to_owned(), 0),
            Some((way, workers)) => (way.to_string(), workers),
        };
        let record = &run.record;
        let traffic = record.traffic.unwrap_or_default();
        let (mean, most) = (run.mean_cpu(), run.most_cpu());
        let rows: u64 = record.extents.iter().map(|e| u64::from(e.rows)).sum();
        // A string takes everything.
        let _ = write!(
            out,
            "{},{},{way},{workers},{},{},{},{mean},{most},{},{},{rows},{},{},{}",
            run.round,
            run.case.search,
            run.positions,
            run.wall,
            run.own_cpu,
            traffic.rows_sent,
            record.extents.len(),
            traffic.bytes_to_workers,
            traffic.bytes_between_workers,
            traffic.bytes_of_results,
        );
        for phase in PHASES {
            let _ = write!(out, ",{}", summary::phase(run, phase));
        }
        out.push('\n');
    }
    out
}
