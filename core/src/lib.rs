//! The mathematics of virtual digitizing: from a part to the heights of a tool path.
//!
//! Turn the part to face the cutter, advance the cutter along the attack axis, and stop where it
//! first touches: that is the tool centre for this position. The modules follow the pipeline.
//! This crate refuses I/O, clocks, async and wire types: it is values in and values out, and the
//! same values in give the same bits out on any machine and with any number of threads.

mod error;
mod tolerance;
mod vector;

mod evaluate;
mod jet;
mod surface;

mod part;
mod placement;

mod cutter;
mod job;
mod motion;

mod refine;

mod discretize;
mod grid;
mod row;

mod bisect;
mod extent;
mod plan;
mod runs;

mod simd;

mod contact;
mod lanes;

mod bound;

mod blocks;
mod leaf;
mod tree;

mod local;
mod sweep;

mod between;
mod digitize;

mod path;

mod keep_out;
mod solid;

mod course;
mod feed;

mod layers;

mod verify;

mod rays;

mod last;

mod record;

mod packed;

pub use course::{MachineAxis, Station, course};
pub use cutter::Cutter;
pub use digitize::{Digitizer, Heuristic};
pub use discretize::{Model, discretize};
pub use error::{Error, Result};
pub use extent::{Extent, Halo};
pub use feed::{AxisLimits, Bound, Limits, Peak, Steady, Timing, peaks, steady, timing};
pub use grid::SurfaceGrid;
pub use job::{Contact, Culling, Discretization, Distribution, Job, Local, Method};
pub use job::{Sharing, Window};
pub use keep_out::{KeepOut, Raised, keep_out};
pub use last::{Choice, Frame, Grading, Hold, Landmark, Landmarks, Last, Measures, Scale, Shaped};
pub use last::{Sections, System, shape};
pub use layers::{Layer, deepest_cut, layers};
pub use motion::{Index, Motion, MotionKind, Trajectory};
pub use packed::{Packing, pack_words, unpack_words};
pub use part::{Body, Mesh, Part, Shape};
pub use path::{Inserted, SubTrajectory, ToolPath, Touch, Waypoint, stitch};
pub use placement::{Axis, place};
pub use plan::{Handout, Plan, Stock};
pub use rays::{Machined, Rays, Spot, machined};
pub use record::{BodyRecord, Counters, ExtentRecord, LostAttempt, Phase, Record};
pub use record::{SecondAttempt, Share, Traffic, WorkerRecord};
pub use row::{Outline, Row, RowKind};
pub use runs::Run;
pub use simd::Simd;
pub use solid::{Section, Solid};
pub use surface::{Direction, MAX_DEGREE, Surface};
pub use tolerance::MAX_COORDINATE;
pub use vector::{Interval, Point, cross, dot, length, sub, unit};
pub use verify::{
    Clearances, Deviation, Excess, Gouge, INTERMEDIATE, Position, Scallop, Verification,
};
pub use verify::{verify, verify_everywhere};
