//! Pictures: the part, shaded, with the tool path around it.
//!
//! It is a picture to look at, not one to measure from: nothing is computed from it.

mod render;
mod sheet;

use std::io::Write;
use std::path::Path;

use horma_core::{Point, ToolPath, Waypoint, facing_at};

use crate::error::Result;
use crate::output;

pub use render::{Colour, Polyline, SIZE, png};
pub use sheet::{Sheet, sheets};

/// Colour of the line along which the cutter touches.
pub const CONTACT: Colour = [13, 71, 161];
/// Colour of the line along which the tool centre runs.
pub const CENTRE: Colour = [206, 112, 76];

/// Writes a picture of a part, which lies as it is on the lathe, and of `path` around it.
///
/// # Errors
/// [`crate::Error::Io`], naming `file`.
pub fn save(file: &Path, part: &[Sheet], path: &ToolPath) -> Result<()> {
    let touches = path.waypoints().map(|w| w.touch);
    let contact: Vec<_> = touches.map(|t| t.map(|t| t.contact)).collect();
    let centre: Vec<_> = path.waypoints().map(|w| centre(&w)).collect();
    let lines = [
        Polyline {
            points: &contact,
            colour: CONTACT,
            width: 1.0,
        },
        Polyline {
            points: &centre,
            colour: CENTRE,
            width: 0.8,
        },
    ];
    let picture = png(part, &lines);
    output::write(file, |file| file.write_all(&picture))
}

/// The tool centre at a position as the part sees it: the cutter turns about the part.
pub(crate) fn centre(waypoint: &Waypoint) -> Option<Point> {
    let height = waypoint.touch?.height;
    Some(facing_at(waypoint.x, height, waypoint.angle))
}

#[cfg(test)]
mod tests {
    use horma_core::{Body, Interval, Mesh, Motion, MotionKind, Part, Shape, Touch};

    use super::*;

    #[test]
    fn a_part_and_its_path_are_drawn() {
        let corners = vec![[0.0; 3], [10.0, 0.0, 0.0], [10.0, 0.0, 8.0]];
        let mesh = Mesh::new("m", corners, vec![[0, 1, 2]]).expect("valid");
        let part = Part {
            bodies: vec![Body {
                name: "m".to_owned(),
                shape: Shape::Mesh(mesh),
            }],
        };
        let motion = Motion {
            from: Some(0.0),
            to: Some(10.0),
            ..Motion::new(MotionKind::Helix, 5.0, 4)
        };
        let extent = Interval {
            low: 0.0,
            high: 10.0,
        };
        let trajectory = motion.over(extent, 1.0).expect("valid");
        let touch = Touch {
            height: 20.0,
            contact: [0.0; 3],
        };
        let mut touches = vec![Some(touch); 9];
        touches[2] = None;
        let path = ToolPath {
            trajectory,
            touches,
            between: Vec::new(),
        };

        let centres: Vec<_> = path.waypoints().map(|w| centre(&w)).collect();
        assert_eq!(centres[0], Some([0.0, 20.0, 0.0]));
        assert_eq!(centres[2], None);
        let [x, y, z] = centres[5].expect("touched");
        assert!(x == 6.25 && y.abs() < 1e-12 && z == -20.0);

        let dir = tempfile::tempdir().expect("a scratch directory");
        let file = dir.path().join("preview.png");
        save(&file, &sheets(&part), &path).expect("written");
        let bytes = std::fs::read(&file).expect("there");
        assert!(bytes.starts_with(b"\x89PNG"));
    }
}
