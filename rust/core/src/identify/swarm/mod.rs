//! Particle swarm optimisation with an ask/tell interface: no threads, no clock, no data.
//!
//! The classic update is
//!
//! ```text
//! V_i <- w V_i + c1 r1 (P_i - X_i) + c2 r2 (P_g - X_i)     (17)
//! X_i <- X_i + V_i                                         (18)
//! ```
//!
//! Kennedy and Eberhart 1995, doi 10.1109/ICNN.1995.488968, with the settings of Xu and Li
//! 2010, equations (17) and (18), doi 10.1115/1.4001712. Particles live in the unit box: the
//! update does not change under a scaling of the coordinates. r1 and r2 are drawn anew for
//! each particle and coordinate. The other update is that of SPSO-2011, which does not change
//! under a rotation either: [`Update::Hypersphere`].

mod ask_tell;
mod particle;
mod settings;
mod topology;
mod update;

pub use ask_tell::Swarm;
pub use settings::{Boundary, SwarmSettings, Topology, Update};
