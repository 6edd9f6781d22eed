//! A run's page in the browser of whoever sits here.

use horma_formats::output;

use crate::args;
use crate::error::{Error, Result};
use crate::say;

/// Tells where the page of a run's results is, and opens it: in `browser` if there is one, else in what
/// the system opens pages with.
pub(crate) fn view(args: &args::View) -> Result<()> {
    let file = args.directory.join(output::VIEW);
    // A browser goes by a directory of its own.
    let Ok(file) = file.canonicalize() else {
        return Err(Error::NothingToView { path: file });
    };
    say(&file.display().to_string());
    let opened = match &args.browser {
        Some(browser) => open::with(&file, browser),
        None => open::that(&file),
    };
    opened.map_err(|error| Error::NoBrowser {
        path: file,
        reason: error.to_string(),
    })
}
