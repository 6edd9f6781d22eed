//! Where in a job something is wrong: a line of the file, or a flag.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Where something was given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// Some characters of a job file.
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The first character, from 1.
        column: usize,
        /// How many characters.
        width: usize,
        /// The whole line.
        text: String,
    },
    /// A job file in which something is missing.
    File(PathBuf),
    /// A flag or an environment variable, by the key whose place it takes.
    Flag(&'static str),
}

impl Place {
    /// The place of the bytes `span` of `text`, which is what the file at `path` holds.
    pub(super) fn of(path: &Path, text: &str, span: &Range<usize>) -> Self {
        let before = text.get(..span.start).unwrap_or(text);
        let start = before.rfind('\n').map_or(0, |i| i + 1);
        let line = text[start..].lines().next().unwrap_or_default();
        let length = text
            .get(span.clone())
            .map_or(0, |s| s.lines().next().unwrap_or_default().chars().count());
        Self::Line {
            path: path.to_owned(),
            line: before.matches('\n').count() + 1,
            column: before[start..].chars().count() + 1,
            width: length.max(1),
            text: line.to_owned(),
        }
    }
}

/// What follows an error's text: lines that show the place, or a clause that names it.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(f, "\n --> {}", path.display()),
            // No variable says what is made of a last; of several at once the flag is the plural.
            Self::Flag(key @ ("size" | "side")) => {
                write!(f, " (given as --{key} or --{key}s)")
            }
            Self::Flag(key) => {
                let (flag, variable) = (key.replace('_', "-"), key.to_uppercase());
                write!(f, " (given as --{flag} or HORMA_{variable})")
            }
            Self::Line {
                path,
                line,
                column,
                width,
                text,
            } => {
                let number = line.to_string();
                let gutter = " ".repeat(number.len());
                // Tabs stay tabs, so that the marks stand under what they mark.
                let indent = text.chars().take(column - 1);
                let indent: String = indent.map(|c| if c == '\t' { c } else { ' ' }).collect();
                let marks = "^".repeat(*width);
                writeln!(f, "\n{gutter}--> {}:{line}:{column}", path.display())?;
                writeln!(f, "{gutter} |\n{number} | {text}")?;
                write!(f, "{gutter} | {indent}{marks}")
            }
        }
    }
}
