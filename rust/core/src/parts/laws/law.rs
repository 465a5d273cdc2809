//! The list of feedback laws, and the types that hold any of them.

use piezotrack_control::hysteresis::{BoucWen, Dahl};
use piezotrack_control::unfused::Unfused;
use piezotrack_control::{
    Damped, Feedback, FeedbackSample, HysteresisObserved, Observed, SampledPid, SampledSlidingMode,
    ScheduledPid, Snapshot, StateSpace,
};

use super::hysteresis_observer::AnyObserved;
use super::state_space::MOST_STATES;
use super::{
    disturbance_observer, hysteresis_observer, integral_resonant, lead_lag, perturbation_estimator,
    pid, positive_position, positive_velocity_position, scheduled_pid, sliding_mode, state_space,
};
use crate::design::LinearFeedback;
use crate::error::{Error, Result, shown_text};
use crate::parts::info::PartInfo;

/// Makes the types that hold any law from one list: name of the variant, type of the sampled law,
/// and the modules whose `INFO` and `build` describe and make it.
macro_rules! laws {
    ($($(#[$doc:meta])* $variant:ident($law:ty): $($module:ident),*;)*) => {
        /// The feedback laws that a controller can be given.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[expect(clippy::large_enum_variant, reason = "one in a controller, and no allocation in it")]
        pub enum Law {
            /// None: feedforward without feedback.
            None,
            $($(#[$doc])* $variant($law),)*
        }

        /// Memory of a [`Law`].
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum LawState {
            /// Nothing to remember.
            None,
            $($(#[$doc])* $variant(<$law as Feedback>::State),)*
        }

        $(
            impl From<$law> for Law {
                fn from(law: $law) -> Self {
                    Self::$variant(law)
                }
            }
        )*

        impl Law {
            /// Descriptions of all that have a name, in the order of the list.
            pub const INFOS: &'static [&'static PartInfo] = &[$($(&$module::INFO,)*)*];

            /// A law for samples every `dt` seconds, from its name and its numbers, which are those
            /// of its [`PartInfo`].
            ///
            /// # Errors
            /// [`Error::Parameter`] for a name that is unknown, another count of numbers, and a
            /// number out of its range.
            pub fn named(name: &str, numbers: &[f64], dt: f64) -> Result<Self> {
                match name {
                    $($(known if known == $module::INFO.name => {
                        Ok($module::build(numbers, dt)?.into())
                    })*)*
                    other => {
                        let names: Vec<String> =
                            Self::INFOS.iter().map(|info| format!("'{}'", info.name)).collect();
                        Err(Error::parameter("law", shown_text(other), names.join(", ")))
                    }
                }
            }
        }

        impl Snapshot for LawState {
            fn save(&self, write: &mut dyn FnMut(f64)) {
                match self {
                    Self::None => {}
                    $(Self::$variant(state) => state.save(write),)*
                }
            }

            fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
                match self {
                    Self::None => Some(()),
                    $(Self::$variant(state) => state.load(read),)*
                }
            }
        }

        impl Feedback for Law {
            type State = LawState;

            fn rest(&self) -> LawState {
                match self {
                    Self::None => LawState::None,
                    $(Self::$variant(law) => LawState::$variant(law.rest()),)*
                }
            }

            fn start(&self, volts: f64) -> LawState {
                match self {
                    Self::None => LawState::None,
                    $(Self::$variant(law) => LawState::$variant(law.start(volts)),)*
                }
            }

            fn holds(&self) -> bool {
                !matches!(self, Self::None)
            }

            fn adopt(&self, before: &Self, state: &mut LawState) -> bool {
                match (self, before, state) {
                    (Self::None, Self::None, _) => true,
                    $((Self::$variant(law), Self::$variant(before), LawState::$variant(state)) => {
                        law.adopt(before, state)
                    })*
                    _ => false,
                }
            }

            fn step(&self, state: &mut LawState, sample: &FeedbackSample) -> f64 {
                match (self, state) {
                    $((Self::$variant(law), LawState::$variant(state)) => law.step(state, sample),)*
                    _ => 0.0,
                }
            }
        }

        impl LinearFeedback for Law {
            fn transfer_function(&self) -> [Vec<f64>; 2] {
                match self {
                    Self::None => ().transfer_function(),
                    $(Self::$variant(law) => law.transfer_function(),)*
                }
            }

            fn reference_numerator(&self) -> Option<Vec<f64>> {
                match self {
                    Self::None => None,
                    $(Self::$variant(law) => law.reference_numerator(),)*
                }
            }

            fn named_gain(&self) -> Option<f64> {
                match self {
                    Self::None => None,
                    $(Self::$variant(law) => law.named_gain(),)*
                }
            }
        }
    };
}

laws! {
    /// Incremental PID.
    Pid(SampledPid): pid;
    /// Discrete state space.
    StateSpace(StateSpace<MOST_STATES>): state_space, lead_lag;
    /// Sliding mode with a boundary layer.
    SlidingMode(SampledSlidingMode): sliding_mode;
    /// Disturbance observer around a PID.
    ObservedPid(Observed<SampledPid>): disturbance_observer;
    /// Sliding mode with perturbation estimation.
    ObservedSlidingMode(Observed<SampledSlidingMode>): perturbation_estimator;
    /// PID whose gains follow amplitude and rate of the reference.
    Scheduled(ScheduledPid): scheduled_pid;
    /// Observer of a Dahl hysteresis around a PID.
    DahlObserver(HysteresisObserved<Dahl<Unfused>, SampledPid>): hysteresis_observer;
    /// Observer of a Bouc-Wen hysteresis around a PID.
    BoucWenObserver(HysteresisObserved<BoucWen<Unfused>, SampledPid>):;
    /// PID with a damping filter of the measurement.
    Damped(Damped<SampledPid>): integral_resonant, positive_position, positive_velocity_position;
}

impl From<AnyObserved> for Law {
    fn from(law: AnyObserved) -> Self {
        match law {
            AnyObserved::Dahl(law) => Self::DahlObserver(law),
            AnyObserved::BoucWen(law) => Self::BoucWenObserver(law),
        }
    }
}
