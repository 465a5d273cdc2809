//! Tracks 0.2 Hz over 110 um on the virtual stage: feedforward, PID and both together.
//!
//! `cargo run --release -p piezotrack-core --example track_virtual_stage`

use piezotrack_control::{Controller, DahlInverse, Limits, Pid};
use piezotrack_core::parts::Law;
use piezotrack_core::signal::NEVER;
use piezotrack_core::signal::metrics::tracking;
use piezotrack_core::simulate::{ReferenceSamples, Timing, VirtualStage, track};

const INTERVAL: f64 = 0.02;
const FREQUENCY: f64 = 0.2;
const SAMPLES: u32 = 1000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let angular = core::f64::consts::TAU * FREQUENCY;
    let inverse = DahlInverse::xu_li_2010().at(INTERVAL)?;
    let mut state = inverse.rest();
    let (mut reference, mut feedforward) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let (sine, cosine) = (angular * INTERVAL * f64::from(k)).sin_cos();
        let (x, v, a) =
            (55e-6 * (1.0 - cosine), 55e-6 * angular * sine, 55e-6 * angular * angular * cosine);
        reference.push(x);
        feedforward.push(inverse.step(&mut state, x, v, a));
    }
    let silent = vec![0.0; reference.len()];
    let pid = Law::Pid(Pid::xu_li_2010().at(INTERVAL)?);
    let situations = [
        ("feedforward alone", Law::None, &feedforward),
        ("PID alone", pid, &silent),
        ("both", pid, &feedforward),
    ];
    let stage = VirtualStage::xu_li_2010(1);
    for (name, law, feedforward) in situations {
        let controller = Controller::new(Limits::new(0.0, 75.0)?, law);
        let timing = Timing {
            interval: INTERVAL,
            samples: reference.len(),
            delay: 0.0,
            jitter: 0.0,
            substeps: 1,
        };
        let course = ReferenceSamples { reference: &reference, feedforward };
        let run = track(&stage.apparatus(), stage.start(), &timing, &controller, course, NEVER)?;
        let Some(run) = run else { continue };
        let measured = &run.motion.measured;
        // The first period has the start in it.
        let figures = tracking(&reference[250..], &measured[250..], INTERVAL, Some(FREQUENCY))?;
        println!(
            "{name:<18} largest error {:.2} um, phase lag {:.4} rad",
            1e6 * figures.max_error,
            figures.phase_lag.unwrap_or(f64::NAN)
        );
    }
    Ok(())
}
