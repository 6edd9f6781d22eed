//! What to compute: jobs, positions, how a job is shared and what a search cost.

use horma_core::{
    Contact, Coordinates, Counters, Culling, Cutter, Discretization, Distribution, Job, Local,
    Method, Motion, MotionKind, Sharing, Trajectory, Window,
};

use super::{coordinates_from_wire, missing};
use crate::error::{Error, Result};
use crate::wire;

/// A job for the wire.
pub fn job_to_wire(job: &Job) -> wire::Job {
    use wire::job::{Cutter as C, Discretization as D};
    wire::Job {
        discretization: Some(match job.discretization {
            Discretization::Grid { rows, columns } => D::Grid(wire::Grid { rows, columns }),
            Discretization::Tolerance(t) => D::Tolerance(t),
        }),
        cutter: Some(match job.cutter {
            Cutter::Torus {
                major_radius,
                minor_radius,
            } => C::Torus(wire::Torus {
                major_radius,
                minor_radius,
            }),
            Cutter::Cone {
                radius,
                width,
                half_angle,
                ..
            } => C::Cone(wire::Cone {
                radius,
                width,
                half_angle,
            }),
        }),
        motion: Some(wire::Motion {
            kind: kind_to_wire(job.motion.kind).into(),
            step: job.motion.step,
            points_per_revolution: job.motion.points_per_revolution,
            from: job.motion.from,
            to: job.motion.to,
            path_tolerance: job.motion.path_tolerance,
            lead_in: job.motion.lead[0],
            lead_out: job.motion.lead[1],
        }),
        contact: match job.contact {
            Contact::Point => wire::Contact::Point,
            Contact::Facet => wire::Contact::Facet,
        }
        .into(),
        method: match job.method {
            Method::Exact => wire::Method::Exact,
            Method::Brute => wire::Method::Brute,
            Method::Local(_) => wire::Method::Local,
        }
        .into(),
        local: local_to_wire(job.method),
        packed21: job.coordinates == Coordinates::Packed21,
    }
}

/// A job from the wire.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Core`].
pub fn job_from_wire(job: &wire::Job) -> Result<Job> {
    use wire::job::{Cutter as C, Discretization as D};
    let discretization = match job.discretization {
        Some(D::Grid(wire::Grid { rows, columns })) => Discretization::Grid { rows, columns },
        Some(D::Tolerance(t)) => Discretization::Tolerance(t),
        None => return Err(missing("job", "a discretization")),
    };
    let cutter = match &job.cutter {
        Some(C::Torus(t)) => Cutter::torus(t.major_radius, t.minor_radius)?,
        Some(C::Cone(c)) => Cutter::cone(c.radius, c.width, c.half_angle)?,
        None => return Err(missing("job", "a cutter")),
    };
    let motion = job.motion.as_ref().ok_or(missing("job", "a motion"))?;
    let motion = Motion {
        kind: kind_from_wire(motion.kind())?,
        step: motion.step,
        points_per_revolution: motion.points_per_revolution,
        from: motion.from,
        to: motion.to,
        path_tolerance: motion.path_tolerance,
        lead: [motion.lead_in, motion.lead_out],
    };
    let job = Job {
        discretization,
        coordinates: coordinates_from_wire(job.packed21),
        cutter,
        motion,
        contact: match job.contact() {
            wire::Contact::Point => Contact::Point,
            wire::Contact::Facet => Contact::Facet,
            wire::Contact::Unspecified => return Err(missing("job", "a contact")),
        },
        method: match job.method() {
            wire::Method::Exact => Method::Exact,
            wire::Method::Brute => Method::Brute,
            wire::Method::Local => {
                let local = job.local.ok_or(missing("job", "a window"))?;
                Method::Local(local_from_wire(local))
            }
            wire::Method::Unspecified => return Err(missing("job", "a method")),
        },
    };
    job.validate()?;
    Ok(job)
}

/// The local search, if that is the method. Workers have its fallback in any case.
fn local_to_wire(method: Method) -> Option<wire::Local> {
    let Method::Local(local) = method else {
        return None;
    };
    let window = local.window.unwrap_or(Window::EVERYTHING);
    Some(wire::Local {
        delta_u: window.delta_u,
        delta_v: window.delta_v,
        back_faces: local.culling.back_faces,
        beyond_reach: local.culling.beyond_reach,
    })
}

fn local_from_wire(local: wire::Local) -> Local {
    Local {
        window: Some(Window {
            delta_u: local.delta_u,
            delta_v: local.delta_v,
        }),
        culling: Culling {
            back_faces: local.back_faces,
            beyond_reach: local.beyond_reach,
        },
        fallback: true,
    }
}

/// What searches cost, for the wire.
pub fn counters_to_wire(counters: Counters) -> wire::Counters {
    wire::Counters {
        evaluations: counters.evaluations,
        nodes: counters.nodes,
        lost: counters.lost,
        largest_loss: counters.largest_loss,
        beyond_tolerance: counters.beyond_tolerance,
    }
}

/// What searches cost, from the wire.
///
/// # Errors
/// [`Error::Malformed`] if a loss is no length: no report or journal could give it back.
pub fn counters_from_wire(counters: wire::Counters) -> Result<Counters> {
    let loss = counters.largest_loss;
    if !(0.0..f64::INFINITY).contains(&loss) {
        let why = format!("a largest loss of {loss} mm");
        return Err(Error::Malformed(why));
    }
    Ok(Counters {
        evaluations: counters.evaluations,
        nodes: counters.nodes,
        lost: counters.lost,
        largest_loss: loss,
        beyond_tolerance: counters.beyond_tolerance,
    })
}

fn kind_to_wire(kind: MotionKind) -> wire::MotionKind {
    match kind {
        MotionKind::Helix => wire::MotionKind::Helix,
        MotionKind::Rings => wire::MotionKind::Rings,
    }
}

fn kind_from_wire(kind: wire::MotionKind) -> Result<MotionKind> {
    match kind {
        wire::MotionKind::Helix => Ok(MotionKind::Helix),
        wire::MotionKind::Rings => Ok(MotionKind::Rings),
        wire::MotionKind::Unspecified => Err(missing("motion", "a kind")),
    }
}

/// A trajectory for the wire.
pub fn trajectory_to_wire(t: &Trajectory) -> wire::Trajectory {
    wire::Trajectory {
        kind: kind_to_wire(t.kind).into(),
        from: t.from,
        step: t.step,
        points_per_revolution: t.points_per_revolution,
        positions: t.positions,
    }
}

/// A trajectory from the wire.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Core`].
pub fn trajectory_from_wire(t: Option<&wire::Trajectory>) -> Result<Trajectory> {
    let t = t.ok_or(missing("task", "a trajectory"))?;
    let kind = kind_from_wire(t.kind())?;
    let motion = Motion {
        from: Some(t.from),
        ..Motion::new(kind, t.step, t.points_per_revolution)
    };
    motion.validate()?;
    Ok(Trajectory {
        kind,
        from: t.from,
        step: t.step,
        points_per_revolution: t.points_per_revolution,
        positions: t.positions,
    })
}

/// How a job is shared, for the wire.
pub fn sharing_to_wire(sharing: Sharing) -> wire::Sharing {
    let distribution = match sharing.distribution {
        Distribution::Overlap => wire::Distribution::Overlap,
        Distribution::Halo => wire::Distribution::Halo,
        Distribution::Surface => wire::Distribution::Surface,
    };
    wire::Sharing {
        distribution: distribution.into(),
        extents_per_worker: sharing.extents_per_worker,
    }
}

/// How a job is shared, from the wire.
///
/// # Errors
/// [`Error::Missing`].
pub fn sharing_from_wire(sharing: Option<&wire::Sharing>) -> Result<Sharing> {
    let missing = |field| missing("submission", field);
    let sharing = sharing.ok_or(missing("how it is shared"))?;
    let distribution = match sharing.distribution() {
        wire::Distribution::Overlap => Distribution::Overlap,
        wire::Distribution::Halo => Distribution::Halo,
        wire::Distribution::Surface => Distribution::Surface,
        wire::Distribution::Unspecified => return Err(missing("a distribution")),
    };
    let extents_per_worker = sharing.extents_per_worker;
    if extents_per_worker == 0 {
        return Err(missing("a number of extents for each worker"));
    }
    Ok(Sharing {
        distribution,
        extents_per_worker,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(cutter: Cutter) -> Job {
        Job {
            discretization: Discretization::Grid {
                rows: 159,
                columns: 120,
            },
            cutter,
            motion: Motion {
                to: Some(12.5),
                ..Motion::new(MotionKind::Rings, 2.0, 360)
            },
            coordinates: Coordinates::Double,
            contact: Contact::Facet,
            method: Method::Brute,
        }
    }

    #[test]
    fn jobs_survive_the_wire() {
        for cutter in [
            Cutter::torus(40.0, 8.0),
            Cutter::cylinder(20.0, 6.0),
            Cutter::cone(20.0, 6.0, 30.0),
        ] {
            let mut job = job(cutter.expect("valid"));
            assert_eq!(job_from_wire(&job_to_wire(&job)), Ok(job));
            job.motion.path_tolerance = Some(0.005);
            job.motion.lead = [4.0, 2.5];
            job.coordinates = Coordinates::Packed21;
            job.contact = Contact::Point;
            job.method = Method::Local(Local {
                window: Some(Window {
                    delta_u: 8,
                    delta_v: 20,
                }),
                culling: Culling {
                    back_faces: true,
                    beyond_reach: false,
                },
                fallback: true,
            });
            assert_eq!(job_from_wire(&job_to_wire(&job)), Ok(job));
        }
    }

    #[test]
    fn what_is_impossible_is_refused_on_arrival() {
        let good = job_to_wire(&job(Cutter::ball(5.0).expect("valid")));
        let negative = wire::Torus {
            major_radius: -1.0,
            minor_radius: 1.0,
        };
        let bad = wire::Job {
            cutter: Some(wire::job::Cutter::Torus(negative)),
            ..good
        };
        assert!(matches!(job_from_wire(&bad), Err(Error::Core(_))));
        let mut bad = good;
        if let Some(motion) = &mut bad.motion {
            motion.path_tolerance = Some(f64::NAN);
        }
        assert!(matches!(job_from_wire(&bad), Err(Error::Core(_))));
        let bad = wire::Job { contact: 0, ..good };
        assert!(matches!(job_from_wire(&bad), Err(Error::Missing { .. })));
    }
}
