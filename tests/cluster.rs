//! The same job gives the same bytes: in one process with any number of threads, on any number of
//! workers, started by `run` or by hand, by any method.

mod common;

use common::{data, job, master, path_of, report, sample, scratch, succeed, text, worker};

const LAST: &str = "axis = { point = [0, 0, 14], direction = [1, 0, 0] }
[cutter]
kind = \"torus\"
major_radius = 40.0
minor_radius = 8.0
[motion]
step = 2.0
points_per_revolution = 360
";

/// Any number of workers, against one process.
fn check_workers(job: &std::path::Path) {
    let dir = scratch();
    let alone = path_of(job, dir.path(), "alone", &[]);
    for count in [1, 2, 3, 5, 8] {
        let name = format!("{count}");
        let path = path_of(job, dir.path(), &name, &["--workers", &name]);
        assert!(path == alone, "{} on {count} workers", job.display());
        let report = report(&dir.path().join(&name));
        let extents = report["extents"].as_array().expect("extents");
        assert_eq!(extents.len(), count, "each worker had its extent");
        assert_eq!(report["lost"].as_array().map(Vec::len), Some(0));
    }
}

#[test]
fn the_sample_is_the_same_on_any_number_of_workers() {
    check_workers(&sample());
}

#[test]
fn surfaces_are_the_same_on_any_number_of_workers() {
    let Some(part) = data("last_3surfaces.step") else {
        return;
    };
    let dir = scratch();
    check_workers(&job(dir.path(), "job.toml", &[&part], LAST));
}

#[test]
fn a_mesh_is_the_same_on_any_number_of_workers() {
    let Some(part) = data("last_scan.stl") else {
        return;
    };
    let dir = scratch();
    check_workers(&job(dir.path(), "job.toml", &[&part], LAST));
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
        for count in ["1", "2", "3", "5"] {
            let args = [&given[..], &["--workers", count]].concat();
            let path = path_of(&sample(), dir.path(), count, &args);
            assert!(path == alone, "{more:?} on {count} workers");
            assert_eq!(inserted(count), expected);
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
    // Extents narrower than the cutter, rings, brute force.
    let coarse = [
        "--step",
        "40",
        "--points-per-revolution",
        "12",
        "--path-tolerance",
        "0.02",
    ];
    let alone = path_of(&sample(), dir.path(), "coarse", &coarse);
    let others: [&[&str]; 2] = [&["--workers", "8"], &["--method", "brute"]];
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
            let others: [&[&str]; 3] = [&brute, &["--threads", "2"], &["--workers", "7"]];
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
    for name in ["first", "second"] {
        let out = dir.path().join(name);
        let sample = sample();
        succeed(&[
            "submit",
            text(&sample),
            "--master",
            &address,
            "-o",
            text(&out),
            "-q",
        ]);
        assert!(std::fs::read(out.join("path.csv")).expect("a path") == alone);
        let report = report(&out);
        let workers: Vec<_> = report["workers"]
            .as_array()
            .expect("workers")
            .iter()
            .map(|w| w["worker"].as_str().expect("a name"))
            .collect();
        assert_eq!(workers, ["a", "b"]);
    }
}
