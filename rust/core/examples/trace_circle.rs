//! Traces a circle on the XY virtual stage: feedforward of one model and PID on both axes.
//!
//! `cargo run --release -p piezotrack-core --example trace_circle`

use piezotrack_control::{Controller, DahlInverse, Limits, Pid};
use piezotrack_core::parts::Law;
use piezotrack_core::signal::NEVER;
use piezotrack_core::signal::contour_error::radial_errors;
use piezotrack_core::signal::metrics::Spread;
use piezotrack_core::simulate::{
    MissedTicks, ReferenceSamples, Timing, TwoAxes, VirtualStage, track_both,
};

const INTERVAL: f64 = 0.02;
const FREQUENCY: f64 = 0.1;
const CENTRE: f64 = 58.5e-6;
const SAMPLES: u32 = 1500;
/// Time from home to the circle, s.
const START: f64 = 2.0;

/// One coordinate of the circle, reached smoothly from 0, and its feedforward.
fn coordinate(radius: f64, phase: f64) -> Result<[Vec<f64>; 2], piezotrack_control::Error> {
    let angular = core::f64::consts::TAU * FREQUENCY;
    let inverse = DahlInverse::xu_li_2010().at(INTERVAL)?;
    let mut state = inverse.rest();
    let (mut reference, mut feedforward) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let t = INTERVAL * f64::from(k);
        let (sine, cosine) = (angular * t + phase).sin_cos();
        let x = CENTRE + radius * cosine;
        let (v, a) = (-radius * angular * sine, -radius * angular * angular * cosine);
        let u = (t / START).min(1.0);
        let s = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let (slope, bend) =
            (30.0 * (u * (1.0 - u)).powi(2), 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u));
        let (v, a) = (
            slope * x / START + s * v,
            bend * x / (START * START) + 2.0 * slope * v / START + s * a,
        );
        reference.push(s * x);
        feedforward.push(inverse.step(&mut state, s * x, v, a));
    }
    Ok([reference, feedforward])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (x, y) = (VirtualStage::xu_li_2010(1), VirtualStage::xu_li_2010_y(1));
    let axes = TwoAxes {
        x: x.apparatus(),
        y: y.apparatus(),
        cross_talk: [0.015, 0.010],
        lag: 0.010,
        missed: MissedTicks::NONE,
    };
    let pid = Law::Pid(Pid::xu_li_2010().at(INTERVAL)?);
    let controller = Controller::new(Limits::new(0.0, 75.0)?, pid);
    for (radius, published) in [(10e-6, 0.184), (20e-6, 0.300), (40e-6, 0.472)] {
        let coordinates =
            [coordinate(radius, 0.0)?, coordinate(radius, -0.25 * core::f64::consts::TAU)?];
        let courses = [0, 1].map(|i| ReferenceSamples {
            reference: &coordinates[i][0],
            feedforward: &coordinates[i][1],
        });
        let timing = Timing {
            interval: INTERVAL,
            samples: courses[0].reference.len(),
            delay: 0.0,
            jitter: 0.0,
            substeps: 1,
        };
        let start = (x.start(), y.start());
        let loops = (&controller, &controller);
        let Some((x, y)) = track_both(&axes, start, &timing, loops, courses, NEVER)? else {
            continue;
        };
        // The first turn has the start in it.
        let (x, y) = (&x.motion.measured[500..], &y.motion.measured[500..]);
        let errors = radial_errors(x, y, [CENTRE, CENTRE], radius)?;
        let found = Spread::of(errors.into_iter());
        println!(
            "{:.0} um: contour error {:.3} um peak to peak, mean {:.3} um, SD {:.3} um; published \
             SD {published:.3} um",
            1e6 * radius,
            1e6 * found.peak_to_peak,
            1e6 * found.mean,
            1e6 * found.sd
        );
    }
    Ok(())
}
