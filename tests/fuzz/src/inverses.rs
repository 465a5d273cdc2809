//! Inverses of every model and of networks, at work as a feedforward.

use piezotrack_control::inverse::{Inverse, NetworkNumbers, NeuralNetworkInverse};
use piezotrack_control::{Limits, OnlineFeedforward, ReferenceSample, Snapshot};
use piezotrack_core::models::{AnyInverse, AnyInverseState};

use crate::bytes::{Bytes, bits};
use crate::stages::stage;

/// A stage or a network, then a reference.
pub fn run(data: &[u8]) -> bool {
    let mut bytes = Bytes(data);
    let dt = bytes.near(1e-3);
    let made = if bytes.below(8) == 7 { network(&mut bytes) } else { of_stage(&mut bytes, dt) };
    let Some((inverse, start)) = made else { return false };
    directly(&inverse, &start, bytes);
    let (offset, delay) = (bytes.near(0.0), bytes.near(0.0));
    let Ok(online) = OnlineFeedforward::new(inverse, dt, offset, delay) else { return false };
    let Ok(limits) = Limits::new(bytes.near(-10.0), bytes.near(75.0)) else { return false };
    let mut state = online.start(start);
    for k in 0..64 {
        if bytes.is_empty() && k >= 16 {
            break;
        }
        let mut sample = ReferenceSample::new(bytes.near(1e-6 * f64::from(k)));
        let given = bytes.byte();
        sample.preview = (given & 0x01 == 0x01).then(|| bytes.near(1e-6 * f64::from(k + 1)));
        sample.velocity = (given & 0x06 == 0x06).then(|| bytes.near(1e-3));
        sample.acceleration = (given & 0x18 == 0x18).then(|| bytes.near(1.0));
        let drive = online.step_within(&mut state, &sample, &limits);
        assert!(!drive.is_infinite(), "{drive}");
        if given & 0xe0 == 0xe0 {
            online.applied(&mut state, bytes.near(10.0));
        }
    }
    true
}

/// The inverse alone: NaN leaves the state as it was, and numbers from elsewhere do no harm.
fn directly(inverse: &AnyInverse, start: &AnyInverseState, mut bytes: Bytes<'_>) {
    let mut state = *start;
    for k in 0..16 {
        let before = bits(&state);
        let x = bytes.near(1e-6 * f64::from(k));
        let drive = inverse.step(&mut state, x, bytes.near(1e-3), bytes.near(1.0));
        assert!(!drive.is_infinite(), "{drive}");
        assert!(!drive.is_nan() || bits(&state) == before, "a state that changed without a drive");
        if bytes.byte() == 1 {
            let some = bits(&state)
                .into_iter()
                .map(|bits| if bytes.byte() < 200 { f64::from_bits(bits) } else { bytes.number() });
            let mut numbers = some.collect::<Vec<_>>().into_iter();
            let mut other = state;
            if other.load(&mut || numbers.next()).is_some() {
                inverse.step(&mut other, x, 0.0, 0.0);
            }
        }
    }
}

fn of_stage(bytes: &mut Bytes<'_>, dt: f64) -> Option<(AnyInverse, AnyInverseState)> {
    let (stage, _) = stage(bytes)?;
    let initial = bytes.flag().then(|| bytes.values(stage.model().info().state, None));
    let (inverse, state) = stage.inverse(dt, initial.as_ref()).ok()?;
    Some((AnyInverse::Stage(Box::new(inverse)), AnyInverseState::Stage(state)))
}

fn network(bytes: &mut Bytes<'_>) -> Option<(AnyInverse, AnyInverseState)> {
    let (thresholds, units) = (bytes.numbers(9), bytes.below(4));
    let mut some = |count| (0..count).map(|_| bytes.near(1.0)).collect::<Vec<_>>();
    let inputs = 3 + thresholds.len();
    let (hidden, biases, outputs) = (some(units * inputs), some(units), some(units));
    let network = NeuralNetworkInverse::new(&NetworkNumbers {
        direct: &some(inputs),
        offset: some(1)[0],
        centre: some(1)[0],
        scales: [1e-6, 1e-3, 1.0].map(|usual| usual * some(1)[0]),
        thresholds: &thresholds,
        hidden: &hidden,
        biases: &biases,
        outputs: &outputs,
    });
    let network = network.ok()?;
    let state = AnyInverseState::Network(network.rest());
    Some((AnyInverse::Network(Box::new(network)), state))
}
