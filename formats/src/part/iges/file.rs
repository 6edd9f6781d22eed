//! The fixed form of an IGES file: sections of 80 columns, the directory, and parameters in free form.
//!
//! Nothing is known here of what an entity means.

use crate::error::{Error, Result};

/// Columns of a line; in the last eight are the section's letter and the line's number.
const COLUMNS: usize = 80;
/// Columns of the global section that hold text.
const TEXT: usize = 72;
/// Columns of the parameter section that hold text; behind them is the entity that they belong to.
const DATA: usize = 64;

/// A file, taken apart.
pub(super) struct File {
    /// Parameters of the global section from the third on.
    global: Vec<Vec<u8>>,
    delimiters: Delimiters,
    /// The directory.
    pub(super) entities: Vec<Entity>,
    /// The parameter section, its lines one after another.
    data: Vec<u8>,
}

/// Between parameters, and at the end of them.
#[derive(Clone, Copy)]
struct Delimiters {
    parameter: u8,
    record: u8,
}

/// An entity as the directory has it.
pub(super) struct Entity {
    /// Its number: that of its first line in the directory.
    pub(super) number: usize,
    /// Its type.
    pub(super) kind: u32,
    /// Its form.
    pub(super) form: i64,
    /// The transformation matrix that it refers to; 0 for none.
    pub(super) matrix: usize,
    /// Whether it is hidden.
    pub(super) blanked: bool,
    /// Whether something else contains it.
    pub(super) dependent: bool,
    /// Its label.
    pub(super) label: String,
    /// First line of its parameters, from 0, and how many there are.
    lines: (usize, usize),
}

impl Entity {
    /// That this is wrong with it.
    pub(super) fn wrong(&self, name: &str, reason: impl Into<String>) -> Error {
        Error::IgesEntity {
            name: name.to_owned(),
            number: self.number,
            kind: self.kind,
            reason: reason.into(),
        }
    }
}

impl File {
    /// Takes a file apart.
    pub(super) fn read(name: &str, bytes: &[u8]) -> Result<Self> {
        let mut global = Vec::new();
        let mut directory: Vec<(usize, &[u8])> = Vec::new();
        let mut data = Vec::new();
        let mut counts = [0_usize; 4];
        let mut ended = false;
        let mut last = 0;
        for (number, line) in lines(bytes) {
            if ended {
                break;
            }
            last = number;
            let wrong = |reason: String| syntax(name, number, reason);
            let Some(&letter) = line.get(TEXT) else {
                return Err(wrong(format!(
                    "a line of IGES has its section's letter in column 73, but this one ends at {}; export it again, as fixed ASCII",
                    line.len()
                )));
            };
            let count = match letter {
                b'S' => &mut counts[0],
                b'G' => {
                    global.extend_from_slice(&line[..TEXT]);
                    &mut counts[1]
                }
                b'D' => {
                    directory.push((number, &line[..TEXT]));
                    &mut counts[2]
                }
                b'P' => {
                    data.extend_from_slice(&line[..DATA]);
                    &mut counts[3]
                }
                b'T' => {
                    ended = true;
                    check_counts(&line[..TEXT], counts).map_err(wrong)?;
                    continue;
                }
                b'C' | b'B' => {
                    let form = if letter == b'C' {
                        "compressed"
                    } else {
                        "binary"
                    };
                    return Err(wrong(format!(
                        "this is IGES in its {form} form, which is not read; export it as fixed ASCII"
                    )));
                }
                other => {
                    let found = char::from(other);
                    return Err(wrong(format!(
                        "column 73 has one of the letters S, G, D, P and T, but this has '{found}'; export it again, as fixed ASCII"
                    )));
                }
            };
            *count += 1;
            let stated = integer(&line[TEXT + 1..line.len().min(COLUMNS)]);
            // Seven digits go round.
            if stated.is_some_and(|n| n != 0 && n as usize % 10_000_000 != *count % 10_000_000) {
                return Err(wrong(format!(
                    "this is line {count} of section {}, but it is numbered {}; lines are missing, export it again",
                    char::from(letter),
                    stated.unwrap_or_default(),
                )));
            }
        }
        if !ended {
            let reason =
                "the file ends before its last section (T); it is cut short, export it again";
            return Err(syntax(name, last, reason.to_owned()));
        }
        let (delimiters, global) = global_section(&global).map_err(|reason| Error::IgesGlobal {
            name: name.to_owned(),
            reason,
        })?;
        if !directory.len().is_multiple_of(2) {
            let reason = "the directory has two lines for each entity, but its last has only one";
            return Err(syntax(name, last, reason.to_owned()));
        }
        let entities = directory
            .chunks_exact(2)
            .enumerate()
            .map(|(i, pair)| entity(2 * i + 1, pair[0].1, pair[1].1))
            .collect();
        Ok(Self {
            global,
            delimiters,
            entities,
            data,
        })
    }

    /// The entity with the directory number `number`.
    pub(super) fn at(&self, number: usize) -> Option<&Entity> {
        (number % 2 == 1)
            .then(|| self.entities.get(number / 2))
            .flatten()
    }

    /// The parameter of the global section with the number that the standard gives it, from 3; empty if
    /// it is left out.
    pub(super) fn global(&self, number: usize) -> &[u8] {
        self.global.get(number - 3).map_or(&[], Vec::as_slice)
    }

    /// The parameters of an entity, without its type.
    pub(super) fn parameters<'a>(
        &'a self,
        name: &'a str,
        entity: &'a Entity,
    ) -> Result<Parameters<'a>> {
        let (first, count) = entity.lines;
        let text = first
            .checked_mul(DATA)
            .and_then(|start| {
                self.data
                    .get(start..count.checked_mul(DATA)?.checked_add(start)?)
            })
            .ok_or_else(|| entity.wrong(name, "its parameters are not in the file"))?;
        let fields = fields(text, self.delimiters).map_err(|r| entity.wrong(name, r))?;
        match fields.split_first() {
            Some((kind, rest)) if integer(kind) == Some(i64::from(entity.kind)) => Ok(Parameters {
                name,
                entity,
                fields: rest.to_vec(),
                at: 0,
            }),
            _ => Err(entity.wrong(name, "its parameters are those of another entity")),
        }
    }
}

/// The parameters of one entity, to be read in their order.
pub(super) struct Parameters<'a> {
    name: &'a str,
    entity: &'a Entity,
    fields: Vec<&'a [u8]>,
    at: usize,
}

impl<'a> Parameters<'a> {
    /// How many are left.
    pub(super) fn left(&self) -> usize {
        self.fields.len().saturating_sub(self.at)
    }

    /// That there is something wrong with the entity.
    pub(super) fn wrong(&self, reason: impl Into<String>) -> Error {
        self.entity.wrong(self.name, reason)
    }

    /// Passes over some.
    pub(super) fn skip(&mut self, count: usize) {
        self.at = self.at.saturating_add(count);
    }

    fn next(&mut self) -> Result<&'a [u8]> {
        let field = self.fields.get(self.at);
        let field = field.ok_or_else(|| {
            let count = self.fields.len();
            self.wrong(format!("it has {count} parameters, too few"))
        })?;
        self.at += 1;
        Ok(field)
    }

    /// The next number; 0 if it is left out.
    pub(super) fn number(&mut self) -> Result<f64> {
        let field = self.next()?;
        real(field).ok_or_else(|| {
            let at = self.at;
            self.wrong(format!(
                "parameter {at} is '{}', not a number",
                shown(field)
            ))
        })
    }

    /// The next `count` numbers.
    pub(super) fn numbers(&mut self, count: usize) -> Result<Vec<f64>> {
        if count > self.left() {
            let left = self.left();
            return Err(self.wrong(format!(
                "{count} numbers should follow, but there are {left}"
            )));
        }
        (0..count).map(|_| self.number()).collect()
    }

    /// The next whole number that is not negative.
    pub(super) fn count(&mut self) -> Result<usize> {
        let field = self.next()?;
        let number = if field.is_empty() {
            Some(0)
        } else {
            integer(field)
        };
        // Some writers put a point behind every number.
        let number = number.or_else(|| real(field).filter(|n| n.fract() == 0.0).map(|n| n as i64));
        number.and_then(|n| usize::try_from(n).ok()).ok_or_else(|| {
            let at = self.at;
            self.wrong(format!(
                "parameter {at} is '{}', not a whole number from 0",
                shown(field)
            ))
        })
    }

    /// The next `count` whole numbers, such as references to entities.
    pub(super) fn counts(&mut self, count: usize) -> Result<Vec<usize>> {
        if count > self.left() {
            let left = self.left();
            return Err(self.wrong(format!(
                "{count} numbers should follow, but there are {left}"
            )));
        }
        (0..count).map(|_| self.count()).collect()
    }
}

/// The lines of a file with their numbers, without blank ones. Files without line ends are cut at 80.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let broken = bytes.contains(&b'\n') || bytes.contains(&b'\r');
    let at_ends = broken.then(|| bytes.split(|&b| b == b'\n' || b == b'\r'));
    let at_columns = (!broken).then(|| bytes.chunks(COLUMNS));
    let all = at_ends
        .into_iter()
        .flatten()
        .chain(at_columns.into_iter().flatten());
    let some = all.filter(|line| line.iter().any(|b| !b.is_ascii_whitespace() && *b != 0x1a));
    (1..).zip(some)
}

fn syntax(name: &str, line: usize, reason: String) -> Error {
    Error::Syntax {
        name: name.to_owned(),
        line,
        reason,
    }
}

/// `S0000001G0000004D0000192P0001234`: how many lines there are of each section.
fn check_counts(line: &[u8], counts: [usize; 4]) -> std::result::Result<(), String> {
    for ((part, letter), count) in line.chunks(8).zip("SGDP".chars()).zip(counts) {
        let stated = part.get(1..).and_then(integer).unwrap_or_default();
        if stated != 0 && stated as usize % 10_000_000 != count % 10_000_000 {
            return Err(format!(
                "section {letter} should have {stated} lines, but there are {count}; the file is damaged, export it again"
            ));
        }
    }
    Ok(())
}

/// The delimiters, and the parameters from the third on.
fn global_section(text: &[u8]) -> std::result::Result<(Delimiters, Vec<Vec<u8>>), String> {
    let (parameter, rest) = delimiter(text.trim_ascii_start(), b',')?;
    let rest = rest.strip_prefix(&[parameter]);
    let rest = rest.ok_or("its first delimiter is not followed by itself")?;
    let (record, rest) = delimiter(rest.trim_ascii_start(), b';')?;
    let delimiters = Delimiters { parameter, record };
    if parameter == record {
        return Err("it has the same delimiter between parameters and after them".to_owned());
    }
    let rest = rest.trim_ascii_start();
    let rest = rest.strip_prefix(&[parameter]).unwrap_or(rest);
    let fields = fields(rest, delimiters)?;
    Ok((delimiters, fields.into_iter().map(<[u8]>::to_vec).collect()))
}

/// `1H/`, or nothing for the usual one; and what follows.
fn delimiter(text: &[u8], usual: u8) -> std::result::Result<(u8, &[u8]), String> {
    let Some(stated) = text.strip_prefix(b"1H").or(text.strip_prefix(b"1h")) else {
        return Ok((usual, text));
    };
    let (&found, rest) = stated.split_first().ok_or("it ends with its delimiters")?;
    if found.is_ascii_alphanumeric() || found <= b' ' || b"+-.\"".contains(&found) {
        return Err(format!("'{}' cannot be a delimiter", char::from(found)));
    }
    Ok((found, rest))
}

/// The parameters of a record: those that are strings (`5Hwords`) without their counts, all without
/// blanks around them.
fn fields(text: &[u8], delimiters: Delimiters) -> std::result::Result<Vec<&[u8]>, String> {
    let Delimiters { parameter, record } = delimiters;
    let mut fields = Vec::new();
    let mut rest = text;
    loop {
        rest = rest.trim_ascii_start();
        let field;
        if let Some((count, behind)) = hollerith(rest) {
            field = behind
                .get(..count)
                .ok_or("a string in it runs over its end")?;
            rest = behind[count..].trim_ascii_start();
        } else {
            let end = rest.iter().position(|&b| b == parameter || b == record);
            let end = end.ok_or("it has no end; export it again")?;
            field = rest[..end].trim_ascii_end();
            rest = &rest[end..];
        }
        fields.push(field);
        match rest.split_first() {
            Some((&found, behind)) if found == parameter => rest = behind,
            Some((&found, _)) if found == record => break,
            None => return Err("it has no end; export it again".to_owned()),
            _ => {
                return Err(format!(
                    "something follows '{}' without a delimiter",
                    shown(field)
                ));
            }
        }
    }
    Ok(fields)
}

/// How long a string is, and what begins with it.
fn hollerith(text: &[u8]) -> Option<(usize, &[u8])> {
    let digits = text.iter().take_while(|b| b.is_ascii_digit()).count();
    let (count, rest) = text.split_at(digits);
    let rest = rest.strip_prefix(b"H").or(rest.strip_prefix(b"h"))?;
    let count = std::str::from_utf8(count).ok()?.parse().ok()?;
    Some((count, rest))
}

/// Two lines of the directory: fields of eight columns.
fn entity(number: usize, first: &[u8], second: &[u8]) -> Entity {
    let field = |line: &[u8], i: usize| integer(&line[8 * i..8 * i + 8]).unwrap_or_default();
    let count = |line, i| usize::try_from(field(line, i)).unwrap_or_default();
    // Four numbers of two digits; blanks in front of them are zeros.
    let status = field(first, 8);
    let label = String::from_utf8_lossy(&second[56..64]).trim().to_owned();
    let subscript = field(second, 8);
    Entity {
        number,
        kind: u32::try_from(field(first, 0)).unwrap_or_default(),
        form: field(second, 4),
        matrix: count(first, 6),
        blanked: status / 1_000_000 % 100 == 1,
        dependent: [1, 3].contains(&(status / 10_000 % 100)),
        label: match subscript {
            0 => label,
            subscript => format!("{label}({subscript})"),
        },
        lines: (count(first, 1).wrapping_sub(1), count(second, 3)),
    }
}

/// A whole number, if it is one.
pub(super) fn integer(field: &[u8]) -> Option<i64> {
    std::str::from_utf8(field.trim_ascii()).ok()?.parse().ok()
}

/// A finite number, with E or D before its exponent; 0 if it is left out.
pub(super) fn real(field: &[u8]) -> Option<f64> {
    if field.is_empty() {
        return Some(0.0);
    }
    // Neither words such as "inf" nor anything else that begins with a letter.
    if !field.iter().all(|b| b"+-.0123456789EeDd".contains(b)) {
        return None;
    }
    let text = std::str::from_utf8(field).ok()?;
    let number: f64 = text.replace(['D', 'd'], "E").parse().ok()?;
    number.is_finite().then_some(number + 0.0)
}

fn shown(field: &[u8]) -> String {
    super::super::stl::shortened(&String::from_utf8_lossy(field))
}
