//! Properties that hold for all inputs, on inputs that proptest draws.
//!
//! `PROPTEST_CASES` is the number of cases of each property, `PROPTEST_RNG_SEED` their seed; both
//! are fixed where they are not given, so that a change alone can make a test fail.
#![allow(missing_docs, clippy::unwrap_used, clippy::float_cmp)]

mod control;
mod laws;
mod lockstep;
mod operators;
mod signals;
mod swarm;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};

/// The cases of a property: one in `fewer` where a case takes long.
#[must_use]
pub fn cases(fewer: u32) -> Config {
    let given = Config::default();
    let rng_seed = match given.rng_seed {
        RngSeed::Random => RngSeed::Fixed(1),
        fixed @ RngSeed::Fixed(_) => fixed,
    };
    // What is found is kept as a test of its own, not as a seed.
    let failure_persistence = None;
    Config { cases: given.cases.div_ceil(fewer), rng_seed, failure_persistence, ..given }
}

/// Any number at all: NaN, infinite, denormal, huge.
pub fn any_number() -> impl Strategy<Value = f64> {
    let named = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 9.91e37, 1e99, 5e-324];
    prop_oneof![proptest::num::f64::ANY, proptest::sample::select(named.to_vec()), around(1.0)]
}

/// A number of about a size, of either sign.
pub fn around(size: f64) -> impl Strategy<Value = f64> {
    (-1.0..1.0_f64).prop_map(move |x| size * x)
}

/// A number of a size that may be out by powers of ten.
pub fn decades(size: f64, out: f64) -> impl Strategy<Value = f64> {
    (-out..out).prop_map(move |power| size * 10_f64.powf(power))
}
