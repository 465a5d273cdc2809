//! Gain of back-calculation for a feedback law in state space, where none is given.
//!
//! The command that saturated is taken as a measurement of the law's own output: an observer of
//! the law moves its state to where its output would have been the applied voltage (Astrom and
//! Wittenmark 1997, Computer-Controlled Systems, 3rd edition, section 9.4). The gain is that of
//! the steady Kalman predictor with the error as process noise:
//!
//! ```text
//! P = A P A' + B B' - l (A P C' + B D)',   l = (A P C' + B D)/(C P C' + D^2 + R)
//! ```
//!
//! `A - l C` is stable then. With R = 0 this is Hanus' conditioning, l = B/D, for a law of minimum
//! phase; a PI law has the tracking time Tt = Ti. R, 1 % of the squared first answers D, C B, C A B
//! and so on of n states, keeps zeros on the unit circle inside.

/// Iterations of the Riccati equation: more than laws at usual sampling rates need.
const ITERATIONS: u32 = 3000;
/// Relative change at which the iteration ends.
const SETTLED: f64 = 1e-10;
/// Share of the first answers in R.
const NOISE: f64 = 0.01;

type Matrix<const N: usize> = [[f64; N]; N];

/// The gain for the first `n` states; `None` where no gain makes `A - l C` stable.
pub(crate) fn gain<const N: usize>(
    a: &Matrix<N>,
    b: &[f64; N],
    c: &[f64; N],
    d: f64,
    n: usize,
) -> Option<[f64; N]> {
    let (mut answers, mut x) = (d * d, *b);
    for _ in 0..n {
        let answer = (0..n).fold(0.0, |sum, i| sum + c[i] * x[i]);
        answers += answer * answer;
        x = column(a, &x, n);
    }
    let noise = d * d + NOISE * answers;
    let mut p = [[0.0; N]; N];
    for i in 0..n {
        for j in 0..n {
            p[i][j] = b[i] * b[j];
        }
    }
    let mut l = [0.0; N];
    for _ in 0..ITERATIONS {
        let pc = column(&p, c, n);
        let total = (0..n).fold(noise, |sum, i| sum + c[i] * pc[i]);
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut cross = column(a, &pc, n);
        let (mut change, mut size) = (0.0, 0.0);
        for i in 0..n {
            cross[i] += b[i] * d;
            change = f64::max(change, (cross[i] / total - l[i]).abs());
            size = f64::max(size, (cross[i] / total).abs());
            l[i] = cross[i] / total;
        }
        if size > 0.0 && change <= SETTLED * size {
            break;
        }
        let ap = product(a, &p, n);
        let mut next = [[0.0; N]; N];
        for i in 0..n {
            for j in 0..n {
                let moved = (0..n).fold(0.0, |sum, k| sum + ap[i][k] * a[j][k]);
                next[i][j] = moved + b[i] * b[j] - l[i] * cross[j];
            }
        }
        // Rounding must not make it asymmetric.
        for i in 0..n {
            for j in 0..n {
                p[i][j] = 0.5 * (next[i][j] + next[j][i]);
            }
        }
    }
    let mut closed = *a;
    for i in 0..n {
        for j in 0..n {
            closed[i][j] -= l[i] * c[j];
        }
    }
    stable(&closed, n).then_some(l)
}

/// Whether the powers of a matrix vanish.
fn stable<const N: usize>(matrix: &Matrix<N>, n: usize) -> bool {
    let mut power = *matrix;
    for _ in 0..40 {
        power = product(&power, &power, n);
        let mut size = 0.0;
        for row in power.iter().take(n) {
            for entry in row.iter().take(n) {
                size += entry.abs();
            }
        }
        if size < 1e-6 {
            return true;
        }
        if !size.is_finite() {
            return false;
        }
    }
    false
}

fn product<const N: usize>(a: &Matrix<N>, b: &Matrix<N>, n: usize) -> Matrix<N> {
    let mut out = [[0.0; N]; N];
    for i in 0..n {
        for k in 0..n {
            for j in 0..n {
                out[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    out
}

fn column<const N: usize>(a: &Matrix<N>, b: &[f64; N], n: usize) -> [f64; N] {
    let mut out = [0.0; N];
    for i in 0..n {
        for k in 0..n {
            out[i] += a[i][k] * b[k];
        }
    }
    out
}
