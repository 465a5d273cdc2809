//! A controller with its feedforward and the state of both, in Rust.

use piezotrack_control::inverse::{Inverse, NetworkNumbers, NeuralNetworkInverse};
use piezotrack_control::{
    Command, Controller, ControllerState, OnlineFeedforward, OnlineFeedforwardState,
    ReferenceSample, Refused,
};
use piezotrack_core::math::zeros;
use piezotrack_core::models::{AnyInverse, AnyInverseState, Model, ParameterInfo, Values};
use piezotrack_core::parts::{ControllerParts, Law, LawState, Named};
use piezotrack_core::simulate::DELAY_LINE;
use piezotrack_core::{Error, Result};

/// Name of the feedforward's model that is a network.
const NETWORK: &str = "neural network";

/// Parts of the feedforward.
pub struct FeedforwardParts<'a> {
    pub model: &'a str,
    pub parameters: Vec<Named<'a>>,
    pub initial: Vec<Named<'a>>,
    pub offset: f64,
    pub delay: f64,
}

/// Inverse of the stage, sample by sample.
struct Feedforward {
    online: OnlineFeedforward<AnyInverse>,
    start: AnyInverseState,
    state: OnlineFeedforwardState<AnyInverseState>,
}

/// A controller at work.
pub struct Running {
    controller: Controller<Law>,
    state: ControllerState<LawState, Vec<f64>>,
    feedforward: Option<Feedforward>,
}

impl Running {
    /// A controller that begins at 0 V.
    pub fn new(
        parts: &ControllerParts<'_>,
        forward: Option<&FeedforwardParts<'_>>,
    ) -> Result<Self> {
        let controller = parts.controller()?;
        let feedforward = match forward {
            Some(forward) => Some(Feedforward::new(forward, parts.dt)?),
            None => None,
        };
        let state = controller.rest(line(&controller)?)?;
        Ok(Self { controller, state, feedforward })
    }

    /// The voltage of a sample, V; the reference one sample ahead where it is known.
    pub fn step(&mut self, reference: f64, next: Option<f64>, measured: f64) -> f64 {
        let mut volts = 0.0;
        if let Some(Feedforward { online, state, .. }) = &mut self.feedforward {
            let sample = ReferenceSample { preview: next, ..ReferenceSample::new(reference) };
            volts = online.step_within(state, &sample, &self.controller.limits);
        }
        self.step_given(reference, measured, volts)
    }

    /// The voltage of a sample with a feedforward of the caller's, V.
    pub fn step_given(&mut self, reference: f64, measured: f64, feedforward: f64) -> f64 {
        self.controller.step(&mut self.state, reference, measured, feedforward).volts
    }

    /// Begins anew, without a bump from the voltage that is there, V.
    pub fn start(&mut self, present: f64) -> Result<()> {
        self.state = self.controller.start(present, line(&self.controller)?)?;
        self.restart();
        Ok(())
    }

    /// Forgets what was learnt, and goes on from the voltage that is there.
    pub fn reset(&mut self) {
        self.controller.reset(&mut self.state);
        self.restart();
    }

    fn restart(&mut self) {
        if let Some(Feedforward { online, start, state }) = &mut self.feedforward {
            *state = online.start(*start);
        }
    }

    /// Takes the voltage that the actuator got for the last command, V.
    pub fn applied(&mut self, volts: f64) -> Result<()> {
        self.controller.applied(&mut self.state, volts)?;
        let reached = self.controller.reached(&self.state);
        if let (Some(forward), Some(reached)) = (&mut self.feedforward, reached) {
            forward.online.applied(&mut forward.state, reached);
        }
        Ok(())
    }

    /// The last command.
    pub fn last(&self) -> &Command {
        self.state.last()
    }

    /// Readings that were no measurements.
    pub fn refused(&self) -> Refused {
        self.state.refused()
    }
}

/// Memory of the repetitive part.
fn line(controller: &Controller<Law>) -> Result<Vec<f64>> {
    zeros(DELAY_LINE, controller.repetitive.map_or(0, |part| part.length()))
}

impl Feedforward {
    fn new(parts: &FeedforwardParts<'_>, dt: f64) -> Result<Self> {
        let (inverse, start) = if parts.model == NETWORK {
            let network = network(&parts.parameters)?;
            let start = AnyInverseState::Network(network.rest());
            (AnyInverse::Network(Box::new(network)), start)
        } else {
            let model = Model::named(parts.model).map_err(or_network)?;
            let parameters = model.info().parameters;
            let given = whole(parameters, &parts.parameters);
            let stage = model.build(&Values::named(parameters, given)?)?;
            let initial = match &parts.initial[..] {
                [] => None,
                initial => {
                    Some(Values::named(model.info().state, owned(initial)).map_err(of_initial)?)
                }
            };
            let (inverse, start) = stage.inverse(dt, initial.as_ref())?;
            (AnyInverse::Stage(Box::new(inverse)), AnyInverseState::Stage(start))
        };
        let online = OnlineFeedforward::new(inverse, dt, parts.offset, parts.delay)?;
        Ok(Self { state: online.start(start), online, start })
    }
}

/// A model that is not known, with what is none of the list.
fn or_network(error: Error) -> Error {
    match error {
        Error::Parameter { name, value, expected } => {
            Error::Parameter { name, value, expected: format!("{expected}, or {NETWORK}") }
        }
        other => other,
    }
}

/// An error of a list of states, which is not one of parameters.
fn of_initial(error: Error) -> Error {
    match error {
        Error::Parameter { name, value, expected } if name == "parameters" => {
            Error::Parameter { name: "initial".into(), value, expected }
        }
        other => other.of("initial"),
    }
}

/// The parameters that are given, with the defaults of the others: none of a list, none of what is
/// optional.
fn whole(infos: &[ParameterInfo], given: &[Named<'_>]) -> Vec<(String, Vec<f64>)> {
    let mut named = owned(given);
    for info in infos {
        let left_out = given.iter().all(|(name, _)| *name != info.name);
        let default = match info.default {
            Some(number) => Some(vec![number]),
            None => (info.is_list || info.is_optional).then(Vec::new),
        };
        if let (true, Some(numbers)) = (left_out, default) {
            named.push((info.name.into(), numbers));
        }
    }
    named
}

fn owned(named: &[Named<'_>]) -> Vec<(String, Vec<f64>)> {
    named.iter().map(|&(name, numbers)| (name.into(), numbers.to_vec())).collect()
}

fn network(parameters: &[Named<'_>]) -> Result<NeuralNetworkInverse> {
    let numbers = |name: &str| {
        let found = parameters.iter().find(|(known, _)| *known == name);
        found.map(|&(_, numbers)| numbers).ok_or_else(|| {
            Error::parameter("parameters", format!("without '{name}'"), "all numbers of a network")
        })
    };
    let single = |name: &str| match numbers(name)? {
        &[number] => Ok(number),
        more => Err(Error::parameter(name, format!("{} numbers", more.len()), "one number")),
    };
    let scales = numbers("scales")?;
    let scales = scales.try_into().map_err(|_| {
        Error::parameter("scales", format!("{} numbers", scales.len()), "three numbers")
    })?;
    Ok(NeuralNetworkInverse::new(&NetworkNumbers {
        centre: single("centre")?,
        scales,
        thresholds: numbers("thresholds")?,
        hidden: numbers("hidden")?,
        biases: numbers("biases")?,
        outputs: numbers("outputs")?,
        direct: numbers("direct")?,
        offset: single("constant")?,
    })?)
}
