//! The command as its user meets it: what it answers to bad input, and with which exit code.

use std::path::{Path, PathBuf};

use crate::common::{job, master, report, run, sample, scratch, succeed, text, texts};

const GOOD: &str =
    "[cutter]\nkind = \"ball\"\nradius = 8.0\n[motion]\nstep = 20.0\npoints_per_revolution = 12\n";

/// The papers' way: a grid of points, here a coarse one.
const GRID: &str = "[discretization]\ngrid = { rows = 60, columns = 40 }\n\
    [digitizing]\ncontact = \"point\"\n\
    [cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0\n\
    [motion]\nstep = 5.0\npoints_per_revolution = 36\n";

/// The command fails with this exit code, one message that has all of these words, and nothing on
/// standard output.
fn check(args: &[&str], code: i32, words: &[&str]) {
    let output = run(args);
    let (out, err) = texts(&output);
    assert_eq!(
        output.status.code(),
        Some(code),
        "horma {args:?}\n{out}{err}"
    );
    assert_eq!(out, "", "horma {args:?}");
    assert_eq!(err.matches("horma: ").count(), 1, "one message: {err}");
    assert!(!err.contains("panicked"), "{err}");
    for word in words {
        assert!(err.contains(word), "{word:?} is not in: {err}");
    }
}

/// A run of a job fails, and leaves no result behind.
fn check_job(dir: &Path, job: &Path, code: i32, words: &[&str]) {
    let out = dir.join("out");
    check(&["run", text(job), "-o", text(&out), "-q"], code, words);
    let left = std::fs::read_dir(&out).map_or(0, Iterator::count);
    assert_eq!(left, 0, "something is left in the output directory");
}

fn file(dir: &Path, name: &str, content: &[u8]) -> PathBuf {
    let path = dir.join(name);
    std::fs::write(&path, content).expect("writable");
    path
}

#[test]
fn bad_parts_are_refused() {
    let dir = scratch();
    let dir = dir.path();
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 nan\nvertex 0 1 0\nendloop\nendfacet\n";
    let mut lying = vec![0; 84];
    lying[80..84].copy_from_slice(&1000u32.to_le_bytes());
    lying.extend([0; 50]);
    let mut infinite = vec![0; 134];
    infinite[80] = 1;
    infinite[96..100].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let plain_step = "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));\nENDSEC;\nDATA;\n#1=CARTESIAN_POINT('',(0.,0.,0.));\nENDSEC;\nEND-ISO-10303-21;\n";
    let not_a_number = format!("solid\n{facet}endsolid\n");
    let cases: [(&str, &[u8], &[&str]); 9] = [
        ("truncated.stl", &[0; 40], &["truncated.stl", "84"]),
        ("lying.stl", &lying, &["lying.stl", "1000 triangles"]),
        ("nan.stl", not_a_number.as_bytes(), &["nan.stl", "NaN"]),
        ("infinite.stl", &infinite, &["infinite.stl", "inf"]),
        ("empty.stl", &[0; 84], &["empty.stl"]),
        ("empty.obj", b"", &["empty.obj", "empty"]),
        ("far.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 9\n", &["far.obj", "3"]),
        (
            "plain.step",
            plain_step.as_bytes(),
            &["plain.step", "no surface"],
        ),
        ("part.iges", b"x", &["part.iges", "column 73"]),
    ];
    for (name, content, words) in cases {
        let part = file(dir, name, content);
        check_job(dir, &job(dir, "job.toml", &[&part], GOOD), 2, words);
        check(&["inspect", text(&part)], 2, words);
    }
    let missing = dir.join("missing.stl");
    check_job(
        dir,
        &job(dir, "job.toml", &[&missing], GOOD),
        2,
        &["missing.stl"],
    );
    check_job(dir, &job(dir, "job.toml", &[dir], GOOD), 2, &["folder"]);
    check_job(dir, &job(dir, "job.toml", &[], GOOD), 2, &[]);
}

#[test]
fn bad_jobs_are_refused_with_their_place() {
    let dir = scratch();
    let dir = dir.path();
    let part = sample().with_file_name("last.step");
    let cases: [(&str, &str, &[&str]); 12] = [
        (
            "radius = 8.0",
            "raduis = 8.0",
            &["job.toml", "raduis", "radius"],
        ),
        ("radius = 8.0", "radius = \"8\"", &["job.toml", "radius"]),
        (
            "radius = 8.0",
            "radius = -8.0",
            &["radius", "-8", "greater than 0"],
        ),
        ("radius = 8.0", "radius = nan", &["radius"]),
        ("\"ball\"", "\"spoon\"", &["spoon", "torus"]),
        (
            "kind = \"ball\"\nradius = 8.0",
            "kind = \"cone\"\nradius = 5.0\nwidth = 20.0\nhalf_angle = 45.0",
            &["half_angle", "45"],
        ),
        (
            "points_per_revolution = 12",
            "points_per_revolution = 0",
            &["points_per_revolution", "from 1 to 1000000"],
        ),
        ("step = 20.0", "step = 0", &["step", "at least 0.000001"]),
        (
            "step = 20.0",
            "step = 20.0\nfrom = 5\nto = 1",
            &["from 5 to 1"],
        ),
        (
            "[motion]",
            "[discretization]\ntolerance = 0\n[motion]",
            &["tolerance", "0"],
        ),
        (
            "[motion]",
            "[digitizing]\nmethod = \"guess\"\n[motion]",
            &["guess", "exact"],
        ),
        ("[motion]", "[[motion]", &["job.toml"]),
    ];
    for (good, bad, words) in cases {
        let job = job(dir, "job.toml", &[&part], &GOOD.replace(good, bad));
        check_job(dir, &job, 2, words);
    }
    check_job(dir, &dir.join("nowhere.toml"), 2, &["nowhere.toml"]);
    let good = job(dir, "job.toml", &[&part], GOOD);
    let out = dir.join("out");
    let flag = ["run", text(&good), "-o", text(&out), "--step", "0"];
    check(&flag, 2, &["--step", "at least 0.000001"]);
}

#[test]
fn jobs_that_cannot_be_done_are_refused_before_they_are_tried() {
    let dir = scratch();
    let dir = dir.path();
    let part = sample().with_file_name("last.step");
    let cases: [(&str, &str, &[&str]); 4] = [
        (
            "step = 20.0",
            "step = 1e-6",
            &["positions", "GB", "larger step"],
        ),
        (
            "points_per_revolution = 12",
            "points_per_revolution = 1000000\nto = 900000.0",
            &["positions", "GB"],
        ),
        (
            "[motion]",
            "[discretization]\ngrid = { rows = 1000000, columns = 1000000 }\n[motion]",
            &["points", "GB"],
        ),
        (
            "[motion]",
            "[discretization]\ngrid = { rows = 4000000000, columns = 2 }\n[motion]",
            &["4000000000"],
        ),
    ];
    for (good, bad, words) in cases {
        check_job(
            dir,
            &job(dir, "job.toml", &[&part], &GOOD.replace(good, bad)),
            3,
            words,
        );
    }
    // Beside the part there is nothing to touch, and so nothing to cut.
    let beside = GOOD.replace("step = 20.0", "step = 20.0\nfrom = 5000\nto = 5100");
    check_job(
        dir,
        &job(dir, "job.toml", &[&part], &beside),
        3,
        &["never touches"],
    );
}

#[test]
fn output_directories_that_are_not_ours_are_left_alone() {
    let dir = scratch();
    let dir = dir.path();
    let job = job(
        dir,
        "job.toml",
        &[&sample().with_file_name("last.step")],
        GOOD,
    );
    let theirs = dir.join("theirs");
    std::fs::create_dir(&theirs).expect("writable");
    file(&theirs, "thesis.txt", b"years of work");
    for (out, words) in [
        (theirs.clone(), ["theirs", "thesis.txt"]),
        (file(dir, "a file", b""), ["a file", "not a directory"]),
        (dir.join("a file/below"), ["a file", "below"]),
        (PathBuf::from("/proc/nowhere"), ["/proc/nowhere", ""]),
    ] {
        check(&["run", text(&job), "-o", text(&out), "-q"], 2, &words);
    }
    assert_eq!(std::fs::read_dir(&theirs).expect("there").count(), 1);
}

#[test]
fn addresses_that_cannot_be_used_are_named() {
    let (_master, address) = master(&[]);
    check(
        &["master", "--bind", &address],
        2,
        &["cannot listen", &address],
    );
    check(&["master", "--bind", "0.0.0.0:0"], 2, &["--insecure"]);
    let port = address.rsplit(':').next().expect("a port");
    check(
        &["worker", "--master", &address, "--bind", &address],
        2,
        &["cannot listen", port],
    );

    // A port that was free a moment ago has no master.
    let free = std::net::TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr());
    let nobody = free.expect("a port").to_string();
    let dir = scratch();
    let out = dir.path().join("out");
    let sample = sample();
    let submit = [
        "submit",
        text(&sample),
        "-o",
        text(&out),
        "-q",
        "--master",
        &nobody,
    ];
    check(&submit, 4, &["no master answers", &nobody]);
    let worker = [
        "worker",
        "--master",
        &nobody,
        "--bind",
        "127.0.0.1:0",
        "--patience",
        "0",
    ];
    let output = run(&worker);
    assert_eq!(output.status.code(), Some(4));
    assert!(
        texts(&output).1.contains("no master answered"),
        "{output:?}"
    );
    check(
        &[
            "submit",
            text(&sample),
            "-o",
            text(&out),
            "-q",
            "--master",
            "no port",
        ],
        2,
        &["host:port"],
    );
}

#[test]
fn the_sample_is_written_runs_and_is_not_overwritten() {
    let dir = scratch();
    let demo = dir.path().join("demo");
    let said = succeed(&["init", text(&demo)]);
    let job = demo.join("job.toml");
    assert!(said.contains(&format!("horma run {}", job.display())));
    for name in ["job.toml", "last.step"] {
        let ours = std::fs::read(demo.join(name)).expect("written");
        assert!(ours == std::fs::read(sample().with_file_name(name)).expect("committed"));
    }
    check(&["init", text(&demo)], 2, &["demo", "exists already"]);

    let out = dir.path().join("out");
    let output = run(&["run", text(&job), "-o", text(&out), "--step", "10"]);
    let (said, progress) = texts(&output);
    assert!(output.status.success(), "{progress}");
    for name in [
        "path.csv",
        "path.ngc",
        "report.json",
        "report.html",
        "preview.png",
    ] {
        assert!(
            said.contains(name) && out.join(name).exists(),
            "{name}: {said}"
        );
    }
    for phase in [
        "read",
        "discretize",
        "digitize",
        "stitch",
        "verify",
        "write",
    ] {
        assert!(progress.contains(phase), "{phase}: {progress}");
    }
    assert!(
        said.contains("deepest gouge") && said.contains("scallop"),
        "{said}"
    );
    let report = report(&out);
    assert_eq!(report["bodies"].as_array().map(Vec::len), Some(3));
    assert_eq!(report["job"]["motion"]["step"], 10.0);
    let positions = report["path"]["positions"].as_u64().expect("positions");
    let csv = std::fs::read_to_string(out.join("path.csv")).expect("a path");
    assert_eq!(csv.lines().count() as u64, positions + 1);
    // The same directory takes the next run; quiet means quiet.
    let quiet = run(&[
        "run",
        text(&job),
        "-o",
        text(&out),
        "--step",
        "10",
        "--quiet",
    ]);
    assert_eq!(texts(&quiet), (String::new(), String::new()));
}

#[test]
fn variables_lie_between_flags_and_file() {
    let dir = scratch();
    let job = job(
        dir.path(),
        "job.toml",
        &[&sample().with_file_name("last.step")],
        GOOD,
    );
    let out = dir.path().join("out");
    let step_with = |flags: &[&str]| {
        let mut command = crate::common::horma();
        command
            .args(["run", text(&job), "-o", text(&out), "-q"])
            .args(flags);
        let output = command.env("HORMA_STEP", "30").output().expect("starts");
        assert!(output.status.success(), "{output:?}");
        report(&out)["job"]["motion"]["step"].as_f64()
    };
    assert_eq!(step_with(&[]), Some(30.0));
    assert_eq!(step_with(&["--step", "40"]), Some(40.0));
}

#[test]
fn a_path_is_held_against_the_designed_surface() {
    let dir = scratch();
    let part = sample().with_file_name("last.step");
    let job = job(dir.path(), "job.toml", &[&part], GOOD);
    let out = dir.path().join("out");
    let coarse = ["--points-per-revolution", "90", "--tolerance", "0.05"];
    let run_with = |more: &[&str]| {
        let mut all = vec!["run", text(&job), "-o", text(&out), "-q"];
        all.extend(coarse);
        all.extend(more);
        run(&all)
    };
    // Facets hold the tolerance, points sink between each other and do not.
    assert!(run_with(&[]).status.success());
    let depth = |report: &serde_json::Value| report["normal"]["gouge"]["depth"].as_f64();
    let verification = &report(&out)["verification"];
    assert!(
        depth(verification).is_none_or(|d| d <= 0.05),
        "{verification}"
    );
    assert!(verification["normal"]["motion_gouge"]["depth"].as_f64() > Some(0.0));
    let points = run_with(&["--contact", "point"]);
    let (_, err) = texts(&points);
    assert_eq!(points.status.code(), Some(3), "{err}");
    assert!(
        err.contains("gouges the part by") && err.contains("travel"),
        "{err}"
    );
    assert!(
        run_with(&["--contact", "point", "--no-verify"])
            .status
            .success()
    );
    assert!(report(&out)["verification"].is_null());

    // A path from anywhere: this one, advanced by half a millimetre and without its contacts.
    let deeper = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        match fields[3].parse::<f64>() {
            Ok(y) => format!("{},{},{},{},,,", fields[0], fields[1], fields[2], y - 0.5),
            Err(_) => line.to_owned(),
        }
    };
    let path = std::fs::read_to_string(out.join("path.csv")).expect("a path");
    let path: Vec<String> = path.lines().map(deeper).collect();
    let path = file(dir.path(), "deeper.csv", path.join("\n").as_bytes());
    let verify = |more: &[&str]| {
        let mut all = vec!["verify", text(&path), text(&job)];
        all.extend(more);
        run(&all)
    };
    assert_eq!(verify(&[]).status.code(), Some(3));
    let json = verify(&["--json", "--tolerance", "9"]);
    assert!(json.status.success());
    let found: serde_json::Value = serde_json::from_slice(&json.stdout).expect("JSON");
    assert!(depth(&found) > Some(0.4), "{found}");
}

#[test]
fn the_local_search_tells_its_windows_and_what_it_lost() {
    let dir = scratch();
    let part = sample().with_file_name("last.step");
    let job = job(dir.path(), "job.toml", &[&part], GRID);
    let run_with = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let mut all = vec!["run", text(&job), "-o", text(&out), "-q", "--no-verify"];
        all.extend(more);
        succeed(&all);
        (
            std::fs::read(out.join("path.csv")).expect("a path"),
            report(&out),
        )
    };
    let local = |more: &[&'static str]| [&["--method", "local"], more].concat();
    let window = |report: &serde_json::Value, key: &str| report["window"][key].as_u64();
    let (exact, _) = run_with("exact", &[]);
    let (found, report) = run_with("found", &local(&[]));
    assert_eq!(report["counters"]["lost"], 0);
    assert!(window(&report, "delta_u") > Some(0) && window(&report, "delta_v") > Some(1));
    assert!(found == exact);
    let given = local(&["--delta-u", "2", "--delta-v", "2"]);
    let (fallen_back, report) = run_with("given", &given);
    assert!(fallen_back == exact);
    assert!(report["counters"]["lost"].as_u64() > Some(0));
    let (on_workers, _) = run_with("workers", &[given.clone(), vec!["--workers", "2"]].concat());
    assert!(on_workers == exact);
    let (wrong, report) = run_with("wrong", &[given, vec!["--no-fallback"]].concat());
    assert!(wrong != exact);
    assert!(report["counters"]["largest_loss"].as_f64() > Some(0.0));

    let out = dir.path().join("refused");
    let refused: [(&[&str], &[&str]); 4] = [
        (&["--workers", "2"], &["one process", "workers"]),
        (&["--delta-u", "8"], &["delta_u and delta_v"]),
        (&["--contact", "facet"], &["contact", "point"]),
        (&["--delta-u", "0", "--delta-v", "9"], &["delta_u is 0"]),
    ];
    for (more, words) in refused {
        let mut all = vec!["run", text(&job), "-o", text(&out), "--method", "local"];
        all.extend(more);
        check(&all, 2, words);
    }
}

#[test]
fn positions_are_inserted_where_straight_moves_would_gouge() {
    let dir = scratch();
    let part = sample().with_file_name("last.step");
    let coarse = job(dir.path(), "coarse.toml", &[&part], GOOD);
    let finer = GOOD.replace("[motion]", "[motion]\npath_tolerance = 0.02");
    let finer = job(dir.path(), "finer.toml", &[&part], &finer);
    let results = |job: &Path, name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let mut all = vec!["run", text(job), "-o", text(&out)];
        all.extend(more);
        let said = succeed(&all);
        let read = |file: &str| std::fs::read_to_string(out.join(file)).expect("a result");
        (said, read("path.csv"), read("path.ngc"), report(&out))
    };
    let (_, plain, _, before) = results(&coarse, "coarse", &[]);
    let (said, csv, program, after) = results(&finer, "finer", &[]);
    let gouge = |report: &serde_json::Value| {
        report["verification"]["normal"]["motion_gouge"]["depth"].as_f64()
    };
    assert!(gouge(&before) > Some(1.0), "{:?}", gouge(&before));
    assert!(gouge(&after) < Some(0.03), "{:?}", gouge(&after));
    assert_eq!(after["job"]["motion"]["path_tolerance"], 0.02);
    let (positions, inserted) = (&after["path"]["positions"], &after["path"]["inserted"]);
    assert!(
        said.contains(&format!(
            "{positions} positions, {inserted} of them inserted"
        )),
        "{said}"
    );
    assert!(after["path"]["beyond_tolerance"].is_u64());

    // The positions of the motion are what they were, and the others lie between them.
    let is_inserted = |line: &&str| line.split(',').next().is_some_and(|i| i.contains('.'));
    let whole: Vec<&str> = csv.lines().filter(|l| !is_inserted(l)).collect();
    assert_eq!(whole, plain.lines().collect::<Vec<_>>());
    assert_eq!(
        csv.lines().filter(is_inserted).count() as u64,
        inserted.as_u64().expect("a count")
    );
    let start: f64 = plain
        .lines()
        .nth(1)
        .and_then(|l| l.split(',').nth(1)?.parse().ok())
        .expect("x");
    for line in csv.lines().filter(is_inserted) {
        let number = |k: usize| line.split(',').nth(k).and_then(|n| n.parse::<f64>().ok());
        let [index, x, angle] = [0, 1, 2].map(|k| number(k).expect("a number"));
        assert!((x - (start + 20.0 * index / 12.0)).abs() < 1e-9, "{line}");
        assert!((angle - 30.0 * index).abs() < 1e-9, "{line}");
    }
    let moves = program.lines().filter(|l| l.starts_with("G1 X")).count();
    assert_eq!(
        moves + 2,
        csv.lines().count(),
        "one to each position but the first"
    );

    // By flag or file, and by any search, it is the same.
    let flag = ["--path-tolerance", "0.02"];
    assert!(results(&coarse, "flag", &flag).1 == csv);
    let [exact, brute] = ["exact", "brute"].map(|method| {
        // Brute force takes its time over all facets.
        let rough = ["--tolerance", "0.1", "--method", method];
        results(&finer, method, &rough).1
    });
    assert!(exact == brute);

    // A path is held to its job's tolerance, wherever it comes from.
    let [coarse_csv, finer_csv] = ["coarse", "finer"].map(|d| dir.path().join(d).join("path.csv"));
    succeed(&["verify", text(&finer_csv), text(&finer)]);
    succeed(&["verify", text(&coarse_csv), text(&coarse)]);
    let words = ["straight move gouges", "path tolerance", "travel"];
    let verify = run(&["verify", text(&coarse_csv), text(&finer)]);
    let (_, err) = texts(&verify);
    assert_eq!(verify.status.code(), Some(3), "{err}");
    assert!(words.iter().all(|w| err.contains(w)), "{err}");

    // What cannot be: a tolerance of nothing, and no heights between positions.
    let out = dir.path().join("refused");
    let local = ["--method", "local", "--contact", "point", "--no-fallback"];
    let refused: [(&[&str], i32, &[&str]); 3] = [
        (
            &["--path-tolerance", "0"],
            2,
            &["--path-tolerance", "at least"],
        ),
        (&[&local[..], &flag].concat(), 2, &["without its fallback"]),
        (&["--path-tolerance", "nan"], 2, &["path_tolerance is NaN"]),
    ];
    for (more, code, words) in refused {
        let mut all = vec!["run", text(&coarse), "-o", text(&out), "-q"];
        all.extend(more);
        check(&all, code, words);
    }
}

#[test]
fn every_instruction_set_gives_the_same_bytes() {
    let dir = scratch();
    let part = sample().with_file_name("last.step");
    let job = job(dir.path(), "job.toml", &[&part], GOOD);
    let path = |simd: &str| crate::common::path_of(&job, dir.path(), simd, &["--simd", simd]);
    let scalar = path("scalar");
    for simd in horma_core::Simd::available() {
        assert!(path(&simd.to_string()) == scalar, "{simd}");
    }
    let out = dir.path().join("out");
    let unknown = run(&["run", text(&job), "-o", text(&out), "--simd", "mmx"]);
    let (_, err) = texts(&unknown);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(err.contains("mmx") && err.contains("scalar"), "{err}");
}

#[test]
fn an_open_mesh_is_cut_with_a_warning() {
    let dir = scratch();
    let obj = "v 0 50 0\nv 10 50 0\nv 10 0 50\nv 0 0 50\nf 1 2 3\nf 1 3 4\n";
    let part = file(dir.path(), "open.obj", obj.as_bytes());
    let job = job(dir.path(), "job.toml", &[&part], GOOD);
    let out = dir.path().join("out");
    let output = run(&["run", text(&job), "-o", text(&out)]);
    let (_, err) = texts(&output);
    assert!(output.status.success(), "{err}");
    assert!(
        err.contains("warning") && err.contains("4 edges are open"),
        "{err}"
    );
    let path = &report(&out)["path"];
    assert!(
        path["without_contact"].as_u64() > Some(0),
        "a sheet is out of reach from behind"
    );
    let csv = std::fs::read_to_string(out.join("path.csv")).expect("a path");
    assert!(
        csv.lines().any(|line| line.ends_with(",,,,")),
        "an empty contact"
    );
}

#[test]
fn inspect_tells_what_is_in_a_file() {
    let part = sample().with_file_name("last.step");
    let said = succeed(&["inspect", text(&part)]);
    for word in ["last", "toe holder", "heel holder", "degree 3", "mm"] {
        assert!(said.contains(word), "{word}: {said}");
    }
}

#[test]
fn units_are_those_of_the_file_or_said_and_told() {
    let dir = scratch();
    let dir = dir.path();
    let parts = Path::new(env!("CARGO_MANIFEST_DIR")).join("formats/tests/parts");
    let said = |file: &str, more: &[&str]| {
        let file = parts.join(file);
        succeed(&[&["inspect", text(&file)], more].concat())
    };
    assert!(said("slope.igs", &[]).contains("1 body, inch\n"));
    assert!(said("wedge.ply", &[]).contains("no unit stated, taken as mm\n"));
    let inches = said("wedge.3mf", &["--units", "inch"]);
    assert!(inches.contains("30.00 × 20.00 × 10.00"), "{inches}");
    let inches = said("wedge.stl", &["--units", "inch"]);
    assert!(inches.contains("762.00 × 508.00 × 254.00"), "{inches}");
    let unknown = run(&["inspect", text(&parts.join("wedge.stl")), "--units", "ell"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(texts(&unknown).1.contains("known: mm"), "{unknown:?}");

    let files = ["wedge.stl", "wedge.3mf"].map(|f| parts.join(f));
    let part = [&files[0], &files[1]].map(PathBuf::as_path);
    let with = |units: &str| {
        job(
            dir,
            "job.toml",
            &part,
            &format!("units = \"{units}\"\n{GOOD}"),
        )
    };
    check_job(dir, &with("ell"), 2, &["job.toml", "unknown unit 'ell'"]);
    let out = dir.join("out");
    succeed(&["run", text(&with("inch")), "-o", text(&out), "-q"]);
    let report = report(&out);
    assert_eq!(report["job"]["part"]["units"], "inch");
    let told: Vec<_> = report["files"].as_array().expect("a list").iter().collect();
    assert_eq!(told[0]["unit"], "inch");
    assert_eq!(told[0]["millimetres"], 25.4);
    assert_eq!(told[0]["stated"], false);
    assert_eq!(told[1]["unit"], "millimetre");
    assert_eq!(told[1]["stated"], true);
}

#[test]
fn help_teaches_and_completions_complete() {
    let help = succeed(&["--help"]);
    for word in ["horma init", "horma submit", "Exit codes", "run", "worker"] {
        assert!(help.contains(word), "{word}");
    }
    for shell in ["bash", "zsh", "fish"] {
        assert!(succeed(&["completions", shell]).contains("horma"));
    }
}

#[test]
fn a_bench_prints_its_table_and_leaves_others_results_alone() {
    let dir = scratch();
    let out = dir.path().join("bench");
    let said = succeed(&["bench", "kernel", "-o", text(&out), "--quick", "-q"]);
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    assert_eq!(said, read("kernel.txt"));
    assert!(said.contains("the sample last"), "{said}");
    let figures: serde_json::Value = serde_json::from_str(&read("kernel.json")).expect("JSON");
    for density in figures["density"].as_array().expect("densities") {
        let ratio = density["point"]["brute_over_exact"].as_f64();
        assert!(ratio.is_some_and(|r| r > 1.0), "{density}");
    }
    assert!(read("kernel.svg").ends_with("</svg>\n"));
    std::fs::rename(out.join("kernel.txt"), out.join("path.csv")).expect("renamed");
    check(&["bench", "kernel", "-o", text(&out)], 2, &["path.csv"]);
    let missing = dir.path().join("missing.toml");
    let bench = ["bench", "kernel", text(&missing), "-o", text(&out)];
    check(&bench, 2, &["missing.toml"]);
}

#[test]
fn a_bench_of_clusters_tells_what_each_took_and_what_that_projects() {
    let dir = scratch();
    let out = dir.path().join("scaling");
    let last = sample().with_file_name("last.step");
    let tiny = job(dir.path(), "job.toml", &[&last], GRID);
    let bench = ["bench", "scaling", text(&tiny), "-o", text(&out), "-q"];
    let more = ["--workers", "1,3", "--rounds", "2", "--thin", "6"];
    let said = succeed(&[&bench[..], &more[..]].concat());
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    assert_eq!(said.trim_end(), read("scaling.md").trim_end());
    for words in [
        "one process",
        "m = n/p + o",
        "**Not measured.**",
        "10 Gbit/s",
    ] {
        assert!(said.contains(words), "{words:?} is not in:\n{said}");
    }
    let csv = read("scaling.csv");
    let (head, runs) = csv.split_once('\n').expect("a header");
    let column = |name: &str| head.split(',').position(|c| c == name).expect(name);
    let field = |run: &str, name: &str| run.split(',').nth(column(name)).expect(name).to_owned();
    // Two methods, each in one process and as three distributions on two numbers of workers, twice.
    assert_eq!(runs.lines().count(), 2 * (1 + 3 * 2) * 2, "{csv}");
    for run in runs.lines() {
        let number = |name: &str| field(run, name).parse::<f64>().expect(name);
        let workers = number("workers");
        assert!(number("wall_s") > 0.0 && number("positions") > 0.0, "{run}");
        assert_eq!(number("extents"), workers, "{run}");
        assert_eq!(number("bytes_to_workers") > 0.0, workers > 0.0, "{run}");
        let fetched = field(run, "distribution") == "halo" && workers > 1.0;
        assert_eq!(number("bytes_between_workers") > 0.0, fetched, "{run}");
    }
    let diagrams = [
        "rows",
        "bytes",
        "time-exact",
        "speedup-brute",
        "projection-brute",
    ];
    for name in diagrams {
        assert!(read(&format!("{name}.svg")).ends_with("</svg>\n"), "{name}");
    }
    let missing = dir.path().join("missing.toml");
    check(
        &["bench", "scaling", text(&missing), "-o", text(&out)],
        2,
        &["missing.toml"],
    );
}

#[test]
fn papers_are_reproduced_by_name_beside_other_files() {
    let dir = scratch();
    let out = dir.path().join("docs");
    std::fs::create_dir(&out).expect("ours");
    let other = file(&out, "other.md", b"mine");
    let said = succeed(&[
        "papers",
        "precision",
        "multirotator",
        "-o",
        text(&out),
        "-q",
    ]);
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    let (page, view) = (read("papers.md"), read("papers.html"));
    assert!(
        said.contains("papers.md") && said.contains("papers.html"),
        "{said}"
    );
    // In their own order, whatever was typed.
    let [first, second] = ["## The MultiRotator", "## Precision"].map(|h| page.find(h).expect(h));
    assert!(
        first < second && !page.contains("## The coprocessor"),
        "{page}"
    );
    assert!(
        page.contains("horma papers multirotator precision -o docs"),
        "{page}"
    );
    assert!(
        page.contains("(papers/figure7.svg)") && read("papers/figure7.svg").ends_with("</svg>\n")
    );
    assert!(
        view.contains("<svg") && !view.contains("<img"),
        "diagrams are in the page"
    );
    // What is written anew takes the place of what was there, and of nothing else.
    succeed(&["papers", "multirotator", "-o", text(&out), "-q"]);
    assert!(!out.join("papers/figure7.svg").exists());
    assert_eq!(std::fs::read(&other).expect("there"), b"mine");
    let unknown = run(&["papers", "abacus", "-o", text(&out)]);
    let (_, err) = texts(&unknown);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(
        err.contains("abacus") && err.contains("multirotator"),
        "{err}"
    );
    file(&out, "papers/notes.txt", b"mine");
    check(&["papers", "-o", text(&out)], 2, &["notes.txt"]);
}

#[cfg(unix)]
#[test]
fn a_run_is_viewed_in_the_browser_that_is_named() {
    use std::os::unix::fs::PermissionsExt;

    let dir = scratch();
    let dir = dir.path();
    check(&["view", text(dir)], 2, &["report.html", "horma run"]);
    let page = file(dir, "report.html", b"").canonicalize().expect("there");
    let (browser, seen) = (dir.join("browser"), dir.join("seen"));
    let script = format!("#!/bin/sh\nprintf %s \"$1\" > {}\n", seen.display());
    std::fs::write(&browser, script).expect("writable");
    let executable = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(&browser, executable).expect("ours");
    let said = succeed(&["view", text(dir), "--browser", text(&browser)]);
    assert_eq!(said.trim_end(), text(&page));
    assert_eq!(std::fs::read_to_string(seen).expect("opened"), text(&page));

    let nobody = run(&["view", text(dir), "--browser", "/nowhere/browser"]);
    let (said, err) = texts(&nobody);
    assert_eq!(nobody.status.code(), Some(3));
    assert!(said.contains("report.html"), "the path helps all the same");
    assert!(
        err.contains("--browser") && err.contains("by hand"),
        "{err}"
    );
}
