//! Motion of one candidate, stepped as the search steps.

use crate::identify::parameters::candidate::Theta;
use crate::identify::records::history::{History, voltages_before};
use crate::integrator::{Kernel, LumpedStage, Parameters, Stepping, Substeps};
use crate::models::{Held, KernelVisitor, Model};
use crate::signal::{Drive, Stop};

/// Displacement and velocity; `None` where they are not finite or `stop` said so.
pub(in crate::identify) fn motion(
    model: Model,
    history: History,
    theta: &Theta,
    drive: &Drive<'_>,
    stepping: Stepping,
    stop: Stop<'_>,
) -> Option<[Vec<f64>; 2]> {
    let parameters = theta.parameters();
    let held = Held::all(model.scalars(), &parameters);
    let voltages = voltages_before(drive, history, theta.before());
    let one = One { parameters, voltages, drive, substeps: stepping.substeps, stop };
    model.kernel(&held, stepping.order, one).flatten()
}

/// One simulation from equilibrium.
struct One<'a> {
    parameters: Parameters<f64>,
    voltages: Vec<f64>,
    drive: &'a Drive<'a>,
    substeps: Substeps,
    stop: Stop<'a>,
}

impl KernelVisitor for One<'_> {
    type Output = Option<[Vec<f64>; 2]>;

    fn visit<K: Kernel>(self, kernel: K) -> Self::Output {
        let stage = LumpedStage { kernel, parameters: self.parameters };
        let start = stage.equilibrium(&self.voltages);
        let run = stage.simulate_fixed(self.drive, start, self.substeps, self.stop);
        run.ok().flatten().map(|run| [run.x, run.v])
    }
}
