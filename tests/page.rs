//! The master's page in a real browser, during a real job. Where there is none this is skipped by name.

use crate::common::browser::Browser;
use crate::common::{Process, get, http, master, sample, scratch, submit, worker};
use serde_json::{Value, json};

const ARROW_RIGHT: char = '\u{E014}';

/// Writes down every state that an extent is shown in, and every shift of the layout.
const OBSERVE: &str = "
    window.states = {};
    window.shifts = [];
    new MutationObserver(() => {
        for (const button of document.querySelectorAll('.strip button')) {
            const extent = button.parentElement.dataset.name;
            (window.states[extent] ??= new Set()).add(button.dataset.state);
        }
    }).observe(document.body, { subtree: true, childList: true, attributes: true });
    new PerformanceObserver((list) => {
        for (const entry of list.getEntries()) window.shifts.push(entry.value);
    }).observe({ type: 'layout-shift' });";

#[test]
fn the_page_shows_a_job_from_its_begin_to_its_end() {
    let Some(browser) = Browser::start(&["--disable-gpu"]) else {
        return;
    };
    let dir = scratch();
    let (mut master, address) = master(&["--http", "0", "--lease", "60"]);
    let seen = http(&mut master);
    let workers = ["a", "b"].map(|id| worker(&address, id));
    browser.screen(1280, 800, "light");
    browser.open(&format!("http://{seen}/"));
    browser.wait("document.querySelector('#link').textContent === 'live'");
    browser.wait("document.querySelectorAll('#workers tbody tr').length === 2");
    browser.ask(OBSERVE);

    // One of the two stands still for as long as it takes to see that the other has gone on.
    workers[1].signal("-STOP");
    let (sample, out) = (sample(), dir.path().join("out"));
    let submit = submit(&sample, &address, &out);
    browser.wait("document.querySelectorAll('.strip li').length === 2");
    browser.wait("document.querySelectorAll('.strip [data-state=running]').length === 1");
    browser.wait("document.querySelectorAll('.strip [data-state=done]').length === 1");
    assert_eq!(
        browser.ask("return document.querySelector('.state').textContent"),
        "running"
    );
    let worker = "[...document.querySelectorAll('#workers tbody tr:last-child td')].map((e) => e.textContent).join()";
    browser.wait(&format!("{worker}.startsWith('digitizing,1 of job 1,')"));
    check_looks(&browser, "running");
    let top = "return document.querySelector('.job').getBoundingClientRect().top";
    let before = browser.ask(top);
    workers[1].signal("-CONT");
    browser.wait("document.querySelector('.state').textContent === 'done'");
    assert_eq!(submit.end().0, Some(0));
    assert_eq!(
        browser.ask(top),
        before,
        "a job stays where it is when it is done"
    );
    let states = "return Object.values(window.states).map((s) => [...s].join(' '))";
    let states = browser.ask(states);
    let states: Vec<&str> = states
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(Value::as_str)
        .collect();
    assert_eq!(states.len(), 2);
    assert!(states.contains(&"running done"), "{states:?}");

    // The strip is the part's: its ends in mm, as in the state.
    let (status, state) = get(&seen, "/api/state");
    assert_eq!(status, 200);
    let state: Value = serde_json::from_str(&state).expect("JSON");
    let extents = state["ended"][0]["extents"].as_array().expect("extents");
    let from = extents[0]["x"][0].as_f64().expect("a number");
    let axis = browser.ask("return document.querySelector('.axis').firstElementChild.textContent");
    assert_eq!(axis, format!("{from:.1} mm").replace('-', "−"));

    // By keys from one extent to the next, which is told about in words.
    browser.ask("document.querySelector('.strip button').focus()");
    browser.press(ARROW_RIGHT);
    let told = browser.ask("return document.querySelector('.detail').textContent");
    let told = told.as_str().expect("a text");
    assert!(
        told.starts_with("Extent 1, ") && told.contains(", done by "),
        "{told}"
    );

    let first = browser.ask("return document.querySelector('#events li span').textContent");
    assert_eq!(first, "job 1 is digitized");
    let events = browser.ask("return document.querySelector('#events ol').textContent");
    for event in [
        "worker a registered",
        "job 1 begins, in 2 extents",
        "given to worker b",
    ] {
        assert!(
            events.as_str().is_some_and(|all| all.contains(event)),
            "{event}: {events}"
        );
    }
    check_looks(&browser, "done");
    assert_eq!(browser.complaints(), Vec::<Value>::new());

    // Without a master the page says so, and finds the next one by itself.
    master.signal("-TERM");
    assert_eq!(master.end().0, Some(0));
    browser.wait("document.querySelector('#link').textContent === 'no connection'");
    let again = ["master", "--bind", "127.0.0.1:0", "--http", &seen];
    let _again = Process::start("master", &again, "info");
    browser.wait("document.querySelector('#link').textContent === 'live'");
}

/// Nothing is wider than the screen, and everything to be operated has a name.
fn check_looks(browser: &Browser, when: &str) {
    browser.check_widths(&format!("page-{when}"));
    let nameless =
        "return [...document.querySelectorAll('button, progress, section, article, ol, a')]
        .filter((e) => !(e.ariaLabel || e.textContent.trim() || e.getAttribute('aria-labelledby')))
        .map((e) => e.outerHTML)";
    assert_eq!(browser.ask(nameless), json!([]));
}
