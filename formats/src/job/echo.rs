//! A job as values again, for the report.

use horma_core::{Axis, Cutter, Discretization, Job, Local, MachineAxis, Method};
use serde_json::{Map, Value, json};

use super::digitizing::CONTACTS;
use super::discretization::COORDINATES;
use super::machine::{LIMITS, Machine};
use super::motion::KINDS;
use super::part::TRIMMED;
use super::program::{ANGLES, FEED_MODES, POINTS, UNITS};
use super::{JobFile, last, passes};
use crate::post::{Program, Split};

impl JobFile {
    /// The job in effect, keyed as a job file is, for the report.
    pub fn echo(&self) -> Value {
        let files: Vec<_> = self.files.iter().map(|f| f.to_string_lossy()).collect();
        let axis = match self.axis {
            Axis::Principal => json!("auto"),
            Axis::Through { point, direction } => json!({ "point": point, "direction": direction }),
        };
        let mut discretization = match self.job.discretization {
            Discretization::Tolerance(tolerance) => json!({ "tolerance": tolerance }),
            Discretization::Grid { rows, columns } => {
                json!({ "grid": { "rows": rows, "columns": columns } })
            }
        };
        discretization["coordinates"] = json!(name_of(&COORDINATES, &self.job.coordinates));
        let motion = self.job.motion;
        let mut echo = json!({
            "part": {
                "files": files,
                "axis": axis,
                "trimmed": name_of(&TRIMMED, &self.reading.trimmed),
            },
            "discretization": discretization,
            "cutter": cutter_echo(&self.job.cutter),
            "motion": {
                "kind": name_of(&KINDS, &motion.kind),
                "step": motion.step,
                "points_per_revolution": motion.points_per_revolution,
                "from": motion.from,
                "to": motion.to,
                "lead_in": motion.lead[0],
                "lead_out": motion.lead[1],
                "path_tolerance": motion.path_tolerance,
            },
            "digitizing": digitizing_echo(&self.job),
            "cluster": {
                "workers": self.cluster.workers,
                "distribution": self.cluster.sharing.distribution.name(),
                "extents_per_worker": self.cluster.sharing.extents_per_worker,
            },
            "program": program_echo(&self.program),
            "machine": machine_echo(&self.machine),
            "output": { "also": self.also.iter().map(|a| a.name()).collect::<Vec<_>>() },
        });
        if let Some(unit) = &self.reading.unit {
            echo["part"]["units"] = json!(unit.name);
        }
        for (section, said) in passes::echo(self) {
            echo[section] = said;
        }
        for (section, said) in self.last.iter().flat_map(last::echo) {
            if !said.is_null() {
                echo[section] = said;
            }
        }
        echo
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

fn program_echo(program: &Program) -> Value {
    let [travel, attack, rotation] = program
        .words
        .map(|w| format!("{}{}", if w.negative { "-" } else { "" }, w.letter));
    let decimals = program.decimals;
    json!({
        "dialect": program.control.dialect().name,
        "travel": travel,
        "attack": attack,
        "rotation": rotation,
        "units": name_of(&UNITS, &program.units),
        "point": name_of(&POINTS, &program.point),
        "decimals": { "travel": decimals[0], "attack": decimals[1], "rotation": decimals[2] },
        "angles": name_of(&ANGLES, &program.angles),
        "feed_mode": name_of(&FEED_MODES, &program.feed_mode),
        "split": program.split.map(|split| match split {
            Split::Bytes(most) => json!({ "bytes": most }),
            Split::Moves(most) => json!({ "moves": most }),
        }),
        "block_numbers": program.block_numbers,
        "apt": program.apt,
        "feed": program.feed,
        "clearance": program.clearance,
    })
}

/// What is known of the machine, and nothing of what is not.
fn machine_echo(machine: &Machine) -> Value {
    let mut echo = Map::new();
    for axis in MachineAxis::ALL {
        let limits = LIMITS.into_iter().zip(machine.axes[axis as usize]);
        let limits = limits.filter_map(|(key, value)| Some((key, json!(value?))));
        let range = machine.ranges.get(axis as usize).cloned().flatten();
        let range = range.map(|r| ("range", json!([r.start(), r.end()])));
        let all = limits
            .chain(range)
            .map(|(key, value)| (key.to_owned(), value));
        let all: Map<String, Value> = all.collect();
        if !all.is_empty() {
            echo.insert(axis.name().to_owned(), all.into());
        }
    }
    if let Some(turns) = machine.turns {
        echo.insert("turns".to_owned(), json!(turns));
    }
    echo.into()
}

pub(super) fn name_of<T: PartialEq>(known: &[(&'static str, T)], value: &T) -> &'static str {
    let named = known.iter().find(|(_, v)| v == value);
    named.map_or("", |(name, _)| name)
}
