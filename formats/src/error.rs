//! Everything that can be wrong with a file.

use std::path::{Path, PathBuf};

use crate::job::Place;
use crate::part::Format;
use crate::post::Spot;

/// What is wrong with a file that was read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A directory for results that is a file.
    #[error("{}: not a directory; name a new or an empty one", path.display())]
    NotADirectory {
        /// What was named.
        path: PathBuf,
    },
    /// A directory for results that holds something else.
    #[error("{}: holds {entry}, which is no result of ours; name a new or an empty directory", path.display())]
    ForeignDirectory {
        /// The directory.
        path: PathBuf,
        /// Something in it.
        entry: String,
    },
    /// A file of the user's where the sample would go.
    #[error("{}: exists already and is not overwritten; name a new directory", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A line of a path that is not what we write.
    #[error("{}:{line}: expected {expected}, but found {found:?}", path.display())]
    BadCsvLine {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What the line should be.
        expected: &'static str,
        /// The line as found.
        found: String,
    },
    /// A path that cannot be made a program.
    #[error(
        "the cutter never touches the part at any of {positions} positions, so there is nothing to cut; check the spindle axis and the range of travel"
    )]
    NoContact {
        /// Number of positions.
        positions: u64,
    },
    /// A position with more digits than a control's numbers have.
    #[error(
        "{axis} at {spot} is beyond the {limit} that {control} can be told with {decimals} decimals; ask for fewer (decimals in [program]), or for the rotation choose other angles, such as \"rezero\" and split"
    )]
    TooManyDigits {
        /// The axis.
        axis: &'static str,
        /// Its decimals.
        decimals: u8,
        /// Farthest that can be told, in the program's units.
        limit: f64,
        /// The control.
        control: &'static str,
        /// The place.
        spot: Spot,
    },
    /// A move along which F counts nothing.
    #[error(
        "after {spot} nothing that F counts moves, so that it cannot tell how fast; choose feed_mode = \"inverse\" in [program], or more decimals"
    )]
    NoFeed {
        /// Where the move begins.
        spot: Spot,
    },
    /// A program in more files than can be numbered.
    #[error("the program takes more than {limit} files; let each hold more (split in [program])")]
    TooManyFiles {
        /// Most files.
        limit: u32,
    },
    /// A position that an axis does not reach.
    #[error(
        "{axis} goes to {value:.4} mm at {spot}, but its range in [machine] is from {least} to {most}; move the part, or change the motion"
    )]
    OutsideTravel {
        /// The axis.
        axis: &'static str,
        /// Where it should go, mm.
        value: f64,
        /// Least that it reaches, mm.
        least: f64,
        /// Most that it reaches, mm.
        most: f64,
        /// The place.
        spot: Spot,
    },
    /// A retract that the attack axis does not reach.
    #[error(
        "attack retracts to {value:.4} mm, but its range in [machine] is from {least} to {most}; ask for less clearance in [program]"
    )]
    RetractOutside {
        /// Where it should go, mm.
        value: f64,
        /// Least that it reaches, mm.
        least: f64,
        /// Most that it reaches, mm.
        most: f64,
    },
    /// The numbers of a part or of a job contradict each other or are out of bounds.
    #[error(transparent)]
    Core(#[from] horma_core::Error),
    /// A folder where a part was expected.
    #[error("{}: this is a folder; name a file in it", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// A file too large to index.
    #[error("{}: the file has {length} bytes, more than the {limit} that are read; export it coarser", path.display())]
    FileTooLarge {
        /// The file.
        path: PathBuf,
        /// Its length, bytes.
        length: u64,
        /// Longest file that is read, bytes.
        limit: u64,
    },
    /// A file with nothing in it.
    #[error("{name}: the file is empty; export it again")]
    EmptyFile {
        /// The file.
        name: String,
    },
    /// An extension that no reader knows.
    #[error("{}: parts are read from STEP, IGES, STL, OBJ, PLY and 3MF files (.step, .stp, .iges, .igs, .stl, .obj, .ply, .3mf); export it as one of them", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// A format that is known and not read.
    #[error(
        "{name}: this is {what}, which is no part that is read; {advice} (parts are STEP, IGES, STL, OBJ, PLY and 3MF files)"
    )]
    Foreign {
        /// The file.
        name: String,
        /// What it is.
        what: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// An extension that contradicts the content.
    #[error("{name}: its extension says {claimed}, but its content is {found}; rename it")]
    OtherContent {
        /// The file.
        name: String,
        /// What the extension says.
        claimed: Format,
        /// What the content is.
        found: Format,
    },
    /// A binary STL file without room for its header.
    #[error(
        "{name}: {length} bytes are too few for an STL file, whose header alone has 84; export it again"
    )]
    StlTooShort {
        /// The file.
        name: String,
        /// Its length, bytes.
        length: usize,
    },
    /// A binary STL file whose length contradicts its header.
    #[error(
        "{name}: the header states {stated} triangles, which take {needed} bytes, but there are {present} in {length} bytes; the file is damaged, export it again"
    )]
    StlLength {
        /// The file.
        name: String,
        /// Triangles that the header states.
        stated: u32,
        /// Bytes that they take.
        needed: u64,
        /// Length of the file, bytes.
        length: usize,
        /// Triangles that are there.
        present: usize,
    },
    /// A line of a text format that makes no sense.
    #[error("{name}: line {line}: {reason}")]
    Syntax {
        /// The file.
        name: String,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// A mesh file without a triangle.
    #[error("{name}: there is no triangle in it; export the part as a mesh or as surfaces")]
    NoTriangle {
        /// The file.
        name: String,
    },
    /// A file that is no STEP file, or a damaged one.
    #[error("{name}: not a readable STEP file: {source}")]
    StepSyntax {
        /// The file.
        name: String,
        /// What the parser says.
        source: Box<step_io::Error>,
    },
    /// A polygon with less than three corners.
    #[error(
        "{name}: face {face} has {corners} corners, but must have three or more; the file is damaged, export it again"
    )]
    BadFace {
        /// The file.
        name: String,
        /// The face, from 0.
        face: usize,
        /// Its corners.
        corners: usize,
    },
    /// A 3MF package that cannot be read.
    #[error("{name}: not a readable 3MF file: {reason}")]
    ThreeMf {
        /// The file.
        name: String,
        /// What is wrong, and where.
        reason: String,
    },
    /// An IGES file whose global section makes no sense.
    #[error("{name}: its global section (G) cannot be read: {reason}")]
    IgesGlobal {
        /// The file.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An entity of an IGES file that makes no sense.
    #[error("{name}: the entity of type {kind} at D{number} cannot be read: {reason}")]
    IgesEntity {
        /// The file.
        name: String,
        /// Its number in the directory.
        number: usize,
        /// Its type.
        kind: u32,
        /// What is wrong with it.
        reason: String,
    },
    /// A file in which there is nothing but what a cutter does not touch.
    #[error(
        "{name}: nothing in it can be machined; there is {found}. Export the part as surfaces or solids (as B-splines, IGES entity 144 or 128), or as a mesh (STL)"
    )]
    NothingUsable {
        /// The file.
        name: String,
        /// What there is.
        found: String,
    },
    /// A STEP file without a surface.
    #[error(
        "{name}: there is no surface in it; export the part as surfaces or solids, not as curves or a picture"
    )]
    NoSurface {
        /// The file.
        name: String,
    },
    /// A face, a shell, a solid or a placement that could not be read.
    #[error(
        "{name}: #{entity} {kind} cannot be read ({reason}); export it as B-spline surfaces, or the part as a mesh (STL)"
    )]
    StepLoss {
        /// The file.
        name: String,
        /// Number of the entity in the file.
        entity: u64,
        /// Its keyword.
        kind: String,
        /// Why.
        reason: String,
    },
    /// Units that cannot be applied.
    #[error("{name}: {reason}; export it in millimetres")]
    Units {
        /// The file.
        name: String,
        /// What is wrong with them.
        reason: String,
    },
    /// An assembly that cannot be followed.
    #[error("{name}: {reason}; export the assembly as one flat part")]
    StepAssembly {
        /// The file.
        name: String,
        /// What cannot be followed.
        reason: &'static str,
    },
    /// A face that is not the whole of its surface.
    #[error(
        "{name} is trimmed inside its surface; export it untrimmed, or the part as a mesh (STL); or have whole surfaces machined (trimmed = \"whole\" in [part]), which gouges nothing, but leaves what the trim cuts away"
    )]
    Trimmed {
        /// The face.
        name: String,
    },
    /// A face whose edges cannot be read.
    #[error(
        "{name} has an edge that cannot be read, so its trim is unknown; export it untrimmed, or the part as a mesh (STL); or have whole surfaces machined (trimmed = \"whole\" in [part])"
    )]
    UnreadableTrim {
        /// The face.
        name: String,
    },
    /// A kind of surface that is not read.
    #[error(
        "{name} lies on a {kind}, which is not read; export it as a B-spline surface, or the part as a mesh (STL)"
    )]
    UnsupportedSurface {
        /// The face.
        name: String,
        /// The kind of surface.
        kind: &'static str,
    },
    /// A job file, or a flag, that makes no sense.
    #[error("{what}{place}")]
    Job {
        /// What is wrong, and what would be right.
        what: String,
        /// Where.
        place: Box<Place>,
    },
}

/// The result of reading or writing.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Whether a path is what is wrong: the input makes sense, but no program comes of it.
    pub fn is_impossible(&self) -> bool {
        match self {
            Self::Core(error) => error.is_impossible(),
            error => matches!(
                error,
                Self::NoContact { .. }
                    | Self::TooManyDigits { .. }
                    | Self::NoFeed { .. }
                    | Self::TooManyFiles { .. }
                    | Self::OutsideTravel { .. }
                    | Self::RetractOutside { .. }
            ),
        }
    }

    /// The operating system's refusal, with the file it is about.
    pub(crate) fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            source,
        }
    }
}
