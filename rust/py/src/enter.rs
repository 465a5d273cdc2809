//! Entry of all long calls into the core: GIL, Ctrl-C, progress and threads.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use piezotrack_core::Error;
use piezotrack_core::identify::{Journal, Monitor, Progress};
use piezotrack_core::signal::Stop;
use pyo3::exceptions::{PyKeyboardInterrupt, PyOSError, PyStopIteration};
use pyo3::prelude::*;

use crate::errors::raise;

/// Time between two checks for signals, and between two reports to a progress bar.
const POLL: Duration = Duration::from_millis(50);

/// Most threads that are started: more than any machine of today has use for.
const MOST_THREADS: usize = 256;

/// Receivers of the progress of a search.
pub struct Watchers {
    /// Called after every iteration, which waits for it; may stop the search.
    pub callback: Option<Py<PyAny>>,
    /// Called now and then.
    pub progress: Option<Py<PyAny>>,
    /// Keeps what is computed.
    pub journal: Option<Arc<dyn Journal>>,
    /// Called now and then: whether the job is to stop, of one on a thread that no signal reaches.
    pub stopped: Option<Py<PyAny>>,
}

/// Why a job was stopped from Python.
#[derive(Default)]
struct Halt {
    stopped: AtomicBool,
    error: Mutex<Option<PyErr>>,
}

impl Halt {
    /// Stops the job; an exception other than an interruption is kept, to be raised.
    fn stop(&self, py: Python<'_>, error: PyErr) {
        self.stopped.store(true, Ordering::Relaxed);
        let interruption = error.is_instance_of::<PyKeyboardInterrupt>(py)
            || error.is_instance_of::<PyStopIteration>(py);
        if !interruption && let Ok(mut slot) = self.error.lock() {
            *slot = Some(error);
        }
    }

    fn look_at_signals(&self, stopped: Option<&Py<PyAny>>) {
        self.with_python(|py| {
            let asked = py.check_signals().and_then(|()| match stopped {
                Some(stopped) => stopped.call0(py)?.is_truthy(py),
                None => Ok(false),
            });
            match asked {
                Ok(false) => {}
                Ok(true) => self.stop(py, PyKeyboardInterrupt::new_err("interrupted")),
                Err(error) => self.stop(py, error),
            }
        });
    }

    /// Calls Python, or stops the job where there is none any more: the interpreter ends without
    /// waiting for a daemon thread, and to attach one to it then is a segmentation fault. The end
    /// of `detach` is safe: there `pyo3` lets such a thread sleep until the process is gone.
    fn with_python(&self, call: impl FnOnce(Python<'_>)) {
        if Python::try_attach(call).is_none() {
            self.stopped.store(true, Ordering::Relaxed);
        }
    }

    fn stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    fn take(&self) -> Option<PyErr> {
        self.error.lock().ok().and_then(|mut slot| slot.take())
    }
}

/// Runs a job on the calling thread, without the GIL, answering Ctrl-C.
pub fn enter<T: Send>(
    py: Python<'_>,
    job: impl FnOnce(Stop<'_>) -> piezotrack_core::Result<T> + Send,
) -> PyResult<T> {
    let halt = Halt::default();
    let last = Mutex::new(Instant::now());
    let result = py.detach(|| {
        let stop = || {
            if let Ok(mut last) = last.lock()
                && last.elapsed() >= POLL
            {
                halt.look_at_signals(None);
                *last = Instant::now();
            }
            halt.stopped()
        };
        job(&stop)
    });
    match halt.take() {
        Some(error) => Err(error),
        None if halt.stopped() => Err(PyKeyboardInterrupt::new_err("interrupted")),
        None => result.map_err(|error| raise(&error)),
    }
}

/// Runs a job on threads of its own while the calling thread watches signals and callbacks.
///
/// The pool is built for the call, so nothing is shared with a forked process and the global
/// pool stays untouched. An interruption is not an error: the job returns what it has.
pub fn enter_pool<T: Send>(
    py: Python<'_>,
    threads: usize,
    watchers: &Watchers,
    job: impl FnOnce(&mut dyn Monitor, Stop<'_>) -> piezotrack_core::Result<T> + Send,
) -> PyResult<T> {
    if threads > MOST_THREADS {
        let expected = format!("0 for all cores, or up to {MOST_THREADS}");
        return Err(raise(&Error::parameter("threads", threads, expected)));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|i| format!("piezotrack-{i}"))
        .build()
        .map_err(|error| PyOSError::new_err(format!("no threads could be started: {error}")))?;
    let halt = &Halt::default();
    let (reports, inbox) = channel();
    let (answers, outbox) = channel();
    let mut relay = Relay {
        reports,
        answers: outbox,
        waits: watchers.callback.is_some(),
        shows: watchers.progress.is_some(),
        last: None,
        journal: watchers.journal.clone(),
    };
    let (pool, stop) = (&pool, &|| halt.stopped());
    let joined = py.detach(move || {
        std::thread::scope(|scope| {
            let worker = scope.spawn(move || pool.install(move || job(&mut relay, stop)));
            watch(watchers, halt, &inbox, &answers);
            worker.join()
        })
    });
    if let Some(error) = halt.take() {
        return Err(error);
    }
    match joined {
        Ok(result) => result.map_err(|error| raise(&error)),
        Err(_) => Err(PyOSError::new_err(
            "a thread of the search ended with an internal error; please report this",
        )),
    }
}

/// Runs a job on threads of its own that reports nothing, and whose partial result is of no use: an
/// interruption is raised.
pub fn enter_quiet_pool<T: Send>(
    py: Python<'_>,
    threads: usize,
    job: impl FnOnce(Stop<'_>) -> piezotrack_core::Result<T> + Send,
) -> PyResult<T> {
    enter_quiet_pool_until(py, threads, None, job)
}

/// The same, until `stopped` says so.
pub fn enter_quiet_pool_until<T: Send>(
    py: Python<'_>,
    threads: usize,
    stopped: Option<Py<PyAny>>,
    job: impl FnOnce(Stop<'_>) -> piezotrack_core::Result<T> + Send,
) -> PyResult<T> {
    let quiet = Watchers { callback: None, progress: None, journal: None, stopped };
    let (result, stopped) = enter_pool(py, threads, &quiet, |_, stop| {
        let result = job(stop);
        Ok((result, stop()))
    })?;
    if stopped {
        return Err(PyKeyboardInterrupt::new_err("interrupted"));
    }
    result.map_err(|error| raise(&error))
}

/// Passes reports to Python, and signals to the worker, until the worker ends.
fn watch(
    watchers: &Watchers,
    halt: &Halt,
    inbox: &Receiver<Progress>,
    answers: &Sender<ControlFlow<()>>,
) {
    let mut looked = Instant::now();
    loop {
        match inbox.recv_timeout(POLL) {
            Ok(progress) => tell(watchers, halt, &progress, answers),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        if looked.elapsed() >= POLL {
            halt.look_at_signals(watchers.stopped.as_ref());
            looked = Instant::now();
        }
    }
}

/// Calls the progress bar and the callback, and answers the worker if it waits.
fn tell(watchers: &Watchers, halt: &Halt, progress: &Progress, answers: &Sender<ControlFlow<()>>) {
    let report = (
        progress.iteration,
        progress.iterations,
        progress.evaluations,
        progress.cost,
        progress.theta.parameters().to_vec(),
        progress.theta.delay(),
    );
    halt.with_python(|py| {
        if let Some(bar) = &watchers.progress
            && let Err(error) = bar.call1(py, report.clone())
        {
            halt.stop(py, error);
        }
        if let Some(callback) = &watchers.callback {
            let asked = callback.call1(py, report).and_then(|answer| answer.is_truthy(py));
            match asked {
                Ok(false) => {}
                Ok(true) => halt.stop(py, PyStopIteration::new_err(())),
                Err(error) => halt.stop(py, error),
            }
        }
    });
    if watchers.callback.is_some() {
        let answer =
            if halt.stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        // The worker may have gone meanwhile; then nobody waits.
        let _ = answers.send(answer);
    }
}

/// The search's side of the conversation.
struct Relay {
    reports: Sender<Progress>,
    answers: Receiver<ControlFlow<()>>,
    waits: bool,
    shows: bool,
    last: Option<Instant>,
    journal: Option<Arc<dyn Journal>>,
}

impl Monitor for Relay {
    fn journal(&self) -> Option<Arc<dyn Journal>> {
        self.journal.clone()
    }

    fn report(&mut self, progress: &Progress) -> ControlFlow<()> {
        let due = self.last.is_none_or(|last| last.elapsed() >= POLL);
        let wanted = self.waits || (self.shows && due);
        if !wanted {
            return ControlFlow::Continue(());
        }
        self.last = Some(Instant::now());
        if self.reports.send(*progress).is_err() {
            return ControlFlow::Break(());
        }
        if !self.waits {
            return ControlFlow::Continue(());
        }
        self.answers.recv().unwrap_or(ControlFlow::Break(()))
    }
}
