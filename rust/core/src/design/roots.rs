//! All roots of the closed loop at once, for a picture.

use core::f64::consts::TAU;

use super::jet::C;
use super::sampled_loop::{SampledLoop, small};
