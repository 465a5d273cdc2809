//! The numbers of a sampled controller, for those who write its step in another language.

use piezotrack_control::hysteresis::Dahl;
use piezotrack_control::{
    Controller, Damped, HysteresisObserved, Observed, Recursion, SampledPid, SampledSlidingMode,
    StateSpace,
};
use piezotrack_core::parts::Law;

/// Numbers by their names.
pub type Named = Vec<(String, Vec<f64>)>;

/// The numbers of every part that a controller has.
pub fn of_controller(controller: &Controller<Law>) -> Named {
    let mut out = Named::new();
    of_law(&controller.feedback, &mut out);
    for filter in controller.filters.iter().flatten() {
        let (b, a) = filter.coefficients();
        put(&mut out, "filter", &[b[0], b[1], b[2], a[0], a[1]]);
    }
    if let Some(part) = &controller.repetitive {
        of_repetitive(&part.recursion(), &mut out);
    }
    put(&mut out, "span", &[controller.span.low(), controller.span.high()]);
    out
}

fn put(out: &mut Named, name: &str, numbers: &[f64]) {
    out.push((name.to_owned(), numbers.to_vec()));
}

/// A law that holds another comes before it. Nothing for one that needs more than arithmetic.
fn of_law(law: &Law, out: &mut Named) {
    match law {
        Law::Pid(pid) => of_pid(pid, out),
        Law::StateSpace(law) => of_state_space(law, out),
        Law::SlidingMode(law) => of_sliding(law, out),
        Law::ObservedPid(law) => {
            of_disturbance(law, out);
            of_pid(law.inner(), out);
        }
        Law::ObservedSlidingMode(law) => {
            of_disturbance(law, out);
            of_sliding(law.inner(), out);
        }
        Law::DahlObserver(law) => {
            of_dahl(law, out);
            of_pid(law.inner(), out);
        }
        Law::Damped(law) => {
            of_damped(law, out);
            of_pid(law.inner(), out);
        }
        Law::None | Law::Scheduled(_) | Law::BoucWenObserver(_) => {}
    }
}

fn of_pid(pid: &SampledPid, out: &mut Named) {
    let [proportional, integral, derivative] = pid.weights();
    put(out, "pid", &[proportional, integral, derivative, pid.tracking()]);
}

fn of_sliding(law: &SampledSlidingMode, out: &mut Named) {
    let [gain, integral, derivative, fresh] = law.inside();
    put(out, "sliding-mode", &[law.switching(), gain, integral, derivative, fresh]);
}

fn of_disturbance<F>(law: &Observed<F>, out: &mut Named) {
    put(out, "disturbance-observer", &law.coefficients());
}

fn of_damped<F>(law: &Damped<F>, out: &mut Named) {
    let (b, a) = law.filter().coefficients();
    put(out, "damping", &[b[0], b[1], b[2], a[0], a[1]]);
}

fn of_dahl<F>(
    law: &HysteresisObserved<Dahl<piezotrack_control::unfused::Unfused>, F>,
    out: &mut Named,
) {
    let [pole, fresh, correction] = law.coefficients();
    let Dahl { a1, a2, gain } = law.operator();
    put(out, "dahl-observer", &[pole, fresh, correction, a1.0, a2.0, gain.0, law.longest()]);
}

fn of_state_space<const N: usize>(law: &StateSpace<N>, out: &mut Named) {
    let (a, b, c, d) = law.matrices();
    let n = law.states();
    let a: Vec<f64> = a.iter().take(n).flat_map(|row| row.iter().take(n).copied()).collect();
    put(out, "a", &a);
    put(out, "b", b.get(..n).unwrap_or_default());
    put(out, "c", c.get(..n).unwrap_or_default());
    put(out, "d", &[d]);
    if let Some(back) = law.antiwindup() {
        put(out, "back", back.get(..n).unwrap_or_default());
    }
}

#[expect(clippy::cast_precision_loss, reason = "at most 1e7 samples")]
fn of_repetitive(part: &Recursion<'_>, out: &mut Named) {
    let Recursion { period, pole, gain, lead, nearest, entries, unread, whole, pause, .. } = *part;
    put(out, "repetitive", &[pole, gain, period, f64::from(u8::from(pause))]);
    let counts = [lead as f64, nearest as f64, entries as f64, unread as f64, f64::from(whole)];
    put(out, "repetitive lengths", &counts);
    put(out, "taps", part.taps);
}
