//! Discrete Fourier transform of two real signals at once, radix 2: the same bits on every processor.

use libm::sincos;

/// Transforms two real signals, padded with zeros to a power of two: the halves of their spectra, from
/// frequency 0 to the half of the sampling rate, as (real, imaginary).
///
/// Cooley and Tukey 1965, doi 10.1090/S0025-5718-1965-0178586-1.
pub(super) fn transform(a: &[f64], b: &[f64], size: usize) -> [Vec<(f64, f64)>; 2] {
    let mut z = vec![(0.0, 0.0); size];
    for (z, a) in z.iter_mut().zip(a) {
        z.0 = *a;
    }
    for (z, b) in z.iter_mut().zip(b) {
        z.1 = *b;
    }
    in_place(&mut z);
    let half = size / 2;
    let of_both = |k: usize| {
        let (p, q) = (z[k], z[(size - k) % size]);
        let a = (0.5 * (p.0 + q.0), 0.5 * (p.1 - q.1));
        let b = (0.5 * (p.1 + q.1), 0.5 * (q.0 - p.0));
        (a, b)
    };
    let (a, b) = (0..=half).map(of_both).unzip();
    [a, b]
}

/// Transforms a signal whose length is a power of two.
fn in_place(z: &mut [(f64, f64)]) {
    let size = z.len();
    if size < 2 {
        return;
    }
    let bits = size.trailing_zeros();
    for k in 0..size {
        let reversed = k.reverse_bits() >> (usize::BITS - bits);
        if k < reversed {
            z.swap(k, reversed);
        }
    }
    let turns: Vec<(f64, f64)> = (0..size / 2).map(|k| turn(k, size)).collect();
    let mut length = 2;
    while length <= size {
        let (half, step) = (length / 2, size / length);
        for block in z.chunks_exact_mut(length) {
            let (low, high) = block.split_at_mut(half);
            let pairs = low.iter_mut().zip(high).zip(turns.iter().step_by(step));
            for ((low, high), (re, im)) in pairs {
                let part = (high.0 * re - high.1 * im, high.0 * im + high.1 * re);
                *high = (low.0 - part.0, low.1 - part.1);
                *low = (low.0 + part.0, low.1 + part.1);
            }
        }
        length *= 2;
    }
}

/// The `k`-th of `size` turns, backward.
#[expect(clippy::cast_precision_loss, reason = "sizes are below 2^53")]
fn turn(k: usize, size: usize) -> (f64, f64) {
    let (sine, cosine) = sincos(core::f64::consts::TAU * k as f64 / size as f64);
    (cosine, -sine)
}

#[cfg(test)]
mod tests {
    use super::transform;

    #[test]
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    fn two_signals_have_the_spectra_of_the_sum() {
        let a: Vec<f64> = (0..11).map(|k| libm::sin(f64::from(k * k))).collect();
        let b: Vec<f64> = (0..13).map(|k| libm::cos(f64::from(3 * k))).collect();
        let found = transform(&a, &b, 16);
        for (signal, spectrum) in [a, b].iter().zip(&found) {
            for (k, value) in spectrum.iter().enumerate() {
                let mut sum = (0.0, 0.0);
                for (t, x) in signal.iter().enumerate() {
                    let phase = core::f64::consts::TAU * (k * t) as f64 / 16.0;
                    sum = (sum.0 + x * libm::cos(phase), sum.1 - x * libm::sin(phase));
                }
                assert!((sum.0 - value.0).abs() < 1e-12 && (sum.1 - value.1).abs() < 1e-12);
            }
        }
    }
}
