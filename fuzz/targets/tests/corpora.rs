//! Every input that is kept goes through its target: what was mended stays mended, on the normal build.
//!
//! `fuzz/corpus/<target>` holds what reaches the most code (files named by their hash) and what was trouble once (files with a
//! name that says so).

use carom_fuzz_targets::TARGETS;
use std::fs;
use std::panic::catch_unwind;
use std::path::Path;

fn replay(name: &str) {
    let (_, target) = TARGETS.iter().find(|t| t.0 == name).expect("a target");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../corpus")
        .join(name);
    let mut paths: Vec<_> = fs::read_dir(&folder)
        .expect("a corpus")
        .map(|e| e.expect("a file").path())
        .collect();
    paths.sort();
    assert!(
        paths.len() >= 10,
        "{} inputs in {}",
        paths.len(),
        folder.display()
    );
    let failed: Vec<_> = (paths.iter())
        .filter(|path| {
            let data = fs::read(path).expect("readable");
            catch_unwind(|| target(&data)).is_err()
        })
        .collect();
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn scenes() {
    replay("scene");
}

#[test]
fn saved_states() {
    replay("state");
}

#[test]
fn contact_problems() {
    replay("solve");
}

#[test]
fn neighbours() {
    replay("neighbours");
}

#[test]
fn walls() {
    replay("walls");
}

#[test]
fn expressions() {
    replay("expression");
}
