//! The report as a page of Markdown. Its diagrams lie beside it, in a folder.
//!
//! What differs from run to run stands between two marks, so that a test can compare the rest.

use std::fmt::Write;

use crate::report::{Block, Chapter, Table, of_claims};
use crate::{DIAGRAMS, INTRODUCTION, TITLE, command};

/// Before what differs from run to run.
pub const TIMED: &str = "<!-- timed -->";
/// After it.
pub const END_TIMED: &str = "<!-- end of timed -->";

/// The whole page.
pub fn page(chapters: &[Chapter]) -> String {
    let mut out = format!("# {TITLE}\n\n```sh\n{}\n```\n", command(chapters));
    for paragraph in INTRODUCTION {
        push(&mut out, format_args!("\n{paragraph}\n"));
    }
    for chapter in chapters {
        push(
            &mut out,
            format_args!(
                "\n## {}\n\nFrom {}. `horma papers {} -o DIR` makes this part alone.\n",
                chapter.title, chapter.source, chapter.name
            ),
        );
        for block in &chapter.blocks {
            push_block(&mut out, block);
        }
    }
    out
}

fn push_block(out: &mut String, block: &Block) {
    match block {
        Block::Text(text) => push(out, format_args!("\n{text}\n")),
        Block::Table(table) => push(
            out,
            format_args!("\n**{}**\n\n{}", table.title, rows(table)),
        ),
        Block::Figure(name, plot) => {
            push(
                out,
                format_args!("\n![{}]({DIAGRAMS}/{name}.svg)\n", plot.title),
            );
        }
        Block::Claims(claims) => push(out, format_args!("\n{}", rows(&of_claims(claims)))),
        Block::Timed(claims) => push(
            out,
            format_args!("\n{TIMED}\n\n{}\n{END_TIMED}\n", rows(&of_claims(claims))),
        ),
    }
}

fn rows(table: &Table) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let escaped = |cell: &String| cell.replace('|', "\\|");
    let mut out = line(table.heads.iter().map(|h| (*h).to_owned()).collect());
    out += &line(table.heads.iter().map(|_| "---".to_owned()).collect());
    for row in &table.rows {
        out += &line(row.iter().map(escaped).collect());
    }
    out
}

fn push(out: &mut String, what: std::fmt::Arguments) {
    // A string takes everything.
    let _ = out.write_fmt(what);
}

/// The page without what differs from run to run.
pub fn lasting(page: &str) -> String {
    let mut out = String::new();
    let mut rest = page;
    while let Some((before, after)) = rest.split_once(TIMED) {
        out += before;
        rest = after.split_once(END_TIMED).map_or("", |(_, rest)| rest);
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Claim, Verdict};

    #[test]
    fn what_is_timed_can_be_left_out() {
        let claim = Claim::new("a | b", "1", "2", Verdict::Differs);
        let chapter = Chapter {
            name: "name",
            title: "Title",
            source: "a paper",
            blocks: vec![
                Block::text("before"),
                Block::Timed(vec![claim]),
                Block::text("after"),
            ],
        };
        let page = page(&[chapter]);
        assert!(page.contains("| a \\| b | 1 | 2 | differs |"), "{page}");
        let lasting = lasting(&page);
        assert!(!lasting.contains("differs |"), "{lasting}");
        assert!(
            lasting.contains("before") && lasting.ends_with("after\n"),
            "{lasting}"
        );
    }
}
