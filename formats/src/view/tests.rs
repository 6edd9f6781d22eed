use horma_core::{Body, Mesh, Part, Rays, Record, Shape, ToolPath, Touch, Trajectory};

use super::*;
use crate::preview::sheets;
use crate::report::{PathStatistics, Report};

fn part() -> Part {
    let corners = vec![[0.0; 3], [10.0, 0.0, 0.0], [10.0, 0.0, 8.0]];
    let mesh = Mesh::new("m", corners, vec![[0, 1, 2]]).expect("valid");
    Part {
        bodies: vec![Body {
            name: "m".to_owned(),
            shape: Shape::Mesh(mesh),
        }],
    }
}

fn path() -> ToolPath {
    let touch = |k: u32| {
        (k != 2).then_some(Touch {
            height: 20.0 + f64::from(k),
            contact: [f64::from(k), 1.0, 2.0],
        })
    };
    ToolPath {
        trajectory: Trajectory {
            kind: MotionKind::Helix,
            from: 0.0,
            step: 5.0,
            points_per_revolution: 4,
            positions: 9,
        },
        touches: (0..9).map(touch).collect(),
        between: Vec::new(),
    }
}

fn report() -> Report {
    let record = Record::default();
    Report {
        version: "0.1.0".to_owned(),
        job: serde_json::Value::Null,
        files: Vec::new(),
        warnings: vec!["</script><script>alert(1)</script>".to_owned()],
        path: PathStatistics::of(path().waypoints(), &record.counters),
        verification: None,
        machined: None,
        program: None,
        keep_outs: Vec::new(),
        roughing: None,
        last: None,
        record,
    }
}

/// What an element of the page holds.
fn element<'a>(page: &'a str, id: &str) -> &'a str {
    let (_, rest) = page.split_once(&format!("id=\"{id}\">")).expect("there");
    rest.split_once("</script>").expect("ends").0
}

fn bytes(page: &str, id: &str) -> Vec<u8> {
    use base64::Engine;
    let engine = base64::engine::general_purpose::STANDARD;
    engine.decode(element(page, id)).expect("base 64")
}

fn page(found: Findings) -> String {
    page_of(Some(&path().trajectory), found)
}

fn page_of(trajectory: Option<&Trajectory>, found: Findings) -> String {
    let cutter = Cutter::torus(40.0, 8.0).expect("valid");
    let waypoints: Vec<Waypoint> = path().waypoints().collect();
    let view = view(&sheets(&part()), &cutter, &waypoints, trajectory, found);
    let mut page = Vec::new();
    write(&mut page, &view, &report()).expect("in memory");
    String::from_utf8(page).expect("text")
}

#[test]
fn a_page_holds_the_numbers_that_it_was_given() {
    let clearances = Clearances {
        points: vec![[10.0, 0.0, 8.0]],
        normal: vec![-0.25],
    };
    let page = page(Findings {
        clearances: Some(&clearances),
        machined: None,
    });
    let heights: Vec<f32> = bytes(&page, "heights")
        .as_chunks()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect();
    assert_eq!(heights.len(), 9);
    assert_eq!((heights[0], heights[8]), (20.0, 28.0));
    assert!(heights[2].is_nan(), "nothing is touched there");
    let last = &bytes(&page, "index")[8 * 8..];
    assert_eq!(last, 8.0_f64.to_le_bytes());
    assert_eq!(bytes(&page, "clearances"), (-0.25_f32).to_le_bytes());
    // The far corner of the box, but for the height of the contacts.
    assert_eq!(bytes(&page, "samples"), [255, 255, 0, 0, 255, 255]);
    let contents: serde_json::Value =
        serde_json::from_str(element(&page, "contents")).expect("JSON");
    assert_eq!(contents["high"], serde_json::json!([10.0, 1.0, 8.0]));
    assert_eq!(contents["positions"]["of"], 9);
    let wheel = contents["wheel"].as_array().expect("a profile");
    assert_eq!(wheel[0], serde_json::json!([-8.0, 40.0]));
    assert_eq!(wheel[PROFILE / 2][1], 48.0);
}

#[test]
fn nothing_of_a_run_becomes_part_of_the_page_and_nothing_comes_from_elsewhere() {
    let page = page(Findings::default());
    assert!(!page.contains("alert(1)</script>"));
    let report: Report = serde_json::from_str(element(&page, "report")).expect("JSON");
    assert_eq!(report.warnings, self::report().warnings);
    let outside = page.replace("http://www.w3.org/2000/svg", "");
    for from in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!outside.contains(from), "{from}");
    }
    assert!(!page.contains("id=\"samples\""));
}

#[test]
fn a_page_holds_the_machined_surface() {
    let rays = Rays {
        from: 0.5,
        step: 1.0,
        rows: 2,
        columns: 3,
    };
    let mut deviation = vec![Some(0.25); rays.len()];
    deviation[4] = Some(-0.5);
    deviation[5] = None;
    let mut designed = vec![Some(10.0); rays.len()];
    designed[1] = Some(20.0);
    let machined = Machined {
        rays,
        designed,
        machined: vec![Some(10.25); rays.len()],
        deviation,
    };
    let page = page(Findings {
        clearances: None,
        machined: Some(&machined),
    });
    let contents: serde_json::Value =
        serde_json::from_str(element(&page, "contents")).expect("JSON");
    assert_eq!(contents["cells"]["rows"], 2);
    assert_eq!(contents["cells"]["step"], serde_json::json!([1.0, 120.0]));
    assert_eq!(contents["radius"], 20.0);
    assert_eq!(bytes(&page, "radii")[..4], [0, 128, 255, 255]);
    let deviations = bytes(&page, "deviations");
    assert_eq!(deviations[16..20], (-0.5_f32).to_le_bytes());
    assert_eq!(deviations.len(), 24);
}

#[test]
fn positions_from_elsewhere_have_places_of_their_own() {
    let page = page_of(None, Findings::default());
    let contents: serde_json::Value =
        serde_json::from_str(element(&page, "contents")).expect("JSON");
    assert!(contents["motion"].is_null());
    let last = |id: &str| bytes(&page, id)[8 * 8..].to_vec();
    assert_eq!(last("travels"), 10.0_f64.to_le_bytes());
    assert_eq!(last("angles"), 720.0_f64.to_le_bytes());
}
