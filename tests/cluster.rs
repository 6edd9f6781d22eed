//! The same job gives the same bytes: in one process with any number of threads, on any number of
//! workers, started by `run` or by hand, however they come by the part, by any method.

use std::collections::BTreeSet;
use std::path::Path;

use crate::common::{
    Process, data, job, master, path_of, report, run, sample, scratch, submission, succeed,
};
use crate::common::{text, texts, worker};
use serde_json::Value;

const LAST_WITHOUT_AXIS: &str = "[cutter]
kind = \"torus\"
major_radius = 40.0
minor_radius = 8.0
[motion]
step = 2.0
points_per_revolution = 36
";

const LAST: &str = "axis = { point = [0, 0, 14], direction = [1, 0, 0] }
[cutter]
kind = \"torus\"
major_radius = 40.0
minor_radius = 8.0
[motion]
step = 2.0
points_per_revolution = 360
";

const DISTRIBUTIONS: [&str; 3] = ["overlap", "halo", "surface"];

/// Any number of workers, however they come by the part, against one process; over points only some, for
/// what is sent does not depend on what the cutter touches.
fn check_workers(job: &Path, distributions: &[&str], counts: &[usize]) {
    check_contact(job, "facet", distributions, counts);
    check_contact(job, "point", distributions, &[3]);
}

fn check_contact(job: &Path, contact: &str, distributions: &[&str], counts: &[usize]) {
    let dir = scratch();
    let contact = ["--contact", contact];
    let alone = path_of(job, dir.path(), "alone", &contact);
    for distribution in distributions {
        for count in counts {
            let name = format!("{distribution}-{count}");
            let workers = count.to_string();
            let args = ["--workers", &workers, "--distribution", distribution];
            let path = path_of(job, dir.path(), &name, &[&args, &contact[..]].concat());
            assert!(path == alone, "{} on {name}, {contact:?}", job.display());
            let report = report(&dir.path().join(&name));
            assert_eq!(report["job"]["cluster"]["distribution"], *distribution);
            let extents = report["extents"].as_array().expect("extents");
            assert_eq!(extents.len(), *count, "each worker had its extent");
            assert_eq!(report["lost"].as_array().map(Vec::len), Some(0));
            check_traffic(distribution, &report);
        }
    }
}

/// What travels is what the distribution promises, by the report.
fn check_traffic(distribution: &str, report: &Value) {
    let extents = report["extents"].as_array().expect("extents");
    let traffic = &report["traffic"];
    let number = |of: &Value, key: &str| of[key].as_u64().expect("a number");
    let sum = |key: &str| extents.iter().map(|e| number(e, key)).sum::<u64>();
    let [needed, sent] = ["rows_needed", "rows_sent"].map(|key| number(traffic, key));
    let [total, halo] = ["rows", "halo_rows"].map(sum);
    assert_eq!(total, needed + halo, "every row has one owner");
    let fetched = number(traffic, "bytes_between_workers");
    // Where there are more workers than cores some are late, and idle ones help them.
    let second = report["second"].as_array().expect("second attempts");
    let again: u64 = second.iter().map(|s| number(s, "rows_sent")).sum();
    match distribution {
        "overlap" => assert_eq!(
            (sent, fetched),
            (total + again, 0),
            "rows travel with their halo"
        ),
        "halo" => {
            assert_eq!(
                sent,
                needed + again,
                "no row is sent twice but to who helps"
            );
            assert!(fetched > 0 || halo == 0 || again > 0, "the halo is fetched");
        }
        _ => assert_eq!((sent, fetched), (0, 0), "surfaces travel, not rows"),
    }
    for e in extents {
        let seconds = |key: &str| e[key].as_f64().expect("a number");
        let phases = ["receive", "make", "halo", "build", "digitize"];
        let phases = phases.map(|phase| seconds(&format!("{phase}_seconds")));
        let all = phases.iter().sum::<f64>();
        assert!(all <= seconds("seconds"), "phases follow each other: {e}");
    }
}

/// Numbers of workers; `table` goes through more of them over fewer positions.
const COUNTS: [usize; 3] = [1, 3, 16];

#[test]
fn the_sample_is_the_same_on_any_number_of_workers() {
    check_workers(&sample(), &DISTRIBUTIONS, &COUNTS);
}

#[test]
fn surfaces_are_the_same_on_any_number_of_workers() {
    let Some(part) = data("last_3surfaces.step") else {
        return;
    };
    let dir = scratch();
    let job = job(dir.path(), "job.toml", &[&part], LAST);
    check_workers(&job, &DISTRIBUTIONS, &[8]);
}

#[test]
fn a_mesh_is_the_same_on_any_number_of_workers() {
    let Some(part) = data("last_scan.stl") else {
        return;
    };
    let dir = scratch();
    let job = job(dir.path(), "job.toml", &[&part], LAST);
    check_workers(&job, &["overlap", "halo"], &[2, 16]);
}

/// Over a grid of more than half a million points the surfaces are next to nothing.
#[test]
fn surfaces_take_less_than_a_hundredth_of_the_bytes_of_their_points() {
    let dir = scratch();
    let part = sample().with_file_name("last.step");
    let more = "[discretization]\ngrid = { rows = 700, columns = 500 }
[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0
[motion]\nstep = 10.0\npoints_per_revolution = 60\n";
    let job = job(dir.path(), "job.toml", &[&part], more);
    let bytes = DISTRIBUTIONS.map(|distribution| {
        let args = ["--workers", "4", "--distribution", distribution];
        let path = path_of(&job, dir.path(), distribution, &args);
        let report = report(&dir.path().join(distribution));
        let points = report["bodies"].as_array().expect("bodies").iter();
        let points: u64 = points.filter_map(|b| b["points"].as_u64()).sum();
        assert!(points >= 500_000, "{points}");
        let traffic = &report["traffic"];
        let bytes = traffic["bytes_to_workers"].as_u64().expect("a number");
        (path, bytes)
    });
    let [(path, overlap), (by_halo, halo), (by_surface, surface)] = bytes;
    assert!(path == by_halo && path == by_surface);
    assert!(halo < overlap, "{halo} {overlap}");
    assert!(100 * surface < overlap, "{surface} {overlap}");
}

/// Packed points are a third of the bytes, and the same everywhere.
#[test]
fn packed_points_are_the_same_on_any_number_of_workers() {
    let (dir, sample) = (scratch(), sample());
    let packed = ["--coordinates", "packed21"];
    // One worker has nobody to help it, so that nothing is sent twice.
    let doubles = path_of(&sample, dir.path(), "doubles", &["--workers", "1"]);
    let bytes = |name: &str| report(&dir.path().join(name))["traffic"]["bytes_to_workers"].as_f64();
    let alone = path_of(&sample, dir.path(), "alone", &packed);
    assert!(alone != doubles);
    for distribution in DISTRIBUTIONS {
        for count in ["1", "5"] {
            let how = ["--workers", count, "--distribution", distribution];
            let name = format!("{distribution}-{count}");
            let path = path_of(&sample, dir.path(), &name, &[&how[..], &packed].concat());
            assert!(path == alone, "{name}");
            check_traffic(distribution, &report(&dir.path().join(name)));
        }
    }
    let share = bytes("overlap-1").zip(bytes("doubles")).map(|(p, d)| p / d);
    assert!(
        share.is_some_and(|s| (0.33..0.36).contains(&s)),
        "{share:?}"
    );
    let report = report(&dir.path().join("alone"));
    for body in report["bodies"].as_array().expect("bodies") {
        let [rounding, deviation] = ["rounding", "deviation"].map(|key| body[key].as_f64());
        let rounding = rounding.expect("a number");
        assert!((4.2e-4..4.3e-4).contains(&rounding), "{rounding}");
        // It is part of what the tolerance allows.
        assert!(
            deviation.is_some_and(|d| d > rounding && d <= 0.01),
            "{deviation:?}"
        );
    }
}

/// Each worker has several extents, and in halo holds the rows of several.
#[test]
fn more_extents_than_workers_are_the_same() {
    let (dir, job) = (scratch(), sample());
    let alone = path_of(&job, dir.path(), "alone", &[]);
    for distribution in DISTRIBUTIONS {
        let how = ["--workers", "3", "--distribution", distribution];
        let each = ["--extents-per-worker", "4"];
        let path = path_of(&job, dir.path(), distribution, &[&how[..], &each].concat());
        assert!(path == alone, "{distribution}");
        let report = report(&dir.path().join(distribution));
        assert_eq!(report["job"]["cluster"]["extents_per_worker"], 4);
        assert_eq!(report["extents"].as_array().map(Vec::len), Some(12));
        check_traffic(distribution, &report);
        let shares = report["extents"].as_array().expect("extents").iter();
        let shares = shares.flat_map(|e| e["shares"].as_array().expect("shares"));
        let workers: BTreeSet<_> = shares.filter_map(|s| s["worker"].as_str()).collect();
        assert_eq!(workers.len(), 3, "everybody had some");
    }
}

#[test]
fn a_mesh_has_no_surfaces_to_send() {
    let dir = scratch();
    let mesh = dir.path().join("mesh.obj");
    std::fs::write(&mesh, "v 0 0 0\nv 10 0 0\nv 0 5 0\nf 1 2 3\n").expect("writable");
    let job = job(dir.path(), "job.toml", &[&mesh], LAST_WITHOUT_AXIS);
    let (master, address) = master(&[]);
    let _worker = worker(&address, "a");
    let out = dir.path().join("out");
    for more in [
        &["run", "--workers", "2"][..],
        &["submit", "--master", &address],
    ] {
        let (command, flags) = more.split_first().expect("a command");
        let mut args = vec![
            *command,
            text(&job),
            "-o",
            text(&out),
            "--distribution",
            "surface",
        ];
        args.extend(flags);
        let refused = run(&args);
        let (_, err) = texts(&refused);
        assert_eq!(refused.status.code(), Some(2), "{err}");
        assert!(
            err.contains("is a mesh") && err.contains("overlap or halo"),
            "{err}"
        );
    }
    drop(master);
}

/// Positions inserted between others, by any number of processes and threads, and through a master.
#[test]
fn what_is_inserted_is_the_same_on_any_number_of_workers() {
    let (dir, sample_job) = (scratch(), sample());
    let base = ["--path-tolerance", "0.005", "--points-per-revolution", "72"];
    for more in [&[][..], &["--contact", "point"]] {
        let given = [&base[..], more].concat();
        let alone = path_of(&sample(), dir.path(), "alone", &given);
        let inserted = |name: &str| report(&dir.path().join(name))["path"]["inserted"].as_u64();
        let expected = inserted("alone");
        assert!(expected > Some(1000), "{expected:?}");
        for count in if more.is_empty() {
            &["1", "2", "5"][..]
        } else {
            &["3"]
        } {
            for distribution in DISTRIBUTIONS {
                let how = ["--workers", count, "--distribution", distribution];
                let path = path_of(&sample(), dir.path(), count, &[&given[..], &how].concat());
                assert!(path == alone, "{more:?} {how:?}");
                assert_eq!(inserted(count), expected);
            }
        }
        let args = [&given[..], &["--threads", "1"]].concat();
        assert!(path_of(&sample(), dir.path(), "thread", &args) == alone);
        let (_master, address) = master(&[]);
        let _worker = worker(&address, "w");
        let out = dir.path().join("submitted");
        let mut submit = vec![
            "submit",
            text(&sample_job),
            "-o",
            text(&out),
            "-q",
            "--no-verify",
        ];
        submit.extend(["--master", &address]);
        submit.extend(&given);
        succeed(&submit);
        assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
    }
    // Extents narrower than the cutter, brute force.
    let coarse = [
        "--step",
        "40",
        "--points-per-revolution",
        "12",
        "--path-tolerance",
        "0.02",
        "--tolerance",
        "0.1",
    ];
    let alone = path_of(&sample(), dir.path(), "coarse", &coarse);
    let others: [&[&str]; 4] = [
        &["--workers", "8"],
        &["--workers", "8", "--distribution", "halo"],
        &["--workers", "8", "--distribution", "surface"],
        &["--method", "brute"],
    ];
    for more in others {
        let other = path_of(
            &sample(),
            dir.path(),
            "coarse",
            &[&coarse[..], more].concat(),
        );
        assert!(other == alone, "{more:?}");
    }
}

/// Every cutter, motion and contact, on extents narrower than the cutter, against brute force.
#[test]
fn every_kind_of_job_is_the_same_by_brute_force_and_on_workers() {
    let cutters = [
        "kind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0",
        "kind = \"ball\"\nradius = 6.0",
        "kind = \"cylinder\"\nradius = 30.0\nwidth = 50.0",
        "kind = \"cone\"\nradius = 30.0\nwidth = 12.0\nhalf_angle = 25.0",
    ];
    let dir = scratch();
    let part = sample().with_file_name("last.step");
    for (i, cutter) in cutters.into_iter().enumerate() {
        for (motion, contact) in [("helix", "facet"), ("rings", "point"), ("rings", "facet")] {
            let more = format!(
                "[discretization]\ngrid = {{ rows = 60, columns = 40 }}\n[cutter]\n{cutter}\n[motion]\nkind = \"{motion}\"\nstep = 15.0\npoints_per_revolution = 37\n[digitizing]\ncontact = \"{contact}\"\n"
            );
            let name = format!("{i}-{motion}-{contact}");
            let job = job(dir.path(), &format!("{name}.toml"), &[&part], &more);
            let alone = path_of(&job, dir.path(), &name, &["--threads", "1"]);
            let brute = ["--method", "brute"];
            let distribution = DISTRIBUTIONS[i % 3];
            let workers = ["--workers", "7", "--distribution", distribution];
            let others: [&[&str]; 3] = [&brute, &["--threads", "2"], &workers];
            for args in others {
                let other = path_of(&job, dir.path(), &name, args);
                assert!(alone == other, "{name} {args:?}");
            }
        }
    }
}

#[test]
fn a_part_of_several_files_is_one_part() {
    let Some(part) = data("last_scan.stl") else {
        return;
    };
    let dir = scratch();
    let sample = sample().with_file_name("last.step");
    let coarse = "[cutter]\nkind = \"ball\"\nradius = 20.0\n[motion]\nstep = 20.0\npoints_per_revolution = 30\n";
    let both = job(dir.path(), "both.toml", &[&part, &sample], coarse);
    let alone = path_of(&both, dir.path(), "alone", &[]);
    assert!(alone == path_of(&both, dir.path(), "three", &["-w", "3"]));
    let bodies = report(&dir.path().join("alone"))["bodies"]
        .as_array()
        .map(Vec::len);
    assert_eq!(bodies, Some(4), "one mesh and three surfaces");
}

#[test]
fn a_cluster_made_by_hand_gives_the_same_bytes() {
    let dir = scratch();
    let alone = path_of(&sample(), dir.path(), "alone", &[]);
    let (_master, address) = master(&[]);
    let _workers = ["a", "b"].map(|id| worker(&address, id));
    for name in ["overlap", "halo", "surface", "halo again"] {
        let distribution = name.split(' ').next().expect("a word");
        let out = dir.path().join(name);
        let sample = sample();
        let submit = submission(&sample, &address, &out);
        succeed(&[&submit[..], &["--distribution", distribution]].concat());
        assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
        let report = report(&out);
        let workers: Vec<_> = report["workers"]
            .as_array()
            .expect("workers")
            .iter()
            .map(|w| w["worker"].as_str().expect("a name"))
            .collect();
        // On a busy machine one helps the other, which may deliver nothing then.
        let second = report["second"].as_array().expect("second attempts");
        let one = !second.is_empty() && (workers == ["a"] || workers == ["b"]);
        assert!(one || workers == ["a", "b"], "{workers:?}");
        check_traffic(distribution, &report);
    }
}

#[test]
fn workers_find_their_master_by_a_file_and_again_when_it_came_back_elsewhere() {
    let dir = scratch();
    let file = dir.path().join("master");
    let start = |id: &str| {
        let args = ["worker", "--rendezvous", text(&file), "--id", id];
        Process::start(id, &args, "info")
    };
    // There before the master is, and waiting for it.
    let mut early = start("early");
    early.wait_for(&["no answer", "No such file"]);
    let (first, address) = master(&["--rendezvous", text(&file)]);
    early.wait_for(&["registered", &address]);
    assert_eq!(
        std::fs::read_to_string(&file).ok(),
        Some(format!("{address}\n"))
    );
    // Killed, it leaves its file behind: the next one, at another port, replaces it.
    drop(first);
    let (second, elsewhere) = master(&["--rendezvous", text(&file)]);
    assert_ne!(address, elsewhere);
    early.wait_for(&["registered", &elsewhere]);
    let sample = job(
        dir.path(),
        "job.toml",
        &[&sample().with_file_name("last.step")],
        LAST_WITHOUT_AXIS,
    );
    let out = dir.path().join("out");
    let submit = [
        "submit",
        text(&sample),
        "--master",
        &elsewhere,
        "-o",
        text(&out),
        "-q",
        "--no-verify",
    ];
    succeed(&submit);
    let path = std::fs::read(out.join("path.csv")).expect("a path");
    assert!(path == path_of(&sample, dir.path(), "alone", &[]));
    // Ended in order, it takes its file away.
    second.signal("-TERM");
    assert_eq!(second.end().0, Some(0));
    assert!(!file.exists());
}

#[test]
fn a_worker_has_one_way_to_its_master_and_waits_for_a_stated_time() {
    let dir = scratch();
    let file = dir.path().join("nowhere");
    let both = [
        "worker",
        "--rendezvous",
        text(&file),
        "--master",
        "127.0.0.1:1",
    ];
    for wrong in [&["worker"][..], &both[..]] {
        assert_eq!(run(wrong).status.code(), Some(2), "{wrong:?}");
    }
    let output = run(&["worker", "--rendezvous", text(&file), "--patience", "0"]);
    assert_eq!(output.status.code(), Some(4));
    assert!(texts(&output).1.contains("nowhere"), "{output:?}");
    // What cannot be right does not get right by waiting.
    std::fs::write(&file, "not an address\n").expect("writable");
    let output = run(&["worker", "--rendezvous", text(&file)]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
}
