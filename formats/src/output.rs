//! The output directory: its results appear whole or not at all, and nothing of others is touched.

use std::fs::{self, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::error::{Error, Result};

/// Every name that a run may give a file of its output directory.
pub const FILES: [&str; 5] = [PATH, REPORT, PROGRAM, PREVIEW, VIEW];
/// The tool path.
pub const PATH: &str = "path.csv";
/// What was computed, by whom and how fast.
pub const REPORT: &str = "report.json";
/// The program for the machine.
pub const PROGRAM: &str = "path.ngc";
/// The picture.
pub const PREVIEW: &str = "preview.png";
/// The run to look at.
pub const VIEW: &str = "report.html";

/// Every name that a bench of the kernel may give a file of its output directory.
pub const BENCH_FILES: [&str; 3] = [BENCH_TABLE, BENCH_FIGURES, BENCH_PLOT];
/// The bench's table.
pub const BENCH_TABLE: &str = "kernel.txt";
/// The bench's figures.
pub const BENCH_FIGURES: &str = "kernel.json";
/// The bench's diagram.
pub const BENCH_PLOT: &str = "kernel.svg";

/// Every name that a bench of clusters may give a file of its output directory.
pub const SCALING_FILES: [&str; 10] = [
    SCALING_TABLE,
    SCALING_FIGURES,
    "rows.svg",
    "bytes.svg",
    "time-exact.svg",
    "time-brute.svg",
    "speedup-exact.svg",
    "speedup-brute.svg",
    "projection-exact.svg",
    "projection-brute.svg",
];
/// Its tables.
pub const SCALING_TABLE: &str = "scaling.md";
/// Every run in figures.
pub const SCALING_FIGURES: &str = "scaling.csv";

/// Begins the name of a file that is still being written.
const UNFINISHED: &str = ".horma-";

/// Makes `dir` ready for results: creates it if it is missing, else checks that it is writable and
/// holds nothing but the results of an earlier run.
///
/// # Errors
/// [`Error::NotADirectory`], [`Error::ForeignDirectory`] if it holds anything else, [`Error::Io`]
/// if it cannot be created, read or written.
pub fn prepare_dir(dir: &Path) -> Result<()> {
    prepare_dir_of(dir, &FILES)
}

/// The same for results of these names.
///
/// # Errors
/// Those of [`prepare_dir`].
pub fn prepare_dir_of(dir: &Path, files: &[&str]) -> Result<()> {
    let io = |source| Error::io(dir, source);
    if dir.exists() && !dir.is_dir() {
        return Err(Error::NotADirectory {
            path: dir.to_owned(),
        });
    }
    fs::create_dir_all(dir).map_err(io)?;
    for entry in fs::read_dir(dir).map_err(io)? {
        let name = entry.map_err(io)?.file_name();
        let name = name.to_string_lossy();
        if !files.contains(&&*name) && !name.starts_with(UNFINISHED) {
            return Err(Error::ForeignDirectory {
                path: dir.to_owned(),
                entry: name.into_owned(),
            });
        }
    }
    unfinished(dir).map_err(io)?;
    Ok(())
}

/// Results on their way: they lie in a directory of their own and vanish with this value unless they
/// are published, all at once.
#[derive(Debug)]
pub struct Staging {
    files: &'static [&'static str],
    dir: PathBuf,
    staged: TempDir,
}

impl Staging {
    /// Begins results for `dir`.
    ///
    /// # Errors
    /// [`Error::Io`] if nothing can be created there.
    pub fn begin(dir: &Path) -> Result<Self> {
        Self::begin_of(dir, &FILES)
    }

    /// Begins results of these names for `dir`.
    ///
    /// # Errors
    /// [`Error::Io`] if nothing can be created there.
    pub fn begin_of(dir: &Path, files: &'static [&'static str]) -> Result<Self> {
        let mut builder = tempfile::Builder::new();
        let staged = builder.prefix(UNFINISHED).tempdir_in(dir);
        Ok(Self {
            files,
            dir: dir.to_owned(),
            staged: staged.map_err(|source| Error::io(dir, source))?,
        })
    }

    /// Where to write the result called `name`, one of those that were begun.
    pub fn file(&self, name: &str) -> PathBuf {
        self.staged.path().join(name)
    }

    /// Moves every result to its place. What an earlier run left there and this one did not write
    /// is removed, so that no stale program lies beside a new path.
    ///
    /// # Errors
    /// [`Error::Io`], naming the file.
    pub fn publish(self) -> Result<()> {
        for name in self.files {
            let target = self.dir.join(name);
            let moved = match self.file(name) {
                staged if staged.exists() => fs::rename(staged, &target),
                _ => fs::remove_file(&target),
            };
            match moved {
                Err(e) if e.kind() != io::ErrorKind::NotFound => {
                    return Err(Error::io(&target, e));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Writes `file` with `contents`: into a file beside it that takes its name once it is whole.
///
/// # Errors
/// [`Error::Io`], naming `file`; nothing is left behind.
pub fn write(
    file: &Path,
    contents: impl FnOnce(&mut BufWriter<&mut fs::File>) -> io::Result<()>,
) -> Result<()> {
    replace(file, contents).map_err(|source| Error::io(file, source))
}

fn replace(
    file: &Path,
    contents: impl FnOnce(&mut BufWriter<&mut fs::File>) -> io::Result<()>,
) -> io::Result<()> {
    let dir = match file.parent() {
        Some(dir) if dir != Path::new("") => dir,
        _ => Path::new("."),
    };
    let mut beside = unfinished(dir)?;
    let mut out = BufWriter::new(beside.as_file_mut());
    contents(&mut out)?;
    out.flush()?;
    drop(out);
    beside.as_file().sync_all()?;
    beside.persist(file)?;
    Ok(())
}

/// A file in `dir` that vanishes unless it is given a name.
fn unfinished(dir: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(UNFINISHED);
    if let Some(permissions) = ordinary() {
        builder.permissions(permissions);
    }
    builder.tempfile_in(dir)
}

/// The permissions of a file like any other, where the library would make it private.
fn ordinary() -> Option<Permissions> {
    #[cfg(unix)]
    return Some(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    #[cfg(not(unix))]
    return None;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let entries = fs::read_dir(dir).expect("readable");
        let mut names: Vec<_> = entries
            .map(|e| e.expect("entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_whole_or_not_at_all() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join(PATH);
        write(&file, |out| out.write_all(b"first")).expect("writable");
        let broken = write(&file, |out| {
            out.write_all(b"sec")?;
            Err(io::Error::other("the pen broke"))
        });
        let message = broken.expect_err("broken").to_string();
        assert!(
            message.contains(PATH) && message.contains("the pen broke"),
            "{message}"
        );
        assert_eq!(fs::read(&file).expect("there"), b"first");
        assert_eq!(names(dir.path()), [PATH]);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_is_as_readable_as_any_other() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().expect("scratch");
        let [ours, other] = [PATH, "other"].map(|n| dir.path().join(n));
        write(&ours, |_| Ok(())).expect("writable");
        fs::write(&other, "").expect("writable");
        let mode = |f| fs::metadata(f).expect("there").permissions().mode();
        assert_eq!(mode(ours), mode(other));
    }

    #[test]
    fn a_directory_is_created_and_used_again() {
        let scratch = tempfile::tempdir().expect("scratch");
        let dir = scratch.path().join("new/deep");
        prepare_dir(&dir).expect("created");
        for name in FILES {
            fs::write(dir.join(name), "").expect("writable");
        }
        fs::write(dir.join(".horma-killed"), "").expect("writable");
        prepare_dir(&dir).expect("ours");
        let dropped = Staging::begin(&dir).expect("writable");
        fs::write(dropped.file(PATH), "never seen").expect("writable");
        drop(dropped);
        assert_eq!(fs::read(dir.join(PATH)).expect("there"), b"");
        let staging = Staging::begin(&dir).expect("writable");
        for name in [PATH, REPORT] {
            fs::write(staging.file(name), "new").expect("writable");
        }
        staging.publish().expect("movable");
        assert_eq!(names(&dir), [".horma-killed", PATH, REPORT]);
        assert_eq!(fs::read(dir.join(PATH)).expect("there"), b"new");
    }

    #[test]
    fn what_is_not_ours_is_left_alone() {
        let scratch = tempfile::tempdir().expect("scratch");
        let letter = scratch.path().join("letter.txt");
        fs::write(&letter, "dear").expect("writable");
        let message = |dir: &Path| prepare_dir(dir).expect_err("refused").to_string();
        assert!(message(scratch.path()).contains("letter.txt"));
        assert!(message(&letter).contains("not a directory"));
        assert!(message(&letter.join("out")).contains("letter.txt"));
        let nowhere = write(&letter.join(PATH), |_| Ok(()));
        assert!(matches!(nowhere, Err(Error::Io { .. })));
    }
}
