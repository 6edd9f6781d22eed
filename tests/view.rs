//! A run's page in a real browser, from disk. Where there is none this is skipped by name.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::common::browser::Browser;
use crate::common::{job, lower, sample, scratch, succeed, text};
use serde_json::{Value, json};

const ARROW_RIGHT: char = '\u{E014}';
const PAGE_UP: char = '\u{E00E}';

/// A picture of three dimensions without a graphics card.
const WITH_WEBGL: [&str; 2] = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

/// Functions for what follows: `picture` draws anew and tells of the picture in three dimensions how
/// many pixels are covered, how many are clearly red, and a sum that tells one from another.
const LOOK: &str = "
    window.picture = () => new Promise((resolve) => {
        document.querySelector('#show-part').dispatchEvent(new Event('change'));
        requestAnimationFrame(() => {
            const canvas = document.querySelector('#solid');
            const gl = canvas.getContext('webgl2');
            const { width, height } = canvas;
            const pixels = new Uint8Array(4 * width * height);
            gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
            let [covered, red, sum] = [0, 0, 0];
            for (let i = 0; i < pixels.length; i += 4) {
                const r = pixels[i], g = pixels[i + 1], b = pixels[i + 2];
                if (pixels[i + 3] > 0) {
                    covered++;
                    if (r > g + 70 && r > b + 70) red++;
                }
                sum = (sum * 31 + r + 256 * g + 65536 * b) % 1000003;
            }
            resolve({ covered: covered / (width * height), red, sum });
        });
    });
    window.choose = (id, value) => {
        const element = document.querySelector(id);
        element.value = value;
        element.dispatchEvent(new Event(id === '#at' ? 'input' : 'change'));
    };
    window.here = (k) => document.querySelector('#here').children[k].lastElementChild.textContent;
    window.shifts = [];
    new PerformanceObserver((list) => {
        for (const entry of list.getEntries()) {
            window.shifts.push([entry.value, ...entry.sources.map(({ node }) => `${node?.nodeName}#${node?.id}`)]);
        }
    }).observe({ type: 'layout-shift', buffered: true });";

/// Runs a job on two workers and returns its page.
fn page(dir: &Path, job: &Path) -> PathBuf {
    let out = dir.join("out");
    succeed(&["run", text(job), "-q", "-w", "2", "-o", text(&out)]);
    out.join("report.html")
}

/// The page of the sample's run, which is the same for all tests that look at it.
fn page_of_the_sample() -> &'static Path {
    static PAGE: OnceLock<PathBuf> = OnceLock::new();
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("view");
    PAGE.get_or_init(|| page(&dir, &sample()))
}

fn open(browser: &Browser, page: &Path) {
    browser.screen(1280, 900, "light");
    browser.open(&format!("file://{}", text(page)));
    browser.wait("performance.getEntriesByName('drawn').length === 1");
    browser.ask(LOOK);
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn a_page_from_disk_shows_its_run() {
    let Some(browser) = Browser::start(&WITH_WEBGL) else {
        return;
    };
    open(&browser, page_of_the_sample());

    let first = browser.ask("return picture()");
    let covered = number(&first["covered"]);
    assert!((0.05..0.7).contains(&covered), "{first}");
    // But for the mark where the wheel touches.
    assert!(number(&first["red"]) < 50.0, "nothing is gouged: {first}");
    assert_eq!(browser.ask("return picture()"), first);

    // The slider: a position by an arrow, a turn by Page Up, and the wheel goes along.
    let at = |k: usize| browser.ask(&format!("return here({k})"));
    let position = at(0).as_str().and_then(|p| p.parse::<u64>().ok());
    browser.ask("document.querySelector('#at').focus()");
    browser.press(ARROW_RIGHT);
    browser.wait(&format!("here(0) === '{}'", position.expect("whole") + 1));
    browser.press(PAGE_UP);
    browser.wait(&format!("here(0) === '{}'", position.expect("whole") + 361));
    let moved = browser.ask("choose('#at', 9000); return picture()");
    assert_eq!(at(0), "9000");
    assert_eq!(at(1), "2.000 mm");
    let by = at(7);
    assert!(
        by.as_str().is_some_and(|by| by.ends_with(", extent 0")),
        "{by}"
    );
    assert_ne!(moved["sum"], first["sum"]);

    // Every choice of colours is another picture and another map.
    let choices =
        browser.ask("return [...document.querySelector('#colour').options].map((o) => o.value)");
    let expected = [
        "errors", "machined", "height", "speed", "bend", "rim", "extent",
    ];
    assert_eq!(choices, json!(expected));
    let mut seen = Vec::new();
    for choice in expected {
        let picture = browser.ask(&format!("choose('#colour', '{choice}'); return picture()"));
        let map = browser.ask("return document.querySelector('#map').toDataURL()");
        seen.push((picture["sum"].clone(), map));
    }
    for (i, (picture, map)) in seen.iter().enumerate() {
        let others = seen[..i].iter();
        assert!(
            others.clone().all(|(p, m)| p != picture && m != map),
            "{}",
            expected[i]
        );
    }
    let bare = browser.ask("document.querySelector('#show-wheel').click(); return picture()");
    assert!(bare["covered"].as_f64() < Some(covered), "{bare}");

    // The plot goes by the speed of the spindle: 178 turns.
    let asked =
        "choose('#turns', 60); document.querySelector('#turns').dispatchEvent(new Event('input'));
        return document.querySelector('#motion-note').textContent";
    let note = browser.ask(asked);
    assert!(
        note.as_str().is_some_and(|n| n.contains("takes 178 s")),
        "{note}"
    );
    let before = browser.ask("return document.querySelector('#axis').toDataURL()");
    browser.ask("choose('#span', 'turn'); return picture()");
    assert_ne!(
        browser.ask("return document.querySelector('#axis').toDataURL()"),
        before
    );

    let shown = browser.ask("return document.querySelector('#shown').textContent");
    assert!(
        shown
            .as_str()
            .is_some_and(|s| s.contains("all 64,080 positions")),
        "{shown}"
    );
    let tables =
        browser.ask("return [...document.querySelectorAll('table')].map((t) => t.ariaLabel)");
    for title in [
        "Path",
        "Held against the designed surface",
        "The surface as machined",
        "Time",
        "Workers",
        "Extents",
    ] {
        assert!(
            tables
                .as_array()
                .is_some_and(|all| all.contains(&json!(title))),
            "{tables}"
        );
    }
    assert_eq!(browser.ask("return window.shifts"), json!([]));
    check_looks(&browser, "run");
    assert_eq!(browser.complaints(), Vec::<Value>::new());
}

#[test]
fn a_gouge_is_seen() {
    let Some(browser) = Browser::start(&WITH_WEBGL) else {
        return;
    };
    let dir = scratch();
    // Points far apart, between which the wheel falls into the part.
    let points = "[discretization]\ngrid = { rows = 50, columns = 40 }\n\
        [digitizing]\ncontact = \"point\"\n\
        [cutter]\nkind = \"ball\"\nradius = 6.0\n\
        [motion]\nstep = 2.0\npoints_per_revolution = 90\n";
    let part = sample().with_file_name("last.step");
    let job = job(dir.path(), "job.toml", &[&part], points);
    open(&browser, &page(dir.path(), &job));
    let picture = browser.ask("return picture()");
    assert!(number(&picture["red"]) > 500.0, "{picture}");
    let said = browser.ask("return document.querySelector('#histogram').ariaLabel");
    assert!(
        said.as_str().is_some_and(|s| s.contains("−0.5 to −0.2 mm")),
        "{said}"
    );
    check_looks(&browser, "gouged");
    assert_eq!(browser.complaints(), Vec::<Value>::new());
}

/// Where the map is clearly red: how many pixels, and in their middle travel and angle.
const RED_ON_MAP: &str = "
    const canvas = document.querySelector('#map');
    const { width, height } = canvas;
    const { data } = canvas.getContext('2d').getImageData(0, 0, width, height);
    let [count, across, down] = [0, 0, 0];
    for (let i = 0; i < data.length; i += 4) {
        if (data[i] < data[i + 1] + 70 || data[i] < data[i + 2] + 70) continue;
        [count, across, down] = [count + 1, across + ((i / 4) % width), down + Math.floor(i / 4 / width)];
    }
    // The map's margins; a pixel of the screen is one of the picture.
    const [left, right, top, bottom] = [46, 12, 10, 36];
    const { rows, first, step } = JSON.parse(document.querySelector('#contents').textContent).cells;
    const x = first[0] - step[0] / 2 + (rows * step[0] * (across / count + 0.5 - left)) / (width - left - right);
    const angle = 360 * (1 - (down / count + 0.5 - top) / (height - top - bottom));
    return [count, x, angle];";

#[test]
fn what_one_position_too_low_leaves_is_seen_on_the_map() {
    let Some(browser) = Browser::start(&WITH_WEBGL) else {
        return;
    };
    let dir = scratch();
    let good = page_of_the_sample();
    let path = good.with_file_name("path.csv");
    let lowered = dir.path().join("low.csv");
    let [x, angle] = lower(&path, &lowered);
    let out = dir.path().join("low");
    succeed(&[
        "machined",
        text(&lowered),
        text(&sample()),
        "-o",
        text(&out),
    ]);
    let look = |page: &Path| {
        open(&browser, page);
        browser.ask("document.querySelector('#show-wheel').click()");
        let picture = browser.ask("choose('#colour', 'machined'); return picture()");
        (browser.ask(RED_ON_MAP), number(&picture["red"]))
    };
    let (map, before) = look(good);
    assert_eq!(map[0], 0, "nothing is gouged: {map}");
    let (map, red) = look(&out.join("report.html"));
    assert!(red > before + 200.0, "no ring: {red}, {before} before");
    assert!(number(&map[0]) > 20.0, "{map}");
    assert!((number(&map[1]) - x).abs() < 1.5, "{map} instead of {x} mm");
    let apart = (number(&map[2]) - angle + 180.0).rem_euclid(360.0) - 180.0;
    assert!(apart.abs() < 4.0, "{map} instead of {angle}°");

    let table = browser.ask(
        "return [...document.querySelectorAll('table')].find((t) => t.ariaLabel === 'The surface as machined').textContent",
    );
    let told = table.as_str().expect("text");
    assert!(told.contains("0.49") || told.contains("0.50"), "{told}");
    let by = browser.ask("return here(7)");
    assert_eq!(by, "read from a file");
    check_looks(&browser, "machined");
    assert_eq!(browser.complaints(), Vec::<Value>::new());
}

#[test]
fn a_part_alone_is_shown_with_its_open_edges() {
    let Some(browser) = Browser::start(&WITH_WEBGL) else {
        return;
    };
    let dir = scratch();
    let corners = "v 0 0 0\nv 60 0 0\nv 0 80 0\nv 0 0 90\n";
    let faces = "f 1 3 2\nf 1 2 4\nf 2 3 4\n";
    let open_mesh = dir.path().join("open.obj");
    std::fs::write(&open_mesh, format!("{corners}{faces}")).expect("written");
    let last = sample().with_file_name("last.step");
    let page = dir.path().join("part.html");
    let said = succeed(&[
        "inspect",
        text(&last),
        text(&open_mesh),
        "--html",
        text(&page),
    ]);
    assert!(
        said.ends_with(&format!("wrote {}\n", page.display())),
        "{said}"
    );
    open(&browser, &page);

    let first = browser.ask("return picture()");
    let covered = number(&first["covered"]);
    assert!((0.03..0.7).contains(&covered), "{first}");
    let bare = browser.ask("document.querySelector('#show-edges').click(); return picture()");
    assert_ne!(bare["sum"], first["sum"], "three edges are marked");
    browser.ask("document.querySelector('#show-part').click()");
    let nothing = browser.ask("return picture()");
    assert_eq!(nothing["covered"], json!(0), "{nothing}");
    browser.ask("document.querySelector('#show-part').click(); document.querySelector('#show-edges').click()");

    let visible = browser.ask(
        "return ['#scene', '#figures', '#legend', '#unrolled', '#errors', '#motion', '#here', '#play', '#show-wheel']
            .filter((id) => document.querySelector(id).checkVisibility())",
    );
    assert_eq!(visible, json!(["#scene", "#figures", "#legend"]));
    let told = browser.ask("return document.body.innerText");
    let told = told.as_str().expect("text");
    for words in [
        "4 bodies · 3 open edges",
        "last.step",
        "open.obj",
        "no unit stated, taken as mm",
        "60.00 × 80.00 × 90.00 mm",
    ] {
        assert!(told.contains(words), "{words:?} is missing: {told}");
    }
    assert_eq!(browser.ask("return window.shifts"), json!([]));
    check_looks(&browser, "part");
    assert_eq!(browser.complaints(), Vec::<Value>::new());
}

#[test]
fn fingers_turn_and_zoom_and_play_goes_along_the_path() {
    let Some(browser) = Browser::start(&WITH_WEBGL) else {
        return;
    };
    open(&browser, page_of_the_sample());
    browser.screen(390, 844, "light");
    browser.ask("document.querySelector('#show-wheel').click(); document.querySelector('#solid').scrollIntoView()");
    let at = browser.ask(
        "const { x, y, width, height } = document.querySelector('#solid').getBoundingClientRect();
        return [x + width / 2, y + height / 2, window.scrollY]",
    );
    let [x, y, scrolled] = [0, 1, 2].map(|k| number(&at[k]));
    let before = browser.ask("return picture()");

    // One finger turns the part, and does not scroll the page.
    browser.touch(&[[[x, y], [x + 60.0, y + 40.0]]]);
    let turned = browser.ask("return picture()");
    assert_ne!(turned["sum"], before["sum"]);
    assert_eq!(number(&browser.ask("return window.scrollY")), scrolled);

    // Two that go apart zoom in, two that come together out again.
    let apart = [
        [[x - 20.0, y], [x - 80.0, y]],
        [[x + 20.0, y], [x + 80.0, y]],
    ];
    browser.touch(&apart);
    let near = browser.ask("return picture()");
    let covered = |picture: &Value| number(&picture["covered"]);
    assert!(covered(&near) > 1.5 * covered(&turned), "{turned} {near}");
    browser.touch(&apart.map(|[from, to]| [to, from]));
    let far = browser.ask("return picture()");
    assert!(covered(&far) < covered(&near), "{near} {far}");
    assert_eq!(number(&browser.ask("return window.scrollY")), scrolled);

    // Play goes on until it is told to stop, and stops at the end.
    let play = |told: &str| {
        browser.ask("document.querySelector('#play').click()");
        let said = browser.ask(
            "const { textContent, ariaPressed } = document.querySelector('#play'); return [textContent, ariaPressed]",
        );
        assert_eq!(said, json!([told, (told == "Pause").to_string()]));
    };
    browser.ask("choose('#at', 9000)");
    play("Pause");
    browser.wait("Number(here(0)) > 9020");
    play("Play");
    // The frame that was on its way is still drawn.
    browser.ask("return picture()");
    let stopped = browser.ask("return here(0)");
    browser.ask("return picture()");
    assert_eq!(browser.ask("return here(0)"), stopped);
    browser.ask("choose('#at', document.querySelector('#at').max - 20)");
    play("Pause");
    browser.wait("document.querySelector('#play').textContent === 'Play'");
    browser.ask("return picture()");
    let end = browser.ask("return [here(0), document.querySelector('#at').max]");
    assert_eq!(end[0], end[1]);
    assert_eq!(browser.complaints(), Vec::<Value>::new());
}

#[test]
fn without_webgl_the_plots_and_figures_are_there() {
    let Some(browser) = Browser::start(&["--disable-3d-apis"]) else {
        return;
    };
    open(&browser, page_of_the_sample());
    let told = browser.ask("return document.querySelector('#no-webgl').checkVisibility()");
    assert_eq!(told, true);
    let drawn = "const drawn = (id) => {
            const { width, height } = document.querySelector(id);
            const pen = document.querySelector(id).getContext('2d');
            return pen.getImageData(0, 0, width, height).data.filter((_, i) => i % 4 === 3).some((a) => a > 0);
        };
        return ['#map', '#axis', '#histogram'].map(drawn)";
    assert_eq!(browser.ask(drawn), json!([true, true, true]));
    browser.ask("choose('#at', 9000)");
    browser.wait("here(0) === '9000'");
    assert_eq!(browser.complaints(), Vec::<Value>::new());
}

#[test]
#[ignore = "makes the pictures and figures of docs/report.md anew: -- --ignored --nocapture"]
fn pictures_for_the_documentation() {
    let Some(browser) = Browser::start(&WITH_WEBGL) else {
        return;
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/report");
    let part = sample().with_file_name("last.step");
    for (name, step, turn) in [("44k", 2.0, 248), ("million", 0.5, 1440)] {
        let dir = scratch();
        let more = format!(
            "[cutter]\nkind = \"torus\"\nmajor_radius = 40.0\nminor_radius = 8.0\n\
             [motion]\nstep = {step:?}\npoints_per_revolution = {turn}\n"
        );
        let page = page(dir.path(), &job(dir.path(), "job.toml", &[&part], &more));
        let bytes = std::fs::metadata(&page).expect("written").len();
        for (width, height) in [(1280, 900), (390, 844)] {
            browser.screen(width, height, "light");
            browser.open(&format!("file://{}", text(&page)));
            browser.wait("performance.getEntriesByName('drawn').length === 1");
            let drawn = browser.ask("return performance.getEntriesByName('drawn')[0].startTime");
            let shown = browser.ask("return document.querySelector('#shown').textContent");
            eprintln!("{name}, {width} px: {bytes} bytes, first picture after {drawn} ms; {shown}");
            browser.ask(LOOK);
            browser.ask("return picture()");
            let file = folder.join(format!("{name}-{width}.jpg"));
            std::fs::write(file, browser.snapshot()).expect("writable");
        }
        assert_eq!(browser.complaints(), Vec::<Value>::new());
    }
}

/// Nothing is wider than the screen, and everything to be operated has a name.
fn check_looks(browser: &Browser, what: &str) {
    browser.check_widths(&format!("view-{what}"));
    let nameless = "return [...document.querySelectorAll('button, input, select, section, table, canvas, a, [role]')]
        .filter((e) => e.checkVisibility() && !(e.ariaLabel || e.ariaHidden || e.textContent.trim() || e.labels?.length
            || e.getAttribute('aria-labelledby')))
        .map((e) => e.outerHTML)";
    assert_eq!(browser.ask(nameless), json!([]));
}
