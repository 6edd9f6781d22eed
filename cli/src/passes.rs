//! The passes of a job: what was digitized for each kept out of what holds the part, the roughing in layers,
//! and what each of them cuts.

use std::sync::Arc;

use horma_core::{
    Clearances, Job, Layer, Part, Point, Raised, Solid, ToolPath, Verification, deepest_cut,
    keep_out, layers,
};
use horma_formats::job::{JobFile, Roughing};
use horma_formats::report::Left;

use crate::error::{Error, Result};
use crate::verify;

/// Every pass of a job, in the order in which they are cut.
pub(crate) struct Passes {
    /// The layers of the roughing.
    pub layers: Vec<Layer>,
    /// The finishing pass.
    pub finish: ToolPath,
    /// What each keep-out did to that.
    pub raised: Vec<Raised>,
    /// The most that the finishing pass takes, mm, if that is known.
    pub deepest: Option<f64>,
    /// By how much the part comes out of the stock, mm, and where it does most; it may be negative.
    pub outside: Option<(f64, Point)>,
}

/// Makes the passes of what was digitized: for the roughing, if there is any, and for the finishing pass.
pub(crate) fn passes(file: &JobFile, mut digitized: Vec<ToolPath>) -> Result<Passes> {
    let cutter = &file.job.cutter;
    let kept = |path: ToolPath| keep_out(path, cutter, &file.keep_outs);
    let digitized_finish = digitized.pop().ok_or(Error::Interrupted)?;
    let outside = file
        .stock
        .and_then(|stock| outside(&stock, &digitized_finish));
    let (finish, raised) = kept(digitized_finish);
    let rough = file.roughing.zip(file.stock).zip(digitized.pop());
    let layers = match rough {
        None => Vec::new(),
        Some(((roughing, stock), target)) => {
            layers(&kept(target).0, cutter, &stock, roughing.depth_of_cut)?
        }
    };
    let deepest = match (layers.is_empty(), file.stock) {
        (true, Some(stock)) => Some(deepest_cut(&finish, cutter, &stock)),
        _ => None,
    };
    Ok(Passes {
        layers,
        finish,
        raised,
        deepest,
        outside,
    })
}

impl Passes {
    /// What there is to warn of.
    pub fn warnings(&self, file: &JobFile) -> Vec<String> {
        let mut all = uncut(file, &self.raised);
        if let Some((by, [x, y, z])) = self.outside.filter(|(by, _)| *by > TOUCHING) {
            all.push(format!(
                "the part comes out of the stock by {by:.3} mm at [{x:.3}, {y:.3}, {z:.3}], where there is nothing to cut it from; take a larger [stock]"
            ));
        }
        if file.roughing.is_some() && self.layers.is_empty() {
            let what =
                "there is nothing to rough: the stock is nowhere above the part and its allowance";
            all.push(what.to_owned());
        }
        all
    }
}

/// How far the part is outside of the stock at most, where a path touches it, and where.
fn outside(stock: &Solid, path: &ToolPath) -> Option<(f64, Point)> {
    let contacts = path.waypoints().filter_map(|w| Some(w.touch?.contact));
    let outside = contacts.filter_map(|p| Some((stock.outside(p)?, p)));
    outside.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// What a part may come out of its stock by for rounding's sake, mm.
const TOUCHING: f64 = 1.0e-3;

/// What the keep-outs leave uncut, in words.
fn uncut(file: &JobFile, raised: &[Raised]) -> Vec<String> {
    let all = (1..).zip(file.keep_outs.iter().zip(raised));
    let cutting = all.filter(|(_, (_, raised))| raised.uncut > 0);
    cutting
        .map(|(number, (keep_out, raised))| {
            let [first, last] = raised.travel.unwrap_or_default();
            format!(
                "keep-out {number} ({} to {}) leaves the part uncut at {} positions, travel {first:.3} to {last:.3}: the cutter stays up to {:.3} mm above it",
                keep_out.x.low, keep_out.x.high, raised.uncut, raised.most
            )
        })
        .collect()
}

/// What the roughing leaves, by the clearances of its last layer and of the finishing pass, and the most that
/// the latter takes.
///
/// # Errors
/// [`Error::RoughTooDeep`] if it comes closer to the part than its allowance less the job's `tolerance`.
fn left(
    roughing: &Roughing,
    verified: (&Verification, &Clearances),
    finish: &Clearances,
    tolerance: Option<f64>,
) -> Result<(Option<Left>, Option<f64>)> {
    let (verification, rough) = verified;
    let allowance = roughing.allowance;
    let all = rough.normal.iter().zip(&rough.points);
    let Some((&least, point)) = all.min_by(|a, b| a.0.total_cmp(b.0)) else {
        return Ok((None, None));
    };
    if tolerance.is_some_and(|t| least < allowance - t) {
        let (left, point) = (least, *point);
        return Err(Error::RoughTooDeep {
            left,
            allowance,
            point,
        });
    }
    if let (Some(gouge), Some(tolerance)) = (verification.normal.motion_gouge, tolerance)
        && gouge.depth > tolerance
    {
        return Err(Error::RoughGouge {
            depth: gouge.depth,
            point: gouge.point,
            x: gouge.x,
            angle: gouge.angle,
        });
    }
    let taken = rough.normal.iter().zip(&finish.normal).map(|(r, f)| r - f);
    let left = verification.normal.excess.map(|excess| Left {
        least,
        median: excess.median,
        p99: excess.p99,
        max: excess.max,
    });
    Ok((left, Some(taken.fold(0.0, f64::max))))
}

/// What verifying the passes found.
pub(crate) struct Verified {
    pub finish: (Verification, Clearances),
    /// What the roughing leaves, and the most that the finishing pass takes of it.
    pub roughing: Option<(Option<Left>, Option<f64>)>,
}

/// Verifies the finishing pass and the last layer of the roughing beside the runtime, and refuses one that
/// gouges deeper than the job's tolerance.
pub(crate) async fn verified(
    part: Arc<Part>,
    file: &JobFile,
    passes: &Passes,
    threads: usize,
) -> Result<Verified> {
    let file = file.clone();
    let finish = passes.finish.positions();
    // What none of the layers before goes below.
    let rough = passes.layers.last().map(|layer| layer.path.positions());
    let checking = tokio::task::spawn_blocking(move || {
        let finish = verify::check(&part, &file.job, &finish, None, threads)?;
        let tolerance = verify::tolerance(&file);
        if let Some(tolerance) = tolerance {
            verify::hold(&finish.0, tolerance, file.job.motion.path_tolerance)?;
        }
        let roughing = match file.roughing.zip(rough) {
            None => None,
            Some((roughing, positions)) => {
                let job = Job {
                    motion: roughing.motion,
                    ..file.job
                };
                let (found, rough) = verify::check(&part, &job, &positions, None, threads)?;
                let left = left(&roughing, (&found, &rough), &finish.1, tolerance)?;
                Some(left)
            }
        };
        Ok(Verified { finish, roughing })
    });
    checking.await.unwrap_or(Err(Error::Interrupted))
}
