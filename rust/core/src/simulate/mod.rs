//! Experiments on a stage in continuous time: amplifier, plant and sensor, driven or controlled.
//!
//! ```text
//! command -> amplifier -> applied voltage -> plant -> displacement -> sensor -> reading
//! ```

mod amplifier;
mod apparatus;
mod closed_loop;
mod modes;
mod open_loop;
mod sensor;
mod sensor_delay;
mod timing;
mod tracking;
mod two_axes;
mod virtual_run;
mod virtual_stage;

pub use amplifier::{Amplifier, AmplifierFlow};
pub use apparatus::{Apparatus, ApparatusState};
pub use closed_loop::{ClosedLoop, closed_loop};
pub use modes::{
    AxesLoop, AxesRun, DistortedModes, DistortedState, ModalState, ModalSystem, Regressor,
    RegressorState, Regressors,
};
pub use open_loop::{OpenLoop, open_loop};
pub use sensor::{Sensor, SensorState};
pub use timing::{MissedTicks, Timing};
pub use tracking::{DELAY_LINE, ReferenceSamples, TrackingRun, track};
pub use two_axes::{
    TwoAxes, TwoLogs, TwoMotions, TwoStates, TwoTracked, closed_loops, open_loops, track_both,
};
pub use virtual_run::VirtualRun;
pub use virtual_stage::{Preconditioning, VirtualStage};

pub(crate) use modes::check_modes;
pub(crate) use timing::{Delay, SAME};
