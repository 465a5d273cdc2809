//! The Preisach stage: relays at the input, creep, linear dynamics.
//!
//! [`PreisachOperator`] has the equations; Mayergoyz 1986, Physical Review Letters 56, 1518-1521,
//! doi 10.1103/PhysRevLett.56.1518. [`InputStage`] says what follows the operator.
//!
//! The output is the sum of the masses of the cells times the shares of them that are switched on:
//! a fit finds the masses by least squares. Its levels divide the range of the drive. Of masses
//! that explain a record as well those are found whose neighbours are alike.

use piezotrack_control::hysteresis::Operator;

use super::everett::{Everett, entry};
use super::preisach_operator::{PreisachInverse, PreisachInverseState, PreisachOperator};
use super::reversals::Reversals;
use crate::error::Result;
use crate::models::input::input_model::InputModel;
use crate::models::input::input_stage::{InputStage, Remembering, state_at_rest};
use crate::models::input::superposition::{
    FittedWeights, Nodes, Rest, Signals, SignalsOf, Superposition,
};
use crate::models::parameters::values::{ParameterInfo, Values};
use crate::models::traits::StageModel;

const PARAMETERS: &[ParameterInfo] = &[
    ParameterInfo::new("linear", "w0", "m/V"),
    ParameterInfo::list("levels", "v", "V"),
    ParameterInfo::list("masses", "mu", "m"),
];

/// A stage with relays at its input.
///
/// ```
/// use piezotrack_core::models::{
///     Dynamics, Experiment, PreisachOperator, PreisachStage, Relaxation, StageModel,
/// };
/// use piezotrack_core::signal::{Drive, Hold, NEVER};
///
/// # fn main() -> piezotrack_core::Result<()> {
/// let stage = PreisachStage {
///     operator: PreisachOperator::new(1e-6, &[0.0, 50.0, 100.0], &[5e-6, 10e-6, 15e-6])?,
///     relaxation: Relaxation::new(&[], &[], Dynamics::None)?,
/// };
/// let drive = Drive::new(&[0.0, 100.0, 50.0, 25.0], 0.01, Hold::First)?;
/// let run = stage.simulate(&Experiment::of(&drive, NEVER))?.unwrap();
/// assert!((run.x[1] - 130e-6).abs() < 1e-18);
/// assert!((run.x[2] - 65e-6).abs() < 1e-18);
/// assert!((run.x[3] - 32.5e-6).abs() < 1e-18);
/// # Ok(())
/// # }
/// ```
pub type PreisachStage = InputStage<PreisachOperator>;

impl InputModel for PreisachOperator {
    const NAME: &'static str = "preisach";
    const TITLE: &'static str = "Preisach";
    const PARAMETERS: &'static [ParameterInfo] = PARAMETERS;

    type Inverse = PreisachInverse;

    fn build(values: &Values) -> Result<Self> {
        let (levels, masses) = (values.list("levels"), values.list("masses"));
        PreisachOperator::new(values.number("linear"), levels, masses)
    }

    fn path(&self) -> &impl Operator<f64> {
        self
    }

    fn inverse(&self, _dt: f64) -> Result<Self::Inverse> {
        Ok(PreisachInverse(*self))
    }

    fn start(&self, inverse: &Self::Inverse, state: &Self::State) -> PreisachInverseState {
        inverse.memory(state)
    }
}

/// The drive, and the share of each cell that is switched on, less that before any voltage.
#[derive(Clone, Debug)]
struct Shares {
    /// Without masses.
    cells: Everett,
    /// Reversals before any voltage, and the place there.
    rest: Vec<f64>,
    /// Shares there.
    zero: Vec<f64>,
}

impl Shares {
    /// Of the reversals in a memory, whose last entry is the present place.
    fn reversals(&self, memory: &[f64]) -> Reversals {
        let ends = self.cells.ends();
        let (place, turns) = memory.split_last().unwrap_or((&ends.0, &[]));
        let turned = Reversals::recalled(ends, turns);
        let mut reversals = turned.unwrap_or_else(|| Reversals::rise(ends.0, ends.0));
        reversals.follow(*place);
        reversals
    }

    /// Writes the shares of the cells.
    fn write(&self, reversals: &Reversals, shares: &mut [f64]) {
        shares.fill(0.0);
        let turns = reversals.turns();
        let places = turns.iter().copied().skip(1).chain([reversals.place()]);
        for (from, to) in turns.iter().zip(places) {
            self.cells.add_shares(*from, to, shares);
        }
        for (share, zero) in shares.iter_mut().zip(&self.zero) {
            *share -= zero;
        }
    }
}

impl Signals for Shares {
    fn count(&self) -> usize {
        1 + self.zero.len()
    }

    fn rest(&self) -> Vec<f64> {
        self.rest.clone()
    }

    /// Neighbouring cells: a drive of one amplitude tells of rows and columns only.
    fn alike(&self) -> Vec<(usize, usize)> {
        let count = self.cells.levels().len().saturating_sub(1);
        let place = |i, j| 1 + entry(i, j);
        let cells = (0..count).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let pairs = cells.flat_map(|(i, j)| {
            let below = (i + 1 < count).then(|| (place(i, j), place(i + 1, j)));
            let beside = (j < i).then(|| (place(i, j), place(i, j + 1)));
            below.into_iter().chain(beside)
        });
        pairs.collect()
    }

    fn follow(&self, memory: &mut Vec<f64>, volts: f64, _dt: f64, signals: &mut [f64]) {
        let (low, high) = self.cells.ends();
        let mut reversals = self.reversals(memory);
        reversals.follow(volts.clamp(low, high));
        memory.clear();
        memory.extend_from_slice(&reversals.turns()[1..]);
        memory.push(reversals.place());
        if let Some((drive, shares)) = signals.split_first_mut() {
            *drive = volts;
            self.write(&reversals, shares);
        }
    }
}

impl Superposition for PreisachStage {
    const NODES: Nodes = Nodes::Levels;

    fn signals(of: &SignalsOf<'_>) -> Box<dyn Signals> {
        // Levels that are none have been refused.
        let cells = Everett::of_levels(of.nodes).unwrap_or_else(|_| Everett::empty());
        let reversals = PreisachOperator { linear: 1.0, everett: cells }.rest().reversals;
        let rest = [&reversals.turns()[1..], &[reversals.place()]].concat();
        let shares = Shares { cells, rest, zero: Vec::new() };
        let mut zero = vec![0.0; entry(cells.levels().len() - 1, 0)];
        shares.write(&reversals, &mut zero);
        Box::new(Shares { zero, ..shares })
    }

    fn values(fitted: &FittedWeights) -> Values {
        let (linear, masses) = with_gain_outside(fitted);
        let operator = [vec![linear], fitted.nodes.clone(), masses];
        Values::of(Self::INFO.parameters, operator.into_iter().chain(fitted.relaxation.values()))
    }

    fn state_at_rest(rest: &Rest<'_>) -> Values {
        let turns = rest.memory.split_last().map_or(&[][..], |(_, turns)| turns);
        state_at_rest(PreisachOperator::STATE, rest, turns)
    }
}

/// The gain without memory and the masses of a fit.
///
/// What all cells of the diagonal have in common is a gain without memory between the levels. It
/// becomes one outside them too, where the stage would hardly move otherwise, unless the record
/// shows how it moves there, or 0 V is there.
fn with_gain_outside(fitted: &FittedWeights) -> (f64, Vec<f64>) {
    let (levels, mut masses) = (&fitted.nodes, fitted.weights.clone());
    let ends = levels.first().zip(levels.last());
    let (low, high) = (fitted.drive.0.min(0.0), fitted.drive.1.max(0.0));
    if !ends.is_some_and(|(lowest, highest)| *lowest <= low && high <= *highest) {
        return (fitted.linear, masses);
    }
    let widths: Vec<f64> = levels.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let slope = |(i, width): (usize, &f64)| masses.get(entry(i, i)).copied().unwrap_or(0.0) / width;
    let slopes: Vec<f64> = widths.iter().enumerate().map(slope).collect();
    let smaller = |one: f64, other: f64| if other.abs() < one.abs() { other } else { one };
    let common = slopes.iter().copied().reduce(smaller).unwrap_or(0.0);
    for (i, (width, slope)) in widths.iter().zip(&slopes).enumerate() {
        if let Some(mass) = masses.get_mut(entry(i, i)) {
            *mass = (slope - common) * width;
        }
    }
    (fitted.linear + common, masses)
}
