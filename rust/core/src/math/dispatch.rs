//! Dispatch of code to instruction sets, without compiling it for those that do not need it.

use pulp::{Arch, Simd, WithSimd};

/// Returns the name of the vector instructions that searches use on this processor.
#[must_use]
pub fn instruction_set() -> &'static str {
    match Arch::new() {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Arch::V4(_) => "AVX-512",
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Arch::V3(_) => "AVX2",
        #[cfg(target_arch = "aarch64")]
        Arch::Neon(_) => "NEON",
        _ => "none",
    }
}

/// Lanes in one vector of an instruction set.
pub(crate) fn width(arch: Arch) -> usize {
    struct Width;

    impl WithSimd for Width {
        type Output = usize;
        #[inline(always)]
        fn with_simd<S: Simd>(self, _simd: S) -> usize {
            S::F64_LANES
        }
    }

    arch.dispatch(Width)
}

/// Runs scalar code where the processor has fused multiply-add, without wider vectors than that
/// needs: they would only be compiled for nothing. The bits are those of every other dispatch.
pub(crate) fn dispatch_fused<W: WithSimd>(code: W) -> W::Output {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        match pulp::x86::V3::try_new() {
            Some(simd) => Simd::vectorize(simd, code),
            None => Simd::vectorize(pulp::Scalar, code),
        }
    }
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
    Arch::new().dispatch(code)
}

/// Runs code for several vectors; `None` where the instruction set has none.
pub(crate) fn dispatch_vectors<W: WithSimd>(arch: Arch, code: W) -> Option<W::Output> {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        match arch {
            Arch::V4(simd) => Some(Simd::vectorize(simd, code)),
            Arch::V3(simd) => Some(Simd::vectorize(simd, code)),
            _ => None,
        }
    }
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
    Some(arch.dispatch(code))
}
