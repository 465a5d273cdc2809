//! Python's `Problem`: the model, the records and what is said of the parameters, read by attribute.

use piezotrack_core::Result;
use piezotrack_core::identify::{
    Delay, DriftKind, History, Record, Spec, WeightsRecord, creep_times,
};
use piezotrack_core::models::Model;
use piezotrack_core::signal::Hold;
use pyo3::prelude::*;

use crate::conversions::arrays::samples;
use crate::errors::raise;
use crate::stages::stage::hold;

/// A `Problem`.
#[derive(FromPyObject)]
pub struct PyProblem<'py> {
    model: String,
    records: Vec<PyRecord<'py>>,
    labels: Vec<String>,
    #[pyo3(from_py_with = entries)]
    parameters: Vec<(String, PyParameter)>,
    constraints: Vec<String>,
    creep: Option<PyCreep>,
}

/// A `Record`.
#[derive(FromPyObject)]
struct PyRecord<'py> {
    data: PyDataset<'py>,
    offset: bool,
    delay: Option<PyDelay>,
    drift: Option<PyDrift>,
    history: Option<String>,
    weight: f64,
}

/// A `Dataset` with its window.
#[derive(FromPyObject)]
struct PyDataset<'py> {
    full: PySamples<'py>,
    dt: f64,
    hold: String,
    warmup: usize,
}

#[derive(FromPyObject)]
struct PySamples<'py> {
    u: Bound<'py, PyAny>,
    y: Bound<'py, PyAny>,
    left_out: Option<Vec<bool>>,
}

/// Whether a delay is fitted, its value or its bounds, s.
#[derive(FromPyObject)]
enum PyDelay {
    Truth(bool),
    Value(f64),
    Bounds((f64, f64)),
}

/// Whether a drift is fitted, or its time constant, s.
#[derive(FromPyObject)]
enum PyDrift {
    Truth(bool),
    Time(f64),
}

/// Whether the stage creeps, or with which time constants, s.
#[derive(FromPyObject)]
enum PyCreep {
    Truth(bool),
    Times(Vec<f64>),
}

/// A `Parameter`.
#[derive(FromPyObject)]
struct PyParameter {
    value: Option<f64>,
    bounds: Option<(f64, f64)>,
    scale: Option<String>,
    tie: Option<String>,
    prior: Option<(f64, f64)>,
}

/// The entries of a mapping, in its order.
fn entries(mapping: &Bound<'_, PyAny>) -> PyResult<Vec<(String, PyParameter)>> {
    mapping.call_method0("items")?.try_iter()?.map(|entry| entry?.extract()).collect()
}

/// The same with its numbers out of Python.
pub struct Question {
    pub model: Model,
    pub records: Vec<OneRecord>,
    /// Specification of the stage, without the values of each record.
    spec: Spec,
    /// Known time constants of the creep; those that suit the records where there are none.
    creep: Option<Vec<f64>>,
}

/// A record and what is asked of it alone.
pub struct OneRecord {
    u: Vec<f64>,
    y: Vec<f64>,
    /// Samples whose displacement does not count; none where empty.
    left_out: Vec<bool>,
    dt: f64,
    hold: Hold,
    start: usize,
    offset: bool,
    delay: Delay,
    /// None where nothing is said of it.
    drift: Option<DriftKind>,
    /// None where the record is to show it.
    history: Option<History>,
    label: String,
    weight: f64,
}

impl PyProblem<'_> {
    /// Takes the numbers out of Python.
    pub fn question(self) -> PyResult<Question> {
        let model = Model::named(&self.model).map_err(|error| raise(&error))?;
        let labelled = self.records.into_iter().zip(self.labels);
        let records = labelled.map(|(record, label)| record.numbers(label));
        let mut spec = Spec { constraints: self.constraints, ..Spec::of(model) };
        for (name, parameter) in self.parameters {
            parameter.enter(name, &mut spec);
        }
        let creep = match self.creep {
            Some(PyCreep::Truth(true)) => None,
            None | Some(PyCreep::Truth(false)) => Some(Vec::new()),
            Some(PyCreep::Times(times)) => Some(times),
        };
        Ok(Question { model, records: records.collect::<PyResult<_>>()?, spec, creep })
    }
}

impl PyParameter {
    /// Enters what is said of it; of one that nothing is said of, that it is searched.
    fn enter(self, name: String, spec: &mut Spec) {
        let Self { value, bounds, scale, tie, prior } = self;
        if value.is_none()
            && bounds.is_none()
            && scale.is_none()
            && tie.is_none()
            && prior.is_none()
        {
            spec.free.push(name);
            return;
        }
        spec.fixed.extend(value.map(|value| (name.clone(), value)));
        spec.bounds.extend(bounds.map(|bounds| (name.clone(), bounds)));
        spec.scales.extend(scale.map(|scale| (name.clone(), scale)));
        spec.ties.extend(tie.map(|tie| (name.clone(), tie)));
        spec.priors.extend(prior.map(|prior| (name, prior)));
    }
}

impl PyRecord<'_> {
    fn numbers(self, label: String) -> PyResult<OneRecord> {
        let PyDataset { full, dt, hold: named, warmup: start } = self.data;
        let hold = hold(&named).map_err(|error| raise(&error))?;
        let history = self.history.as_deref().map(History::named).transpose();
        let history = history.map_err(|error| raise(&error.of(&label)))?;
        let delay = match self.delay {
            None | Some(PyDelay::Truth(false)) => Delay::default(),
            Some(PyDelay::Truth(true)) => Delay::Fitted,
            Some(PyDelay::Value(value)) => Delay::Fixed(value),
            Some(PyDelay::Bounds((low, high))) => Delay::Between(low, high),
        };
        let drift = self.drift.map(|drift| match drift {
            PyDrift::Truth(false) => DriftKind::None,
            PyDrift::Truth(true) => DriftKind::Auto,
            PyDrift::Time(time) => DriftKind::Time(time),
        });
        let (u, y) = (samples("u", &full.u)?, samples("y", &full.y)?);
        let left_out = full.left_out.unwrap_or_default();
        let Self { offset, weight, .. } = self;
        Ok(OneRecord {
            u,
            y,
            left_out,
            dt,
            hold,
            start,
            offset,
            delay,
            drift,
            history,
            label,
            weight,
        })
    }
}

impl OneRecord {
    /// The record.
    pub fn record(&self) -> Result<Record<'_>> {
        let record = Record::new(&self.u, &self.y, self.dt, self.hold, self.start)
            .and_then(|record| record.without(&self.left_out));
        record.map_err(|error| error.of(&self.label))?.among(&self.label, self.weight)
    }

    /// The record for least squares, which take the drift that it shows where nothing is said.
    pub fn weights_record(&self) -> Result<WeightsRecord<'_>> {
        let Record { drive, y, weight, left_out, .. } = self.record()?;
        let Self { start, offset, history, .. } = *self;
        let shown = if offset { DriftKind::Auto } else { DriftKind::None };
        let drift = self.drift.unwrap_or(shown);
        let of_all = WeightsRecord::of(drive, y, start);
        let one = WeightsRecord { history, offset, drift, weight, left_out, ..of_all };
        one.delayed(self.delay).map_err(|error| error.of(&self.label))
    }
}

impl Question {
    /// The records of a search, each with what is searched, and with the creep that suits them all.
    pub fn searched(&self) -> Result<Vec<(Record<'_>, Spec)>> {
        let records: Vec<Record<'_>> =
            self.records.iter().map(OneRecord::record).collect::<Result<_>>()?;
        let all: Vec<&Record<'_>> = records.iter().collect();
        let creep_times = self.creep.clone().map_or_else(|| creep_times(&all), Ok)?;
        let spec = |one: &OneRecord| Spec {
            offset: one.offset,
            delay: one.delay,
            drift: one.drift.unwrap_or(DriftKind::None),
            history: one.history.unwrap_or(History::Virgin),
            creep_times: creep_times.clone(),
            ..self.spec.clone()
        };
        let specs: Vec<Spec> = self.records.iter().map(spec).collect();
        Ok(records.into_iter().zip(specs).collect())
    }
}
