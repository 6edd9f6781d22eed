//! Lines of a program: block numbers, words, comments.

use super::dialect::Dialect;
use crate::decimal;

/// The program's text so far, and the number of its last block.
#[derive(Debug)]
pub(super) struct Lines {
    pub(super) text: Vec<u8>,
    dialect: &'static Dialect,
    step: u32,
    number: u32,
}

impl Lines {
    /// An empty text whose blocks are numbered by `step`, if not by 0.
    pub(super) fn new(dialect: &'static Dialect, step: u32) -> Self {
        Self {
            text: Vec::new(),
            dialect,
            step,
            number: 0,
        }
    }

    /// A line as it is, without a number.
    pub(super) fn bare(&mut self, line: &str) {
        self.text.extend_from_slice(line.as_bytes());
        self.text.push(b'\n');
    }

    /// A block without words.
    pub(super) fn block(&mut self, command: &str) {
        self.begin(command);
        self.end();
    }

    /// Begins a block.
    pub(super) fn begin(&mut self, command: &str) {
        if self.step > 0 {
            self.number += self.step;
            if self.number > self.dialect.most_block_number {
                self.number = self.step;
            }
            self.text.push(b'N');
            decimal::integer(&mut self.text, u64::from(self.number));
            self.text.push(b' ');
        }
        self.text.extend_from_slice(command.as_bytes());
    }

    /// A word of the block that was begun.
    pub(super) fn word(&mut self, letter: char, increments: i64, decimals: u8) {
        self.called(letter, "", increments, decimals, "");
    }

    /// A word with something around its number: a sign, a function.
    pub(super) fn called(
        &mut self,
        letter: char,
        open: &str,
        increments: i64,
        decimals: u8,
        close: &str,
    ) {
        self.text.extend_from_slice(&[b' ', letter as u8]);
        self.text.extend_from_slice(open.as_bytes());
        let decimals = usize::from(decimals);
        decimal::scaled(&mut self.text, increments, decimals, self.dialect.point);
        self.text.extend_from_slice(close.as_bytes());
    }

    /// F to six digits, rounded down, never 0 and never above `most`.
    pub(super) fn feed(&mut self, feed: f64, most: f64) {
        self.number_of_feed(feed.min(most), f64::floor);
    }

    /// F to six digits, rounded up: the seconds of a move.
    pub(super) fn seconds(&mut self, seconds: f64) {
        self.number_of_feed(seconds, f64::ceil);
    }

    fn number_of_feed(&mut self, feed: f64, round: fn(f64) -> f64) {
        let (mut decimals, mut leading) = (5, feed);
        while leading >= 10.0 && decimals > 0 {
            (decimals, leading) = (decimals - 1, leading / 10.0);
        }
        while leading < 1.0 && decimals < self.dialect.feed_decimals {
            (decimals, leading) = (decimals + 1, leading * 10.0);
        }
        let decimals = decimals.min(self.dialect.feed_decimals);
        let scaled = feed * 10_f64.powi(decimals as i32);
        // What is whole but for the last bits is meant to be whole.
        let near = scaled.round();
        let whole = if (scaled - near).abs() <= 1.0e-9 * near {
            near
        } else {
            round(scaled)
        };
        self.text.extend_from_slice(b" F");
        let increments = (whole as i64).max(1);
        decimal::scaled(&mut self.text, increments, decimals, self.dialect.point);
    }

    /// Ends the block.
    pub(super) fn end(&mut self) {
        self.text.push(b'\n');
    }

    /// A comment, in as many lines as it needs.
    pub(super) fn comment(&mut self, content: &str) {
        let [open, close] = self.dialect.comment;
        let plain: Vec<u8> = content.chars().map(|c| self.harmless(c)).collect();
        let width = self.dialect.line - open.len() - close.len();
        let mut rest = &plain[..];
        while !rest.is_empty() {
            let (line, more) = broken(rest, width);
            self.text.extend_from_slice(open.as_bytes());
            self.text.extend_from_slice(line);
            self.text.extend_from_slice(close.as_bytes());
            self.text.push(b'\n');
            rest = more;
        }
    }

    /// A printable character that ends no comment, as near to `c` as the dialect has one.
    fn harmless(&self, c: char) -> u8 {
        let plain = self.dialect.plain_comments;
        match c {
            '(' => b'[',
            ')' => b']',
            ';' => b',',
            ':' if plain => b'=',
            '"' | '\'' if plain => b' ',
            ' '..='~' if plain => c.to_ascii_uppercase() as u8,
            ' '..='~' => c as u8,
            _ => b'?',
        }
    }
}

/// As many words as fit, and the rest; a word that is longer than a line is cut.
fn broken(text: &[u8], width: usize) -> (&[u8], &[u8]) {
    if text.len() <= width {
        return (text, &[]);
    }
    let space = text[..=width].iter().rposition(|&c| c == b' ');
    match space {
        Some(at) if at > 0 => (&text[..at], &text[at + 1..]),
        _ => text.split_at(width),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Control;
    use super::*;

    fn text(control: Control, write: impl FnOnce(&mut Lines)) -> String {
        let mut lines = Lines::new(control.dialect(), 0);
        write(&mut lines);
        String::from_utf8(lines.text).expect("ASCII")
    }

    #[test]
    fn comments_are_harmless_and_fit() {
        let content = format!("a(b)c\n%\u{e9} {}", "long ".repeat(100));
        for control in Control::ALL {
            let text = text(control, |l| l.comment(&content));
            let dialect = control.dialect();
            assert!(text.is_ascii() && text.lines().all(|l| l.len() <= dialect.line));
            let [open, close] = dialect.comment;
            let mut words = String::new();
            for line in text.lines() {
                let inner = line.strip_prefix(open).and_then(|l| l.strip_suffix(close));
                let inner = inner.expect(line);
                assert!(!inner.contains(['(', ')']));
                words += &format!("{inner} ");
            }
            assert_eq!(words.to_lowercase().matches("long").count(), 100);
            assert!(words.to_lowercase().starts_with("a[b]c?%? long"), "{text}");
        }
        let fanuc = text(Control::Fanuc, |l| l.comment("cutter: {\"r\"; 8}"));
        assert_eq!(fanuc, "(CUTTER= { R , 8})\n");
        let unbroken = text(Control::GrblHal, |l| l.comment(&"x".repeat(100)));
        assert_eq!(unbroken.lines().map(str::len).collect::<Vec<_>>(), [79, 25]);
    }

    #[test]
    fn feeds_keep_six_digits_and_are_slower_rather_than_faster() {
        for (feed, expected) in [
            (1.0e7, " F10000000"),
            (1234.5678, " F1234.56"),
            (0.000_123_456_789, " F0.000123456"),
            (1.0e-30, " F0.000000000001"),
            (0.7, " F0.7"),
            (1.0, " F1"),
        ] {
            let mut plain = text(Control::LinuxCnc, |l| l.feed(feed, f64::INFINITY));
            assert_eq!(plain, expected);
            plain = text(Control::Fanuc, |l| l.feed(feed, 9999.999));
            let value: f64 = plain[2..].parse().expect("a number");
            assert!(
                plain.contains('.') && (0.001..=9999.999).contains(&value),
                "{plain}"
            );
        }
        let seconds = |t| text(Control::Beckhoff, |l| l.seconds(t));
        assert_eq!(seconds(1.0 / 3.0), " F0.333334");
        assert_eq!(seconds(0.002), " F0.002");
    }

    #[test]
    fn blocks_are_numbered_and_begin_again() {
        let mut lines = Lines::new(Control::Fanuc.dialect(), 60_000);
        for _ in 0..3 {
            lines.block("G94");
        }
        assert_eq!(lines.text, b"N60000 G94\nN60000 G94\nN60000 G94\n");
        let mut lines = Lines::new(Control::Siemens.dialect(), 10);
        lines.block("G94");
        lines.bare("; not a block");
        lines.block("G93");
        assert_eq!(lines.text, b"N10 G94\n; not a block\nN20 G93\n");
    }
}
