//! A controller as firmware runs it: feedforward, feedback and repetitive part, one call a sample.
//!
//! `Axis` and its `new` and `step` use `core` only and do not allocate. In firmware they belong to
//! the interrupt of the sampling timer. `main` is the test bench: it connects the axis to a linear
//! stage and prints the tracking error.
//!
//! ```sh
//! cargo run -p piezotrack-control --example firmware_step
//! ```

use piezotrack_control::hysteresis::Play;
use piezotrack_control::pid::{PidState, SampledPid};
use piezotrack_control::{
    Command, Controller, ControllerState, Creep, Dynamics, Limits, OnlineFeedforward,
    OnlineFeedforwardState, Pid, PrandtlIshlinskiiInverse, PrandtlIshlinskiiInverseState,
    ReferenceSample, Repetitive, Result, Smoothing,
};

/// Sampling interval, s.
const DT: f64 = 1e-3;
/// Period of the reference, s and samples.
const PERIOD: f64 = 0.2;
const SAMPLES: u32 = 200;
/// Entries of the repetitive part's delay line.
const ROOM: usize = Repetitive::room(SAMPLES as usize);

/// Two play operators, no dead zone, one relaxation.
type Inverse = PrandtlIshlinskiiInverse<2, 0, 1>;
type InverseState = PrandtlIshlinskiiInverseState<2, 1>;

/// One axis: configuration and state, of a size known to the compiler.
struct Axis {
    feedforward: OnlineFeedforward<Inverse>,
    feedforward_state: OnlineFeedforwardState<InverseState>,
    controller: Controller<SampledPid>,
    controller_state: ControllerState<PidState, [f64; ROOM]>,
}

impl Axis {
    /// Checks the parameters and works out the coefficients, once.
    fn new() -> Result<Self> {
        let hysteresis = Play {
            linear: 1.2e-6,            // m/V
            thresholds: [5.0, 15.0],   // V
            weights: [0.2e-6, 0.1e-6], // m/V
            corners: [],
            bends: [],
        };
        let creep = [Creep { share: 0.01, time: 0.5 }];
        let dynamics = Dynamics::First { time: 2e-3 };
        let inverse = Inverse::new(&hysteresis, &creep, dynamics, DT)?;
        let feedforward = OnlineFeedforward::new(inverse, DT, 0.0, 0.0)?;

        let pid = Pid::new(0.05e6, 0.02, 0.0, None)?.at(DT)?;
        let mut controller = Controller::new(Limits::new(0.0, 75.0)?, pid);
        let smoothing = Smoothing::ZeroPhase { order: 2 };
        controller.repetitive = Some(Repetitive::new(PERIOD, smoothing, 0.3)?.at(DT)?);
        let controller_state = controller.rest([0.0; ROOM])?;
        let feedforward_state = feedforward.rest();
        Ok(Self { feedforward, feedforward_state, controller, controller_state })
    }

    /// One sample: reference, reference one sample ahead and measurement in m.
    fn step(&mut self, reference: f64, next: f64, measured: f64) -> Command {
        let sample = ReferenceSample { preview: Some(next), ..ReferenceSample::new(reference) };
        let volts = self.feedforward.step(&mut self.feedforward_state, &sample);
        self.controller.step(&mut self.controller_state, reference, measured, volts)
    }
}

/// Displacement to be followed at sample `k`, m.
fn reference(k: u32) -> f64 {
    let phase = core::f64::consts::TAU * f64::from(k % SAMPLES) / f64::from(SAMPLES);
    20e-6 * (1.0 - libm::cos(phase))
}

fn main() -> Result<()> {
    let mut axis = Axis::new()?;
    let mut x = 0.0;
    for period in 0..10 {
        let mut worst: f64 = 0.0;
        for k in 0..SAMPLES {
            let command = axis.step(reference(k), reference(k + 1), x);
            worst = worst.max(command.error.abs());
            // A stage of 1.4 um/V behind a lag of 2 ms: not what the inverse was made for.
            x += (1.4e-6 * command.volts - x) * (1.0 - libm::exp(-DT / 2e-3));
        }
        println!("period {period}: largest error {:6.3} um", 1e6 * worst);
    }
    Ok(())
}
