//! The list of models: their parameters, their states and their published values.

use piezotrack_core::models::{AnySuperposition, FoundBy, Model, Nodes, ParameterInfo, Values};
use piezotrack_core::{Error, Result};
use pyo3::prelude::*;

use crate::errors::raise;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(models, module)?)?;
    module.add_function(wrap_pyfunction!(published, module)?)
}

/// Names and numbers, in the order of a model's parameters or of its state.
pub type Named = Vec<(String, Vec<f64>)>;

pub fn named(values: &Values) -> Named {
    values.iter().map(|(name, numbers)| (name.into(), numbers.to_vec())).collect()
}

/// One parameter of a model, as a dict in Python.
#[derive(IntoPyObject)]
struct Parameter {
    name: &'static str,
    symbol: &'static str,
    unit: &'static str,
    carries_force: bool,
    default: Option<f64>,
    held: Option<&'static str>,
    is_list: bool,
    is_optional: bool,
}

impl Parameter {
    fn of(info: &ParameterInfo) -> Self {
        let ParameterInfo {
            name,
            symbol,
            unit,
            carries_force,
            default,
            held,
            is_list,
            is_optional,
        } = *info;
        Self { name, symbol, unit, carries_force, default, held, is_list, is_optional }
    }
}

/// A model of the list, as a dict in Python.
#[derive(IntoPyObject)]
struct Listed {
    name: &'static str,
    title: &'static str,
    drive_unit: &'static str,
    searched: bool,
    /// Name of the nodes of its signals; empty where they have none.
    nodes: &'static str,
    parameters: Vec<Parameter>,
    state: Vec<Parameter>,
    published: Vec<&'static str>,
}

/// The list of models, in its order.
#[pyfunction]
fn models() -> Vec<Listed> {
    let listed = |model: &Model| {
        let info = model.info();
        Listed {
            name: info.name,
            title: info.title,
            drive_unit: info.drive_unit,
            searched: model.found_by() == FoundBy::Swarm,
            nodes: match model.superposition().map(AnySuperposition::nodes) {
                Some(Nodes::Thresholds) => "thresholds",
                Some(Nodes::Levels) => "levels",
                Some(Nodes::None) | None => "",
            },
            parameters: info.parameters.iter().map(Parameter::of).collect(),
            state: info.state.iter().map(Parameter::of).collect(),
            published: info.published.iter().map(|(name, _)| *name).collect(),
        }
    };
    Model::ALL.iter().map(listed).collect()
}

/// Published parameters of a model, by their name.
#[pyfunction]
fn published(model: &str, name: &str) -> PyResult<Named> {
    let find = || -> Result<Named> {
        let info = Model::named(model)?.info();
        let found = info.published.iter().find(|(known, _)| *known == name);
        let (_, values) = found.ok_or_else(|| {
            let known: Vec<&str> = info.published.iter().map(|(known, _)| *known).collect();
            Error::parameter("name", format!("'{name}'"), format!("one of {}", known.join(", ")))
        })?;
        Ok(named(&values()))
    };
    find().map_err(|error| raise(&error))
}
