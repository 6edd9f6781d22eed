//! The store against a map in memory that does the same: after any sequence of calls, and as it would
//! be found if the master were killed after any one of them.

use proptest::prelude::*;

use super::*;

#[derive(Debug, Clone, PartialEq, Default)]
struct Model {
    jobs: BTreeMap<u64, Entry>,
    submissions: BTreeMap<u64, Pieces>,
    journal: BTreeMap<u64, BTreeMap<u32, Pieces>>,
    results: BTreeMap<u64, Pieces>,
    next: u64,
}

#[derive(Debug, Clone)]
enum Call {
    Submit { key: u128, pieces: Pieces },
    Begin { job: u64, digest: u32 },
    Keep { job: u64, extent: u32, piece: Bytes },
    Finish { job: u64, pieces: Pieces },
    End { job: u64 },
    Drop { job: u64 },
    Forget { job: u64 },
}

const AT: Duration = Duration::from_secs(7);

fn entry(key: u128) -> Entry {
    Entry {
        key,
        name: format!("job of {key}"),
        submitted: AT,
        trace: None,
        memory: u64::MAX,
        stage: Stage::Queued,
    }
}

fn bytes() -> impl Strategy<Value = Bytes> {
    prop::collection::vec(any::<u8>(), 0..5000).prop_map(Bytes::from)
}

fn call() -> impl Strategy<Value = Call> {
    let pieces = || prop::collection::vec(bytes(), 0..3);
    let job = 1..6_u64;
    let keys = prop_oneof![Just(u128::MAX), (0..5_u128)];
    prop_oneof![
        (keys, pieces()).prop_map(|(key, pieces)| Call::Submit { key, pieces }),
        (job.clone(), 0..2_u32).prop_map(|(job, digest)| Call::Begin { job, digest }),
        (job.clone(), 0..4_u32, bytes()).prop_map(|(job, extent, piece)| Call::Keep {
            job,
            extent,
            piece
        }),
        (job.clone(), pieces()).prop_map(|(job, pieces)| Call::Finish { job, pieces }),
        job.clone().prop_map(|job| Call::End { job }),
        job.clone().prop_map(|job| Call::Drop { job }),
        job.prop_map(|job| Call::Forget { job }),
    ]
}

fn carry_out(store: &Store, call: &Call) -> Result<()> {
    match call.clone() {
        Call::Submit { key, pieces } => store.submit(&entry(key), &pieces).map(drop),
        Call::Begin { job, digest } => store.begin(job, 3, digest).map(drop),
        Call::Keep { job, extent, piece } => store.keep(job, extent, &[piece]).map(drop),
        Call::Finish { job, pieces } => store.finish(job, AT, &pieces).map(drop),
        Call::End { job } => store.end(job, Stage::Cancelled { at: AT }).map(drop),
        Call::Drop { job } => store.drop_result(job, Gone::Fetched).map(drop),
        Call::Forget { job } => store.forget(job),
    }
}

impl Model {
    fn carry_out(&mut self, call: &Call) {
        let is_open = |job: &u64| self.jobs.get(job).is_some_and(|e| e.stage.is_open());
        match call.clone() {
            Call::Submit { key, pieces } if self.jobs.values().all(|e| e.key != key) => {
                self.next += 1;
                self.jobs.insert(self.next, entry(key));
                self.submissions.insert(self.next, pieces);
            }
            Call::Begin { job, digest } if is_open(&job) => {
                let stage = Stage::Running { workers: 3, digest };
                let entry = self.jobs.get_mut(&job).expect("open");
                if std::mem::replace(&mut entry.stage, stage.clone()) != stage {
                    self.journal.remove(&job);
                }
            }
            Call::Keep { job, extent, piece } if is_open(&job) => {
                let journal = self.journal.entry(job).or_default();
                journal.insert(extent, vec![piece]);
            }
            Call::Finish { job, pieces } if is_open(&job) => {
                let stage = Stage::Done {
                    at: AT,
                    pieces: pieces.len() as u32,
                    bytes: pieces.iter().map(|p| p.len() as u64).sum(),
                };
                self.close(job, stage);
                self.results.insert(job, pieces);
            }
            Call::End { job } if is_open(&job) => self.close(job, Stage::Cancelled { at: AT }),
            Call::Drop { job } if self.results.remove(&job).is_some() => {
                let why = Gone::Fetched;
                self.jobs.get_mut(&job).expect("done").stage = Stage::Gone { at: AT, why };
            }
            Call::Forget { job } if !is_open(&job) => {
                self.jobs.remove(&job);
                self.results.remove(&job);
            }
            _ => {}
        }
    }

    fn close(&mut self, job: u64, stage: Stage) {
        self.jobs.get_mut(&job).expect("open").stage = stage;
        self.submissions.remove(&job);
        self.journal.remove(&job);
    }
}

fn contents(store: &Store) -> Model {
    let jobs = store.jobs().expect("readable");
    let mut all = Model::default();
    for (&job, entry) in &jobs {
        match entry.stage {
            Stage::Queued | Stage::Running { .. } => {
                let submission = store.submission(job).expect("readable");
                all.submissions.insert(job, submission);
                let journal = store.journal(job).expect("readable");
                if !journal.is_empty() {
                    all.journal.insert(job, journal);
                }
            }
            Stage::Done { pieces, .. } => {
                let piece = |i| store.result(job, i).expect("readable").expect("there");
                all.results.insert(job, (0..pieces).map(piece).collect());
                assert_eq!(store.result(job, pieces).expect("readable"), None);
            }
            Stage::Gone { .. } | Stage::Failed { .. } | Stage::Cancelled { .. } => {}
        }
    }
    all.jobs = jobs;
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn what_a_call_did_is_there_after_a_kill(calls in prop::collection::vec(call(), 1..24)) {
        let dir = tempfile::tempdir().expect("a directory");
        let (place, seen) = (dir.path().join("store"), dir.path().join("seen"));
        std::fs::create_dir(&seen).expect("writable");
        let store = Store::open(Some(&place)).expect("new");
        let in_memory = Store::open(None).expect("new");
        let mut model = Model::default();
        for call in calls {
            carry_out(&store, &call).expect("writable");
            carry_out(&in_memory, &call).expect("writable");
            model.carry_out(&call);
            // What a kill leaves is the file as it is now: nobody closes it.
            std::fs::copy(place.join(FILE), seen.join(FILE)).expect("readable");
            let found = contents(&Store::open(Some(&seen)).expect("whole"));
            let next = model.next;
            prop_assert_eq!(Model { next, ..found }, model.clone());
            prop_assert_eq!(Model { next, ..contents(&in_memory) }, model.clone());
        }
    }
}

#[test]
fn a_store_has_one_master_and_one_format() {
    let dir = tempfile::tempdir().expect("a directory");
    let store = Store::open(Some(dir.path())).expect("new");
    let second = Store::open(Some(dir.path())).map(drop);
    let error = second.expect_err("in use").to_string();
    assert!(error.contains("another master uses it"), "{error}");
    let newer = store.change(|t| {
        t.open_table(NUMBERS)?.insert("format", FORMAT + 1)?;
        Ok(())
    });
    newer.expect("writable");
    drop(store);
    let opened = Store::open(Some(dir.path())).map(drop);
    assert!(matches!(opened, Err(Error::StoreFormat { .. })));
}

#[test]
fn a_piece_that_is_not_what_was_put_there_is_found() {
    let store = Store::open(None).expect("new");
    let sent = [Bytes::from_static(b"a part")];
    let (job, _) = store.submit(&entry(1), &sent).expect("writable");
    let damage = store.change(|t| {
        let mut table = t.open_table(SUBMISSIONS)?;
        let mut piece = seal(&sent[0]);
        piece[5] ^= 1;
        table.insert((job, 0), &piece[..])?;
        Ok(())
    });
    damage.expect("writable");
    let found = store.submission(job);
    assert!(matches!(found, Err(Error::StoreDamaged(_))), "{found:?}");
}
