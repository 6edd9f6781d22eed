//! docs/papers.md and its diagrams are what `horma papers -o docs` writes, but for what is timed.

use std::fs;
use std::path::{Path, PathBuf};

use horma_papers::markdown::{lasting, page};
use horma_papers::report::Chapter;
use horma_papers::{DIAGRAMS, Experiment, PAGE, diagrams};

const ANEW: &str = "run `horma papers -o docs` and look at what has changed";

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

#[test]
fn the_page_in_the_repository_is_what_is_found_now() {
    let made = Experiment::ALL.map(|e| e.run().expect("the experiment"));
    let chapters: &[Chapter] = &made;
    let there = fs::read_to_string(docs().join(PAGE)).expect(PAGE);
    let (there, now) = (lasting(&there), lasting(&page(chapters)));
    for (there, now) in there.lines().zip(now.lines()) {
        assert_eq!(there, now, "{ANEW}");
    }
    assert_eq!(there.lines().count(), now.lines().count(), "{ANEW}");
    let mut names = Vec::new();
    for (name, svg) in diagrams(chapters) {
        let there = fs::read_to_string(docs().join(DIAGRAMS).join(&name)).expect(&name);
        assert!(there == svg, "{name} differs; {ANEW}");
        names.push(name);
    }
    for entry in fs::read_dir(docs().join(DIAGRAMS)).expect(DIAGRAMS) {
        let name = entry
            .expect("readable")
            .file_name()
            .to_string_lossy()
            .into_owned();
        assert!(
            names.contains(&name),
            "{name} is no diagram of this page; {ANEW}"
        );
    }
}
