//! The modules of the crates are layers, and so are the rooms inside the two largest: each imports
//! only those below it. No files import each other in a circle, whatever folders they are in.
#![allow(missing_docs, clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::path::Path;
use std::slice::from_ref;

/// From the bottom up.
const CORE: [&str; 10] = [
    "error",
    "math",
    "signal",
    "integrator",
    "design",
    "parts",
    "models",
    "simulate",
    "identify",
    "tune",
];

/// The rooms of `identify`, from the bottom up.
const IDENTIFY: [&str; 13] = [
    "modes",
    "swarm",
    "records",
    "parameters",
    "problem",
    "least_squares",
    "cost",
    "descent",
    "search",
    "experiments",
    "inference",
    "intervals",
    "identification",
];

/// The rooms of `models`, from the bottom up.
const MODELS: [&str; 14] = [
    "plant",
    "creep",
    "parameters",
    "traits",
    "creeping",
    "dahl",
    "feedback",
    "input",
    "plays",
    "relays",
    "nodes",
    "registry",
    "lanes",
    "any_inverse",
];

/// From the bottom up.
const CONTROL: [&str; 30] = [
    "error",
    "snapshot",
    "number",
    "cast",
    "unfused",
    "root",
    "cubic_motion",
    "cubic_segment",
    "hysteresis",
    "creep",
    "dynamics",
    "inverse",
    "limits",
    "online_feedforward",
    "filters",
    "feedback_law",
    "back_calculation",
    "state_space",
    "pid",
    "scheduled_pid",
    "lead_lag",
    "sliding_mode",
    "damping",
    "disturbance_observer",
    "hysteresis_observer",
    "repetitive",
    "iterative_learning",
    "measurement",
    "controller",
    "lockstep",
];

/// From the bottom up.
const PY: [&str; 7] = ["errors", "enter", "conversions", "control", "stages", "identify", "tune"];

/// A source file: its path below `src`, and its module path, empty for lib.rs.
struct Source {
    file: String,
    module: Vec<String>,
    text: String,
}

impl Source {
    fn new(file: &str, text: &str) -> Self {
        let stem = file.trim_end_matches(".rs");
        let module = stem.split('/').filter(|part| !matches!(*part, "mod" | "lib"));
        Self { file: file.into(), module: module.map(Into::into).collect(), text: text.into() }
    }

    /// A file that declares and re-exports those beside and below it.
    fn is_face(&self) -> bool {
        self.file.ends_with("lib.rs") || self.file.ends_with("mod.rs")
    }

    /// A face that does nothing else.
    fn only_declares(&self) -> bool {
        let code = code(&self.text);
        let makes = |line: &str| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let item = |word: &&&str| {
                matches!(
                    **word,
                    "fn" | "struct" | "enum" | "trait" | "impl" | "const" | "macro_rules!"
                )
            };
            words.iter().take(3).find(item).is_some()
        };
        self.is_face() && !code.lines().any(makes)
    }
}

/// One use of another module.
struct Arrow {
    place: String,
    from: Vec<String>,
    to: Vec<String>,
}

impl fmt::Display for Arrow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} -> {}", self.place, self.from.join("::"), self.to.join("::"))
    }
}

/// All files below `src`.
fn sources(src: &Path) -> Vec<Source> {
    let mut found = Vec::new();
    let mut folders = vec![src.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end == "rs") {
                let parts = path.strip_prefix(src).unwrap().iter().map(|part| part.to_str());
                let file: Vec<&str> = parts.map(Option::unwrap).collect();
                found.push(Source::new(&file.join("/"), &fs::read_to_string(&path).unwrap()));
            }
        }
    }
    found
}

/// The text without comments, line by line as before.
fn code(text: &str) -> String {
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

/// The paths that start at byte `at`, groups in braces expanded, each with the byte of its end;
/// and the first byte after them.
fn paths(code: &str, at: usize) -> (Vec<(Vec<String>, usize)>, usize) {
    let skip = |at: usize| at + code[at..].len() - code[at..].trim_start().len();
    let name_at = |at: usize| {
        let length = code[at..].find(|c: char| !(c.is_alphanumeric() || c == '_'));
        &code[at..at + length.unwrap_or(code.len() - at)]
    };
    let mut stem = Vec::new();
    let mut at = skip(at);
    loop {
        if code[at..].starts_with('{') {
            let mut all = Vec::new();
            at += 1;
            while !code[at..].starts_with('}') {
                let (inside, after) = paths(code, at);
                let joined =
                    inside.into_iter().map(|(tail, end)| ([&stem[..], &tail].concat(), end));
                all.extend(joined);
                // An alias is passed over with the comma.
                at = after + code[after..].find([',', '}']).unwrap();
                at = skip(if code[at..].starts_with(',') { at + 1 } else { at });
            }
            return (all, at + 1);
        }
        let name = name_at(at);
        at += name.len();
        if !name.is_empty() && name != "self" {
            stem.push(name.to_string());
        }
        if name.is_empty() || !code[at..].starts_with("::") {
            return (vec![(stem, at)], at);
        }
        at += 2;
    }
}

/// The uses of other modules in a file, their paths from the root of the crate.
fn arrows(source: &Source) -> Vec<Arrow> {
    let code = code(&source.text);
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(next) = code[at..].find("::") {
        // The word before these colons.
        let end = at + next;
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let start = code[..end].rfind(|c| !is_word(c)).map_or(0, |before| before + 1);
        at = end + 2;
        if !matches!(&code[start..end], "crate" | "super") {
            continue;
        }
        let (all, after) = paths(&code, start);
        at = after.max(at);
        for (path, end) in all {
            let above = path.iter().take_while(|part| *part == "super").count();
            let base = source.module.len().saturating_sub(above);
            let base = if path[0] == "crate" { &[] } else { &source.module[..base] };
            let rest = &path[if path[0] == "crate" { 1 } else { above }..];
            let line = 1 + code[..end].matches('\n').count();
            found.push(Arrow {
                place: format!("{}:{line}", source.file),
                from: source.module.clone(),
                to: [base, rest].concat(),
            });
        }
    }
    found
}

/// The uses of modules below a face that does more than declare them, which need no `super`.
fn downward(source: &Source) -> Vec<Arrow> {
    if !source.is_face() || source.only_declares() {
        return Vec::new();
    }
    let code = code(&source.text);
    let mut found = Vec::new();
    // What it re-exports it does not use.
    for (at, _) in code.match_indices("\nuse ") {
        for (path, end) in paths(&code, at + 5).0 {
            if !matches!(path[0].as_str(), "crate" | "super") {
                let line = 1 + code[..end].matches('\n').count();
                let place = format!("{}:{line}", source.file);
                let from = source.module.clone();
                found.push(Arrow { place, to: [&from[..], &path].concat(), from });
            }
        }
    }
    found
}

/// What each face re-exports: the path of the item there, and the file that it comes from.
fn faces(files: &[Source]) -> BTreeMap<Vec<String>, Vec<String>> {
    let mut found = BTreeMap::new();
    for face in files.iter().filter(|file| file.is_face()) {
        let code = code(&face.text);
        for (at, _) in code.match_indices("use ") {
            for (path, _) in paths(&code, at + 4).0 {
                if let [child, .., item] = &path[..] {
                    // A function may have the name of its file.
                    if child != item && !matches!(child.as_str(), "crate" | "super") {
                        let here = [&face.module[..], from_ref(item)].concat();
                        found.insert(here, [&face.module[..], &path[..path.len() - 1]].concat());
                    }
                }
            }
        }
    }
    found
}

/// All arrows, those to a re-exported item led on to the file that it comes from.
fn all_arrows(files: &[Source]) -> Vec<Arrow> {
    let faces = faces(files);
    let mut all = Vec::new();
    for mut arrow in files.iter().flat_map(arrows) {
        // Through the faces of the root, of a layer and of a room.
        while let Some(file) = (1..=arrow.to.len()).rev().find_map(|n| faces.get(&arrow.to[..n])) {
            arrow.to.clone_from(file);
        }
        all.push(arrow);
    }
    all
}

/// The arrows inside `room`, the root where it is empty, that point up in `order` or out of it.
fn upward(files: &[Source], room: &[&str], order: &[&str]) -> Vec<String> {
    let rank = |module: &[String]| {
        let layer = module.get(room.len())?;
        order.iter().position(|other| other == layer)
    };
    let inside = |module: &[String]| {
        module.len() > room.len() && module.iter().zip(room).all(|(name, other)| name == other)
    };
    let all = all_arrows(files).into_iter().filter(|arrow| inside(&arrow.from));
    // The root has nothing outside.
    let all = all.filter(|arrow| room.is_empty() || inside(&arrow.to));
    let wrong = all.filter(|arrow| match (rank(&arrow.from), rank(&arrow.to)) {
        (Some(from), Some(to)) => to > from,
        _ => true,
    });
    wrong.map(|arrow| arrow.to_string()).collect()
}

/// The module that a path is in.
fn within<'p>(modules: &BTreeSet<&[String]>, path: &'p [String]) -> Option<&'p [String]> {
    (1..=path.len()).rev().map(|n| &path[..n]).find(|part| modules.contains(part))
}

/// The circles of files, as the arrows that close them. A face that only declares and re-exports is
/// no file here: what is taken through it is followed to where it comes from.
fn circles(files: &[Source]) -> Vec<String> {
    let modules: BTreeSet<&[String]> =
        files.iter().filter(|file| !file.only_declares()).map(|file| &file.module[..]).collect();
    let mut links: BTreeMap<Vec<String>, BTreeMap<Vec<String>, String>> = BTreeMap::new();
    for arrow in all_arrows(files).into_iter().chain(files.iter().flat_map(downward)) {
        if let (Some(from), Some(to)) = (within(&modules, &arrow.from), within(&modules, &arrow.to))
            && from != to
        {
            let at = links.entry(from.to_vec()).or_default();
            at.entry(to.to_vec()).or_insert_with(|| arrow.to_string());
        }
    }
    // Files that import none of the rest, or that none of the rest imports, are taken away until
    // there are none: what is left is in circles, or between two.
    loop {
        let left: BTreeSet<_> = links.keys().cloned().collect();
        let imported: BTreeSet<_> = links.values().flat_map(BTreeMap::keys).cloned().collect();
        links.retain(|from, _| imported.contains(from));
        for targets in links.values_mut() {
            targets.retain(|to, _| left.contains(to));
        }
        links.retain(|_, targets| !targets.is_empty());
        if links.len() == left.len() {
            return links.into_values().flat_map(BTreeMap::into_values).collect();
        }
    }
}

fn files_of(name: &str) -> Vec<Source> {
    let core = Path::new(env!("CARGO_MANIFEST_DIR"));
    sources(&core.parent().unwrap().join(name).join("src"))
}

/// Files of a crate, a room of it or its root, and the order of what is there.
fn ordered() -> [(Vec<Source>, &'static [&'static str], &'static [&'static str]); 5] {
    [
        (files_of("core"), &[], &CORE),
        (files_of("core"), &["identify"], &IDENTIFY),
        (files_of("core"), &["models"], &MODELS),
        (files_of("control"), &[], &CONTROL),
        (files_of("py"), &[], &PY),
    ]
}

#[test]
fn each_module_has_its_place_in_the_order() {
    for (files, room, order) in ordered() {
        let inside = files.iter().filter(|file| {
            file.module.len() > room.len() && file.module.iter().zip(room).all(|(a, b)| a == b)
        });
        let found: BTreeSet<&str> = inside.map(|file| file.module[room.len()].as_str()).collect();
        assert_eq!(found, order.iter().copied().collect());
    }
}

#[test]
fn no_use_points_upward() {
    for (files, room, order) in ordered() {
        // The reader of the sources finds what is there.
        assert!(all_arrows(&files).len() > 20);
        let wrong = upward(&files, room, order);
        assert!(wrong.is_empty(), "upward:\n{}", wrong.join("\n"));
    }
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    for name in ["core", "control", "py", "capi"] {
        let wrong = circles(&files_of(name));
        assert!(wrong.is_empty(), "in circles:\n{}", wrong.join("\n"));
    }
}

#[test]
fn an_upward_use_is_found() {
    let made_up = "\
// use crate::identify::search;
use crate::error::{Error, Result};
use crate::{
    math::Lanes,
    models::{DahlStage, Model as Kind},
};
use super::delay::delayed;

fn f() {
    let x = super::super::design::margins(); // super::super::simulate
    crate::simulate::track(x);
    crate::nowhere::g();
}
";
    let files = [Source::new("signal/made_up.rs", made_up)];
    let expected = [
        "signal/made_up.rs:5: signal::made_up -> models::DahlStage",
        "signal/made_up.rs:5: signal::made_up -> models::Model",
        "signal/made_up.rs:10: signal::made_up -> design::margins",
        "signal/made_up.rs:11: signal::made_up -> simulate::track",
        "signal/made_up.rs:12: signal::made_up -> nowhere::g",
    ];
    assert_eq!(upward(&files, &[], &CORE), expected);
    assert!(
        upward(&[Source::new("identify/made_up.rs", "use crate::models::A;")], &[], &CORE)
            .is_empty()
    );
}

#[test]
fn an_upward_use_of_what_the_root_re_exports_is_found() {
    let files = [
        Source::new("lib.rs", "pub use models::{DahlStage, Model};"),
        Source::new("signal/made_up.rs", "use crate::DahlStage;"),
    ];
    assert_eq!(upward(&files, &[], &CORE), ["signal/made_up.rs:1: signal::made_up -> models"]);
}

#[test]
fn an_upward_use_between_rooms_is_found() {
    let files = [
        Source::new("identify/mod.rs", "mod cost;\npub use cost::evaluator::Evaluator;"),
        Source::new("identify/records/made_up.rs", "use crate::identify::Evaluator;"),
        Source::new("identify/cost/evaluator.rs", "use crate::tune::T;"),
    ];
    let expected =
        ["identify/records/made_up.rs:1: identify::records::made_up -> identify::cost::evaluator"];
    assert_eq!(upward(&files, &["identify"], &IDENTIFY), expected);
}

#[test]
fn a_circle_of_files_is_found() {
    let files = [
        Source::new("signal/mod.rs", "mod a;\nmod b;\nmod c;\npub use a::{A, Other};"),
        Source::new("signal/a.rs", "use super::b::B;"),
        // Through the face of the layer.
        Source::new("signal/b.rs", "use crate::signal::A;\nuse super::c::C;"),
        Source::new("signal/c.rs", "use crate::error::Error;"),
    ];
    let expected =
        ["signal/a.rs:1: signal::a -> signal::b::B", "signal/b.rs:1: signal::b -> signal::a"];
    assert_eq!(circles(&files), expected);
    assert!(circles(&files[1..2]).is_empty());
    // In a folder, through a file above that holds more than declarations.
    let files = [
        Source::new("signal/room/mod.rs", "mod a;\nuse a::A;\npub struct B;"),
        Source::new("signal/room/a.rs", "use super::B;"),
    ];
    let found = circles(&files);
    assert!(
        found.iter().any(|arrow| arrow.contains("signal::room::a -> signal::room")),
        "{found:?}"
    );
}
