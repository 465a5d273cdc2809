//! Targets of the fuzzers: each makes its input from bytes, and panics where a promise is broken.
//!
//! A target's `run` says whether the settings in the bytes were accepted. libFuzzer runs the same
//! functions (`targets/`) as the replay of what it kept (`replay.rs`).

pub mod bytes;
pub mod checkpoints;
pub mod controllers;
pub mod inverses;
pub mod stages;
pub mod texts;

/// A target: whether it accepted the bytes.
pub type Target = fn(&[u8]) -> bool;

/// All targets by their names, which are those of their folders.
pub const TARGETS: [(&str, Target); 5] = [
    ("checkpoints", checkpoints::run),
    ("texts", texts::run),
    ("controllers", controllers::run),
    ("stages", stages::run),
    ("inverses", inverses::run),
];
