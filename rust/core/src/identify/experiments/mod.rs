//! Experiments that are read directly: steps, a sensor at rest, two axes.

pub(super) mod cross_talk;
pub(super) mod sensor_noise;
pub(super) mod step_response;
pub(super) mod step_ringing;
