//! What the benches share: the paper's search, and what the core can do at most.
#![allow(missing_docs)]

use piezotrack_core::identify::{Candidate, Problem, Spec};
use piezotrack_core::models::Model;
use pulp::{Simd, WithSimd};

pub const RATE: f64 = 5000.0;
pub const SAMPLES: u32 = 20_001;

pub fn drive() -> Vec<f64> {
    let turn = core::f64::consts::TAU * 0.25 / RATE;
    (0..SAMPLES).map(|k| 37.5 * (1.0 - (turn * f64::from(k)).cos())).collect()
}

pub fn paper_spec() -> Spec {
    let named = |pairs: &[(&str, f64)]| pairs.iter().map(|&(n, v)| (n.into(), v)).collect();
    Spec {
        fixed: named(&[("a1", 121.9874), ("a2", 1.1773e6), ("b1", 1.8485e6)]),
        bounds: vec![
            ("mass".into(), (0.1, 0.2)),
            ("damping".into(), (1e3, 5e3)),
            ("stiffness".into(), (1e4, 5e4)),
            ("piezo_coefficient".into(), (0.01, 0.1)),
        ],
        ..Spec::of(Model::Dahl)
    }
}

pub fn candidates(problem: &Problem, particles: u32) -> Vec<Candidate> {
    (0..particles)
        .map(|i| problem.theta(&[f64::from(i) / f64::from(particles); 4]))
        .map(Candidate::of)
        .collect()
}

/// Independent chains of multiply-adds: what the core can do at most.
pub struct Peak(pub f64);

impl Peak {
    const CHAINS: usize = 12;
    const ROUNDS: u64 = 10_000;
    pub const COUNT: u64 = Self::ROUNDS * 12;
}

impl WithSimd for Peak {
    type Output = f64;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let (factor, term) = (simd.splat_f64s(self.0), simd.splat_f64s(1.0));
        let mut chains = [simd.splat_f64s(0.0); Self::CHAINS];
        for _ in 0..Self::ROUNDS {
            for chain in &mut chains {
                *chain = simd.mul_add_f64s(*chain, factor, term);
            }
        }
        let mut sum = simd.splat_f64s(0.0);
        for chain in chains {
            sum = simd.add_f64s(sum, chain);
        }
        simd.reduce_sum_f64s(sum)
    }
}

/// Lanes of an instruction set.
pub struct Width;

impl WithSimd for Width {
    type Output = u64;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> u64 {
        S::F64_LANES as u64
    }
}
