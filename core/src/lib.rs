//! The mathematics of virtual digitizing: from a part to the heights of a tool path.
//!
//! Turn the part to face the cutter, advance the cutter along the attack axis, and stop where it
//! first touches: that is the tool centre for this position. The modules follow the pipeline.
//! This crate refuses I/O, clocks, async and wire types: it is values in and values out, and the
//! same values in give the same bits out on any machine and with any number of threads.
//!
//! # From a part to a path
//!
//! An octahedron, turned by a torus wheel of R 40 and r 8. Lengths are in mm, and X is the spindle.
//!
//! ```
//! use horma_core::*;
//!
//! # fn main() -> Result<()> {
//! let corners = vec![
//!     [-30.0, 0.0, 0.0],
//!     [30.0, 0.0, 0.0],
//!     [0.0, 20.0, 0.0],
//!     [0.0, -20.0, 0.0],
//!     [0.0, 0.0, 20.0],
//!     [0.0, 0.0, -20.0],
//! ];
//! let facets = vec![
//!     [0, 2, 4],
//!     [0, 4, 3],
//!     [0, 3, 5],
//!     [0, 5, 2],
//!     [1, 4, 2],
//!     [1, 3, 4],
//!     [1, 5, 3],
//!     [1, 2, 5],
//! ];
//! let name = "octahedron".to_owned();
//! let shape = Shape::Mesh(Mesh::new(&name, corners, facets)?);
//! let part = Part {
//!     bodies: vec![Body { name, shape }],
//! };
//! let job = Job {
//!     discretization: Discretization::Tolerance(0.01),
//!     cutter: Cutter::torus(40.0, 8.0)?,
//!     motion: Motion {
//!         from: Some(-30.0),
//!         to: Some(30.0),
//!         ..Motion::new(MotionKind::Helix, 1.0, 90)
//!     },
//!     coordinates: Coordinates::Double,
//!     contact: Contact::Facet,
//!     method: Method::Exact,
//! };
//!
//! // Rows and positions; a job that takes more than a gigabyte is refused.
//! let plan = Plan::new(&part, job, 1 << 30)?;
//! // Their hierarchy, and the search, on the threads of the current rayon pool.
//! let digitizer = Digitizer::new(&job, &plan.model.rows, Simd::best());
//! let (path, _cost) = digitizer.path(&plan.trajectory);
//!
//! // After 30 revolutions the wheel stands above the corner at y = 20.
//! let touch = path.touches[30 * 90].expect("the corner is in reach");
//! assert_eq!(touch.height, 20.0 + 40.0 + 8.0);
//! assert_eq!(touch.contact, [0.0, 20.0, 0.0]);
//! # Ok(())
//! # }
//! ```
//!
//! [`Digitizer::run_chunks`] delivers a path as it comes, from wherever in it to wherever, and [`stitch()`] joins what
//! was delivered. Points that lie in rows already go in by [`Model::of_grids`] and [`Plan::over`]. [`verify()`] holds the
//! path against the part, by a search of its own.

mod error;
mod tolerance;
mod vector;

mod simd;
mod slices;

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

mod contact;
mod lanes;

mod bound;

mod blocks;
mod leaf;
mod tree;
mod vertices;

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
pub use evaluate::Net;
pub use extent::{Extent, Halo};
pub use feed::{AxisLimits, Bound, Limits, Peak, Steady, Timing, peaks, steady, timing};
pub use grid::SurfaceGrid;
pub use job::{Contact, Coordinates, Culling, Discretization, Distribution, Job, Local, Method};
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
pub use rays::{Designed, Machined, Rays, Spot, machined};
pub use record::{BodyRecord, Counters, ExtentRecord, LostAttempt, Phase, Record};
pub use record::{SecondAttempt, Share, Traffic, WorkerRecord};
pub use row::{Outline, Row, RowKind};
pub use runs::Run;
pub use simd::Simd;
pub use solid::{Section, Solid};
pub use surface::{Direction, MAX_DEGREE, Surface};
pub use tolerance::MAX_COORDINATE;
pub use vector::{Interval, Point, cross, dot, facing_at, length, sub, unit};
pub use verify::{
    Clearances, Deviation, Excess, Gouge, INTERMEDIATE, Position, Scallop, Verification,
};
pub use verify::{verify, verify_everywhere};
