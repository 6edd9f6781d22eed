//! The diagram of a bench: cost per position against density.

use horma_formats::plot::{Curve, Plot, Scale};

use super::figures::{Density, Figures};

/// Exact search and brute force for points and for facets.
pub(super) fn against_density(figures: &Figures) -> Plot {
    let curve = |name: &str, color, dashed, cost: fn(&Density) -> f64| Curve {
        name: name.to_owned(),
        color,
        dashed,
        points: figures
            .density
            .iter()
            .map(|d| [d.points as f64, cost(d)])
            .collect(),
    };
    Plot {
        title: "Cost per position against density".to_owned(),
        subtitle: format!(
            "{}, {}, step {} mm, {} points a revolution, one thread, {}",
            figures.part,
            figures.cutter,
            figures.step_mm,
            figures.points_per_revolution,
            figures.simd
        ),
        x: "points of the part".to_owned(),
        y: "time per position (µs)".to_owned(),
        scales: [Scale::Logarithmic; 2],
        curves: vec![
            curve("facets, brute force", 1, true, |d| d.facet.brute_us),
            curve("points, brute force", 0, true, |d| d.point.brute_us),
            curve("facets, exact", 1, false, |d| d.facet.exact_us),
            curve("points, exact", 0, false, |d| d.point.exact_us),
        ],
    }
}
