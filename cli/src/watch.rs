//! `run --watch`: a job is run again whenever its file or one of its part files changes.
//!
//! Directories are watched rather than files, since editors put a new file in the place of the old one.
//! It hears what this system tells of its own disks: of what another machine changes on a shared one
//! nobody tells.

use std::collections::BTreeSet;
use std::io::{Write, stderr};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use horma_formats::job::{self, Overrides};
use notify::{EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio_util::sync::CancellationToken;

use crate::error::{Error, Result};
use crate::progress::{Display, Event};
use crate::serve::runtime;
use crate::system;

/// Saving a file is several changes; it is saved when there were none for so long.
const SETTLED: Duration = Duration::from_millis(100);

/// Runs a job, and again with every change of its files, until the user interrupts it. A change ends the
/// run that it finds; of a run that fails it is told why, and the next change may mend it.
pub(crate) fn watch(
    job: &Path,
    overrides: &Overrides,
    display: &Display,
    once: impl Fn(&CancellationToken) -> Result<()>,
) -> Result<()> {
    let runtime = runtime()?;
    let (mut watched, mut changes) = Watched::begin()?;
    loop {
        let stop = CancellationToken::new();
        let files = watched.look_at(files_of(job, overrides), stop.clone())?;
        match once(&stop) {
            // If nothing has changed it was the user who wanted it to stop.
            Err(Error::Interrupted) if changes.is_empty() => return Err(Error::Interrupted),
            Ok(()) | Err(Error::Interrupted) => {}
            // Nobody may be listening.
            Err(error) => drop(writeln!(stderr(), "horma: {error}")),
        }
        display.tell_of(
            &format!("watching {} files; interrupt to end", files.len()),
            &Event::Watching { files: &files },
        );
        let changed = runtime.block_on(async {
            tokio::select! {
                () = system::interrupted() => Err(Error::Interrupted),
                changed = settled(&mut changes) => changed.ok_or(Error::Interrupted),
            }
        })?;
        display.tell_of(
            &format!("{} has changed", changed.display()),
            &Event::Changed { file: &changed },
        );
    }
}

/// The job's file and those of its part; the former alone if nothing can be made of it.
fn files_of(job: &Path, overrides: &Overrides) -> Vec<PathBuf> {
    let part = job::read(job, overrides).map_or(Vec::new(), |file| file.files);
    [job.to_owned()].into_iter().chain(part).collect()
}

/// The next file that changes, once nothing does any more.
async fn settled(changes: &mut UnboundedReceiver<PathBuf>) -> Option<PathBuf> {
    let mut changed = changes.recv().await?;
    while let Ok(Some(next)) = tokio::time::timeout(SETTLED, changes.recv()).await {
        changed = next;
    }
    Some(changed)
}

/// What is watched, and who is to stop when it changes.
struct Watched {
    watcher: RecommendedWatcher,
    directories: BTreeSet<PathBuf>,
    files: Arc<Mutex<(BTreeSet<PathBuf>, CancellationToken)>>,
}

impl Watched {
    /// Nothing yet. Changes are told by the second value.
    fn begin() -> Result<(Self, UnboundedReceiver<PathBuf>)> {
        let (tell, changes) = unbounded_channel();
        let files = Arc::<Mutex<(BTreeSet<PathBuf>, CancellationToken)>>::default();
        let wanted = Arc::clone(&files);
        let watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
            // What cannot be told of is as good as unchanged.
            if let Ok(event) = event {
                heard(&event, &wanted, &tell);
            }
        })
        .map_err(|e| Error::Watch(e.to_string()))?;
        let watched = Self {
            watcher,
            directories: BTreeSet::new(),
            files,
        };
        Ok((watched, changes))
    }

    /// Watches these files as well, and has `stop` cancelled when one changes. Gives all that are watched.
    fn look_at(&mut self, files: Vec<PathBuf>, stop: CancellationToken) -> Result<Vec<PathBuf>> {
        let mut wanted = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        wanted.1 = stop;
        for file in files {
            let parent = file.parent().filter(|p| !p.as_os_str().is_empty());
            let parent = parent.unwrap_or(Path::new(".")).canonicalize();
            // Of a directory that is not there the run tells.
            let (Ok(directory), Some(name)) = (parent, file.file_name()) else {
                continue;
            };
            wanted.0.insert(directory.join(name));
            if self.directories.insert(directory.clone()) {
                let begun = self.watcher.watch(&directory, RecursiveMode::NonRecursive);
                begun.map_err(|e| Error::Watch(e.to_string()))?;
            }
        }
        Ok(wanted.0.iter().cloned().collect())
    }
}

/// Tells of a change of a file that is watched, and stops what is made of it.
fn heard(
    event: &notify::Event,
    wanted: &Mutex<(BTreeSet<PathBuf>, CancellationToken)>,
    tell: &UnboundedSender<PathBuf>,
) {
    if let EventKind::Access(_) = event.kind {
        return;
    }
    let wanted = wanted.lock().unwrap_or_else(PoisonError::into_inner);
    for path in event.paths.iter().filter(|p| wanted.0.contains(*p)) {
        // Whoever watches may have ended.
        let _ = tell.send(path.clone());
        wanted.1.cancel();
    }
}
