//! The machined surface unrolled over travel and angle, in cells few enough for a browser.

use horma_core::Machined;
use serde::Serialize;

/// Most cells.
const MOST: u32 = 200_000;

/// Most cells around the spindle.
const COLUMNS: u32 = 720;

/// Cells of travel and angle; in each, of the rays that it holds the one that strays most.
#[derive(Debug, Clone, PartialEq)]
pub struct Unrolled {
    /// How many cells and where.
    pub cells: Cells,
    /// How far the designed surface is from the spindle, mm; row after row.
    pub radii: Vec<Option<f64>>,
    /// How far the machined surface lies outside of it, mm.
    pub deviations: Vec<Option<f64>>,
}

/// Where cells of travel and angle are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cells {
    /// Cells along the spindle.
    pub rows: u32,
    /// Cells around it.
    pub columns: u32,
    /// Travel, mm, and angle, degrees, in the middle of the first.
    pub first: [f64; 2],
    /// From cell to cell: travel, mm, and angle, degrees.
    pub step: [f64; 2],
    /// Rays that they hold.
    pub rays: u64,
}

/// What is shown of a machined surface.
pub(super) fn unrolled(surface: &Machined) -> Unrolled {
    let rays = surface.rays;
    let columns = rays.columns.min(COLUMNS);
    let rows = rays.rows.min(MOST / columns);
    let cell = |k: usize, of: u32, cells: u32| k * cells as usize / of as usize;
    let strays = |ray: usize| surface.deviation[ray].map_or(-1.0, f64::abs);
    let mut kept: Vec<Option<usize>> = vec![None; rows as usize * columns as usize];
    for ray in 0..rays.len() {
        let (row, column) = (ray / rays.columns as usize, ray % rays.columns as usize);
        let at =
            cell(row, rays.rows, rows) * columns as usize + cell(column, rays.columns, columns);
        if kept[at].is_none_or(|so_far| strays(ray) > strays(so_far)) {
            kept[at] = Some(ray);
        }
    }
    let of = |values: &[Option<f64>]| kept.iter().map(|ray| values[(*ray)?]).collect();
    // A cell reaches from half a ray before its first to half a ray after its last.
    let held = [
        f64::from(rays.rows) / f64::from(rows),
        f64::from(rays.columns) / f64::from(columns),
    ];
    let apart = [rays.step, 360.0 / f64::from(rays.columns)];
    let middle = |k: usize| 0.5 * (held[k] - 1.0) * apart[k];
    Unrolled {
        cells: Cells {
            rows,
            columns,
            first: [rays.from + middle(0), middle(1)],
            step: [held[0] * apart[0], held[1] * apart[1]],
            rays: rays.len() as u64,
        },
        radii: of(&surface.designed),
        deviations: of(&surface.deviation),
    }
}

#[cfg(test)]
mod tests {
    use horma_core::Rays;

    use super::*;

    fn surface(rows: u32, columns: u32) -> Machined {
        let rays = Rays {
            from: 0.25,
            step: 0.5,
            rows,
            columns,
        };
        let deviation = vec![Some(0.001); rays.len()];
        Machined {
            rays,
            designed: vec![Some(20.0); rays.len()],
            machined: vec![Some(20.001); rays.len()],
            deviation,
        }
    }

    #[test]
    fn few_rays_are_cells_as_they_are() {
        let mut surface = surface(40, 360);
        surface.deviation[361] = Some(-0.5);
        surface.designed[5] = None;
        let shown = unrolled(&surface);
        assert_eq!((shown.cells.rows, shown.cells.columns), (40, 360));
        assert_eq!(
            (shown.cells.first, shown.cells.step),
            ([0.25, 0.0], [0.5, 1.0])
        );
        assert_eq!(shown.deviations, surface.deviation);
        assert_eq!(shown.radii, surface.designed);
    }

    #[test]
    fn of_many_rays_the_one_that_strays_most_stays_in_its_place() {
        let mut surface = surface(701, 1000);
        let low = 333 * 1000 + 777;
        surface.deviation[low] = Some(-0.5);
        for ray in 0..10 {
            surface.deviation[ray] = None;
        }
        let shown = unrolled(&surface);
        let Cells {
            rows,
            columns,
            first,
            step,
            rays,
        } = shown.cells;
        assert!(
            rows * columns <= MOST && columns == COLUMNS,
            "{rows} {columns}"
        );
        assert_eq!(rays, 701_000);
        assert!(shown.deviations[1..].iter().all(Option::is_some));
        let at = |d: &Option<f64>| *d == Some(-0.5);
        assert_eq!(shown.deviations.iter().filter(|d| at(d)).count(), 1);
        let at = shown.deviations.iter().position(at).expect("shown") as u32;
        let [x, angle] = surface.rays.position(low);
        let near = |k: usize, cell: u32, value: f64| {
            let off = first[k] + step[k] * f64::from(cell) - value;
            assert!(off.abs() <= 0.5 * step[k], "{off}");
        };
        near(0, at / columns, x);
        near(1, at % columns, angle);
    }
}
