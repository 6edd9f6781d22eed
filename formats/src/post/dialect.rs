//! The dialects of G-code that programs are written in, as data.
//!
//! What is here follows each control's public programming manual. What two machines with the same control
//! may do differently is an option of the job; what nobody could look up is absent, and refused by name.

/// The controls whose dialect is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// LinuxCNC.
    LinuxCnc,
    /// Fanuc 16 to 31, machining centre G-codes.
    Fanuc,
    /// Sinumerik 840D.
    Siemens,
    /// Mach3 and Mach4.
    Mach,
    /// grblHAL.
    GrblHal,
    /// TwinCAT CNC.
    Beckhoff,
}

/// How a control wants its program.
#[derive(Debug)]
pub struct Dialect {
    /// Its name in a job.
    pub name: &'static str,
    /// The control's own name.
    pub title: &'static str,
    /// What names of files end in, after the dot.
    pub extension: &'static str,
    /// Lines before the heading. `{part}` is the number of the file, four digits.
    pub begin: &'static [&'static str],
    /// Lines that set units, distances and planes, no compensation, no canned cycle, feed a minute, and
    /// how corners are rounded. `{units}` is one of [`Dialect::units`], `{blend}` the corner tolerance.
    pub setup: &'static [&'static str],
    /// Lines after the last retract.
    pub end: &'static [&'static str],
    /// Before and after a comment.
    pub comment: [&'static str; 2],
    /// Whether comments have to do with capitals, digits and plain punctuation.
    pub plain_comments: bool,
    /// Longest line, in characters.
    pub line: usize,
    /// Millimetres and inches.
    pub units: [&'static str; 2],
    /// Whether a number without a point means least increments, so that every one needs a point.
    pub point: bool,
    /// Decimals of millimetres, of inches and of degrees, unless the job says otherwise.
    pub decimals: [u8; 3],
    /// Most least increments of a coordinate: what digits or single precision hold.
    pub most: i64,
    /// What F is under G93.
    pub inverse: Inverse,
    /// Most decimals of F.
    pub feed_decimals: usize,
    /// Greatest F under G93, 1/min.
    pub most_inverse: f64,
    /// What F counts under G94 when the part turns as well; absent where that is uncertain.
    pub minute: Option<Counted>,
    /// How the axes that F counts are named, and how that ends. `{axes}` are their letters, `{rotation}`
    /// is the rotation's. Without it, F cannot count degrees alone.
    pub group: Option<Group>,
    /// How an axis that counts to 360 is told where to turn; absent where that is uncertain.
    pub modulo: Option<Modulo>,
    /// Whether G92 gives the present place another number, and keeps it after the program's end.
    pub rezero: bool,
    /// Block numbers go by this unless the job says otherwise; 0 for none.
    pub block_numbers: u32,
    /// Greatest block number.
    pub most_block_number: u32,
}

/// What F is under G93.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Inverse {
    /// One over the minutes that the move takes.
    PerMinute,
    /// The seconds that it takes.
    Seconds,
}

/// What F counts under G94.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counted {
    /// Lengths alone, and degrees where nothing else moves.
    Lengths,
    /// The root of the squares of all axes, a degree as a unit of length.
    All,
}

/// Lines that say which axes F counts.
#[derive(Debug)]
pub struct Group {
    /// From here on.
    pub begin: &'static [&'static str],
    /// No longer.
    pub end: &'static str,
}

/// How an axis that counts to 360 is told where to turn.
#[derive(Debug)]
pub struct Modulo {
    /// What the direction is told by.
    pub direction: Direction,
    /// What has to be set on the control. `{rotation}` is the axis.
    pub note: &'static str,
}

/// What tells an axis that counts to 360 which way to turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// It takes the shorter way.
    Shorter,
    /// The sign of the number, also of 0.
    Sign,
    /// A function around the number, for either direction.
    Function([&'static str; 2]),
}

impl Control {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::LinuxCnc,
        Self::Fanuc,
        Self::Siemens,
        Self::Mach,
        Self::GrblHal,
        Self::Beckhoff,
    ];

    /// What its programs look like.
    pub const fn dialect(self) -> &'static Dialect {
        match self {
            Self::LinuxCnc => &LINUXCNC,
            Self::Fanuc => &FANUC,
            Self::Siemens => &SIEMENS,
            Self::Mach => &MACH,
            Self::GrblHal => &GRBLHAL,
            Self::Beckhoff => &BECKHOFF,
        }
    }
}

const ROUND_BRACKETS: [&str; 2] = ["(", ")"];
const SEMICOLON: [&str; 2] = ["; ", ""];

static LINUXCNC: Dialect = Dialect {
    name: "linuxcnc",
    title: "LinuxCNC",
    extension: "ngc",
    begin: &["%"],
    setup: &["{units} G90 G17 G40 G49 G80 G94", "G64 P{blend}"],
    end: &["M2", "%"],
    comment: ROUND_BRACKETS,
    plain_comments: false,
    line: 251,
    units: ["G21", "G20"],
    point: false,
    decimals: [4, 5, 4],
    most: 1_000_000_000_000,
    inverse: Inverse::PerMinute,
    feed_decimals: 12,
    most_inverse: f64::INFINITY,
    minute: Some(Counted::Lengths),
    group: None,
    modulo: Some(Modulo {
        direction: Direction::Sign,
        note: "{rotation} counts to 360 and turns by the sign: WRAPPED_ROTARY = 1 in the INI file",
    }),
    rezero: true,
    block_numbers: 0,
    most_block_number: 99_999,
};

static FANUC: Dialect = Dialect {
    name: "fanuc",
    title: "Fanuc 16 to 31, machining centre",
    extension: "nc",
    begin: &["%", "O{part}"],
    setup: &["{units} G90 G17 G40 G49 G80 G94", "G64"],
    end: &["M30", "%"],
    comment: ROUND_BRACKETS,
    plain_comments: true,
    line: 120,
    units: ["G21", "G20"],
    point: true,
    // Increment system IS-B, eight digits.
    decimals: [3, 4, 3],
    most: 99_999_999,
    inverse: Inverse::PerMinute,
    feed_decimals: 3,
    most_inverse: 9999.999,
    minute: Some(Counted::All),
    group: None,
    modulo: Some(Modulo {
        direction: Direction::Shorter,
        note: "{rotation} counts to 360 and takes the shorter way: parameter 1008 has ROA 1 and RAB 0",
    }),
    rezero: true,
    block_numbers: 0,
    most_block_number: 99_999,
};

static SIEMENS: Dialect = Dialect {
    name: "siemens",
    title: "Sinumerik 840D",
    extension: "mpf",
    begin: &[],
    setup: &["{units} G90 G17 G40 D0 G94", "G641 ADIS={blend}"],
    end: &["M30"],
    comment: SEMICOLON,
    plain_comments: false,
    line: 512,
    units: ["G710", "G700"],
    point: false,
    decimals: [4, 5, 4],
    most: 1_000_000_000,
    inverse: Inverse::PerMinute,
    feed_decimals: 9,
    most_inverse: f64::INFINITY,
    minute: Some(Counted::All),
    group: Some(Group {
        // A degree counts as a millimetre.
        begin: &["FGREF[{rotation}]=360/(2*$PI)", "FGROUP({axes})"],
        end: "FGROUP()",
    }),
    modulo: Some(Modulo {
        direction: Direction::Function(["=ACP(", "=ACN("]),
        note: "{rotation} is a modulo axis: MD30310 $MA_ROT_IS_MODULO is 1",
    }),
    rezero: false,
    block_numbers: 10,
    most_block_number: 99_999_999,
};

static MACH: Dialect = Dialect {
    name: "mach",
    title: "Mach3 and Mach4",
    extension: "tap",
    begin: &[],
    setup: &["{units} G90 G17 G40 G49 G80 G94", "G64"],
    end: &["M30"],
    comment: ROUND_BRACKETS,
    plain_comments: false,
    line: 251,
    units: ["G21", "G20"],
    point: false,
    decimals: [4, 5, 4],
    most: 1_000_000_000,
    inverse: Inverse::PerMinute,
    feed_decimals: 9,
    most_inverse: f64::INFINITY,
    minute: Some(Counted::Lengths),
    group: None,
    modulo: None,
    rezero: true,
    block_numbers: 0,
    most_block_number: 99_999,
};

static GRBLHAL: Dialect = Dialect {
    name: "grblhal",
    title: "grblHAL",
    extension: "nc",
    begin: &[],
    // It knows no G64.
    setup: &["{units} G90 G17 G40 G49 G80 G94"],
    end: &["M2"],
    comment: ROUND_BRACKETS,
    plain_comments: false,
    line: 79,
    units: ["G21", "G20"],
    point: false,
    // Numbers are held in single precision.
    decimals: [3, 4, 2],
    most: 1 << 24,
    inverse: Inverse::PerMinute,
    feed_decimals: 9,
    most_inverse: f64::INFINITY,
    minute: None,
    group: None,
    modulo: None,
    rezero: true,
    block_numbers: 0,
    most_block_number: 99_999,
};

static BECKHOFF: Dialect = Dialect {
    name: "beckhoff",
    title: "TwinCAT CNC",
    extension: "nc",
    begin: &[],
    setup: &["{units} G90 G17 G40 G94"],
    end: &["M30"],
    comment: SEMICOLON,
    plain_comments: false,
    line: 512,
    units: ["G71", "G70"],
    point: false,
    decimals: [4, 5, 4],
    most: 1_000_000_000,
    inverse: Inverse::Seconds,
    feed_decimals: 9,
    most_inverse: f64::INFINITY,
    minute: Some(Counted::All),
    group: Some(Group {
        begin: &["#FGROUP [{axes}]"],
        end: "#FGROUP",
    }),
    modulo: None,
    // Its G92 is an offset that ends with the program.
    rezero: false,
    block_numbers: 10,
    most_block_number: 99_999_999,
};
