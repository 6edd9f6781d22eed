//! B-spline surfaces, rational or not: validated once, then evaluated on grids of parameters.
//!
//! A surface that exists is sound: degrees, knots, poles and weights agree, and no knot tears it.
//! How the points are computed is `evaluate`'s business; trimming curves are nobody's.

use crate::error::{Error, Result};
use crate::evaluate::Net;
use crate::part::check_points;
use crate::vector::Point;

/// Greatest degree accepted.
pub const MAX_DEGREE: usize = 15;

/// A B-spline surface over `[u₀, u₁] × [v₀, v₁]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    u: Direction,
    v: Direction,
    /// Poles, mm, `u.count × v.count`, v running fastest.
    pub(crate) poles: Vec<Point>,
    /// Weights of the poles, if the surface is rational.
    weights: Option<Vec<f64>>,
}

/// Degree and knots of one parametric direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction {
    /// Polynomial degree.
    pub degree: usize,
    /// Knots, each as often as its multiplicity: `count + degree + 1` of them.
    pub knots: Vec<f64>,
}

impl Direction {
    /// Number of poles in this direction.
    pub fn count(&self) -> usize {
        self.knots.len() - self.degree - 1
    }

    /// First and last parameter.
    pub fn domain(&self) -> (f64, f64) {
        (self.knots[self.degree], self.knots[self.count()])
    }

    /// The knots within the domain, each once: the ends of the polynomial pieces.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks = self.knots[self.degree..=self.count()].to_vec();
        breaks.dedup();
        breaks
    }

    /// The ends of the domain and, between them, the knots where the surface may have a crease:
    /// those as often as the degree, where only the points on both sides need to agree.
    pub(crate) fn creases(&self) -> Vec<f64> {
        let (low, high) = self.domain();
        let inner = self.knots[self.degree + 1..self.count()].chunk_by(|a, b| a == b);
        let sharp =
            inner.filter(|same| same.len() >= self.degree && same[0] > low && same[0] < high);
        let sharp = sharp.map(|same| same[0]);
        [low].into_iter().chain(sharp).chain([high]).collect()
    }

    /// Index of the piece that holds `t`: `knots[span] ≤ t < knots[span + 1]`, the last one closed.
    pub(crate) fn span(&self, t: f64) -> usize {
        let end = self.count();
        let upper = self.knots[self.degree + 1..end].partition_point(|&k| k <= t);
        let mut span = self.degree + upper;
        while span > self.degree && self.knots[span] == self.knots[span + 1] {
            span -= 1;
        }
        span
    }

    /// The `degree + 1` basis functions that do not vanish at `t`, and the first pole they weigh.
    pub(crate) fn basis(&self, t: f64) -> Basis {
        let span = self.span(t);
        Basis {
            first: span - self.degree,
            values: self.basis_in(span, self.degree, t),
        }
    }

    /// The basis functions of a degree up to this direction's own that do not vanish in a piece
    /// (Piegl and Tiller, The NURBS Book, A2.2).
    pub(crate) fn basis_in(&self, span: usize, degree: usize, t: f64) -> [f64; MAX_DEGREE + 1] {
        let mut values = [0.0; MAX_DEGREE + 1];
        let mut left = [0.0; MAX_DEGREE + 1];
        let mut right = [0.0; MAX_DEGREE + 1];
        values[0] = 1.0;
        for j in 1..=degree {
            left[j] = t - self.knots[span + 1 - j];
            right[j] = self.knots[span + j] - t;
            let mut saved = 0.0;
            for r in 0..j {
                let share = values[r] / (right[r + 1] + left[j - r]);
                values[r] = saved + right[r + 1] * share;
                saved = left[j - r] * share;
            }
            values[j] = saved;
        }
        values
    }

    fn check(&self, name: &str, which: &str) -> Result<()> {
        let bad = |reason: String| {
            Err(Error::BadSurface {
                name: name.to_owned(),
                reason,
            })
        };
        let (degree, knots) = (self.degree, &self.knots);
        if degree == 0 || degree > MAX_DEGREE {
            return bad(format!(
                "degree {degree} in {which}, but it must be from 1 to {MAX_DEGREE}"
            ));
        }
        if knots.len() < 2 * degree + 2 {
            return bad(format!(
                "{} knots in {which}, but degree {degree} needs at least {}",
                knots.len(),
                2 * degree + 2
            ));
        }
        if let Some(index) = knots.iter().position(|k| !k.is_finite()) {
            return Err(Error::NotFinite {
                name: name.to_owned(),
                what: "knot",
                index,
                value: knots[index],
            });
        }
        if let Some(i) = knots.windows(2).position(|w| w[0] > w[1]) {
            return bad(format!(
                "knot {} in {which} is smaller than the one before it",
                i + 1
            ));
        }
        let (low, high) = self.domain();
        if low >= high {
            return bad(format!("the knots in {which} span nothing"));
        }
        let inner = &knots[1..knots.len() - 1];
        if let Some(w) = inner.windows(degree + 1).find(|w| w[0] == w[degree]) {
            return bad(format!(
                "knot {} in {which} has a multiplicity above the degree {degree}: the surface would be torn",
                w[0]
            ));
        }
        Ok(())
    }
}

/// Basis functions at one parameter.
pub(crate) struct Basis {
    /// The first pole they weigh.
    pub first: usize,
    /// One for each pole from there on.
    pub values: [f64; MAX_DEGREE + 1],
}

impl Surface {
    /// A surface with `u.count() × v.count()` poles, v running fastest; weights likewise, or none
    /// if they are all equal.
    ///
    /// # Errors
    /// [`Error::BadSurface`], [`Error::NotFinite`] or [`Error::TooFar`], with `name` and the reason.
    pub fn new(
        name: &str,
        u: Direction,
        v: Direction,
        poles: Vec<Point>,
        weights: Option<Vec<f64>>,
    ) -> Result<Self> {
        u.check(name, "u")?;
        v.check(name, "v")?;
        check_points(name, "pole", &poles)?;
        let bad = |reason: String| {
            Err(Error::BadSurface {
                name: name.to_owned(),
                reason,
            })
        };
        let expected = u.count() * v.count();
        if poles.len() != expected {
            return bad(format!(
                "{} poles, but its knots call for {} × {}",
                poles.len(),
                u.count(),
                v.count()
            ));
        }
        if let Some(weights) = &weights {
            if weights.len() != expected {
                return bad(format!("{} weights for {expected} poles", weights.len()));
            }
            let valid = |w: f64| w.is_finite() && w > 0.0;
            if let Some(i) = weights.iter().position(|&w| !valid(w)) {
                return bad(format!(
                    "weight {i} is {}, but must be positive",
                    weights[i]
                ));
            }
        }
        let weights = weights.filter(|w| w.iter().any(|&x| x != w[0]));
        Ok(Self {
            u,
            v,
            poles,
            weights,
        })
    }

    /// The first parametric direction.
    pub fn u(&self) -> &Direction {
        &self.u
    }

    /// The second parametric direction.
    pub fn v(&self) -> &Direction {
        &self.v
    }

    /// Poles, mm, v running fastest.
    pub fn poles(&self) -> &[Point] {
        &self.poles
    }

    /// Weights of the poles, if the surface is rational.
    pub fn weights(&self) -> Option<&[f64]> {
        self.weights.as_deref()
    }

    /// The same surface with u and v exchanged.
    #[must_use]
    pub fn transposed(&self) -> Self {
        let (m, n) = (self.u.count(), self.v.count());
        let order = || (0..n).flat_map(move |j| (0..m).map(move |i| i * n + j));
        Self {
            u: self.v.clone(),
            v: self.u.clone(),
            poles: order().map(|k| self.poles[k]).collect(),
            weights: self
                .weights
                .as_ref()
                .map(|w| order().map(|k| w[k]).collect()),
        }
    }

    /// The same surface run through the other way in v: its normal points to its other side.
    #[must_use]
    pub(crate) fn reversed_v(&self) -> Self {
        let n = self.v.count();
        let (low, high) = self.v.domain();
        let knots = self.v.knots.iter().rev().map(|k| low + (high - k));
        let mut reversed = Self {
            v: Direction {
                degree: self.v.degree,
                knots: knots.collect(),
            },
            ..self.clone()
        };
        for row in reversed.poles.chunks_exact_mut(n) {
            row.reverse();
        }
        for row in reversed
            .weights
            .iter_mut()
            .flat_map(|w| w.chunks_exact_mut(n))
        {
            row.reverse();
        }
        reversed
    }

    /// The surface with u the direction that runs along the spindle: the one in which the poles
    /// travel further in x.
    #[must_use]
    pub fn along_x(self) -> Self {
        let n = self.v.count();
        let travel = |pairs: &mut dyn Iterator<Item = (&Point, &Point)>| {
            pairs.map(|(a, b)| (b[0] - a[0]).abs()).sum::<f64>()
        };
        let along_u = travel(&mut self.poles.iter().zip(&self.poles[n..])) / n as f64;
        let rows = self.poles.chunks_exact(n);
        let along_v = travel(&mut rows.flat_map(|r| r.iter().zip(&r[1..]))) / self.u.count() as f64;
        if along_u >= along_v {
            self
        } else {
            self.transposed()
        }
    }

    /// The points at every pair of parameters, `us.len() × vs.len()`, v running fastest, mm.
    /// Eq. (3) of the 2001 paper.
    pub fn grid(&self, us: &[f64], vs: &[f64]) -> Vec<Point> {
        Net::new(self).grid(us, vs)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A quarter of a cylinder of radius `r` about x, from x = 0 to `length`, rational in v.
    pub(crate) fn quarter_cylinder(r: f64, length: f64) -> Surface {
        let s = std::f64::consts::FRAC_1_SQRT_2;
        let arc = [[r, 0.0], [r, r], [0.0, r]];
        let poles = [0.0, length]
            .iter()
            .flat_map(|&x| arc.map(|[y, z]| [x, y, z]))
            .collect();
        let u = Direction {
            degree: 1,
            knots: vec![0.0, 0.0, 1.0, 1.0],
        };
        let v = Direction {
            degree: 2,
            knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        };
        Surface::new("quarter", u, v, poles, Some([1.0, s, 1.0].repeat(2))).expect("valid")
    }

    #[test]
    fn a_rational_arc_is_a_circle() {
        let ts: Vec<f64> = (0..=20).map(|i| f64::from(i) / 20.0).collect();
        for p in quarter_cylinder(5.0, 10.0).grid(&ts, &ts) {
            assert!((p[1].hypot(p[2]) - 5.0).abs() < 1e-14);
        }
    }

    #[test]
    fn u_is_made_to_run_along_the_spindle() {
        let s = quarter_cylinder(5.0, 10.0);
        assert_eq!(s.transposed().along_x(), s);
        assert_eq!(s.clone().along_x(), s);
        assert_eq!(s.transposed().grid(&[0.3], &[0.7]), s.grid(&[0.7], &[0.3]));
    }

    #[test]
    fn contradictions_are_refused() {
        let s = quarter_cylinder(5.0, 10.0);
        let try_knots = |degree, knots: &[f64]| {
            let u = Direction {
                degree,
                knots: knots.to_vec(),
            };
            Surface::new("s", u, s.v.clone(), s.poles.clone(), None).is_err()
        };
        assert!(try_knots(0, &[0.0, 0.5, 1.0]));
        assert!(try_knots(1, &[0.0, 0.0, 1.0]));
        assert!(try_knots(1, &[0.0, 1.0, 0.5, 1.0]));
        assert!(try_knots(1, &[0.0, 0.0, 0.0, 0.0]));
        assert!(try_knots(1, &[0.0, f64::NAN, 1.0, 1.0]));
        assert!(try_knots(1, &[0.0, 0.0, 0.5, 1.0, 1.0]), "wrong pole count");
    }
}
