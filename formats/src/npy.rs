//! `path.npy`: the path as an array of NumPy's, one record a position.
//!
//! Fields are those of `path.csv`, each a little-endian double; what is empty there is NaN here. Version 1.0
//! of the format, as `numpy.lib.format` describes it.

use std::io::{self, Write};

use horma_core::Waypoint;

use crate::columns;

const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";

/// What the header's end is aligned to, bytes.
const ALIGNED: usize = 64;

/// Writes a path.
pub(crate) fn write(path: &[Waypoint], out: &mut impl Write) -> io::Result<()> {
    let fields = columns::names().map(|name| format!("('{name}', '<f8')"));
    let fields: Vec<String> = fields.collect();
    let mut header = format!(
        "{{'descr': [{}], 'fortran_order': False, 'shape': ({},), }}",
        fields.join(", "),
        path.len()
    );
    // With its length, two bytes, and a line's end.
    let taken = MAGIC.len() + 2 + header.len() + 1;
    header.extend(std::iter::repeat_n(
        ' ',
        taken.next_multiple_of(ALIGNED) - taken,
    ));
    header.push('\n');
    out.write_all(MAGIC)?;
    out.write_all(&(header.len() as u16).to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    for waypoint in path {
        for number in columns::of(waypoint) {
            out.write_all(&number.unwrap_or(f64::NAN).to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use horma_core::{Index, Touch};

    use super::*;

    #[test]
    fn a_header_is_followed_by_seven_doubles_a_position() {
        let touch = Touch {
            height: 60.5,
            contact: [1.0, 2.0, 3.0],
        };
        let at = |index, touch| Waypoint {
            index,
            x: 0.25,
            angle: 90.0,
            touch,
        };
        let half = Index::between(0, 512).expect("between");
        let path = [at(Index::whole(0), Some(touch)), at(half, None)];
        let mut file = Vec::new();
        write(&path, &mut file).expect("memory");
        let length = usize::from(u16::from_le_bytes([file[8], file[9]]));
        assert_eq!((10 + length) % ALIGNED, 0);
        let header = std::str::from_utf8(&file[10..10 + length]).expect("text");
        assert!(
            header.contains("'shape': (2,)") && header.ends_with('\n'),
            "{header}"
        );
        let numbers: Vec<f64> = file[10 + length..]
            .as_chunks()
            .0
            .iter()
            .map(|b| f64::from_le_bytes(*b))
            .collect();
        assert_eq!(numbers[..7], [0.0, 0.25, 90.0, 60.5, 1.0, 2.0, 3.0]);
        assert_eq!(numbers[7..10], [0.5, 0.25, 90.0]);
        assert!(numbers.len() == 14 && numbers[10..].iter().all(|n| n.is_nan()));
    }
}
