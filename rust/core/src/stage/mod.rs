//! Stages: one hysteresis operator coupled with linear mechanics.

mod dahl;
pub mod feedback;

pub use dahl::{DAHL_PARAMETERS, DahlStage, StageState};

/// Name, symbol and unit of one parameter of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterInfo {
    /// The name that both languages use.
    pub name: &'static str,
    /// The symbol in the literature.
    pub symbol: &'static str,
    /// SI unit, empty where there is none.
    pub unit: &'static str,
}
