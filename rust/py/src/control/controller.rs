//! Controllers, as configuration and as sessions.

use piezotrack_control::{Command, Controller, ControllerState};
use piezotrack_core::Error;
use piezotrack_core::design::LinearFeedback;
use piezotrack_core::math::zeros;
use piezotrack_core::parts::{ControllerParts, Law, LawState, Named, Role};
use piezotrack_core::simulate::DELAY_LINE;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::control::coefficients::of_controller;
use crate::conversions::displacements::{meant, outside};
use crate::conversions::snapshots::{load, saved};
use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyController>()?;
    module.add_function(wrap_pyfunction!(check_part, module)?)?;
    module.add_function(wrap_pyfunction!(law_transfer_function, module)?)?;
    module.add_function(wrap_pyfunction!(law_reference_numerator, module)?)?;
    module.add_class::<PySession>()
}

/// A part by its name, with its numbers.
type NamedPart = (String, Vec<f64>);

/// A controller for one sampling interval.
#[pyclass(name = "Controller", frozen, module = "piezotrack._core")]
pub struct PyController {
    pub controller: Controller<Law>,
    pub dt: f64,
}

#[pymethods]
impl PyController {
    #[new]
    #[pyo3(signature = (*, dt, limits, span, max_jump, law, repetitive, filters, follows))]
    #[expect(clippy::too_many_arguments, reason = "all named in Python")]
    #[expect(clippy::needless_pass_by_value, reason = "as Python gives them")]
    fn new(
        dt: f64,
        limits: (f64, f64),
        span: Option<(f64, f64)>,
        max_jump: Option<f64>,
        law: Option<NamedPart>,
        repetitive: Option<NamedPart>,
        filters: Vec<NamedPart>,
        follows: bool,
    ) -> PyResult<Self> {
        let parts = ControllerParts {
            dt,
            limits,
            span,
            max_jump,
            law: law.as_ref().map(borrowed),
            repetitive: repetitive.as_ref().map(borrowed),
            filters: filters.iter().map(borrowed).collect(),
            follows,
        };
        let controller = parts.controller().map_err(|error| raise(&error))?;
        Ok(Self { controller, dt })
    }

    /// Entries of the repetitive part's delay line.
    #[getter]
    fn line_length(&self) -> usize {
        self.controller.repetitive.map_or(0, |part| part.length())
    }

    /// The numbers of every part as it is sampled, by name: of the law, the filters and the
    /// repetitive part.
    fn coefficients(&self) -> Vec<(String, Vec<f64>)> {
        of_controller(&self.controller)
    }

    /// Time of a step, s: the mean over some samples of a slow motion, measured.
    fn step_time(&self, samples: u32) -> PyResult<f64> {
        let line = zeros(DELAY_LINE, self.line_length()).map_err(|error| raise(&error))?;
        let mut state = self.controller.rest(line).map_err(|error| raise(&error.into()))?;
        let mut measured = 0.0;
        let begin = std::time::Instant::now();
        for k in 0..samples {
            // A triangle of 1 um.
            let place = f64::from(k % 1000) / 1000.0;
            let reference = 1e-6 * (0.5 - (place - 0.5).abs());
            let volts = self.controller.step(&mut state, reference, measured, 0.0).volts;
            measured = 0.5 * reference + 1e-12 * volts;
        }
        core::hint::black_box(measured);
        Ok(begin.elapsed().as_secs_f64() / f64::from(samples.max(1)))
    }

    /// A session of its own, going on from the voltage `present` where that is given.
    fn start(&self, present: Option<f64>) -> PyResult<PySession> {
        let line = zeros(DELAY_LINE, self.line_length()).map_err(|error| raise(&error))?;
        let state = match present {
            Some(volts) => self.controller.start(volts, line),
            None => self.controller.rest(line),
        };
        let state = state.map_err(|error| raise(&error.into()))?;
        Ok(PySession { controller: self.controller, state, begun: false })
    }
}

fn borrowed((name, numbers): &NamedPart) -> Named<'_> {
    (name, numbers)
}

/// Checks the numbers of a part by its role.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "as Python gives them")]
fn check_part(role: &str, part: NamedPart) -> PyResult<()> {
    let role = match role {
        "law" => Role::Law,
        "filter" => Role::Filter,
        "repetitive" => Role::Repetitive,
        _ => Role::Smoothing,
    };
    piezotrack_core::parts::check_part(role, borrowed(&part)).map_err(|error| raise(&error))
}

/// Numerator and denominator of a law in powers of `z - 1`, constant term first.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "as Python gives them")]
fn law_transfer_function(law: NamedPart, dt: f64) -> PyResult<[Vec<f64>; 2]> {
    let law = Law::named(&law.0, &law.1, dt).map_err(|error| raise(&error))?;
    Ok(law.transfer_function())
}

/// Numerator from the reference alone to the same denominator, of a law to which a reading is more
/// than what is taken off the reference.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "as Python gives them")]
fn law_reference_numerator(law: NamedPart, dt: f64) -> PyResult<Option<Vec<f64>>> {
    let law = Law::named(&law.0, &law.1, dt).map_err(|error| raise(&error))?;
    Ok(law.reference_numerator())
}

/// A controller at work.
#[pyclass(name = "Session", module = "piezotrack._core")]
struct PySession {
    controller: Controller<Law>,
    state: ControllerState<LawState, Vec<f64>>,
    /// Whether there was a step.
    begun: bool,
}

/// volts, unclipped, feedforward, feedback, repetitive, error, saturated, measured well, reference
/// well.
type CommandParts = (f64, f64, f64, f64, f64, f64, bool, bool, bool);

#[pymethods]
impl PySession {
    /// Refuses a reference outside of the span, and so the measurement of the first sample where
    /// another unit would explain it: nothing has been moved by then.
    fn check(&self, reference: f64, measured: f64) -> PyResult<()> {
        let span = self.controller.span;
        if reference.is_finite() && !span.contains(reference) {
            return Err(outside("reference", reference, span));
        }
        if !self.begun && !span.contains(measured) && meant(measured, span).is_some() {
            return Err(outside("measured", measured, span));
        }
        Ok(())
    }

    /// The voltage of a sample, for what `check` accepts.
    fn step(&mut self, reference: f64, measured: f64, feedforward: f64) -> PyResult<f64> {
        self.check(reference, measured)?;
        self.begun = true;
        Ok(self.controller.step(&mut self.state, reference, measured, feedforward).volts)
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

    /// Readings that were refused: not finite, outside of the span, jumps.
    fn refused(&self) -> (u32, u32, u32) {
        let refused = self.state.refused();
        (refused.not_finite, refused.outside, refused.jumps)
    }

    /// The state as bytes, for `load` of a session of the same controller.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        saved(py, &self.state)
    }

    fn load(&mut self, bytes: &[u8]) -> PyResult<()> {
        self.begun = true;
        load(&mut self.state, bytes)
    }

    fn applied(&mut self, volts: f64) -> PyResult<()> {
        self.controller.applied(&mut self.state, volts).map_err(|error| raise(&error.into()))
    }

    /// The part of the last feedforward that reached the stage; `None` where that is all of it.
    fn reached(&self) -> Option<f64> {
        self.controller.reached(&self.state)
    }

    fn reset(&mut self) {
        self.controller.reset(&mut self.state);
    }

    /// Goes on with the settings of another controller for the same interval.
    fn retune(&mut self, other: &PyController) -> PyResult<()> {
        let (mine, others) = (&self.controller.feedback, &other.controller.feedback);
        if core::mem::discriminant(mine) != core::mem::discriminant(others) {
            let expected = "a feedback of the same kind";
            return Err(raise(&Error::parameter("controller", "another", expected)));
        }
        let done = self.controller.retune(&other.controller, &mut self.state);
        done.map_err(|error| raise(&error.into()))?;
        self.controller = other.controller;
        Ok(())
    }
}
