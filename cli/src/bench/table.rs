//! The figures of a bench as a table to read: units in the headers, a ratio beside what it compares.

use super::figures::{Density, Figures, Positions, Search, SimdLevel, Threads, Wheel};

/// The whole table.
pub(super) fn text(figures: &Figures) -> String {
    let Figures {
        grid: [rows, columns],
        turns,
        ..
    } = figures;
    let grid = if figures.density.iter().any(|d| d.grid.is_none()) {
        "the mesh as it is".to_owned()
    } else {
        format!("{rows} × {columns} points a surface")
    };
    let heading = format!(
        "horma {} bench kernel: {}, {}, step {} mm, {} points a revolution\n\
         {} cores, {}; load in the minute before: {:.1}. What is compared was measured in turn,\n\
         {turns} times or more; the shortest time counts, and ratios are of these. Checked before measuring:\n\
         exact search finds what brute force finds, and every instruction set and number of threads the\n\
         same path, to the last bit.",
        figures.version,
        figures.part,
        figures.cutter,
        figures.step_mm,
        figures.points_per_revolution,
        figures.cores,
        figures.simd,
        figures.load,
    );
    let sections = [
        heading,
        section(
            "Time per position against density, one thread (brute force on a sample of positions)",
            &costs(figures),
            growth(figures),
        ),
        section(
            "Work per position, and what the hierarchy takes, one thread",
            &works(figures),
            figures.too_large.map(|points| {
                format!("Stopped before {points:.0} points: too little memory for four searches side by side.")
            }),
        ),
        section(
            &format!("Instruction sets, {grid}, one thread"),
            &levels(&figures.simd_levels),
            None,
        ),
        section(
            &format!("Threads, {grid}, facet contact"),
            &threads(&figures.threads),
            None,
        ),
        section(
            &format!("Time per position against their number, {grid}, facet contact, one thread"),
            &positions(&figures.positions),
            None,
        ),
        section(
            "Wheels, facet contact, one thread",
            &wheels(&figures.wheels),
            None,
        ),
    ];
    sections.join("\n\n") + "\n"
}

fn section(title: &str, table: &[Vec<String>], note: Option<String>) -> String {
    let note = note.map_or(String::new(), |n| format!("\n{n}"));
    format!("{title}\n{}{note}", aligned(table))
}

fn costs(figures: &Figures) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "rows × columns",
        "points",
        "point\nexact\nµs",
        "point\nbrute\nµs",
        "brute/\nexact",
        "facet\nexact\nµs",
        "facet\nbrute\nµs",
        "brute/\nexact",
        "facet/\npoint\nexact",
    ])];
    table.extend(figures.density.iter().map(|d| {
        let mut row = vec![grid(d), d.points.to_string()];
        for s in [&d.point, &d.facet] {
            row.extend([s.exact_us, s.brute_us, s.brute_over_exact].map(three));
        }
        row.push(three(d.facet_over_point));
        row
    }));
    table
}

/// How the cost grows from the coarsest grid to the finest.
fn growth(figures: &Figures) -> Option<String> {
    let (first, last) = (figures.density.first()?, figures.density.last()?);
    if first.points == last.points {
        return None;
    }
    let times = |value: fn(&Density) -> f64| three(value(last) / value(first));
    Some(format!(
        "{} times the points: exact search takes {} times as long for points and {} times for facets,\n\
         brute force {} and {} times.",
        times(|d| d.points as f64),
        times(|d| d.point.exact_us),
        times(|d| d.facet.exact_us),
        times(|d| d.point.brute_us),
        times(|d| d.facet.brute_us),
    ))
}

fn works(figures: &Figures) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "points",
        "positions",
        "by brute\nforce",
        "contact",
        "nodes per\nposition",
        "evaluated per\nposition",
        "build\ns",
        "build\nµs/point",
        "bytes/\npoint",
    ])];
    for d in &figures.density {
        for (contact, s) in [("point", &d.point), ("facet", &d.facet)] {
            table.push(work(d.points, contact, s));
        }
    }
    table
}

fn work(points: u64, contact: &str, s: &Search) -> Vec<String> {
    vec![
        points.to_string(),
        s.positions.to_string(),
        s.brute_positions.to_string(),
        contact.to_owned(),
        three(s.nodes),
        three(s.evaluations),
        three(s.build_s),
        three(s.build_s * 1.0e6 / points as f64),
        three(s.bytes_per_point),
    ]
}

fn levels(levels: &[SimdLevel]) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "search",
        "set",
        "µs per\nposition",
        "scalar/\nthis",
    ])];
    table.extend(levels.iter().map(|l| {
        vec![
            l.search.to_owned(),
            l.simd.clone(),
            three(l.us),
            three(l.speedup),
        ]
    }));
    table
}

fn threads(threads: &[Threads]) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "threads",
        "µs per\nposition",
        "one/\nthis",
        "of ideal\n%",
    ])];
    table.extend(threads.iter().map(|t| {
        vec![
            t.threads.to_string(),
            three(t.us),
            three(t.speedup),
            three(100.0 * t.efficiency),
        ]
    }));
    table
}

fn positions(positions: &[Positions]) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "step\nmm",
        "points a\nrevolution",
        "positions",
        "µs per\nposition",
        "this/\njob's",
    ])];
    table.extend(positions.iter().map(|p| {
        vec![
            p.step_mm.to_string(),
            p.points_per_revolution.to_string(),
            p.positions.to_string(),
            three(p.us),
            three(p.over_job),
        ]
    }));
    table
}

fn wheels(wheels: &[Wheel]) -> Vec<Vec<String>> {
    let mut table = vec![header(&[
        "cutter",
        "triangles",
        "µs per\nposition",
        "positions\nper s",
        "this/\nfirst",
    ])];
    table.extend(wheels.iter().map(|w| {
        vec![
            w.cutter.clone(),
            w.facets.to_string(),
            three(w.us),
            format!("{:.0}", w.positions_per_second),
            three(w.over_first),
        ]
    }));
    table
}

fn grid(density: &Density) -> String {
    let grid = density.grid.map(|[r, c]| format!("{r} × {c}"));
    grid.unwrap_or_else(|| "mesh".to_owned())
}

pub(super) fn header(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

/// Three significant digits, and all digits before the point.
pub(super) fn three(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let before = if value == 0.0 {
        1
    } else {
        value.abs().log10().floor() as i32 + 1
    };
    let after = (3 - before).clamp(0, 6) as usize;
    format!("{value:.after$}")
}

/// Columns flush right under headers of several lines, which stand on a common base.
fn aligned(table: &[Vec<String>]) -> String {
    let Some((names, rows)) = table.split_first() else {
        return String::new();
    };
    let height = names.iter().map(|n| n.lines().count()).max().unwrap_or(0);
    let line = |k: usize| -> Vec<String> {
        let part = |name: &String| {
            let lines: Vec<&str> = name.lines().collect();
            let blank = height - lines.len();
            let part = k.checked_sub(blank).map(|k| lines[k].to_owned());
            part.unwrap_or_default()
        };
        names.iter().map(part).collect()
    };
    let lines: Vec<Vec<String>> = (0..height).map(line).chain(rows.iter().cloned()).collect();
    let width = |k: usize| {
        lines
            .iter()
            .map(|l| l[k].chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..names.len()).map(width).collect();
    let row = |line: &Vec<String>| {
        let cells = line.iter().zip(&widths).map(|(c, &w)| format!("{c:>w$}"));
        format!("  {}", cells.collect::<Vec<_>>().join("  "))
    };
    lines.iter().map(row).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_under_their_headers() {
        let row = |cells: [&str; 2]| cells.map(str::to_owned).to_vec();
        let table = [
            row(["points", "exact\nµs"]),
            row(["9", "1.23"]),
            row(["57240", "10"]),
        ];
        let expected = "          exact\n  points     µs\n       9   1.23\n   57240     10";
        assert_eq!(aligned(&table), expected);
    }

    #[test]
    fn numbers_have_three_digits() {
        let written = [0.0, 0.001234, 0.5, 1.0, 99.95, 1234.5, f64::NAN].map(three);
        assert_eq!(
            written,
            ["0.00", "0.00123", "0.500", "1.00", "100.0", "1234", "-"]
        );
    }

    #[test]
    fn a_table_has_every_section_and_says_what_it_left_out() {
        let search = |exact_us, brute_us| Search {
            exact_us,
            brute_us,
            brute_over_exact: brute_us / exact_us,
            positions: 52_000,
            brute_positions: 40,
            nodes: 7.25,
            evaluations: 33.0,
            build_s: 0.01,
            bytes_per_point: 99.0,
        };
        let density = |points, scale: f64| Density {
            grid: Some([66, 50]),
            points,
            facets: 2 * points,
            point: search(0.5, 10.0 * scale),
            facet: search(1.5, 450.0 * scale),
            facet_over_point: 3.0,
        };
        let said = text(&Figures {
            version: "0.1.0".to_owned(),
            part: "last.step".to_owned(),
            cutter: "ball of radius 10".to_owned(),
            step_mm: 2.0,
            points_per_revolution: 360,
            cores: 2,
            load: 0.25,
            simd: "avx2".to_owned(),
            turns: 3,
            grid: [159, 120],
            density: vec![density(10_000, 1.0), density(100_000, 10.0)],
            too_large: Some(1.0e6),
            simd_levels: vec![],
            threads: vec![],
            positions: vec![],
            wheels: vec![],
        });
        for words in [
            "last.step, ball of radius 10, step 2 mm, 360",
            "66 × 50",
            "20.0",
            "10.0 times the points: exact search takes 1.00 times",
            "Stopped before 1000000 points",
            "Instruction sets, 159 × 120",
            "Threads",
            "Wheels",
        ] {
            assert!(said.contains(words), "{words:?} is not in:\n{said}");
        }
    }
}
