//! From samples to an identified stage, without Python: the swarm of the paper on the published
//! stage, with four free parameters.

use std::ops::ControlFlow;

use piezotrack_core::Result;
use piezotrack_core::identify::{DescentSettings, Method, Plan, Progress, Record, Spec, identify};
use piezotrack_core::models::{DahlStage, Experiment, Model, StageModel};
use piezotrack_core::signal::{Drive, Hold, NEVER};

const DT: f64 = 1e-3;

fn main() -> Result<()> {
    let turn = core::f64::consts::TAU * 0.25 * DT;
    let u: Vec<f64> = (0..4001).map(|k| 37.5 * (1.0 - (turn * f64::from(k)).cos())).collect();
    let drive = Drive::new(&u, DT, Hold::First)?;
    let stage = DahlStage::xu_li_2010();
    let run = stage.simulate(&Experiment::of(&drive, NEVER))?;
    let y = run.map(|run| run.x).unwrap_or_default();

    let record = Record::new(&u, &y, DT, Hold::First, 0)?;
    let spec = Spec {
        fixed: vec![
            ("a1".into(), stage.a1),
            ("a2".into(), stage.a2),
            ("b1".into(), stage.b1),
            ("mass".into(), stage.mechanics.mass),
        ],
        ..Spec::of(Model::Dahl)
    };
    let plan = Plan {
        method: Method::Descents(DescentSettings::default()),
        seed: 1,
        runs: 1,
        start: None,
    };
    let mut quiet = |_: &Progress| ControlFlow::Continue(());
    let found = identify(&record, &spec, &plan, &mut quiet, NEVER)?;
    for run in &found.runs {
        println!("cost {:.3e} m after {} iterations", run.costs.rms, run.iterations);
    }
    if let Some(best) = found.best {
        for (info, value) in DahlStage::INFO.parameters.iter().zip(found.runs[best].theta.0) {
            println!("{:<18} {value:>14.6e} {}", info.name, info.unit);
        }
    }
    Ok(())
}
