//! Stages of every model: accepted parameters move to finite places or end in an error.

use core::sync::atomic::{AtomicUsize, Ordering};

use piezotrack_core::models::{Experiment, Method, Model, Stage, Values};
use piezotrack_core::signal::{Drive, Hold};
use piezotrack_core::simulate::VirtualStage;

use crate::bytes::Bytes;

/// Times that a simulation may ask whether to go on.
const PATIENCE: usize = 10;

/// Parameters, then a short drive.
pub fn run(data: &[u8]) -> bool {
    let mut bytes = Bytes(data);
    let Some((stage, values)) = stage(&mut bytes) else { return false };
    let dt = bytes.near(1e-3);
    let hold = if bytes.flag() { Hold::Zero } else { Hold::First };
    let count = 1 + bytes.below(8);
    let voltages: Vec<f64> = (0..count).map(|_| bytes.near(20.0)).collect();
    if let Ok(values) = stage.equilibrium(&voltages) {
        assert!(values.iter().flat_map(|(_, numbers)| numbers).all(|number| number.is_finite()));
    }
    // What takes a hundred times as long is tried a hundred times less.
    let patient = bytes.byte() < 4;
    let integrated = ![0.0, 1.0].contains(&values.number("exponent"));
    let radians = dt * (values.number("stiffness") / values.number("mass")).sqrt();
    if patient || bytes.byte() < 8 && !integrated {
        let _ = stage.loop_plants(bytes.near(-10.0), bytes.near(75.0));
    }
    if !patient && (integrated || radians > 256.0) {
        return true;
    }
    let Ok(drive) = Drive::new(&voltages, dt, hold) else { return true };
    let asked = AtomicUsize::new(0);
    let stop = || asked.fetch_add(1, Ordering::Relaxed) > PATIENCE;
    let method = match bytes.byte() {
        // These take up to a million steps for an interval.
        0x71 => Method::Rk4,
        0x72 => Method::Rk45,
        _ => Method::Exponential,
    };
    let info = stage.model().info();
    let initial = bytes.flag().then(|| bytes.values(info.state, None));
    let accuracy = bytes.near(1e-7);
    let experiment =
        Experiment { initial: initial.as_ref(), method, accuracy, ..Experiment::of(&drive, &stop) };
    if let Ok(Some(response)) = stage.simulate(&experiment) {
        assert!([&response.x, &response.v].into_iter().flatten().all(|number| number.is_finite()));
        assert_eq!(response.x.len(), voltages.len());
    }
    let bare = VirtualStage::bare(stage, dt / f64::from(1 + bytes.byte() % 4));
    if let Ok(Some(run)) = bare.simulate(&drive, &stop) {
        assert!(run.displacement.iter().all(|number| number.is_finite()));
    }
    true
}

/// A stage of any model, with its parameters.
pub fn stage(bytes: &mut Bytes<'_>) -> Option<(Stage, Values)> {
    let model = bytes.one_of(Model::ALL);
    let info = model.info();
    let published = info.published.get(bytes.below(info.published.len() + 1));
    let usual = published.map(|(_, make)| make());
    let values = bytes.values(info.parameters, usual.as_ref());
    let made = model.build(&values);
    if let Err(error) = &made {
        assert!(error.to_string().contains("expected"), "{error}");
    }
    made.ok().map(|stage| (stage, values))
}
