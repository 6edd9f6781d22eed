//! What an experiment found, as plain values: text, tables, diagrams, and claims of the papers.

use horma_formats::plot::Plot;

/// What one experiment found.
#[derive(Debug, Clone, PartialEq)]
pub struct Chapter {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is about.
    pub title: &'static str,
    /// Which paper it is from, and where there.
    pub source: &'static str,
    /// What was found, in the order in which it is told.
    pub blocks: Vec<Block>,
}

/// A piece of a chapter.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// A table.
    Table(Table),
    /// A diagram, in a file of this name.
    Figure(&'static str, Plot),
    /// What is in print beside what was found here.
    Claims(Vec<Claim>),
    /// The same, of what differs from run to run and from machine to machine.
    Timed(Vec<Claim>),
}

/// A table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// What is in it.
    pub title: String,
    /// The head of each column.
    pub heads: Vec<&'static str>,
    /// A cell for each head.
    pub rows: Vec<Vec<String>>,
}

/// A figure in print beside the one found here.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// Of what.
    pub what: String,
    /// What the paper says.
    pub printed: String,
    /// What was found.
    pub measured: String,
    /// How the two compare.
    pub verdict: Verdict,
}

/// How what is printed compares with what was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// They are the same, or the bound in print is kept.
    Agrees,
    /// They are not.
    Differs,
    /// What is found was fitted to what is printed, so that it proves nothing.
    Fitted,
    /// The text at hand has lost what was printed.
    Lost,
    /// The paper says nothing of it.
    Unsaid,
}

impl Verdict {
    /// Agrees if so, and else not.
    pub const fn of(agrees: bool) -> Self {
        if agrees { Self::Agrees } else { Self::Differs }
    }

    /// As a table has it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs => "differs",
            Self::Fitted => "fitted",
            Self::Lost => "lost in our text",
            Self::Unsaid => "not in print",
        }
    }
}

/// The heads of a table of claims.
const CLAIM_HEADS: [&str; 4] = ["of what", "in print", "found here", "verdict"];

impl Claim {
    /// A claim and what became of it.
    pub fn new(
        what: impl Into<String>,
        printed: impl Into<String>,
        measured: impl Into<String>,
        verdict: Verdict,
    ) -> Self {
        Self {
            what: what.into(),
            printed: printed.into(),
            measured: measured.into(),
            verdict,
        }
    }
}

impl Block {
    /// A paragraph.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// A table.
    pub fn table(title: impl Into<String>, heads: &[&'static str], rows: Vec<Vec<String>>) -> Self {
        Self::Table(Table {
            title: title.into(),
            heads: heads.to_vec(),
            rows,
        })
    }
}

/// Claims as a table like any other.
pub fn of_claims(claims: &[Claim]) -> Table {
    let row = |claim: &Claim| {
        let verdict = claim.verdict.name().to_owned();
        vec![
            claim.what.clone(),
            claim.printed.clone(),
            claim.measured.clone(),
            verdict,
        ]
    };
    Table {
        title: String::new(),
        heads: CLAIM_HEADS.to_vec(),
        rows: claims.iter().map(row).collect(),
    }
}

/// A number in three digits, small and large ones by powers of ten.
pub fn three(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if !(1.0e-3..1.0e5).contains(&size) {
        let text = format!("{value:.2e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        format!("{digits}·10{}", raised(power))
    } else {
        // Rounding may bring another digit in front.
        let before = format!("{size:.2e}")
            .rsplit('e')
            .next()
            .and_then(|p| p.parse::<i32>().ok());
        let places = (2 - before.unwrap_or(0)).max(0) as usize;
        format!("{value:.places$}")
    }
}

/// A number's text as an exponent.
fn raised(number: &str) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raise = |c: char| c.to_digit(10).map_or('⁻', |d| RAISED[d as usize]);
    number.chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [
            (0.0, "0"),
            (0.54329, "0.543"),
            (9.996, "10.0"),
            (123_456.0, "1.23·10⁵"),
            (-1.23e-7, "-1.23·10⁻⁷"),
            (92.3, "92.3"),
            (1234.5, "1234"),
        ] {
            assert_eq!(three(value), text);
        }
    }
}
