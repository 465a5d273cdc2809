//! Replays what the fuzzers kept: inputs that together reach all code that any input reached, and
//! those that found a fault.

use std::fs;
use std::path::Path;

use piezotrack_fuzz::TARGETS;

/// The files of a folder, in the order of their names; none where there is no folder.
fn files(folder: &str, target: &str) -> Vec<std::path::PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join(target);
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn corpus_and_finds_pass() {
    for (name, target) in TARGETS {
        let corpus = files("corpus", name);
        let mut accepted = 0;
        for file in corpus.iter().chain(&files("finds", name)) {
            println!("{}", file.display());
            accepted += usize::from(target(&fs::read(file).unwrap()));
        }
        println!("{name}: {accepted} of {} accepted", corpus.len());
        // A corpus of refusals would test nothing but refusals.
        assert!(8 * accepted > corpus.len(), "{name}: {accepted} of {}", corpus.len());
    }
}
