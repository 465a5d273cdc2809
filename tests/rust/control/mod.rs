//! Controllers, their loops, and the search for gains.

mod antiwindup;
mod closed_loop;
mod contour;
mod controller;
mod controller_parts;
mod design;
mod hysteresis_observer;
mod iterative_learning;
mod lanes;
mod metrics;
mod online_feedforward;
mod repetitive;
mod scheduled_pid;
mod single_precision;
mod single_precision_feedforward;
mod tune;
mod two_axes;
