//! `machined.ply`, `designed.ply`: a surface as triangles, each corner with the deviation of the machined surface
//! from the designed one and a colour for it; binary PLY, in part coordinates, mm.

use std::io::{self, Write};
use std::path::Path;

use horma_core::Machined;

use crate::error::Result;
use crate::map::Scale;
use crate::output;
use crate::skin::{Which, skin};

/// Writes one of the surfaces to `file`: beside it first, then renamed.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be written.
pub fn save(file: &Path, surface: &Machined, which: Which) -> Result<()> {
    output::write(file, |out| write(surface, which, out))
}

fn write(surface: &Machined, which: Which, out: &mut impl Write) -> io::Result<()> {
    let name = match which {
        Which::Designed => "designed",
        Which::Machined => "machined",
    };
    let skin = skin(surface, which);
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\n\
         comment the surface as {name}, mm, X along the spindle\n\
         comment deviation: how far the machined surface is outside of the designed one, mm, along its normal; \
         negative where gouged\n\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\nproperty float deviation\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        skin.points.len(),
        skin.triangles.len()
    )?;
    let scale = Scale::of(surface);
    for (point, deviation) in skin.points.iter().zip(&skin.deviations) {
        let [x, y, z] = *point;
        for number in [x, y, z, deviation.unwrap_or(f64::NAN)] {
            out.write_all(&(number as f32).to_le_bytes())?;
        }
        out.write_all(&scale.colour(*deviation))?;
    }
    for triangle in skin.triangles {
        out.write_all(&[3])?;
        for corner in triangle {
            out.write_all(&corner.to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::tests::surface;

    #[test]
    fn a_corner_has_its_place_its_deviation_and_its_colour() {
        let mut file = Vec::new();
        write(&surface(), Which::Designed, &mut file).expect("memory");
        let end = b"end_header\n";
        let header = file
            .windows(end.len())
            .position(|w| w == end)
            .expect("there")
            + end.len();
        let text = String::from_utf8_lossy(&file[..header]);
        assert!(
            text.contains("as designed") && text.contains("element vertex 24\nproperty"),
            "{text}"
        );
        let (corners, faces) = file[header..].split_at(24 * 19);
        assert_eq!(faces.len(), 32 * 13);
        let corner = &corners[9 * 19..10 * 19];
        let number = |o: usize| f32::from_le_bytes(corner[o..o + 4].try_into().expect("four"));
        assert_eq!((number(0), number(12)), (1.5, -0.5));
        assert!((number(4).hypot(number(8)) - 10.0).abs() < 1e-5);
        assert_eq!(corner[16..], [192, 31, 46]);
    }
}
