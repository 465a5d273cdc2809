//! Controllers of every law and part: no panic, and a command within the limits, whatever comes in.

use piezotrack_control::{Controller, ControllerState, Snapshot};
use piezotrack_core::parts::{ControllerParts, Law, LawState};

use crate::bytes::{Bytes, bits};

/// Longest delay line that is stepped, in entries.
const LONGEST: usize = 4096;

type State = ControllerState<LawState, Vec<f64>>;

/// Settings, then what happens to the controller.
pub fn run(data: &[u8]) -> bool {
    let mut bytes = Bytes(data);
    let Some(controller) = controller(&mut bytes) else { return false };
    let Some(mut state) = rest(&controller, &mut bytes) else { return false };
    let mut now = controller;
    for k in 0..64 {
        // What zeros for ever do is seen soon.
        if bytes.is_empty() && k >= 16 {
            break;
        }
        meanwhile(&mut now, &mut state, &mut bytes);
        let reference = bytes.near(1e-6 * f64::from(k));
        let (measured, feedforward) = (bytes.near(reference), bytes.near(1.0));
        let command = now.step(&mut state, reference, measured, feedforward);
        let (low, high) = (now.limits.low(), now.limits.high());
        assert!((low..=high).contains(&command.volts), "{command:?} of {now:?}");
        assert!(!command.measurement_ok || now.span.contains(measured), "{measured:e}");
        if let Some(reached) = now.reached(&state) {
            assert!((low..=high).contains(&reached), "{reached:e} of {now:?}");
        }
    }
    true
}

fn controller(bytes: &mut Bytes<'_>) -> Option<Controller<Law>> {
    let law = bytes.below(Law::INFOS.len() + 1);
    let mut law = Law::INFOS.get(law).map(|info| (info.name, bytes.numbers(28)));
    // Any other exponent of a Bouc-Wen hysteresis takes a millisecond for a sample.
    if let Some(("hysteresis-observer", numbers)) = &mut law
        && numbers.len() == 12
        && bytes.byte() < 250
    {
        numbers[11] = 1.0;
    }
    let smoothing = ["lag", "compensated-lag", "zero-phase", "none"];
    let smoothing = smoothing.get(bytes.below(8)).map(|name| {
        let usual = [0.1, 1e6, 2.0, 0.99, 0.0, 1.0];
        (*name, usual.map(|usual| if bytes.flag() { bytes.number() } else { usual }))
    });
    let filter_count = bytes.below(4);
    let mut filter = || {
        let (name, count) = if bytes.flag() { ("low-pass", 1) } else { ("notch", 3) };
        (name, (0..count).map(|_| bytes.near(10.0)).collect::<Vec<_>>())
    };
    let filters: Vec<_> = (0..filter_count).map(|_| filter()).collect();
    let parts = ControllerParts {
        dt: bytes.near(1e-3),
        limits: (bytes.near(-10.0), bytes.near(75.0)),
        span: bytes.flag().then(|| (bytes.near(-1e-5), bytes.near(1e-4))),
        max_jump: bytes.flag().then(|| bytes.near(1e-6)),
        law: law.as_ref().map(|(name, numbers)| (*name, &numbers[..])),
        repetitive: smoothing.as_ref().map(|(name, numbers)| (*name, &numbers[..])),
        filters: filters.iter().map(|(name, numbers)| (*name, &numbers[..])).collect(),
        // No byte of its own, so that what was kept reads as it did.
        follows: filter_count == 1,
    };
    let made = parts.controller();
    if let Err(error) = &made {
        assert!(error.to_string().contains("expected"), "{error}");
    }
    made.ok()
}

fn rest(controller: &Controller<Law>, bytes: &mut Bytes<'_>) -> Option<State> {
    let length = controller.repetitive.map_or(0, |part| part.length());
    let line = (length <= LONGEST).then(|| vec![0.0; length + bytes.below(4)])?;
    if bytes.flag() {
        controller.start(bytes.near(1.0), line).ok()
    } else {
        controller.rest(line).ok()
    }
}

/// Events between two samples.
fn meanwhile(now: &mut Controller<Law>, state: &mut State, bytes: &mut Bytes<'_>) {
    match bytes.below(32) {
        1 => now.reset(state),
        2 => {
            let _ = now.applied(state, bytes.near(1.0));
            let (low, high) = (now.limits.low(), now.limits.high());
            let (low, high) = (low - (high - low), high + (high - low));
            let reached = now.reached(state);
            assert!(reached.is_none_or(|volts| (low..=high).contains(&volts)), "{reached:?}");
        }
        3 => {
            // Bit for bit what was saved.
            let saved = bits(state);
            let mut numbers = saved.iter().map(|&bits| f64::from_bits(bits));
            state.load(&mut || numbers.next()).expect("what was saved");
            assert_eq!(bits(state), saved);
        }
        4 => {
            // Any numbers in place of those of a state: refused, or of no harm.
            let mut kept = state.clone();
            let some = bits(state)
                .into_iter()
                .map(|bits| if bytes.byte() < 200 { f64::from_bits(bits) } else { bytes.number() });
            let mut numbers = some.collect::<Vec<_>>().into_iter();
            if kept.load(&mut || numbers.next()).is_some() {
                *state = kept;
            }
        }
        5 => {
            if let Some(next) = controller(bytes).filter(|next| now.retune(next, state).is_ok()) {
                *now = next;
            }
        }
        _ => {}
    }
}
