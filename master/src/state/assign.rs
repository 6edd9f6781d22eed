//! Who does what next: idle workers are given what waits, one at a time to the job at which the fewest
//! are, so that a small one is not stuck behind a big one; among such the one whose turn it is, and of it
//! the lowest extent. Who has been faster so far comes first, and holds more rows.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use horma_proto::TaskId;

use super::pace::costs;
use super::{Command, Extent, Held, Rows, State, Status, Step, Worker};

/// Gives what waits to idle workers: rows to be placed first, for others may need them.
pub(super) fn assign(state: &mut State, now: Duration, commands: &mut Vec<Command>) {
    let members = costs(&state.workers);
    let mut idle: BTreeSet<&String> = members
        .keys()
        .filter(|name| state.workers[*name].task.is_none())
        .collect();
    while !idle.is_empty() {
        let next = in_turn(state).into_iter().find_map(|job| {
            let extents = state.jobs.get_mut(&job)?;
            place(job, extents, &state.workers, &members, &mut idle)
                .or_else(|| start(job, extents, &members, &mut idle))
        });
        let Some((step, command)) = next else {
            return;
        };
        if let Command::Place { worker, task } | Command::Start { worker, task, .. } = &command
            && let Some(worker) = state.workers.get_mut(worker)
        {
            worker.take(now, *task, step);
            state.turn += 1;
            state.turns.insert(task.job, state.turn);
        }
        commands.push(command);
    }
}

/// The jobs, those first at which the fewest workers are, and of such those whose last turn is longest ago.
fn in_turn(state: &mut State) -> Vec<u64> {
    state.turns.retain(|job, _| state.jobs.contains_key(job));
    let mut at: BTreeMap<u64, u32> = state.jobs.keys().map(|&job| (job, 0)).collect();
    for (task, _) in state.workers.values().filter_map(|w| w.task) {
        *at.entry(task.job).or_default() += 1;
    }
    let mut jobs: Vec<u64> = state.jobs.keys().copied().collect();
    jobs.sort_by_key(|job| (at[job], state.turns.get(job)));
    jobs
}

/// Places the rows of an extent that waits, or whose rows others need that are not done.
fn place(
    job: u64,
    extents: &mut [Extent],
    workers: &BTreeMap<String, Worker>,
    members: &BTreeMap<String, f64>,
    idle: &mut BTreeSet<&String>,
) -> Option<(Step, Command)> {
    if extents.iter().all(|e| e.rows != Rows::Nowhere) {
        return None;
    }
    let mut load: BTreeMap<&String, u32> = BTreeMap::new();
    for held in extents.iter().filter_map(Extent::held) {
        if let Some((name, _)) = members.get_key_value(&held.worker) {
            *load.entry(name).or_default() += 1;
        }
    }
    // Those who are about to hold some are as good as idle ones: what is theirs is not for slower ones.
    let mut taking = BTreeSet::new();
    for name in members.keys() {
        let places = |(t, step): &(TaskId, Step)| (t.job, *step) == (job, Step::Place);
        if workers[name].task.as_ref().is_some_and(places) {
            *load.entry(name).or_default() += 1;
            taking.insert(name);
        }
    }
    let wanted = wanted(extents);
    for ((number, extent), wanted) in (0u32..).zip(extents).zip(wanted) {
        if !wanted || extent.rows != Rows::Nowhere {
            continue;
        }
        let after = |name: &String| f64::from(1 + load.get(name).copied().unwrap_or_default());
        let may = idle.union(&taking).copied();
        let Some(worker) = choose(extent, members, may, idle, after) else {
            continue;
        };
        if !idle.remove(worker) {
            continue;
        }
        extent.attempts += 1;
        extent.only_placed = true;
        extent.rows = Rows::OnTheWay;
        let task = task(job, number, extent);
        let worker = worker.clone();
        return Some((Step::Place, Command::Place { worker, task }));
    }
    None
}

/// Starts an extent that waits: where its rows are, once all that they need are placed, or with any
/// worker if rows travel with the task.
fn start(
    job: u64,
    extents: &mut [Extent],
    members: &BTreeMap<String, f64>,
    idle: &mut BTreeSet<&String>,
) -> Option<(Step, Command)> {
    for i in 0..extents.len() {
        if extents[i].status != Status::Waiting {
            continue;
        }
        let (worker, rows) = match &extents[i].rows {
            Rows::WithTask => {
                let may = idle.iter().copied();
                match choose(&extents[i], members, may, idle, |_| 1.0) {
                    Some(worker) => (worker.clone(), Vec::new()),
                    None => continue,
                }
            }
            Rows::Held(own) if idle.contains(&own.worker) => match needed(extents, i, own) {
                Some(rows) => (own.worker.clone(), rows),
                None => continue,
            },
            Rows::Nowhere | Rows::OnTheWay | Rows::Held(_) => continue,
        };
        idle.remove(&worker);
        let extent = &mut extents[i];
        if !std::mem::take(&mut extent.only_placed) {
            extent.attempts += 1;
        }
        extent.status = Status::Running;
        let task = task(job, i as u32, extent);
        let start = Command::Start {
            worker,
            task,
            rows,
            helps: None,
        };
        return Some((Step::Digitize, start));
    }
    None
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

/// Whoever would be through first with so much of a load, an idle one if there are several; one that
/// has failed the extent only if every member has.
fn choose<'a>(
    extent: &Extent,
    members: &BTreeMap<String, f64>,
    may: impl Iterator<Item = &'a String>,
    idle: &BTreeSet<&String>,
    load: impl Fn(&String) -> f64,
) -> Option<&'a String> {
    let tried = |name: &String| extent.failed_by.contains(name);
    let anyone = members.keys().all(tried);
    let may = may.filter(|name| anyone || !tried(name));
    let through = |name: &String| load(name) * members[name];
    may.min_by(|a, b| {
        let order = through(a).total_cmp(&through(b));
        order.then(idle.contains(b).cmp(&idle.contains(a)))
    })
}

pub(super) fn task(job: u64, extent: u32, of: &Extent) -> TaskId {
    TaskId {
        job,
        extent,
        attempt: of.attempts,
    }
}

impl Worker {
    /// It is given something to do.
    pub(super) fn take(&mut self, now: Duration, task: TaskId, step: Step) {
        self.task = Some((task, step));
        self.pace.begin(now);
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
