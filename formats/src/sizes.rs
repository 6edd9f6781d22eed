//! One report for several sizes and sides of a last: `report.json` and `report.html`.
//!
//! Only what follows from the job is told, nothing of clocks and machines, so that the same job makes the same
//! report.

use std::io::Write;
use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::error::Result;
use crate::lasts::Lasts;
use crate::output;
use crate::report::Report;
use crate::svg::escaped;

/// Several sizes and sides of a last.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sizes {
    /// Version of horma that made them.
    pub version: String,
    /// The job file.
    pub job: String,
    /// Each of them, in order of size.
    pub sizes: Vec<Size>,
}

/// One of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Size {
    /// Its directory.
    pub name: String,
    /// Its size, if the last is graded.
    pub size: Option<f64>,
    /// The foot that it is for.
    pub side: String,
    /// Positions of its path.
    pub positions: u64,
    /// How long the cutter is at work, s.
    pub seconds: Option<f64>,
    /// Deepest gouge at a position, normal to the surface, mm; 0 if there is none, nothing if it was not
    /// looked for.
    pub deepest_gouge: Option<f64>,
    /// Programs for the machine, in its directory.
    pub programs: Vec<String>,
    /// Its measures.
    pub last: Option<Lasts>,
    /// The job in effect.
    pub job: Value,
}

impl Size {
    /// Of one that is made.
    pub fn of(name: String, size: Option<f64>, side: &str, report: &Report) -> Self {
        let verification = report.verification.as_ref();
        let program = report.program.as_ref();
        Self {
            name,
            size,
            side: side.to_owned(),
            positions: report.path.positions,
            seconds: program.map(|p| p.seconds),
            deepest_gouge: verification.map(|v| v.normal.gouge.map_or(0.0, |g| g.depth)),
            programs: program.map_or_else(Vec::new, |p| p.files.clone()),
            last: report.last.clone(),
            // Who computes it changes nothing.
            job: without(&report.job, "cluster"),
        }
    }

    /// In a line.
    pub fn describe(&self) -> String {
        let last = self.last.as_ref().map_or(String::new(), |l| {
            let m = &l.designed;
            format!(
                ", length {:.2}, ball girth {:.2} mm",
                m.length, m.ball_girth
            )
        });
        let gouge = self
            .deepest_gouge
            .map_or(String::new(), |g| format!(", deepest gouge {g:.4} mm"));
        let seconds = self
            .seconds
            .map_or(String::new(), |s| format!(", {s:.1} s of cutting"));
        format!(
            "{}: {} positions{last}{seconds}{gouge}",
            self.name, self.positions
        )
    }
}

fn without(job: &Value, key: &str) -> Value {
    let mut job = job.clone();
    if let Some(table) = job.as_object_mut() {
        table.remove(key);
    }
    job
}

/// Writes both reports into `dir`.
///
/// # Errors
/// [`crate::Error::Io`] if they cannot be written.
pub fn save(dir: &Path, sizes: &Sizes) -> Result<()> {
    output::write(&dir.join(output::REPORT), |out| {
        serde_json::to_writer_pretty(&mut *out, sizes)?;
        out.write_all(b"\n")
    })?;
    let page = page(sizes);
    output::write(&dir.join(output::VIEW), |out| {
        out.write_all(page.as_bytes())
    })
}

const STYLE: &str = "\
:root{color-scheme:light dark}\
body{font:15px/1.5 system-ui,sans-serif;margin:24px auto;max-width:1240px;padding:0 16px;\
color:light-dark(#24292f,#e6edf3);background:light-dark(#fff,#0d1117)}\
h1{font-size:22px}p{color:light-dark(#57606a,#9da7b3)}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}\
th,td{padding:6px 10px;text-align:right;border-bottom:1px solid light-dark(#d8dee4,#30363d);\
white-space:nowrap}thead th{white-space:normal;vertical-align:bottom}\
th:first-child,td:last-child,thead th:last-child{text-align:left}\
a{color:light-dark(#0969da,#58a6ff)}.good{color:light-dark(#1a7f37,#3fb950)}\
.bad{color:light-dark(#c01f2e,#ff7b72)}";

/// The page: a table with a row for each size and side.
pub fn page(sizes: &Sizes) -> String {
    const HEADS: [&str; 14] = [
        "last",
        "length",
        "bottom length",
        "bottom taped",
        "centre line",
        "ball girth",
        "cone heel line",
        "heel height",
        "toe spring",
        "toe thickness",
        "machined off by at most",
        "positions",
        "cutting, s",
        "deepest gouge",
    ];
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>{0}</title>\n<style>{STYLE}</style>\n\
         <h1>{0}</h1>\n<p>{1} lasts. Lengths in mm. horma {2}.</p>\n<div class=\"wide\"><table>\n<thead><tr>",
        escaped(&format!("Sizes and sides of {}", sizes.job)),
        sizes.sizes.len(),
        escaped(&sizes.version),
    );
    for head in HEADS {
        out += &format!("<th scope=\"col\">{head}</th>");
    }
    out += "<th scope=\"col\">files</th></tr></thead>\n<tbody>\n";
    for size in &sizes.sizes {
        out += &row(size);
    }
    out += "</tbody></table></div>\n<p>Measures are of the designed last; how they are defined, and what is held from \
            size to size, says docs/lasts.md.</p>\n</html>\n";
    out
}

fn row(size: &Size) -> String {
    let name = escaped(&size.name);
    let mut row = format!(
        "<tr><th scope=\"row\"><a href=\"{name}/{}\">{name}</a></th>",
        output::VIEW
    );
    let mut cell = |text: String, class: &str| row += &format!("<td class=\"{class}\">{text}</td>");
    let measures = size.last.as_ref().map(|l| l.designed);
    let shown = measures.map(|m| {
        let named = m
            .named()
            .into_iter()
            .filter(|(name, _)| *name != "ball_width");
        named.map(|(_, value)| format!("{value:.2}")).collect()
    });
    for measure in shown.unwrap_or_else(|| vec![String::new(); 9]) {
        cell(measure, "");
    }
    match size.last.as_ref().and_then(|l| l.machined) {
        None => cell(String::new(), ""),
        Some(m) => {
            let class = if m.within_allowed { "good" } else { "bad" };
            cell(format!("{:+.3}", m.largest), class);
        }
    }
    cell(size.positions.to_string(), "");
    cell(
        size.seconds.map_or_else(String::new, |s| format!("{s:.1}")),
        "",
    );
    cell(
        size.deepest_gouge
            .map_or_else(|| "not verified".to_owned(), |g| format!("{g:.4}")),
        "",
    );
    let files = [output::PATH, output::REPORT]
        .map(str::to_owned)
        .into_iter();
    let files = files.chain(size.programs.iter().cloned());
    let links = files.map(|f| format!("<a href=\"{name}/{0}\">{0}</a>", escaped(&f)));
    cell(links.collect::<Vec<_>>().join(" "), "");
    row += "</tr>\n";
    row
}
