//! A job as values again, for the report.

use horma_core::{Axis, Cutter, Discretization, Job, Local, Method};
use serde_json::{Value, json};

use super::{CONTACTS, JobFile, KINDS};

impl JobFile {
    /// The job in effect, keyed as a job file is, for the report.
    pub fn echo(&self) -> Value {
        let files: Vec<_> = self.files.iter().map(|f| f.to_string_lossy()).collect();
        let axis = match self.axis {
            Axis::Principal => json!("auto"),
            Axis::Through { point, direction } => json!({ "point": point, "direction": direction }),
        };
        let discretization = match self.job.discretization {
            Discretization::Tolerance(tolerance) => json!({ "tolerance": tolerance }),
            Discretization::Grid { rows, columns } => {
                json!({ "grid": { "rows": rows, "columns": columns } })
            }
        };
        let motion = self.job.motion;
        json!({
            "part": { "files": files, "axis": axis },
            "discretization": discretization,
            "cutter": cutter_echo(&self.job.cutter),
            "motion": {
                "kind": name_of(&KINDS, &motion.kind),
                "step": motion.step,
                "points_per_revolution": motion.points_per_revolution,
                "from": motion.from,
                "to": motion.to,
                "path_tolerance": motion.path_tolerance,
            },
            "digitizing": digitizing_echo(&self.job),
            "cluster": {
                "workers": self.cluster.workers,
                "distribution": self.cluster.sharing.distribution.name(),
                "extents_per_worker": self.cluster.sharing.extents_per_worker,
            },
            "program": { "feed": self.program.feed, "clearance": self.program.clearance },
        })
    }
}

fn digitizing_echo(job: &Job) -> Value {
    let contact = name_of(&CONTACTS, &job.contact);
    match job.method {
        Method::Exact => json!({ "contact": contact, "method": "exact" }),
        Method::Brute => json!({ "contact": contact, "method": "brute" }),
        Method::Local(Local {
            window,
            culling,
            fallback,
        }) => json!({
            "contact": contact,
            "method": "local",
            "delta_u": window.map(|w| w.delta_u),
            "delta_v": window.map(|w| w.delta_v),
            "back_face_culling": culling.back_faces,
            "area_of_influence": culling.beyond_reach,
            "fallback": fallback,
        }),
    }
}

/// By the name of the most special wheel that it is.
fn cutter_echo(cutter: &Cutter) -> Value {
    match *cutter {
        Cutter::Torus {
            major_radius: 0.0,
            minor_radius: radius,
        } => json!({ "kind": "ball", "radius": radius }),
        Cutter::Torus {
            major_radius,
            minor_radius,
        } => {
            json!({ "kind": "torus", "major_radius": major_radius, "minor_radius": minor_radius })
        }
        Cutter::Cone {
            radius,
            width,
            half_angle: 0.0,
            ..
        } => json!({ "kind": "cylinder", "radius": radius, "width": width }),
        Cutter::Cone {
            radius,
            width,
            half_angle,
            ..
        } => {
            json!({ "kind": "cone", "radius": radius, "width": width, "half_angle": half_angle })
        }
    }
}

fn name_of<T: PartialEq>(known: &[(&'static str, T)], value: &T) -> &'static str {
    let named = known.iter().find(|(_, v)| v == value);
    named.map_or("", |(name, _)| name)
}
