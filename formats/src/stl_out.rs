//! `machined.stl`, `designed.stl`: a surface as triangles; binary STL, in part coordinates, mm. The format has no
//! colours that all readers agree on, so there are none.

use std::io::{self, Write};
use std::path::Path;

use horma_core::{Machined, cross, sub, unit};

use crate::error::Result;
use crate::output;
use crate::skin::{Skin, Which, skin};

/// The header; a reader may take `solid` at its beginning for text.
const HEADER: &[u8] = b"horma, mm, X along the spindle";

/// Writes one of the surfaces to `file`: beside it first, then renamed.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be written.
pub fn save(file: &Path, surface: &Machined, which: Which) -> Result<()> {
    let skin = skin(surface, which);
    output::write(file, |out| write(&skin, out))
}

fn write(skin: &Skin, out: &mut impl Write) -> io::Result<()> {
    let mut header = [b' '; 80];
    header[..HEADER.len()].copy_from_slice(HEADER);
    out.write_all(&header)?;
    out.write_all(&(skin.triangles.len() as u32).to_le_bytes())?;
    for triangle in &skin.triangles {
        let [a, b, c] = triangle.map(|k| skin.points[k as usize]);
        let normal = unit(cross(sub(b, a), sub(c, a))).unwrap_or_default();
        for number in [normal, a, b, c].as_flattened() {
            out.write_all(&(*number as f32).to_le_bytes())?;
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::tests::surface;

    #[test]
    fn another_reader_finds_every_triangle() {
        let skin = skin(&surface(), Which::Machined);
        let mut file = Vec::new();
        write(&skin, &mut file).expect("memory");
        let read = stl_io::read_stl(&mut io::Cursor::new(file)).expect("STL");
        assert_eq!(read.faces.len(), skin.triangles.len());
        for face in &read.faces {
            let corner = read.vertices[face.vertices[0]];
            assert!(face.normal[1] * corner[1] + face.normal[2] * corner[2] > 0.0);
        }
    }
}
