//! `machined.ply`: the machined surface as triangles, each corner with its deviation from the designed
//! surface and a colour for it; binary PLY, in part coordinates, mm.
//!
//! There are triangles between rays that stand next to each other, and nowhere else: ends stay open.

use std::io::{self, Write};
use std::path::Path;

use horma_core::Machined;

use crate::error::Result;
use crate::map::Scale;
use crate::output;

/// Writes the machined surface to `file`: beside it first, then renamed.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be written.
pub fn save(file: &Path, surface: &Machined) -> Result<()> {
    output::write(file, |out| write(surface, out))
}

fn write(surface: &Machined, out: &mut impl Write) -> io::Result<()> {
    // A ray's corner, numbered over those that there are.
    let mut corners = 0_u32;
    let corner = |radius: &Option<f64>| {
        radius.map(|_| {
            corners += 1;
            corners - 1
        })
    };
    let numbers: Vec<Option<u32>> = surface.machined.iter().map(corner).collect();
    let triangles = triangles(surface, &numbers);
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\n\
         comment the surface as machined, mm, X along the spindle\n\
         comment deviation: outside of the designed surface, mm, along its normal; negative where gouged\n\
         element vertex {corners}\n\
         property float x\nproperty float y\nproperty float z\nproperty float deviation\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        triangles.len()
    )?;
    let scale = Scale::of(surface);
    let rays = surface.machined.iter().zip(&surface.deviation).enumerate();
    for (ray, (radius, deviation)) in rays {
        let Some(radius) = *radius else { continue };
        let [x, y, z] = surface.rays.point(ray, radius);
        for number in [x, y, z, deviation.unwrap_or(f64::NAN)] {
            out.write_all(&(number as f32).to_le_bytes())?;
        }
        out.write_all(&scale.colour(*deviation))?;
    }
    for triangle in triangles {
        out.write_all(&[3])?;
        for corner in triangle {
            out.write_all(&corner.to_le_bytes())?;
        }
    }
    Ok(())
}

/// The triangles between neighbouring rays, seen anticlockwise from outside.
fn triangles(surface: &Machined, numbers: &[Option<u32>]) -> Vec<[u32; 3]> {
    let columns = surface.rays.columns as usize;
    let mut triangles = Vec::with_capacity(2 * numbers.len());
    for ray in 0..numbers.len().saturating_sub(columns) {
        let beside = ray - ray % columns + (ray + 1) % columns;
        let [a, b, c, d] = [ray, ray + columns, beside + columns, beside].map(|ray| numbers[ray]);
        for triangle in [[a, b, c], [a, c, d]] {
            if let [Some(a), Some(b), Some(c)] = triangle {
                triangles.push([a, b, c]);
            }
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::tests::surface;
    use horma_core::{cross, dot, sub};

    #[test]
    fn a_ring_is_closed_and_faces_outward() {
        let surface = surface();
        let mut file = Vec::new();
        write(&surface, &mut file).expect("memory");
        let end = b"end_header\n";
        let header = file
            .windows(end.len())
            .position(|w| w == end)
            .expect("there")
            + end.len();
        let text = String::from_utf8_lossy(&file[..header]);
        // 3 rows of 8, one ray of which meets nothing: two rings of 16 triangles without the 3 at its sides.
        assert!(
            text.contains("element vertex 23\n") && text.contains("element face 29\n"),
            "{text}"
        );
        let (corners, faces) = file[header..].split_at(23 * 19);
        assert_eq!(faces.len(), 29 * 13);
        let point = |k: u32| {
            let at = 19 * k as usize;
            [0, 4, 8].map(|o| {
                let bytes = corners[at + o..at + o + 4].try_into().expect("four");
                f64::from(f32::from_le_bytes(bytes))
            })
        };
        for face in faces.as_chunks::<13>().0 {
            let k = [1, 5, 9].map(|o| u32::from_le_bytes(face[o..o + 4].try_into().expect("four")));
            let [a, b, c] = k.map(point);
            let normal = cross(sub(b, a), sub(c, a));
            assert!(dot(normal, [0.0, a[1], a[2]]) > 0.0, "{k:?}");
        }
    }
}
