//! What can be typed, as a shell and as `man` want it.

use std::fs;
use std::path::Path;

use clap::CommandFactory;
use clap_complete::Shell;

use crate::args::Arguments;
use crate::error::{Error, Result};
use crate::say;

/// Prints completions for a shell.
pub(crate) fn completions(shell: Shell) {
    clap_complete::generate(
        shell,
        &mut Arguments::command(),
        "horma",
        &mut std::io::stdout(),
    );
}

/// Writes a page for the command and one for each of its subcommands.
pub(crate) fn pages(directory: &Path) -> Result<()> {
    let written = fs::create_dir_all(directory)
        .and_then(|()| clap_mangen::generate_to(Arguments::command(), directory));
    written.map_err(|source| Error::Manual {
        directory: directory.to_owned(),
        source,
    })?;
    say(&directory.join("horma.1").display().to_string());
    Ok(())
}
