//! First and second derivatives of a surface, to know how it bends.
//!
//! Basis functions are differentiated once for each parameter and the net of poles is collapsed once
//! for each u, as in `evaluate`. At a knot the derivatives are those of the piece that begins there;
//! who wants both sides asks beside it. Third derivatives and points are not to be had here.

use crate::surface::{Direction, MAX_DEGREE, Surface};
use crate::vector::{Point, add_scaled};

/// First and second derivatives of a surface at one place, mm per unit of the parameters.
#[derive(Clone, Copy, Default)]
pub(crate) struct Derivatives {
    pub u: Point,
    pub v: Point,
    pub uu: Point,
    pub uv: Point,
    pub vv: Point,
}

/// Basis functions with their first and second derivatives.
pub(crate) struct Jet {
    first: usize,
    order: usize,
    values: [[f64; MAX_DEGREE + 1]; 3],
}

impl Jet {
    pub fn new(direction: &Direction, t: f64) -> Self {
        let span = direction.span(t);
        let degree = direction.degree;
        let of = |lower: usize| direction.basis_in(span, degree - lower, t);
        let rise = |lower, degree| differentiate(direction, span, degree, &lower);
        let none = [0.0; MAX_DEGREE + 1];
        let second = if degree < 2 {
            none
        } else {
            rise(rise(of(2), degree - 1), degree)
        };
        Self {
            first: span - degree,
            order: degree + 1,
            values: [of(0), rise(of(1), degree), second],
        }
    }
}

/// From the derivatives of the functions of degree `degree − 1` to the next ones of `degree`
/// (Piegl and Tiller, The NURBS Book, eq. 2.7).
fn differentiate(
    direction: &Direction,
    span: usize,
    degree: usize,
    lower: &[f64; MAX_DEGREE + 1],
) -> [f64; MAX_DEGREE + 1] {
    let mut raised = [0.0; MAX_DEGREE + 1];
    for r in 0..degree {
        let i = span + 1 - degree + r;
        let width = direction.knots[i + degree] - direction.knots[i];
        let slope = degree as f64 * lower[r] / width;
        raised[r] -= slope;
        raised[r + 1] += slope;
    }
    raised
}

type Homogeneous = [f64; 4];

/// An isocurve's homogeneous poles, and those of its first and second derivative by u.
pub(crate) fn collapse_jet(surface: &Surface, u: &Jet) -> [Vec<Homogeneous>; 3] {
    let n = surface.v().count();
    u.values.map(|values| {
        let mut curve = vec![[0.0; 4]; n];
        for (i, &share) in values[..u.order].iter().enumerate() {
            let row = (u.first + i) * n;
            for (j, c) in curve.iter_mut().enumerate() {
                let p = surface.poles()[row + j];
                let w = surface.weights().map_or(1.0, |w| w[row + j]) * share;
                *c = [c[0] + w * p[0], c[1] + w * p[1], c[2] + w * p[2], c[3] + w];
            }
        }
        curve
    })
}

/// The derivatives where the isocurve of [`collapse_jet`] meets v.
pub(crate) fn derivatives(curves: &[Vec<Homogeneous>; 3], v: &Jet, rational: bool) -> Derivatives {
    let at = |by_u: usize, by_v: usize| {
        let mut sum = [0.0; 4];
        let poles = &curves[by_u][v.first..v.first + v.order];
        for (&share, c) in v.values[by_v].iter().zip(poles) {
            for (sum, c) in sum.iter_mut().zip(c) {
                *sum += share * c;
            }
        }
        ([sum[0], sum[1], sum[2]], sum[3])
    };
    let [(u, wu), (v_, wv)] = [at(1, 0), at(0, 1)];
    let [(uu, wuu), (uv, wuv), (vv, wvv)] = [at(2, 0), at(1, 1), at(0, 2)];
    if !rational {
        return Derivatives {
            u,
            v: v_,
            uu,
            uv,
            vv,
        };
    }
    // The quotient rule, order by order.
    let (s, w) = at(0, 0);
    let over = |p: Point| p.map(|c| c / w);
    let s = over(s);
    let u = over(add_scaled(u, -wu, s));
    let v = over(add_scaled(v_, -wv, s));
    let twice = |p: Point, w1: f64, d: Point, w2: f64| {
        over(add_scaled(add_scaled(p, -2.0 * w1, d), -w2, s))
    };
    let mixed = add_scaled(add_scaled(uv, -wu, v), -wv, u);
    Derivatives {
        u,
        v,
        uu: twice(uu, wu, u, wuu),
        uv: over(add_scaled(mixed, -wuv, s)),
        vv: twice(vv, wv, v, wvv),
    }
}
