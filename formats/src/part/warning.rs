//! What is worth knowing about files that are machined all the same.

/// What is worth knowing about a file that is machined all the same.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Warning {
    /// A mesh that is not watertight.
    #[error("{name}: {edges} edges are open; the mesh is machined as it is")]
    OpenEdges {
        /// The mesh.
        name: String,
        /// Edges that do not lie between exactly two triangles.
        edges: usize,
    },
    /// Triangles without an area.
    #[error("{name}: {facets} triangles have no area; they are machined as edges and points")]
    DegenerateFacets {
        /// The mesh.
        name: String,
        /// How many of them.
        facets: usize,
    },
    /// Vertices of the same place.
    #[error("{name}: {vertices} vertices are there more than once and are joined")]
    DuplicateVertices {
        /// The mesh.
        name: String,
        /// How many went.
        vertices: usize,
    },
    /// Cracks that were closed.
    #[error(
        "{name}: {vertices} vertices at open edges are joined to others within {tolerance:.6} mm"
    )]
    Cracks {
        /// The mesh.
        name: String,
        /// How many went.
        vertices: usize,
        /// Farthest that one moved, mm.
        tolerance: f64,
    },
    /// Triangles of two or one place, in the edge or at the corner of another.
    #[error("{name}: {facets} triangles without an area lie in edges of others and are left out")]
    CollapsedFacets {
        /// The mesh.
        name: String,
        /// How many of them.
        facets: usize,
    },
    /// Triangles with the same corners.
    #[error("{name}: {facets} triangles are there more than once and count once")]
    DuplicateFacets {
        /// The mesh.
        name: String,
        /// How many went.
        facets: usize,
    },
    /// Triangles that faced the other way than their neighbours.
    #[error("{name}: {facets} triangles face the other way than those around them and are turned")]
    FlippedFacets {
        /// The mesh.
        name: String,
        /// How many of them.
        facets: usize,
    },
    /// Closed shells that faced inwards.
    #[error("{name}: {shells} shells are inside out and are turned")]
    InsideOut {
        /// The mesh.
        name: String,
        /// How many of them.
        shells: usize,
    },
    /// Shells without two sides.
    #[error("{name}: {shells} shells have no inside and no outside; they are machined as they are")]
    OneSided {
        /// The mesh.
        name: String,
        /// How many of them.
        shells: usize,
    },
    /// Bytes after the last triangle.
    #[error("{name}: {bytes} bytes after the last triangle are not read")]
    TrailingBytes {
        /// The file.
        name: String,
        /// How many of them.
        bytes: usize,
    },
    /// Lengths that were converted.
    #[error("{name}: lengths are converted from {unit} to mm, times {factor}")]
    Converted {
        /// The file.
        name: String,
        /// The unit that the file states.
        unit: String,
        /// Millimetres in one of it.
        factor: f64,
    },
    /// A file whose format has units, but that states none.
    #[error("{name}: no unit of length is stated; lengths are taken as {unit}")]
    NoUnit {
        /// The file.
        name: String,
        /// What they are taken as.
        unit: String,
    },
    /// Faces that are trimmed inside their surfaces and count whole.
    #[error(
        "{name}: {faces} faces are trimmed inside their surfaces, {first} for one, and count whole, as a job may say (trimmed = \"whole\" in [part]): nothing is gouged, but what the trim cuts away is left"
    )]
    Whole {
        /// The file.
        name: String,
        /// How many of them.
        faces: usize,
        /// The first of them.
        first: String,
    },
    /// Surfaces that were hidden where the file was made.
    #[error(
        "{name}: {surfaces} surfaces are hidden and left out; show them before the export if they belong to the part"
    )]
    Hidden {
        /// The file.
        name: String,
        /// How many of them.
        surfaces: usize,
    },
    /// What is neither a surface nor a mesh.
    #[error("{name}: passed over, since a cutter does not touch it: {what}")]
    PassedOver {
        /// The file.
        name: String,
        /// How many of which.
        what: String,
    },
    /// Something in a STEP file that was read as far as possible. Never a surface: a file of which
    /// a surface cannot be read is refused.
    #[error("{name}: {what}")]
    Repaired {
        /// The file.
        name: String,
        /// What the reader reports.
        what: String,
    },
}
