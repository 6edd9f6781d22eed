//! What can be typed of lasts, their sizes and sides.

use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use horma_formats::job::Overrides;

/// Most sizes of one run.
const MOST: usize = 200;

/// Sizes and sides to make, each into a directory of its own.
#[derive(Debug, Args)]
#[command(next_help_heading = "The last in other sizes, and for the other foot")]
pub(crate) struct Sizes {
    /// Sizes to make, graded as the job says: 36-42, 36-42/0.5 for half sizes, 36,37.5 or
    /// all of these; each into a directory such as 37-left of DIR, with one report.json and one
    /// report.html for all
    #[arg(long, value_name = "LIST", value_parser = sizes)]
    pub sizes: Option<List>,
    /// Sides to make; the last is mirrored for the one that its files are not for [default: the files']
    #[arg(long, value_name = "SIDE,...", value_delimiter = ',', value_parser = sides())]
    pub sides: Vec<String>,
}

impl Sizes {
    /// Whether any are asked for.
    pub fn asked(&self) -> bool {
        self.sizes.is_some() || !self.sides.is_empty()
    }
}

/// One size and side of a last.
#[derive(Debug, Args)]
pub(crate) struct Made {
    /// Size of the last that it is about [default: the files']
    #[arg(long, value_name = "SIZE")]
    pub size: Option<f64>,
    /// Side of the last that it is about [default: the files']
    #[arg(long, value_name = "SIDE", value_parser = sides())]
    pub side: Option<String>,
}

impl Made {
    /// In the words of a job.
    pub fn overrides(&self) -> Overrides {
        Overrides {
            size: self.size,
            side: self.side.clone(),
            ..Overrides::default()
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct Measure {
    /// A job file (TOML), or part files
    #[arg(value_name = "JOB|PART", required = true)]
    pub files: Vec<PathBuf>,
    /// A path of the job, to measure the last as machined by it
    #[arg(long, value_name = "PATH.csv")]
    pub path: Option<PathBuf>,
    #[command(flatten)]
    pub made: Made,
    /// Draw the sections in which it is measured, with the landmarks, into this SVG file
    #[arg(long, value_name = "FILE")]
    pub figure: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", env = "HORMA_THREADS", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
}

/// Sizes in ascending order, each once.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct List(pub Vec<f64>);

fn sides() -> PossibleValuesParser {
    PossibleValuesParser::new(["left", "right"])
}

/// Reads `36-42`, `36-42/0.5`, `36,37.5`, and lists of these.
fn sizes(text: &str) -> Result<List, String> {
    let mut sizes = Vec::new();
    for item in text.split(',') {
        sizes.extend(range(item.trim())?);
        if sizes.len() > MOST {
            return Err(format!("more than {MOST} sizes; ask for fewer"));
        }
    }
    sizes.sort_by(f64::total_cmp);
    sizes.dedup();
    Ok(List(sizes))
}

fn range(item: &str) -> Result<Vec<f64>, String> {
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(size) if size.is_finite() && (0.0..=1000.0).contains(&size) => Ok(size + 0.0),
        _ => Err(format!(
            "{text:?} is not a size; give sizes as in 36-42, 36-42/0.5 or 36,37.5"
        )),
    };
    let Some((from, to)) = item.split_once('-') else {
        return Ok(vec![number(item)?]);
    };
    let (to, step) = to.split_once('/').unwrap_or((to, "1"));
    let [from, to, step] = [number(from)?, number(to)?, number(step)?];
    if to < from {
        return Err(format!("{item:?} ends before it begins; write {to}-{from}"));
    }
    if step < 0.001 || (to - from) / step > MOST as f64 {
        return Err(format!(
            "{item:?} has too many sizes; ask for at most {MOST}"
        ));
    }
    let count = ((to - from) / step + 1e-9) as u32;
    Ok((0..=count).map(|k| from + step * f64::from(k)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_ranges_and_lists() {
        let check = |text: &str, expected: &[f64]| {
            assert_eq!(sizes(text), Ok(List(expected.to_vec())), "{text}");
        };
        check("36-39", &[36.0, 37.0, 38.0, 39.0]);
        check("36,37.5", &[36.0, 37.5]);
        check("4-5/0.5, 4", &[4.0, 4.5, 5.0]);
        check("37", &[37.0]);
    }

    #[test]
    fn what_is_no_size_is_refused_with_advice() {
        let check = |text: &str, advice: &str| {
            let error = sizes(text).expect_err(text);
            assert!(error.contains(advice), "{text}: {error}");
        };
        check("", "36-42");
        check("36-", "36-42");
        check("42-36", "write 36-42");
        check("small", "36,37.5");
        check("1-1000", "at most 200");
        check("36-42/0", "at most 200");
        check("NaN", "not a size");
    }
}
