//! The list of a controller's parts, with their numbers.

use piezotrack_core::parts::{Law, NumberInfo, OTHERS, PartInfo};
use pyo3::prelude::*;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(parts, module)?)
}

/// A number of a part, as a dict in Python.
#[derive(IntoPyObject)]
struct Number {
    name: &'static str,
    symbol: &'static str,
    unit: &'static str,
    form: &'static str,
    choices: Vec<&'static str>,
    default: Option<f64>,
    is_optional: bool,
}

impl Number {
    fn of(info: &NumberInfo) -> Self {
        let NumberInfo { name, symbol, unit, form, default, is_optional } = *info;
        let choices = form.choices();
        Self { name, symbol, unit, form: form.name(), choices, default, is_optional }
    }
}

/// A part of the list, as a dict in Python.
#[derive(IntoPyObject)]
struct Part {
    name: &'static str,
    title: &'static str,
    role: &'static str,
    numbers: Vec<Number>,
}

/// The feedback laws in the order of their list, then the other parts.
#[pyfunction]
fn parts() -> Vec<Part> {
    let listed = |part: &&PartInfo| Part {
        name: part.name,
        title: part.title,
        role: part.role.name(),
        numbers: part.numbers.iter().map(Number::of).collect(),
    };
    Law::INFOS.iter().chain(OTHERS).map(listed).collect()
}
