//! The small commands: a sample to start with, and a look into files.

use std::path::{Path, PathBuf};

use horma_formats::part::Unit;
use horma_formats::{inspect, sample};

use crate::error::Result;
use crate::say;

/// Tells what is in each file.
pub(crate) fn inspect(files: &[PathBuf], units: Option<&Unit>) -> Result<()> {
    for file in files {
        say(&inspect::inspect(file, units.cloned())?.to_string());
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
