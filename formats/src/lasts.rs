//! What is told of a last: its measures as designed and as machined, and between which landmarks.

pub mod figure;

use std::collections::BTreeMap;

use horma_core::{Frame, Landmark, Measures, Point, Scale, Shaped};
use serde::{Deserialize, Serialize};

/// What the trade allows a machined last to be off, mm.
pub const ALLOWED: f64 = 0.1;

/// A last in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lasts {
    /// How much larger than the base it is.
    pub scale: Scale,
    /// Where its landmarks are, in part coordinates, mm.
    pub landmarks: BTreeMap<String, Point>,
    /// As designed, mm.
    pub designed: Measures,
    /// As the path leaves it; nothing if that was not looked at.
    pub machined: Option<AsMachined>,
}

/// A machined last in figures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AsMachined {
    /// Its measures, mm.
    pub measures: Measures,
    /// Machined less designed, mm.
    pub difference: Measures,
    /// The difference that is largest, mm.
    pub largest: f64,
    /// Whether none is beyond what the trade allows.
    pub within_allowed: bool,
    /// Share of the last of which it is known how it is machined; the rest, at holders and in undercuts,
    /// is taken as designed.
    pub known: f64,
}

impl Lasts {
    /// Of a last, and of what is machined of it if that is known.
    pub fn of(shaped: &Shaped, frame: &Frame, machined: Option<(Measures, f64)>) -> Self {
        let landmarks = Landmark::ALL.map(|landmark| {
            let place = frame.outward(shaped.landmarks.get(landmark));
            (landmark.name().to_owned(), place)
        });
        Self {
            scale: shaped.scale,
            landmarks: landmarks.into_iter().collect(),
            designed: shaped.measures,
            machined: machined.map(|(measures, known)| {
                let difference = measures.less(&shaped.measures);
                let all = difference.named().map(|(_, d)| d);
                let largest = all
                    .into_iter()
                    .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
                AsMachined {
                    measures,
                    difference,
                    largest,
                    within_allowed: largest.abs() <= ALLOWED,
                    known,
                }
            }),
        }
    }

    /// In words: a line for each measure, then one for each landmark.
    pub fn describe(&self) -> String {
        let mut lines = Vec::new();
        for (k, (name, designed)) in self.designed.named().into_iter().enumerate() {
            let name = name.replace('_', " ");
            lines.push(match &self.machined {
                None => format!("{name:<20} {designed:>9.3} mm"),
                Some(machined) => {
                    let [measure, off] =
                        [&machined.measures, &machined.difference].map(|m| m.named()[k].1);
                    format!("{name:<20} {designed:>9.3} mm, machined {measure:>9.3}, {off:>+7.3}")
                }
            });
        }
        lines.push("landmarks, in part coordinates:".to_owned());
        for (name, [x, y, z]) in &self.landmarks {
            let name = name.replace('_', " ");
            lines.push(format!("{name:<20} {x:>9.3} {y:>9.3} {z:>9.3}"));
        }
        if let Some(machined) = &self.machined {
            let verdict = if machined.within_allowed {
                "within"
            } else {
                "beyond"
            };
            lines.push(format!(
                "{verdict} the {ALLOWED} mm that are allowed: largest difference {:+.3} mm; {:.1} % of the last \
                 seen as machined",
                machined.largest,
                100.0 * machined.known
            ));
        }
        lines.join("\n")
    }
}
