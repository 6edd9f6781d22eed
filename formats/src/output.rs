//! The output directory: its results appear whole or not at all, and nothing of others is touched.

use std::fs::{self, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::also::Also;
use crate::error::{Error, Result};
use crate::job::Side;
use crate::post::Control;

/// The tool path.
pub const PATH: &str = "path.csv";
/// Begins the name of the path of a layer of the roughing.
const ROUGH: &str = "rough-";
/// What was computed, by whom and how fast.
pub const REPORT: &str = "report.json";
/// The path as cutter locations.
pub const APT: &str = "path.apt";
/// The picture.
pub const PREVIEW: &str = "preview.png";
/// The run to look at.
pub const VIEW: &str = "report.html";

/// The machined surface as triangles.
pub const MACHINED_MESH: &str = "machined.ply";
/// Its deviation from the designed one, unrolled.
pub const MACHINED_MAP: &str = "machined.svg";

/// The bench's table.
pub const BENCH_TABLE: &str = "kernel.txt";
/// The bench's figures.
pub const BENCH_FIGURES: &str = "kernel.json";
/// The bench's diagram.
pub const BENCH_PLOT: &str = "kernel.svg";

/// Diagrams of a bench of clusters.
const SCALING_PLOTS: [&str; 8] = [
    "rows.svg",
    "bytes.svg",
    "time-exact.svg",
    "time-brute.svg",
    "speedup-exact.svg",
    "speedup-brute.svg",
    "projection-exact.svg",
    "projection-brute.svg",
];
/// Tables of a bench of clusters.
pub const SCALING_TABLE: &str = "scaling.md";
/// Every run in figures.
pub const SCALING_FIGURES: &str = "scaling.csv";

/// Begins the name of a file that is still being written.
const UNFINISHED: &str = ".horma-";

/// The program for the machine, one file or `part` of several; without hyphens, which not every control
/// takes.
pub fn program_name(control: Control, part: Option<u32>) -> String {
    let extension = control.dialect().extension;
    match part {
        None => format!("path.{extension}"),
        Some(part) => format!("path_{part:04}.{extension}"),
    }
}

/// The path of a layer of the roughing, counted from 1.
pub fn rough_name(layer: usize) -> String {
    format!("{ROUGH}{layer}.csv")
}

/// Whether a run may give a file of its output directory this name.
fn of_run(name: &str) -> bool {
    [PATH, APT, PREVIEW].contains(&name) || of_program(name) || of_rough(name) || of_machined(name)
}

fn of_rough(name: &str) -> bool {
    let layer = name
        .strip_prefix(ROUGH)
        .and_then(|n| n.strip_suffix(".csv"));
    let layer = layer.and_then(|n| n.parse().ok());
    layer.is_some_and(|layer| layer > 0 && rough_name(layer) == name)
}

fn of_program(name: &str) -> bool {
    let parts = name.strip_prefix("path").and_then(|n| n.split_once('.'));
    parts.is_some_and(|(part, extension)| {
        let digits = part.strip_prefix('_').unwrap_or("0000");
        Control::ALL
            .iter()
            .any(|c| c.dialect().extension == extension)
            && (part.is_empty() || part.starts_with('_'))
            && digits.len() == 4
            && digits.bytes().all(|c| c.is_ascii_digit())
    })
}

/// What a run of several sizes and sides calls one of them, as in `37.5-left`.
pub fn size_name(size: Option<f64>, side: Option<Side>) -> String {
    let size = size.map(|size| size.to_string());
    let side = side.map(|side| side.name().to_owned());
    let both: Vec<String> = size.into_iter().chain(side).collect();
    both.join("-")
}

/// Whether a run of several sizes and sides may give an entry of its output directory this name.
pub fn of_sizes(name: &str) -> bool {
    [REPORT, VIEW].contains(&name) || of_size(name)
}

/// Whether that is the name of one of them.
fn of_size(name: &str) -> bool {
    let (size, side) = name.rsplit_once('-').unwrap_or((name, ""));
    let sides = [Side::Left, Side::Right].map(Side::name);
    let is_size = |text: &str| text.parse::<f64>().is_ok_and(|s| s.to_string() == text);
    sides.contains(&name) || is_size(name) || (sides.contains(&side) && is_size(size))
}

/// Makes `dir` ready for several sizes and sides, each with a directory of its own.
///
/// # Errors
/// Those of [`prepare_dir`], also for what is in these directories.
pub fn prepare_sizes(dir: &Path) -> Result<()> {
    prepare_dir_of(dir, of_sizes)?;
    let there = names(dir).map_err(|e| Error::io(dir, e))?;
    let mut sizes = there.iter().filter(|name| of_size(name));
    sizes.try_for_each(|name| prepare_dir(&dir.join(name)))
}

/// Whether what is found of a path may give a file of its output directory this name.
pub fn of_machined(name: &str) -> bool {
    [REPORT, VIEW, MACHINED_MAP].contains(&name) || Also::named(name).is_some()
}

/// Whether a bench of the kernel may give a file of its output directory this name.
pub fn of_bench(name: &str) -> bool {
    [BENCH_TABLE, BENCH_FIGURES, BENCH_PLOT].contains(&name)
}

/// Whether a bench of clusters may give a file of its output directory this name.
pub fn of_scaling(name: &str) -> bool {
    [SCALING_TABLE, SCALING_FIGURES].contains(&name) || SCALING_PLOTS.contains(&name)
}

/// Makes `dir` ready for results: creates it if it is missing, else checks that it is writable and
/// holds nothing but the results of an earlier run.
///
/// # Errors
/// [`Error::NotADirectory`], [`Error::ForeignDirectory`] if it holds anything else, [`Error::Io`]
/// if it cannot be created, read or written.
pub fn prepare_dir(dir: &Path) -> Result<()> {
    prepare_dir_of(dir, of_run)
}

/// The same for results of `our` names.
///
/// # Errors
/// Those of [`prepare_dir`].
pub fn prepare_dir_of(dir: &Path, our: fn(&str) -> bool) -> Result<()> {
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
        if !our(&name) && !name.starts_with(UNFINISHED) {
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
    our: fn(&str) -> bool,
    dir: PathBuf,
    staged: TempDir,
}

impl Staging {
    /// Begins results for `dir`.
    ///
    /// # Errors
    /// [`Error::Io`] if nothing can be created there.
    pub fn begin(dir: &Path) -> Result<Self> {
        Self::begin_of(dir, of_run)
    }

    /// Begins results of `our` names for `dir`.
    ///
    /// # Errors
    /// [`Error::Io`] if nothing can be created there.
    pub fn begin_of(dir: &Path, our: fn(&str) -> bool) -> Result<Self> {
        let mut builder = tempfile::Builder::new();
        let staged = builder.prefix(UNFINISHED).tempdir_in(dir);
        Ok(Self {
            our,
            dir: dir.to_owned(),
            staged: staged.map_err(|source| Error::io(dir, source))?,
        })
    }

    /// Where results are written.
    pub fn dir(&self) -> &Path {
        self.staged.path()
    }

    /// Where to write the result called `name`, one of those that were begun.
    pub fn file(&self, name: &str) -> PathBuf {
        self.dir().join(name)
    }

    /// Moves every result to its place. What an earlier run left there and this one did not write
    /// is removed, so that no stale program lies beside a new path.
    ///
    /// # Errors
    /// [`Error::Io`], naming the file.
    pub fn publish(self) -> Result<()> {
        let staged = names(self.dir()).map_err(|e| Error::io(self.dir(), e))?;
        for name in &staged {
            let target = self.dir.join(name);
            // A directory of an earlier run, which held nothing else when this one began.
            if target.is_dir() {
                fs::remove_dir_all(&target).map_err(|e| Error::io(&target, e))?;
            }
            fs::rename(self.file(name), &target).map_err(|e| Error::io(&target, e))?;
        }
        let there = names(&self.dir).map_err(|e| Error::io(&self.dir, e))?;
        for stale in there
            .iter()
            .filter(|n| (self.our)(n) && !staged.contains(n))
        {
            let stale = self.dir.join(stale);
            let removed = if stale.is_dir() {
                fs::remove_dir_all(&stale)
            } else {
                fs::remove_file(&stale)
            };
            removed.map_err(|e| Error::io(&stale, e))?;
        }
        Ok(())
    }
}

/// The names in a directory, in order.
fn names(dir: &Path) -> io::Result<Vec<String>> {
    let names = fs::read_dir(dir)?;
    let names = names.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut names: Vec<String> = names.collect::<io::Result<_>>()?;
    names.sort();
    Ok(names)
}

/// Writes `file` with `contents`: into a file beside it that takes its name once it is whole.
///
/// # Errors
/// [`Error::Io`], naming `file`; nothing is left behind.
pub fn write<T>(
    file: &Path,
    contents: impl FnOnce(&mut BufWriter<&mut fs::File>) -> io::Result<T>,
) -> Result<T> {
    replace(file, contents).map_err(|source| Error::io(file, source))
}

fn replace<T>(
    file: &Path,
    contents: impl FnOnce(&mut BufWriter<&mut fs::File>) -> io::Result<T>,
) -> io::Result<T> {
    let dir = match file.parent() {
        Some(dir) if dir != Path::new("") => dir,
        _ => Path::new("."),
    };
    let mut beside = unfinished(dir)?;
    let mut out = BufWriter::new(beside.as_file_mut());
    let made = contents(&mut out)?;
    out.flush()?;
    drop(out);
    beside.as_file().sync_all()?;
    beside.persist(file)?;
    Ok(made)
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
        super::names(dir).expect("readable")
    }

    #[test]
    fn a_file_is_replaced_whole_or_not_at_all() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join(PATH);
        write(&file, |out| out.write_all(b"first")).expect("writable");
        let broken = write(&file, |out| {
            out.write_all(b"sec")?;
            Err::<(), _>(io::Error::other("the pen broke"))
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
        let old = [
            "path.csv",
            "report.json",
            "path.ngc",
            "path_0001.mpf",
            "path_0002.mpf",
        ];
        for name in old {
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
    fn programs_are_known_by_their_names() {
        for control in Control::ALL {
            assert!(of_run(&program_name(control, None)));
            assert!(of_run(&program_name(control, Some(17))));
        }
        for foreign in [
            "path.txt",
            "path_1.ngc",
            "path_00001.ngc",
            "path-0001.ngc",
            "pathology.nc",
        ] {
            assert!(!of_run(foreign), "{foreign}");
        }
    }

    #[test]
    fn layers_are_known_by_their_names() {
        assert_eq!(rough_name(12), "rough-12.csv");
        assert!(of_run("rough-1.csv") && of_run("rough-200.csv"));
        for foreign in [
            "rough-0.csv",
            "rough-01.csv",
            "rough-+1.csv",
            "rough-1.txt",
            "rough-.csv",
        ] {
            assert!(!of_run(foreign), "{foreign}");
        }
    }

    #[test]
    fn sizes_are_known_by_their_names() {
        let names = [
            size_name(Some(37.0), Some(Side::Left)),
            size_name(Some(37.5), None),
            size_name(None, Some(Side::Right)),
        ];
        assert_eq!(names, ["37-left", "37.5", "right"]);
        for name in &names {
            assert!(of_sizes(name), "{name}");
        }
        for foreign in ["37-both", "photos", "37.50-left", "-left", "left-37"] {
            assert!(!of_sizes(foreign), "{foreign}");
        }
        let scratch = tempfile::tempdir().expect("scratch");
        let size = scratch.path().join("37-left");
        fs::create_dir(&size).expect("writable");
        fs::write(size.join("letter.txt"), "dear").expect("writable");
        let message = prepare_sizes(scratch.path())
            .expect_err("refused")
            .to_string();
        assert!(message.contains("letter.txt"), "{message}");
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
