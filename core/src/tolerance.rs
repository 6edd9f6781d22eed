//! Every tolerance of the core, in one place.

/// Greatest magnitude of a part's coordinate, mm. At a kilometre a double still resolves 0.1 nm,
/// so the slack below covers every rounding error with room to spare.
pub const MAX_COORDINATE: f64 = 1.0e6;

/// Added to every upper bound that decides whether a part of the surface can be skipped, relative
/// to the magnitude of the numbers that went into it: rounding must never prune the winner.
pub const BOUND_SLACK: f64 = 1.0e-12;

/// Added to the cutter's half width where rows and boxes are chosen by x, mm: what rounding puts just
/// within reach of a contact must not be left out. Far above the rounding of any coordinate.
pub const REACH_SLACK: f64 = 1.0e-9;

/// A line search along a facet's edge is over once a step of it is this small, as a fraction of the edge's part
/// within reach. The next step would be smaller by orders, and near a maximum the height is flat, so that its own
/// error is of the order of that next step's square.
pub const EDGE_SEARCH: f64 = 1.0e-5;

/// How far out tangent planes are taken, as a fraction of the reach: at its end their slopes are
/// infinite.
pub const WELL_WITHIN: f64 = 0.98;
