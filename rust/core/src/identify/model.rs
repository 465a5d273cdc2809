//! The models that can be identified: what a search has to know of each.

use super::problem::{DELAY, Theta};
use crate::alone::Alone;
use crate::error::{Error, Result};
use crate::integrate::{Drive, Stop, simulate_fixed};
use crate::march::Stepping;
use crate::stage::{
    BOUC_WEN_PARAMETERS, BoucWenKernel, BoucWenStage, DAHL_PARAMETERS, DahlStage, Kernel,
    ParameterInfo, StageState,
};

/// A kind of stage. The first three parameters of each are mass, damping and stiffness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Model {
    /// Second-order Dahl hysteresis in feedback: [`DahlStage`].
    #[default]
    Dahl,
    /// Bouc-Wen hysteresis at the input: [`BoucWenStage`].
    BoucWen,
}

/// What distinguishes one model's search from another's.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// The name that both languages use.
    pub name: &'static str,
    /// Its parameters, in their order.
    pub parameters: &'static [ParameterInfo],
    /// Indices of those that carry force: all of them can be multiplied by one number.
    pub forces: &'static [usize],
    /// Values of those that are held where the caller says nothing.
    pub defaults: &'static [(usize, f64)],
    /// The one that is never searched, and why.
    pub held: (usize, &'static str),
}

impl Model {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Dahl, Self::BoucWen];

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
                held: (8, "up held: only the products b1 up and b0 up show in the data"),
            },
            Self::BoucWen => Facts {
                name: "bouc-wen",
                parameters: &BOUC_WEN_PARAMETERS,
                forces: &[0, 1, 2],
                defaults: &[(7, 1.0)],
                held: (7, "exponent held, in fixed=: it decides the unit of beta and gamma"),
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
            Self::BoucWen => {
                let [m, b, k, d, alpha, beta, gamma, n, ..] = *theta;
                BoucWenStage::from_theta(&[m, b, k, d, alpha, beta, gamma, n]).map(|_| ())
            }
        }
    }

    /// Displacement and velocity as a search computes them; `None` where they are not finite or
    /// `stop` said so.
    pub(super) fn motion(
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
                let kernel = BoucWenKernel { exponent: theta[EXPONENT] };
                alone(&kernel, theta, drive, stepping, stop)
            }
        }
    }
}

/// Index of the exponent of a Bouc-Wen stage.
pub(super) const EXPONENT: usize = 7;

fn dahl(theta: &Theta) -> Result<DahlStage> {
    let [mass, damping, stiffness, piezo, a1, a2, b1, b0, up, _delay] = *theta;
    DahlStage::from_theta(&[mass, damping, stiffness, piezo, a1, a2, b1, b0, up])
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
