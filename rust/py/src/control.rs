//! Controllers and inverses, as configuration and as sessions.

use numpy::{PyArray1, ToPyArray};
use piezotrack_control::{
    BoucWenInverse, BoucWenInverseState, Command, Controller, ControllerState, DahlInverse,
    FeedbackInverseState, Filter, FirstOrderDahlInverse, InverseState, Limits, OscillatorInverse,
    Pid, Repetitive, SampledDahlInverse, Smoothing, StateSpace,
};
use piezotrack_core::simulate::{Law, LawState};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::arrays::samples;
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyController>()?;
    module.add_class::<PySession>()?;
    module.add_class::<PyInverseSession>()?;
    module.add_function(wrap_pyfunction!(feedforward, module)?)
}

/// kp, ti, td, and tt where it is given.
type PidGains = (f64, f64, f64, Option<f64>);

/// A row by row, B, C, D, and the vector of back-calculation where it is given.
type Matrices = (Vec<f64>, Vec<f64>, Vec<f64>, f64, Option<Vec<f64>>);

/// period, kq, smoothing by its name, its number, leak, lead, pause.
type RepetitiveSettings = (f64, f64, String, f64, f64, u32, bool);

/// A controller for one sampling interval.
#[pyclass(name = "Controller", frozen, module = "piezotrack._core")]
pub struct PyController {
    pub controller: Controller<Law>,
    pub dt: f64,
}

#[pymethods]
impl PyController {
    #[new]
    #[pyo3(signature = (*, dt, limits, pid, state_space, repetitive, filters))]
    fn new(
        dt: f64,
        limits: (f64, f64),
        pid: Option<PidGains>,
        state_space: Option<Matrices>,
        repetitive: Option<RepetitiveSettings>,
        filters: Vec<(String, f64, f64, f64)>,
    ) -> PyResult<Self> {
        let build = move || -> Result<Self> {
            piezotrack_core::error::positive("dt", dt, "s")?;
            let law = law(dt, pid, state_space)?;
            let mut controller = Controller::new(Limits::new(limits.0, limits.1)?, law);
            controller.repetitive = match repetitive {
                Some(settings) => Some(repetitive_from(settings)?.at(dt)?),
                None => None,
            };
            let most = controller.filters.len();
            if filters.len() > most {
                return Err(Error::parameter("filters", filters.len(), format!("{most} at most")));
            }
            for (slot, filter) in controller.filters.iter_mut().zip(&filters) {
                *slot = Some(filter_from(filter, dt)?);
            }
            Ok(Self { controller, dt })
        };
        build().map_err(|error| raise(&error))
    }

    /// Entries of the repetitive part's delay line.
    #[getter]
    fn line_length(&self) -> usize {
        self.controller.repetitive.map_or(0, |part| part.length())
    }

    /// A session of its own, going on from the voltage `present` where that is given.
    fn start(&self, present: Option<f64>) -> PyResult<PySession> {
        let line = vec![0.0; self.line_length()];
        let state = match present {
            Some(volts) => self.controller.start(volts, line),
            None => self.controller.rest(line),
        };
        let state = state.map_err(|error| raise(&error.into()))?;
        Ok(PySession { controller: self.controller, state })
    }
}

fn law(dt: f64, pid: Option<PidGains>, state_space: Option<Matrices>) -> Result<Law> {
    match (pid, state_space) {
        (Some((kp, ti, td, tt)), _) => Ok(Law::Pid(Pid::new(kp, ti, td, tt)?.at(dt)?)),
        (None, Some((a, b, c, d, back))) => {
            Ok(Law::StateSpace(StateSpace::new(&a, &b, &c, d, back.as_deref())?))
        }
        (None, None) => Ok(Law::None),
    }
}

/// A repetitive part from plain numbers.
pub fn repetitive_from(settings: RepetitiveSettings) -> Result<Repetitive> {
    let (period, kq, smoothing, number, leak, lead, pause) = settings;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked there")]
    let smoothing = match smoothing.as_str() {
        "lag" => Smoothing::Lag { tq: number, compensated: false },
        "compensated lag" => Smoothing::Lag { tq: number, compensated: true },
        "zero phase" => Smoothing::ZeroPhase { order: number as u32 },
        _ => Smoothing::None,
    };
    Ok(Repetitive { leak, lead, pause, ..Repetitive::new(period, smoothing, kq)? })
}

/// A filter from its name and three numbers.
fn filter_from((kind, first, second, third): &(String, f64, f64, f64), dt: f64) -> Result<Filter> {
    Ok(match kind.as_str() {
        "notch" => Filter::notch(*first, *second, *third, dt)?,
        _ => Filter::low_pass(*first, dt)?,
    })
}

/// A controller at work.
#[pyclass(name = "Session", module = "piezotrack._core")]
struct PySession {
    controller: Controller<Law>,
    state: ControllerState<LawState, Vec<f64>>,
}

/// volts, unclipped, feedforward, feedback, repetitive, error, saturated, measured well, reference
/// well.
type CommandParts = (f64, f64, f64, f64, f64, f64, bool, bool, bool);

#[pymethods]
impl PySession {
    fn step(&mut self, reference: f64, measured: f64, feedforward: f64) -> f64 {
        self.controller.step(&mut self.state, reference, measured, feedforward).volts
    }

    fn last(&self) -> CommandParts {
        let Command {
            volts,
            unclipped,
            feedforward,
            feedback,
            repetitive,
            error,
            saturated,
            measurement_ok,
            reference_ok,
        } = *self.state.last();
        let well = (measurement_ok, reference_ok);
        (volts, unclipped, feedforward, feedback, repetitive, error, saturated, well.0, well.1)
    }

    fn applied(&mut self, volts: f64) -> PyResult<()> {
        self.state.applied(volts).map_err(|error| raise(&error.into()))
    }

    fn reset(&mut self) {
        self.controller.reset(&mut self.state);
    }

    /// Goes on with the settings of another controller for the same interval.
    fn retune(&mut self, other: &PyController) -> PyResult<()> {
        let (mine, others) = (&self.controller.feedback, &other.controller.feedback);
        let same = core::mem::discriminant(mine) == core::mem::discriminant(others);
        let repetitive = self.controller.repetitive.map(|part| part.length())
            == other.controller.repetitive.map(|part| part.length());
        if !(same && repetitive) {
            let expected = "a feedback of the same kind, and a repetitive part of the same period";
            return Err(raise(&Error::parameter("controller", "another", expected)));
        }
        self.controller = other.controller;
        Ok(())
    }
}

/// The inverse of a stage for one sampling interval.
enum AnyInverse {
    Dahl(SampledDahlInverse, InverseState),
    BoucWen(BoucWenInverse, BoucWenInverseState),
    FirstOrderDahl(FirstOrderDahlInverse, FeedbackInverseState),
    Oscillator(OscillatorInverse, FeedbackInverseState),
}

impl AnyInverse {
    /// By the name of the model.
    fn new(model: &str, theta: &[f64], dt: f64) -> Result<Self> {
        match (model, theta) {
            ("dahl", &[m, d, k, t, a1, a2, b1, b0, up]) => {
                let inverse = DahlInverse::new(m, d, k, t, a1, a2, b1, b0, up)?.at(dt)?;
                Ok(Self::Dahl(inverse, inverse.rest()))
            }
            ("bouc-wen", &[m, b, k, d, alpha, beta, gamma, n]) => {
                piezotrack_core::error::positive("dt", dt, "s")?;
                let inverse = BoucWenInverse::new(m, b, k, d, alpha, beta, gamma, n)?;
                Ok(Self::BoucWen(inverse, inverse.rest()))
            }
            ("first-order-dahl", &[m, d, k, t, sigma, limit, i]) => {
                let inverse = FirstOrderDahlInverse::new(m, d, k, t, (sigma, limit, i), dt)?;
                Ok(Self::FirstOrderDahl(inverse, inverse.rest()))
            }
            ("bouc-wen-oscillator", &[m, c, k, alpha, beta, gamma, delta, nu]) => {
                let hysteresis = (alpha, beta * gamma, beta * delta, nu);
                let inverse = OscillatorInverse::new(m, c, k, hysteresis, dt)?;
                Ok(Self::Oscillator(inverse, inverse.rest()))
            }
            _ => Err(Error::parameter("model", format!("'{model}'"), "one that has an inverse")),
        }
    }

    fn step(&mut self, x: f64, v: f64, a: f64) -> f64 {
        match self {
            Self::Dahl(inverse, state) => inverse.step(state, x, v, a),
            Self::BoucWen(inverse, state) => inverse.step(state, x, v, a),
            Self::FirstOrderDahl(inverse, state) => inverse.step(state, x, v, a),
            Self::Oscillator(inverse, state) => inverse.step(state, x, v, a),
        }
    }

    fn reset(&mut self) {
        match self {
            Self::Dahl(inverse, state) => *state = inverse.rest(),
            Self::BoucWen(inverse, state) => *state = inverse.rest(),
            Self::FirstOrderDahl(inverse, state) => *state = inverse.rest(),
            Self::Oscillator(inverse, state) => *state = inverse.rest(),
        }
    }
}

/// The voltage along a whole reference, from a stage that never moved.
#[pyfunction]
#[pyo3(signature = (model, theta, dt, x, v, a))]
#[expect(clippy::needless_pass_by_value, reason = "a tuple becomes a vector, not a slice")]
fn feedforward<'py>(
    py: Python<'py>,
    model: &str,
    theta: Vec<f64>,
    dt: f64,
    x: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    a: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (x, v, a) = (samples("x", x)?, samples("v", v)?, samples("a", a)?);
    let volts = || -> Result<Vec<f64>> {
        let mut inverse = AnyInverse::new(model, &theta, dt)?;
        let mut volts = Vec::with_capacity(x.len());
        for (k, ((&x, &v), &a)) in x.iter().zip(v.iter()).zip(a.iter()).enumerate() {
            let value = inverse.step(x, v, a);
            if !value.is_finite() {
                return Err(Error::Numerical(format!(
                    "the inverse has no voltage for sample {k} of the reference ({x:e} m, \
                     {v:e} m/s, {a:e} m/s^2): check its units and its sampling"
                )));
            }
            volts.push(value);
        }
        Ok(volts)
    };
    volts().map(|volts| volts.to_pyarray(py)).map_err(|error| raise(&error))
}

/// The inverse at work, sample by sample.
#[pyclass(name = "InverseSession", module = "piezotrack._core")]
struct PyInverseSession(AnyInverse);

#[pymethods]
impl PyInverseSession {
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "a tuple becomes a vector, not a slice")]
    fn new(model: &str, theta: Vec<f64>, dt: f64) -> PyResult<Self> {
        AnyInverse::new(model, &theta, dt).map(Self).map_err(|error| raise(&error))
    }

    /// NaN where there is no voltage.
    fn step(&mut self, x: f64, v: f64, a: f64) -> f64 {
        self.0.step(x, v, a)
    }

    fn reset(&mut self) {
        self.0.reset();
    }
}
