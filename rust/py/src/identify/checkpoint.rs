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

use crate::errors::data;

/// First words of the file, with the version of its format.
const FORMAT: &str = "piezotrack-checkpoint 1";

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
            state.bytes.extend((numbers.len() as u64).to_le_bytes());
            state.bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            state.read = state.bytes.len();
            if state.failure.is_none() && state.last.elapsed() >= INTERVAL {
                self.save(state);
            }
        });
    }
}

/// The first answer of some bytes, if it has so many numbers, and its length in bytes.
fn answer(bytes: &[u8], count: usize) -> Option<(Vec<f64>, usize)> {
    let (head, rest) = bytes.split_first_chunk()?;
    let written = usize::try_from(u64::from_le_bytes(*head)).ok()?;
    let numbers = rest.get(..count.checked_mul(size_of::<f64>())?)?;
    let (numbers, _) = numbers.as_chunks();
    let found = numbers.iter().map(|number| f64::from_le_bytes(*number)).collect();
    (written == count).then_some((found, size_of::<u64>() + size_of::<f64>() * count))
}

impl Answers {
    fn with<T>(&self, job: impl FnOnce(&mut State) -> T) -> T {
        // Nothing panics while it holds the lock.
        job(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Writes the file; a failure is kept for the end, as the search itself can go on.
    fn save(&self, state: &mut State) {
        state.last = Instant::now();
        let head = format!(
            "{FORMAT} {} {} {:016x}\n",
            self.identity,
            state.bytes.len(),
            sum(&state.bytes)
        );
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

/// The answers in the content of a file, or what is wrong with it.
fn payload(content: &[u8], identity: &str) -> Result<Vec<u8>, String> {
    let end = content.iter().take(200).position(|&byte| byte == b'\n');
    let head = end.and_then(|end| std::str::from_utf8(&content[..end]).ok()).unwrap_or("");
    let Some(words) = head.strip_prefix("piezotrack-checkpoint ") else {
        return Err("is no checkpoint: expected a file that a search has written, or none".into());
    };
    let words: Vec<&str> = words.split(' ').collect();
    let [version, known, length, total] = words[..] else {
        return Err("is not as it was written: expected it unchanged, or none".into());
    };
    if Some(version) != FORMAT.split(' ').next_back() {
        return Err(format!("is of version {version}: expected 1"));
    }
    if known != identity {
        return Err("is that of another search: expected the same records, model, arguments and \
                    version, or another file"
            .into());
    }
    let bytes = &content[head.len() + 1..];
    if length != bytes.len().to_string() || total != format!("{:016x}", sum(bytes)) {
        return Err("is not as it was written: expected it unchanged, or none".into());
    }
    Ok(bytes.to_vec())
}

/// FNV-1a of 64 bits, by words of eight bytes and the rest.
fn sum(bytes: &[u8]) -> u64 {
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let (words, rest) = bytes.as_chunks::<8>();
    let words = words.iter().map(|word| u64::from_le_bytes(*word));
    let all = words.chain(rest.iter().map(|&byte| u64::from(byte)));
    all.fold(0xcbf2_9ce4_8422_2325, |sum, word| (sum ^ word).wrapping_mul(PRIME))
}
