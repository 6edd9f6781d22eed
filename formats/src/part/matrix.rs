//! Where files put what is in them: affine maps, rows first.

use horma_core::Point;

/// An affine map in the file's unit of length, rows first.
pub(super) type Matrix = [[f64; 4]; 4];

pub(super) const IDENTITY: Matrix = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

/// `p` moved by `matrix` and scaled to mm.
pub(super) fn apply(matrix: &Matrix, p: Point, scale: f64) -> Point {
    // The usual case keeps the bits of the file.
    if *matrix == IDENTITY {
        return p.map(|c| c * scale);
    }
    std::array::from_fn(|i| {
        let [a, b, c, d] = matrix[i];
        (a * p[0] + b * p[1] + c * p[2] + d) * scale
    })
}

/// First `b`, then `a`.
pub(super) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Whether a map makes mirror images.
pub(super) fn mirrors(matrix: &Matrix) -> bool {
    let [a, b, c] = [0, 1, 2].map(|i| [matrix[i][0], matrix[i][1], matrix[i][2]]);
    horma_core::dot(horma_core::cross(a, b), c) < 0.0
}
