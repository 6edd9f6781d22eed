//! The small commands: a sample to start with, and a look into files.

use std::path::{Path, PathBuf};

use horma_formats::part::Unit;
use horma_formats::{inspect, sample, view};

use crate::error::Result;
use crate::say;

/// Tells what is in each file, and shows all of them on the page `html`.
pub(crate) fn inspect(files: &[PathBuf], units: Option<&Unit>, html: Option<&Path>) -> Result<()> {
    let mut all = Vec::new();
    for file in files {
        let (inspection, part) = inspect::inspect(file, units.cloned())?;
        say(&inspection.to_string());
        all.push((inspection, part));
    }
    if let Some(page) = html {
        let (seen, figures) = view::part(&all);
        view::save(page, &seen, &figures)?;
        say(&format!("wrote {}", page.display()));
    }
    Ok(())
}

/// Writes the sample job.
pub(crate) fn init(directory: &Path) -> Result<()> {
    sample::write_sample(directory)?;
    let job = directory.join("job.toml");
    say(&format!(
        "wrote a shoe last, its holders and a job\nnext: horma run {} -o {}",
        job.display(),
        directory.join("out").display(),
    ));
    Ok(())
}
