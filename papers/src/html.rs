//! The report as one page of HTML, with its diagrams in it.

use horma_formats::{escaped, plot};

use crate::report::{Block, Chapter, Table, Verdict, of_claims};
use crate::{INTRODUCTION, TITLE, command};

const STYLE: &str = "\
:root{color-scheme:light dark}\
body{font:15px/1.5 system-ui,sans-serif;margin:24px auto;max-width:960px;padding:0 16px;\
color:light-dark(#24292f,#e6edf3);background:light-dark(#fff,#0d1117)}\
h1{font-size:22px}h2{margin-top:2em}.minor{color:light-dark(#57606a,#9da7b3)}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}\
caption{text-align:left;font-weight:600;padding:6px 10px}\
th,td{padding:5px 10px;text-align:left;border-bottom:1px solid light-dark(#d8dee4,#30363d)}\
svg{max-width:100%;height:auto}\
.agrees{color:light-dark(#1a7f37,#3fb950)}.differs{color:light-dark(#c01f2e,#ff7b72)}";

/// The whole page.
pub fn page(chapters: &[Chapter]) -> String {
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>{TITLE}</title>\n<style>{STYLE}</style>\n\
         <h1>{TITLE}</h1>\n<pre>{}</pre>\n",
        escaped(&command(chapters))
    );
    for paragraph in INTRODUCTION {
        out += &format!("<p>{}</p>\n", worded(paragraph));
    }
    for chapter in chapters {
        out += &format!(
            "<h2 id=\"{0}\">{1}</h2>\n<p class=\"minor\">From {2}. <code>horma papers {0} -o DIR</code> makes \
             this part alone.</p>\n",
            chapter.name,
            escaped(chapter.title),
            escaped(chapter.source)
        );
        for block in &chapter.blocks {
            out += &match block {
                Block::Text(text) => format!("<p>{}</p>\n", worded(text)),
                Block::Table(of) => table(of),
                Block::Figure(_, plot) => plot::svg(plot),
                Block::Claims(claims) | Block::Timed(claims) => table(&of_claims(claims)),
            };
        }
    }
    out + "</html>\n"
}

fn table(table: &Table) -> String {
    let head = |head: &&str| format!("<th scope=\"col\">{}</th>", escaped(head));
    let cell = |cell: &String| {
        let verdict = [Verdict::Agrees, Verdict::Differs].map(Verdict::name);
        let class = verdict.into_iter().find(|v| v == cell);
        let class = class.map_or_else(String::new, |c| format!(" class=\"{c}\""));
        format!("<td{class}>{}</td>", worded(cell))
    };
    let caption = match table.title.as_str() {
        "" => String::new(),
        title => format!("<caption>{}</caption>", worded(title)),
    };
    let heads: String = table.heads.iter().map(head).collect();
    let row =
        |row: &Vec<String>| format!("<tr>{}</tr>\n", row.iter().map(cell).collect::<String>());
    let rows: String = table.rows.iter().map(row).collect();
    format!(
        "<div class=\"wide\"><table>{caption}\n<thead><tr>{heads}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    )
}

/// A text, in which what stands between backticks is code.
fn worded(text: &str) -> String {
    let parts = escaped(text);
    let parts = parts.split('`').enumerate();
    parts
        .map(|(k, part)| {
            if k % 2 == 1 {
                format!("<code>{part}</code>")
            } else {
                part.to_owned()
            }
        })
        .collect()
}
