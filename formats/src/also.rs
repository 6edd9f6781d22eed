//! Files that are written if they are asked for, each by its name: paths and surfaces for other programs.

use std::path::Path;

use horma_core::{Machined, Waypoint};

use crate::error::Result;
use crate::glb::{self, Scene};
use crate::preview::Sheet;
use crate::skin::Which;
use crate::{npy, output, parquet, ply, stl_out};

/// A file that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Also {
    /// The path as a table of Apache Parquet.
    PathParquet,
    /// The path as an array of NumPy's.
    PathNpy,
    /// The machined surface with its errors in colour.
    MachinedPly,
    /// The machined surface.
    MachinedStl,
    /// The designed surface with the machined one's errors in colour.
    DesignedPly,
    /// The designed surface.
    DesignedStl,
    /// Part, machined surface and path for viewers.
    Scene,
}

/// What such files are written of.
#[derive(Debug, Clone, Copy)]
pub struct Sources<'a> {
    /// The path.
    pub path: &'a [Waypoint],
    /// The part.
    pub part: &'a [Sheet],
    /// The surface that the path leaves; it has to be there if any file [needs](Also::needs_surface) it.
    pub machined: Option<&'a Machined>,
}

impl Also {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::PathParquet,
        Self::PathNpy,
        Self::MachinedPly,
        Self::MachinedStl,
        Self::DesignedPly,
        Self::DesignedStl,
        Self::Scene,
    ];

    /// The file's name, by which it is asked for.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PathParquet => "path.parquet",
            Self::PathNpy => "path.npy",
            Self::MachinedPly => output::MACHINED_MESH,
            Self::MachinedStl => "machined.stl",
            Self::DesignedPly => "designed.ply",
            Self::DesignedStl => "designed.stl",
            Self::Scene => "scene.glb",
        }
    }

    /// The file of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|also| also.name() == name)
    }

    /// Whether it shows the machined surface.
    pub fn needs_surface(self) -> bool {
        !matches!(self, Self::PathParquet | Self::PathNpy)
    }
}

/// Writes a file into `dir`: beside it first, then renamed.
///
/// # Errors
/// [`crate::Error::Io`], naming the file.
pub fn save(also: Also, dir: &Path, of: &Sources) -> Result<()> {
    let file = dir.join(also.name());
    let surface = || of.machined.expect("it was made, since this file needs it");
    match also {
        Also::PathParquet => output::write(&file, |out| parquet::write(of.path, out)),
        Also::PathNpy => output::write(&file, |out| npy::write(of.path, out)),
        Also::MachinedPly => ply::save(&file, surface(), Which::Machined),
        Also::MachinedStl => stl_out::save(&file, surface(), Which::Machined),
        Also::DesignedPly => ply::save(&file, surface(), Which::Designed),
        Also::DesignedStl => stl_out::save(&file, surface(), Which::Designed),
        Also::Scene => {
            let scene = Scene {
                part: of.part,
                machined: surface(),
                path: of.path,
            };
            output::write(&file, |out| glb::write(&scene, out))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_known_by_its_name() {
        for also in Also::ALL {
            assert_eq!(Also::named(also.name()), Some(also));
        }
        assert_eq!(Also::named("path.csv"), None);
    }
}
