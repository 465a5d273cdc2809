//! The file from which an interrupted search goes on.
//!
//! A line that says what it is and of which search, the number of bytes that follow and their sum;
//! then the answers of the simulations, each as the count of its numbers and the numbers themselves,
//! little-endian. The file is written anew beside itself and renamed: it is whole at any moment.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use piezotrack_core::identify::Journal;
use pyo3::prelude::*;

use super::checkpoint_content::{answer, head, keep, payload};
use crate::errors::data;

/// Time between two writings.
const INTERVAL: Duration = Duration::from_millis(500);

/// Answers that a search has computed, in a file.
#[pyclass(name = "Checkpoint", frozen, module = "piezotrack._core")]
pub struct PyCheckpoint(pub Arc<Answers>);

#[pymethods]
impl PyCheckpoint {
    /// Reads the file of the search `identity` where there is one, else begins it.
    #[new]
    fn new(path: PathBuf, identity: String) -> PyResult<Self> {
        let shown = path.display().to_string();
        let bytes = match fs::read(&path) {
            Ok(content) => payload(&content, &identity)
                .map_err(|reason| data(format!("checkpoint {shown} {reason}")))?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(error) => {
                let reason = reason(&error);
                return Err(data(format!("checkpoint {shown} cannot be read: {reason}")));
            }
        };
        let known = bytes.len();
        let state = State { bytes, read: 0, last: Instant::now(), failure: None, strange: false };
        let answers = Answers { path, identity, known, state: Mutex::new(state) };
        // At once, so that a folder that is not there is known before anything is computed.
        if known == 0 {
            answers.with(|state| answers.save(state));
            if let Some(failure) = answers.checked()? {
                return Err(data(failure));
            }
        }
        Ok(Self(Arc::new(answers)))
    }

    /// Writes what is not written yet; a sentence where that is not possible.
    fn save(&self) -> PyResult<Option<String>> {
        let answers = &self.0;
        answers.with(|state| {
            if state.bytes.len() > answers.known {
                answers.save(state);
            }
        });
        answers.checked()
    }

    /// Bytes of answers that an earlier search left.
    #[getter]
    fn known(&self) -> usize {
        self.0.known
    }
}

/// The answers of a search.
pub struct Answers {
    path: PathBuf,
    identity: String,
    known: usize,
    state: Mutex<State>,
}

struct State {
    bytes: Vec<u8>,
    /// Bytes that were recalled.
    read: usize,
    /// When the file was written.
    last: Instant,
    /// Why it could not be written.
    failure: Option<String>,
    /// Whether a question was another than that which was answered.
    strange: bool,
}

impl Journal for Answers {
    fn recall(&self, count: usize) -> Option<Vec<f64>> {
        self.with(|state| {
            let rest = state.bytes.get(state.read..).filter(|rest| !rest.is_empty())?;
            let Some((numbers, length)) = answer(rest, count) else {
                // What follows is of no use either.
                state.strange = true;
                state.bytes.truncate(state.read);
                return None;
            };
            state.read += length;
            Some(numbers)
        })
    }

    fn keep(&self, numbers: &[f64]) {
        self.with(|state| {
            keep(numbers, &mut state.bytes);
            state.read = state.bytes.len();
            if state.failure.is_none() && state.last.elapsed() >= INTERVAL {
                self.save(state);
            }
        });
    }
}

impl Answers {
    fn with<T>(&self, job: impl FnOnce(&mut State) -> T) -> T {
        // Nothing panics while it holds the lock.
        job(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Writes the file; a failure is kept for the end, as the search itself can go on.
    fn save(&self, state: &mut State) {
        state.last = Instant::now();
        let head = head(&self.identity, &state.bytes);
        if let Err(error) = replace(&self.path, &[head.as_bytes(), &state.bytes]) {
            state.failure = Some(reason(&error));
        }
    }

    /// Why it could not be written, if so.
    fn checked(&self) -> PyResult<Option<String>> {
        let shown = self.path.display();
        let (failure, strange) = self.with(|state| (state.failure.clone(), state.strange));
        if strange {
            return Err(data(format!(
                "checkpoint {shown} has other simulations than this search asks for: expected \
                 that of the same search"
            )));
        }
        Ok(failure.map(|failure| format!("checkpoint {shown} cannot be written: {failure}")))
    }
}

/// Message of the system, without its number.
fn reason(error: &io::Error) -> String {
    let text = error.to_string();
    text.split(" (os error").next().unwrap_or(&text).to_lowercase()
}

/// Writes a file beside the one of that name, and renames it.
fn replace(path: &Path, parts: &[&[u8]]) -> io::Result<()> {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".part");
    // One name: what a killed search leaves behind is used again.
    let beside = path.with_file_name(name);
    let written = || {
        let mut file = File::create(&beside)?;
        parts.iter().try_for_each(|part| file.write_all(part))?;
        file.sync_all()?;
        fs::rename(&beside, path)
    };
    written().inspect_err(|_| {
        // The reason for the failure matters more than what is left of the attempt.
        let _ = fs::remove_file(&beside);
    })
}
