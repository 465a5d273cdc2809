//! The models that can be identified: what a search has to know of each.

use super::bouc_wen::{BOUC_WEN_PARAMETERS, BoucWenKernel, BoucWenStage};
use super::bouc_wen_oscillator::{
    BOUC_WEN_OSCILLATOR_PARAMETERS, BoucWenOscillator, BoucWenOscillatorKernel,
};
use super::dahl::{DAHL_PARAMETERS, DahlStage, StageState};
use super::dahl_simulate::simulate_fixed;
use super::first_order_dahl::{
    FIRST_ORDER_DAHL_PARAMETERS, FirstOrderDahlKernel, FirstOrderDahlStage,
};
use crate::error::{Error, Result};
use crate::integrator::{Alone, Kernel, ParameterInfo, Stepping};
use crate::signal::{Drive, Stop};

/// Parameters in the order of [`Model::facts`], 0 for those that the model does not have, and
/// after them the delay, s.
pub type Theta = [f64; 10];

/// Index of the delay in [`Theta`].
pub const DELAY: usize = 9;

/// A kind of stage. The first three parameters of each are mass, damping and stiffness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Model {
    /// Second-order Dahl hysteresis in feedback: [`DahlStage`].
    #[default]
    Dahl,
    /// Bouc-Wen hysteresis at the input: [`BoucWenStage`].
    BoucWen,
    /// First-order Dahl friction in feedback: [`FirstOrderDahlStage`].
    FirstOrderDahl,
    /// Bouc-Wen hysteresis in feedback, under a force: [`BoucWenOscillator`].
    BoucWenOscillator,
}

/// What distinguishes one model's search from another's.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// The name that both languages use.
    pub name: &'static str,
    /// Its parameters, in their order.
    pub parameters: &'static [ParameterInfo],
    /// Indices of those that carry force: all of them can be multiplied by one number. None
    /// where the drive is a force itself.
    pub forces: &'static [usize],
    /// Values of those that are held where the caller says nothing.
    pub defaults: &'static [(usize, f64)],
    /// Those that are never searched, and why.
    pub held: &'static [(usize, &'static str)],
}

impl Model {
    /// All of them.
    pub const ALL: [Self; 4] =
        [Self::Dahl, Self::BoucWen, Self::FirstOrderDahl, Self::BoucWenOscillator];

    /// The model of a name.
    ///
    /// # Errors
    /// [`Error::Parameter`] where there is none.
    pub fn named(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|model| model.facts().name == name).ok_or_else(|| {
            let names = Self::ALL.map(|model| format!("'{}'", model.facts().name));
            Error::parameter("model", format!("'{name}'"), names.join(" or "))
        })
    }

    /// What a search has to know of it.
    #[must_use]
    pub fn facts(self) -> Facts {
        match self {
            Self::Dahl => Facts {
                name: "dahl",
                parameters: &DAHL_PARAMETERS,
                forces: &[0, 1, 2, 3, 6, 7],
                defaults: &[(7, 0.0), (8, 30.0)],
                held: &[(8, "up held: only the products b1 up and b0 up show in the data")],
            },
            Self::BoucWen => Facts {
                name: "bouc-wen",
                parameters: &BOUC_WEN_PARAMETERS,
                forces: &[0, 1, 2],
                defaults: &[(7, 1.0)],
                held: &[(7, "exponent held, in fixed=: it decides the unit of beta and gamma")],
            },
            Self::FirstOrderDahl => Facts {
                name: "first-order-dahl",
                parameters: &FIRST_ORDER_DAHL_PARAMETERS,
                forces: &[0, 1, 2, 3, 4, 5],
                defaults: &[(6, 1.0)],
                held: &[(6, "exponent held, in fixed=: all guesses of a search share it")],
            },
            Self::BoucWenOscillator => Facts {
                name: "bouc-wen-oscillator",
                parameters: &BOUC_WEN_OSCILLATOR_PARAMETERS,
                forces: &[],
                defaults: &[(4, 1.0), (7, 1.0)],
                held: &[
                    (4, "beta held: only the products beta gamma and beta delta show in the data"),
                    (7, "exponent held, in fixed=: it decides the unit of gamma and delta"),
                ],
            },
        }
    }

    /// Refuses parameters with which no stage exists.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of its range.
    pub fn check(self, theta: &Theta) -> Result<()> {
        match self {
            Self::Dahl => dahl(theta).map(|_| ()),
            Self::BoucWen => BoucWenStage::from_theta(&first(theta)).map(|_| ()),
            Self::FirstOrderDahl => FirstOrderDahlStage::from_theta(&first(theta)).map(|_| ()),
            Self::BoucWenOscillator => BoucWenOscillator::from_theta(&first(theta)).map(|_| ()),
        }
    }

    /// The exponent, which all guesses of a search share; 1 for a model without one.
    pub(crate) fn exponent(self, theta: &Theta) -> f64 {
        match self {
            Self::Dahl => 1.0,
            Self::FirstOrderDahl => theta[6],
            Self::BoucWen | Self::BoucWenOscillator => theta[7],
        }
    }

    /// Displacement and velocity as a search computes them; `None` where they are not finite or
    /// `stop` said so.
    pub(crate) fn motion(
        self,
        theta: &Theta,
        drive: &Drive<'_>,
        stepping: Stepping,
        stop: Stop<'_>,
    ) -> Option<[Vec<f64>; 2]> {
        match self {
            Self::Dahl => {
                let stage = dahl(theta).ok()?;
                let run = simulate_fixed(&stage, drive, StageState::default(), stepping, stop);
                run.ok().flatten().map(|run| [run.x, run.v])
            }
            Self::BoucWen => {
                let kernel = BoucWenKernel { exponent: self.exponent(theta) };
                alone(&kernel, theta, drive, stepping, stop)
            }
            Self::FirstOrderDahl => {
                let kernel = FirstOrderDahlKernel { exponent: self.exponent(theta) };
                alone(&kernel, theta, drive, stepping, stop)
            }
            Self::BoucWenOscillator => {
                let kernel = BoucWenOscillatorKernel { exponent: self.exponent(theta) };
                alone(&kernel, theta, drive, stepping, stop)
            }
        }
    }
}

fn dahl(theta: &Theta) -> Result<DahlStage> {
    DahlStage::from_theta(&first(theta))
}

/// The parameters that a model has.
fn first<const N: usize>(theta: &Theta) -> [f64; N] {
    core::array::from_fn(|i| theta[i])
}

fn alone<K: Kernel<f64> + Copy>(
    kernel: &K,
    theta: &Theta,
    drive: &Drive<'_>,
    stepping: Stepping,
    stop: Stop<'_>,
) -> Option<[Vec<f64>; 2]> {
    let mut parameters = [0.0; DELAY];
    parameters.copy_from_slice(&theta[..DELAY]);
    let stage = Alone { kernel, parameters: &parameters };
    let run = stage.simulate_fixed(drive, stage.rest(), stepping.substeps, stop);
    run.ok().flatten().map(|run| [run.x, run.v])
}
