//! Modal terms of several axes fitted to responses: modes sought one after the other, refined by
//! Gauss-Newton steps, and the deviations of their poles.
//!
//! The Jacobian is never formed. Every derivative of the model is a pair of constant real matrices
//! times two of `4 q + 1` functions of frequency: normal equations follow from the inner products
//! of these functions. All sums have one order, whatever the processor and its threads.

mod derivatives;
mod deviations;
mod distortion;
mod factors;
mod normal_equations;
mod products;
mod pursuit;
mod refine;
mod responses;
mod terms;

pub use distortion::{Distortion, ModalForce, choose_distortion};
pub use normal_equations::DistortionRecord;
pub use refine::Descent;
pub use responses::ModalFit;
pub use terms::ModalTerms;
