//! What is asked of a record: the kind of stage, what is searched, and between which bounds.

use piezotrack_core::Result;
use piezotrack_core::identify::{Delay, DriftKind, History, Record, Spec, creep_times};
use piezotrack_core::models::Model;
use piezotrack_core::signal::Hold;
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::errors::raise;
use crate::stage::hold;

/// A record and what is asked of it, from a dict of Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Question<'py> {
    model: String,
    u: Bound<'py, PyAny>,
    y: Bound<'py, PyAny>,
    dt: f64,
    hold_name: String,
    start: usize,
    free: Option<Vec<String>>,
    fixed: Vec<(String, f64)>,
    bounds: Vec<(String, (f64, f64))>,
    scales: Vec<(String, String)>,
    ties: Vec<(String, String)>,
    constraints: Vec<String>,
    priors: Vec<(String, (f64, f64))>,
    stiffness: Option<f64>,
    offset: bool,
    delay: Option<(f64, f64)>,
    drift: Option<f64>,
    history: String,
    creep: Option<Vec<f64>>,
    label: String,
    weight: f64,
}

/// The same, checked as far as it can be without the record's help.
pub struct Asked {
    u: Vec<f64>,
    y: Vec<f64>,
    dt: f64,
    hold: Hold,
    start: usize,
    spec: Spec,
    /// Known time constants of the creep; those that suit the records where there are none.
    creep: Option<Vec<f64>>,
    label: String,
    weight: f64,
}

/// The delay between two bounds, s: known where they are equal, chosen where there are none.
pub fn delay_between(bounds: Option<(f64, f64)>) -> Delay {
    match bounds {
        None => Delay::Fitted,
        #[expect(clippy::float_cmp, reason = "the caller writes one number twice")]
        Some((low, high)) if low == high => Delay::Fixed(low),
        Some((low, high)) => Delay::Between(low, high),
    }
}

/// The drift with a time constant, s: none where it is 0, what the record shows where there is none.
pub fn drift_with(time: Option<f64>) -> DriftKind {
    match time {
        None => DriftKind::Auto,
        Some(0.0) => DriftKind::None,
        Some(time) => DriftKind::Time(time),
    }
}

impl Question<'_> {
    /// Takes the numbers out of Python.
    pub fn asked(self) -> PyResult<Asked> {
        let (u, y) = (samples("u", &self.u)?, samples("y", &self.y)?);
        let delay = delay_between(self.delay);
        let named = || Ok((Model::named(&self.model)?, History::named(&self.history)?));
        let (model, history) = named().map_err(|error| raise(&error))?;
        let spec = Spec {
            free: self.free,
            fixed: self.fixed,
            bounds: self.bounds,
            scales: self.scales,
            ties: self.ties,
            constraints: self.constraints,
            priors: self.priors,
            stiffness: self.stiffness,
            offset: self.offset,
            delay,
            drift: drift_with(self.drift),
            history,
            ..Spec::of(model)
        };
        let hold = hold(&self.hold_name).map_err(|error| raise(&error))?;
        let Self { dt, start, creep, label, weight, .. } = self;
        Ok(Asked { u, y, dt, hold, start, spec, creep, label, weight })
    }
}

impl Asked {
    /// The record.
    pub fn record(&self) -> Result<Record<'_>> {
        let record = Record::new(&self.u, &self.y, self.dt, self.hold, self.start);
        record.map_err(|error| error.of(&self.label))?.among(&self.label, self.weight)
    }

    /// What is searched, with the creep that suits the records.
    pub fn spec(&self, records: &[&Record<'_>]) -> Result<Spec> {
        let creep_times = self.creep.clone().map_or_else(|| creep_times(records), Ok)?;
        Ok(Spec { creep_times, ..self.spec.clone() })
    }
}
