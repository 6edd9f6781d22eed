//! The papers, reproduced: which experiments, and where what they found goes.

use horma_papers::{Experiment, PAGE, VIEW};

use crate::args;
use crate::error::Result;
use crate::progress::{Audience, Display};
use crate::say;

/// Makes the experiments and writes their report.
pub(crate) fn papers(args: &args::Papers) -> Result<()> {
    // What cannot be written should not be computed first.
    horma_papers::prepare(&args.output)?;
    let display = Display::new(Audience::unless(args.quiet));
    let asked = |e: &Experiment| args.names.is_empty() || args.names.contains(e);
    let chapters = Experiment::ALL.into_iter().filter(asked).map(|experiment| {
        display.tell(experiment.name(), 0, 0);
        experiment.run()
    });
    let chapters = chapters.collect::<horma_papers::Result<Vec<_>>>();
    display.finish();
    horma_papers::write(&args.output, &chapters?)?;
    for name in [PAGE, VIEW] {
        say(&args.output.join(name).display().to_string());
    }
    Ok(())
}
