//! Dispatch of scalar code to the fused multiply-add instruction.

use pulp::WithSimd;

/// Runs scalar code where the processor has fused multiply-add, without wider vectors than that
/// needs: they would only be compiled for nothing. The bits are those of every other dispatch.
pub(crate) fn dispatch_fused<W: WithSimd>(code: W) -> W::Output {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        use pulp::Simd;
        match pulp::x86::V3::try_new() {
            Some(simd) => Simd::vectorize(simd, code),
            None => Simd::vectorize(pulp::Scalar, code),
        }
    }
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
    pulp::Arch::new().dispatch(code)
}
