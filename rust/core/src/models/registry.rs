//! The list of models, and the types that hold any model, stage, state or inverse of it.

use core::marker::PhantomData;

use piezotrack_control::Snapshot;
use piezotrack_control::inverse::Inverse;

use super::creeping::Creeping;
use super::input::superposition::{AnySuperposition, Of};
use super::parameters::search_ranges::{Measures, Ranges};
use super::parameters::values::{Held, ParameterInfo, Values};
use super::plant::{Plant, Settling};
use super::traits::{
    Experiment, Invertible, KernelVisitor, ModelInfo, Response, Searchable, StageModel,
};
use crate::design::LoopPlant;
use crate::error::{Error, Result, shown_text};
use crate::integrator::{Order, Parameters};

/// How the parameters of a model are found from a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FoundBy {
    /// A swarm searches the scalar parameters.
    Swarm,
    /// Least squares find the weights.
    LeastSquares,
}

/// `$then` for a model that a swarm searches, `$other` for another one.
macro_rules! by_swarm {
    (swarm, $then:expr, $other:expr) => {
        $then
    };
    (least_squares, $then:expr, $other:expr) => {
        $other
    };
}

/// Makes the types that hold any model from one list: name of the variant, type of the stage, and
/// how it is found.
macro_rules! models {
    ($($variant:ident: $stage:ty, $found:ident;)*) => {
        /// A model of the list.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Model {
            $(#[doc = concat!("[", stringify!($variant), "](", stringify!($stage), ").")] $variant,)*
        }

        impl Model {
            /// All of them, in the order of the list.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// Its name and parts.
            #[must_use]
            pub fn info(self) -> ModelInfo {
                match self { $(Self::$variant => <$stage>::INFO,)* }
            }

            /// How its parameters are found.
            #[must_use]
            pub fn found_by(self) -> FoundBy {
                match self {
                    $(Self::$variant => {
                        by_swarm!($found, FoundBy::Swarm, FoundBy::LeastSquares)
                    })*
                }
            }

            /// The stage with these parameters.
            ///
            /// # Errors
            /// Names the parameter that is out of its range.
            pub fn build(self, values: &Values) -> Result<Stage> {
                Ok(match self {
                    $(Self::$variant => Stage::$variant(<$stage>::build(values)?),)*
                })
            }

            /// Ranges of the parameters that are not held; none where no swarm searches them.
            ///
            /// # Errors
            /// Those of [`Searchable::ranges`].
            pub fn ranges(self, measures: &Measures, held: &Held) -> Result<Ranges> {
                match self {
                    $(Self::$variant => by_swarm!(
                        $found,
                        <$stage as Searchable>::ranges(measures, held),
                        Ok(Ranges::new())
                    ),)*
                }
            }

            /// Whether the force has kinks: see [`Searchable::NONSMOOTH`].
            #[must_use]
            pub fn is_nonsmooth(self) -> bool {
                match self {
                    $(Self::$variant => {
                        by_swarm!($found, <$stage as Searchable>::NONSMOOTH, false)
                    })*
                }
            }

            /// Whether there is a kernel of second order.
            #[must_use]
            pub fn has_second_order(self, held: &Held) -> bool {
                match self {
                    $(Self::$variant => by_swarm!(
                        $found,
                        <$stage as Searchable>::has_second_order(held),
                        false
                    ),)*
                }
            }

            /// Hands the kernel of an order to a visitor; `None` where no swarm searches it.
            pub fn kernel<V: KernelVisitor>(
                self,
                held: &Held,
                order: Order,
                visitor: V,
            ) -> Option<V::Output> {
                match self {
                    $(Self::$variant => by_swarm!(
                        $found,
                        Some(<$stage as Searchable>::kernel(held, order, visitor)),
                        None
                    ),)*
                }
            }
        }

        impl Model {
            /// Superposition whose weights least squares find; `None` where its parameters are searched.
            #[must_use]
            pub fn superposition(self) -> Option<&'static dyn AnySuperposition> {
                match self {
                    $(Self::$variant => {
                        by_swarm!($found, None, Some(&Of::<$stage>(PhantomData)))
                    })*
                }
            }
        }

        /// A stage of any model.
        #[derive(Clone, Copy, Debug)]
        #[allow(clippy::large_enum_variant, reason = "one in an experiment, whichever models there are")]
        pub enum Stage {
            $(#[doc = concat!("[", stringify!($variant), "](", stringify!($stage), ").")] $variant($stage),)*
        }

        /// State of a [`Stage`].
        #[derive(Clone, Debug)]
        #[allow(clippy::large_enum_variant, reason = "one in an experiment, whichever models there are")]
        #[expect(missing_docs, reason = "one for each model")]
        pub enum StageState {
            $($variant(<$stage as Plant>::State),)*
        }

        /// Steps of a [`Stage`].
        #[expect(missing_docs, missing_debug_implementations, reason = "one for each model")]
        pub enum StageFlow {
            $($variant(<$stage as Plant>::Flow),)*
        }

        impl Plant for Stage {
            type State = StageState;
            type Flow = StageFlow;

            fn rest(&self) -> StageState {
                match self { $(Self::$variant(stage) => StageState::$variant(Plant::rest(stage)),)* }
            }

            fn flow(&self, step: f64) -> StageFlow {
                match self { $(Self::$variant(stage) => StageFlow::$variant(stage.flow(step)),)* }
            }

            #[inline(always)]
            fn advance(&self, flow: &StageFlow, state: &mut StageState, from: f64, to: f64) {
                match (self, flow, state) {
                    $((
                        Self::$variant(stage),
                        StageFlow::$variant(flow),
                        StageState::$variant(state),
                    ) => stage.advance(flow, state, from, to),)*
                    // Flow and state are always those of the stage itself.
                    _ => {}
                }
            }

            #[inline(always)]
            fn displacement(&self, state: &StageState) -> f64 {
                match (self, state) {
                    $((Self::$variant(stage), StageState::$variant(state)) => {
                        stage.displacement(state)
                    })*
                    _ => f64::NAN,
                }
            }
        }

        impl Settling for Stage {
            fn settled(&self, voltages: &[f64]) -> StageState {
                match self {
                    $(Self::$variant(stage) => {
                        StageState::$variant(Settling::settled(stage, voltages))
                    })*
                }
            }
        }

        impl Stage {
            /// Which model it is of.
            #[must_use]
            pub fn model(&self) -> Model {
                match self { $(Self::$variant(_) => Model::$variant,)* }
            }

            /// State in equilibrium after a slow visit to each voltage in turn, from rest.
            ///
            /// # Errors
            /// Those of [`StageModel::equilibrium`].
            pub fn equilibrium(&self, voltages: &[f64]) -> Result<Values> {
                match self { $(Self::$variant(stage) => stage.equilibrium(voltages),)* }
            }

            /// Motion under a drive; `None` where it was stopped.
            ///
            /// # Errors
            /// Those of [`StageModel::simulate`].
            pub fn simulate(&self, experiment: &Experiment<'_>) -> Result<Option<Response>> {
                match self {
                    $(Self::$variant(stage) => StageModel::simulate(stage, experiment),)*
                }
            }

            /// The stage for small motions between two voltages.
            ///
            /// # Errors
            /// Those of [`StageModel::loop_plants`].
            pub fn loop_plants(&self, low: f64, high: f64) -> Result<[LoopPlant; 3]> {
                match self { $(Self::$variant(stage) => stage.loop_plants(low, high),)* }
            }

            /// The inverse for samples every `dt` seconds.
            ///
            /// # Errors
            /// Those of [`Invertible::inverse`].
            pub fn inverse(
                &self,
                dt: f64,
                initial: Option<&Values>,
            ) -> Result<(StageInverse, StageInverseState)> {
                match self {
                    $(Self::$variant(stage) => {
                        let (inverse, state) = Invertible::inverse(stage, dt, initial)?;
                        Ok((StageInverse::$variant(inverse), StageInverseState::$variant(state)))
                    })*
                }
            }
        }

        /// Inverse of a [`Stage`].
        #[derive(Clone)]
        #[expect(missing_docs, missing_debug_implementations, reason = "one for each model")]
        #[allow(clippy::large_enum_variant, reason = "one in a controller, whichever models there are")]
        pub enum StageInverse {
            $($variant(<$stage as Invertible>::Inverse),)*
        }

        /// State of a [`StageInverse`].
        #[derive(Clone, Copy)]
        #[allow(clippy::large_enum_variant, reason = "one in a controller, whichever models there are")]
        #[expect(missing_docs, missing_debug_implementations, reason = "one for each model")]
        pub enum StageInverseState {
            $($variant(<<$stage as Invertible>::Inverse as Inverse>::State),)*
        }

        impl Snapshot for StageInverseState {
            fn save(&self, write: &mut dyn FnMut(f64)) {
                match self {
                    $(Self::$variant(state) => state.save(write),)*
                }
            }

            fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
                match self {
                    $(Self::$variant(state) => state.load(read),)*
                }
            }
        }

        impl Inverse for StageInverse {
            type State = StageInverseState;

            fn rest(&self) -> StageInverseState {
                match self {
                    $(Self::$variant(inverse) => {
                        StageInverseState::$variant(Inverse::rest(inverse))
                    })*
                }
            }

            fn step(&self, state: &mut StageInverseState, x: f64, v: f64, a: f64) -> f64 {
                match (self, state) {
                    $((Self::$variant(inverse), StageInverseState::$variant(state)) => {
                        Inverse::step(inverse, state, x, v, a)
                    })*
                    _ => f64::NAN,
                }
            }
        }
    };
}

models! {
    Dahl: Creeping<super::DahlStage>, swarm;
    BoucWen: Creeping<super::BoucWenStage>, swarm;
    AsymmetricBoucWen: Creeping<super::AsymmetricBoucWenStage>, swarm;
    FirstOrderDahl: Creeping<super::FirstOrderDahlStage>, swarm;
    ParallelDahl: Creeping<super::ParallelDahlStage>, swarm;
    LuGre: Creeping<super::LuGreStage>, swarm;
    BoucWenOscillator: Creeping<super::BoucWenOscillator>, swarm;
    PrandtlIshlinskii: super::PrandtlIshlinskiiStage, least_squares;
    MaxwellSlip: super::MaxwellSlipStage, least_squares;
    GeneralisedPrandtlIshlinskii: super::GeneralisedPrandtlIshlinskiiStage, least_squares;
    RateDependentPrandtlIshlinskii: super::RateDependentPrandtlIshlinskiiStage, least_squares;
    PolynomialPrandtlIshlinskii: super::PolynomialPrandtlIshlinskiiStage, least_squares;
    AsymmetricPrandtlIshlinskii: super::AsymmetricPrandtlIshlinskiiStage, least_squares;
    Preisach: super::PreisachStage, least_squares;
    Duhem: super::DuhemStage, least_squares;
}

impl Model {
    /// The model of a name.
    ///
    /// # Errors
    /// [`Error::Parameter`] where there is none.
    pub fn named(name: &str) -> Result<Self> {
        Self::ALL.iter().copied().find(|model| model.info().name == name).ok_or_else(|| {
            let names: Vec<String> =
                Self::ALL.iter().map(|model| format!("'{}'", model.info().name)).collect();
            Error::parameter("model", shown_text(name), names.join(" or "))
        })
    }

    /// Its parameters that are single numbers; in a model that a swarm searches, lists follow
    /// them.
    #[must_use]
    pub fn scalars(self) -> &'static [ParameterInfo] {
        let all = self.info().parameters;
        let count = all.iter().take_while(|info| !info.is_list).count();
        all.get(..count).unwrap_or_default()
    }

    /// Refuses scalar parameters with which no stage exists.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of its range.
    pub fn check(self, parameters: &Parameters<f64>) -> Result<()> {
        self.build(&Values::scalars(self.info().parameters, parameters)).map(drop)
    }
}
