//! Who does what next: idle workers are given what waits, oldest job first, lowest extent first.

use std::collections::{BTreeMap, BTreeSet};

use horma_proto::TaskId;

use super::{Command, Extent, Held, Rows, State, Status, Step};

/// Gives what waits to idle workers: rows to be placed first, for others may need them.
pub(super) fn assign(state: &mut State, commands: &mut Vec<Command>) {
    let members: Vec<String> = state.workers.keys().cloned().collect();
    let mut idle: BTreeSet<&String> = members
        .iter()
        .filter(|name| state.workers[*name].task.is_none())
        .collect();
    for (&job, extents) in &mut state.jobs {
        if idle.is_empty() {
            return;
        }
        let mut given = place(job, extents, &members, &mut idle);
        given.extend(start(job, extents, &members, &mut idle));
        for (step, command) in given {
            if let Command::Place { worker, task } | Command::Start { worker, task, .. } = &command
                && let Some(worker) = state.workers.get_mut(worker)
            {
                worker.task = Some((*task, step));
            }
            commands.push(command);
        }
    }
}

/// Places the rows of extents that wait, or whose rows others need that are not done.
fn place(
    job: u64,
    extents: &mut [Extent],
    members: &[String],
    idle: &mut BTreeSet<&String>,
) -> Vec<(Step, Command)> {
    if extents.iter().all(|e| e.rows != Rows::Nowhere) {
        return Vec::new();
    }
    let mut load: BTreeMap<String, u32> = BTreeMap::new();
    for held in extents.iter().filter_map(Extent::held) {
        *load.entry(held.worker.clone()).or_default() += 1;
    }
    let wanted = wanted(extents);
    let mut given = Vec::new();
    for ((number, extent), wanted) in (0u32..).zip(extents).zip(wanted) {
        if !wanted || extent.rows != Rows::Nowhere {
            continue;
        }
        let held_by = |name: &String| load.get(name).copied().unwrap_or_default();
        let Some(worker) = choose(extent, members, idle, held_by) else {
            continue;
        };
        *load.entry(worker.clone()).or_default() += 1;
        extent.attempts += 1;
        extent.only_placed = true;
        extent.rows = Rows::OnTheWay;
        let task = task(job, number, extent);
        given.push((Step::Place, Command::Place { worker, task }));
    }
    given
}

/// Starts extents that wait: where their rows are, once all that they need are placed, or with any
/// worker if rows travel with the task.
fn start(
    job: u64,
    extents: &mut [Extent],
    members: &[String],
    idle: &mut BTreeSet<&String>,
) -> Vec<(Step, Command)> {
    let mut given = Vec::new();
    for i in 0..extents.len() {
        if idle.is_empty() {
            break;
        }
        if extents[i].status != Status::Waiting {
            continue;
        }
        let (worker, rows) = match &extents[i].rows {
            Rows::WithTask => match choose(&extents[i], members, idle, |_| 0) {
                Some(worker) => (worker, Vec::new()),
                None => continue,
            },
            Rows::Held(own) if idle.contains(&own.worker) => match needed(extents, i, own) {
                Some(rows) => {
                    let worker = own.worker.clone();
                    idle.remove(&worker);
                    (worker, rows)
                }
                None => continue,
            },
            Rows::Nowhere | Rows::OnTheWay | Rows::Held(_) => continue,
        };
        let extent = &mut extents[i];
        if !std::mem::take(&mut extent.only_placed) {
            extent.attempts += 1;
        }
        extent.status = Status::Running;
        let task = task(job, i as u32, extent);
        given.push((Step::Digitize, Command::Start { worker, task, rows }));
    }
    given
}

/// Which extents' rows somebody is still going to need.
pub(super) fn wanted(extents: &[Extent]) -> Vec<bool> {
    let mut wanted: Vec<bool> = extents.iter().map(|e| e.status != Status::Done).collect();
    for extent in extents.iter().filter(|e| e.status != Status::Done) {
        for &other in &extent.halo {
            wanted[other as usize] = true;
        }
    }
    wanted
}

/// Who holds what an extent needs, its own rows first, if all of them are held.
pub(super) fn needed(extents: &[Extent], of: usize, own: &Held) -> Option<Vec<Held>> {
    let halo = extents[of].halo.iter();
    let halo = halo.map(|&other| extents[other as usize].held());
    let all = std::iter::once(Some(own)).chain(halo);
    all.map(Option::<&Held>::cloned).collect()
}

/// Takes the idle worker with the least load, and one that has failed the extent only if every member
/// has.
fn choose(
    extent: &Extent,
    members: &[String],
    idle: &mut BTreeSet<&String>,
    load: impl Fn(&String) -> u32,
) -> Option<String> {
    let tried = |name: &String| extent.failed_by.contains(name);
    let anyone = members.iter().all(tried);
    let may = idle.iter().copied().filter(|name| anyone || !tried(name));
    let chosen = may.min_by_key(|name| load(name))?;
    idle.remove(chosen);
    Some(chosen.clone())
}

fn task(job: u64, extent: u32, of: &Extent) -> TaskId {
    TaskId {
        job,
        extent,
        attempt: of.attempts,
    }
}

impl Extent {
    /// An extent whose rows are to be placed before it is digitized, and which needs those of others.
    pub(super) fn to_be_placed(halo: Vec<u32>) -> Self {
        Self {
            rows: Rows::Nowhere,
            halo,
            ..Self::default()
        }
    }
}
