//! Conventional identification from a step response: Xu and Li 2010, equations (3) to (13),
//! doi 10.1115/1.4001712.

use core::f64::consts::TAU;

use super::step_ringing::{Ringing, decrement, mean};
use crate::error::{Error, Result, finite, positive, shown};
use crate::signal::{Hold, Spectrum, index, range};

/// Constant input of the hysteresis operator, with which the scale of b1 goes.
const UP: f64 = 30.0;
/// Fewest samples that the drive has to stay where it jumped to.
const PLATEAU: usize = 20;
/// Fewest samples in a period of the ringing: below, its peaks cannot be read.
const FEWEST_IN_PERIOD: f64 = 5.0;

/// Readings of a step response, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct StepReadings {
    /// Height of the step, V.
    pub voltage: f64,
    /// Displacement in the end, m, from rest.
    pub steady_state: f64,
    /// Displacement at the overshoot peaks one after the other, m, from rest.
    pub peaks: Vec<f64>,
    /// Period of the damped oscillation, s.
    pub period: f64,
    /// Frequency of the resonance in the spectrum, Hz.
    pub frequency: f64,
    /// Gain at standstill, m/V.
    pub static_gain: f64,
    /// Gain at the resonance, m/V.
    pub resonance_gain: f64,
    /// Initial slope of the response, which is b0.
    pub initial_slope: f64,
}

/// Parameters from the readings by the paper's formulas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conventional {
    /// First overshoot over the steady state.
    pub overshoot_ratio: f64,
    /// Logarithmic decrement: ln of an overshoot over the next.
    pub decrement: f64,
    /// Damping ratio by gains, (4).
    pub damping_ratio: f64,
    /// Damping ratio by the logarithmic decrement.
    pub damping_by_decrement: f64,
    /// Natural frequency, rad/s, (5).
    pub natural_frequency: f64,
    /// Time constant, s, (6).
    pub time_constant: f64,
    /// a1, (9) and (13).
    pub a1: f64,
    /// a2, (10).
    pub a2: f64,
    /// b1, (11).
    pub b1: f64,
    /// b0, (12).
    pub b0: f64,
}

impl Conventional {
    /// Whether all that is computed from these figures is a number too.
    fn is_sound(&self) -> bool {
        let above = [
            self.natural_frequency * self.natural_frequency,
            self.damping_ratio,
            self.time_constant,
            self.a2,
        ];
        let finite = [self.overshoot_ratio, self.decrement, self.a1, self.b1, self.b0];
        above.iter().all(|value| value.is_normal() && *value > 0.0)
            && finite.iter().all(|value| value.is_finite())
    }
}

impl StepReadings {
    /// The paper's formulas (4) to (6) and (9) to (13).
    ///
    /// ```
    /// use piezotrack_core::identify::StepReadings;
    ///
    /// let published = StepReadings {
    ///     voltage: 75.0,
    ///     steady_state: 117.7622e-6,
    ///     peaks: vec![192.5302e-6, 170.2524e-6],
    ///     period: 0.0058,
    ///     frequency: 160.0,
    ///     static_gain: 1.5759e-6,
    ///     resonance_gain: 12.0806e-6,
    ///     initial_slope: 0.0,
    /// };
    /// let found = published.conventional().unwrap();
    /// assert!((found.a1 - 121.9874).abs() < 1e-4);
    /// ```
    ///
    /// # Errors
    /// [`Error::Parameter`] where a reading cannot be that of a step that overshoots.
    pub fn conventional(&self) -> Result<Conventional> {
        let over = self.overshoots()?;
        for (name, value, unit) in
            [("period", self.period, "s"), ("frequency", self.frequency, "Hz")]
        {
            positive(name, value, unit)?;
        }
        for (name, value) in
            [("static_gain", self.static_gain), ("resonance_gain", self.resonance_gain)]
        {
            finite(name, value, "m/V")?;
            if value == 0.0 {
                return Err(Error::parameter(name, "0 m/V", "a value other than 0"));
            }
        }
        finite("initial_slope", self.initial_slope, "")?;
        let decrement = decrement(&over);
        let damping_ratio = (self.static_gain / self.resonance_gain).abs() / 2.0;
        let natural_frequency = TAU * self.frequency;
        let (a1, ring) = (2.0 * decrement / self.period, TAU / self.period);
        let a2 = ring * ring + a1 * a1 / 4.0;
        let found = Conventional {
            overshoot_ratio: over[0] / self.steady_state.abs(),
            decrement,
            damping_ratio,
            damping_by_decrement: decrement / libm::hypot(TAU, decrement),
            natural_frequency,
            time_constant: 1.0 / (damping_ratio * natural_frequency),
            a1,
            a2,
            // The gain in um/V, as the paper has it.
            b1: 1e6 * (self.steady_state / self.voltage) * a2,
            b0: self.initial_slope,
        };
        found.is_sound().then_some(found).ok_or_else(|| {
            Error::Numerical(format!(
                "the readings give a natural frequency of {natural_frequency:e} rad/s and a \
                 damping ratio of {damping_ratio:e}: check the units of frequency, period, \
                 static_gain and resonance_gain"
            ))
        })
    }

    /// By how much the peaks lie beyond the steady state, m.
    fn overshoots(&self) -> Result<Vec<f64>> {
        for (name, value, unit) in
            [("voltage", self.voltage, "V"), ("steady_state", self.steady_state, "m")]
        {
            finite(name, value, unit)?;
            if value == 0.0 {
                let shown = format!("0 {unit}");
                return Err(Error::parameter(name, shown, "a value other than 0"));
            }
        }
        if self.peaks.len() < 2 {
            let found = format!("{} of them", self.peaks.len());
            return Err(Error::parameter("peaks", found, "2 or more, one after the other"));
        }
        let sign = self.steady_state.signum();
        let over: Vec<f64> = self.peaks.iter().map(|p| sign * (p - self.steady_state)).collect();
        for (k, &value) in over.iter().enumerate() {
            let above = value.is_finite() && value > 0.0;
            if !above || (k > 0 && value >= over[k - 1]) {
                return Err(Error::parameter(
                    format!("peaks[{k}]"),
                    format!("{} m", shown(self.peaks[k])),
                    "displacements beyond the steady state, each lower than the one before",
                ));
            }
        }
        Ok(over)
    }
}

/// Stiffness and piezo coefficient from two static levels, with the hysteresis as the scale.
///
/// `K x + Fh(x) = T u` at both, where `Fh` is the Dahl force on the monotone path from rest to x.
///
/// # Errors
/// [`Error::Data`] where the levels do not tell the two apart.
pub fn separate(hysteresis: &Conventional, one: (f64, f64), two: (f64, f64)) -> Result<(f64, f64)> {
    for (name, (u, x)) in [("first level", one), ("second_level", two)] {
        finite(&format!("voltage of {name}"), u, "V")?;
        finite(&format!("displacement of {name}"), x, "m")?;
    }
    let ((u1, x1), (u2, x2)) = (one, two);
    let (f1, f2) = (hysteresis.first_force(x1), hysteresis.first_force(x2));
    let determinant = u1 * x2 - x1 * u2;
    let stiffness = (f1 * u2 - f2 * u1) / determinant;
    let coefficient = (f1 * x2 - f2 * x1) / determinant;
    if determinant.abs() > 1e-6 * (u1 * x2).abs() && stiffness > 0.0 && stiffness.is_finite() {
        return Ok((stiffness, coefficient));
    }
    Err(Error::Data(format!(
        "the levels {:.6} um at {u1} V and {:.6} um at {u2} V do not determine the stiffness: with \
         b1 = {:.5e} the gain would fall with the voltage; give the \
         stiffness or the mass instead",
        1e6 * x1,
        1e6 * x2,
        hysteresis.b1
    )))
}

impl Conventional {
    /// Hysteresis force of (7)-(8) on the monotone path from rest to `x`, N.
    #[must_use]
    pub fn first_force(&self, x: f64) -> f64 {
        let decay = self.a1 / 2.0;
        let wave = (self.a2 - decay * decay).sqrt();
        let (path, faded) = (x.abs(), libm::exp(-decay * x.abs()));
        let (sine, cosine) = (libm::sin(wave * path), libm::cos(wave * path));
        let q1 = UP / self.a2 * (1.0 - faded * (cosine + decay / wave * sine));
        let q2 = UP * faded * sine / wave;
        self.b1 * q1 + self.b0 * q2
    }

    /// The piezo coefficient with which a stiffness stands at `x` under `u`, N/V.
    ///
    /// # Errors
    /// [`Error::Parameter`] where the stiffness is not above 0.
    pub fn piezo_coefficient(&self, stiffness: f64, (u, x): (f64, f64)) -> Result<f64> {
        positive("stiffness", stiffness, "N/m")?;
        Ok((stiffness * x + self.first_force(x)) / u)
    }
}

/// Where the drive steps.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Jump {
    /// Last sample before it.
    before: usize,
    /// First sample at the new level.
    after: usize,
    /// First sample behind the time at that level.
    end: usize,
    /// Levels before and after, V.
    levels: (f64, f64),
    /// First sample of the level before.
    begin: usize,
}

/// A step response as read off a record.
#[derive(Clone, Debug)]
pub struct StepResponse {
    /// Readings that the formulas take.
    pub readings: StepReadings,
    /// Times of the peaks, s from the first sample.
    pub peak_times: Vec<f64>,
    /// Last sample before the step.
    pub before: usize,
    /// First sample that is no longer read.
    pub end: usize,
    /// Whether the drive moves again behind that.
    pub cut: bool,
    /// Displacement before the step, m.
    pub rest: f64,
    /// Samples before the step.
    pub samples_before: usize,
    /// Noise of the displacement, m rms.
    pub noise: f64,
    /// Time constants of the ringing that the record shows.
    pub decays: f64,
    /// Change of the displacement after the time used for the steady state, m.
    pub creep: f64,
    /// Frequencies, Hz, and gains, m/V, of the spectrum.
    pub spectrum: (Vec<f64>, Vec<f64>),
}

/// Reads a step response off a record.
///
/// # Errors
/// [`Error::Data`] where the drive has no step, the displacement does not overshoot, or the
/// record is too short or too coarse.
pub fn read_step(u: &[f64], y: &[f64], dt: f64, hold: Hold) -> Result<StepResponse> {
    positive("dt", dt, "s")?;
    if u.len() != y.len() {
        return Err(Error::Shape {
            name: "y".into(),
            found: format!("{} samples", y.len()),
            expected: format!("{}, as many as u", u.len()),
        });
    }
    let jump = find_jump(u)?;
    let height = jump.levels.1 - jump.levels.0;
    let rest = mean(&y[jump.begin..=jump.before]);
    let before = &y[jump.begin..=jump.before];
    let noise = if before.len() >= PLATEAU { spread(before) } else { jitter(y) };
    // The displacement from the last sample before the step on, from rest.
    let whole: Vec<f64> = y[jump.before..jump.end].iter().map(|value| value - rest).collect();
    let ringing = Ringing::read(&whole, dt, noise)?;
    if ringing.period < FEWEST_IN_PERIOD * dt {
        return Err(Error::Data(format!(
            "the sampling is too slow: {:.1} samples in a period of the ringing, expected at \
             least {FEWEST_IN_PERIOD}; sample at 10 times the natural frequency or faster",
            ringing.period / dt
        )));
    }
    let used = &whole[..ringing.used];
    let drive = &u[jump.before..jump.before + ringing.used];
    let spectrum = Spectrum::new(drive, used, dt, hold);
    let (frequency, resonance_gain) = spectrum.peak(1.0 / ringing.period);
    let rest_of_it = &whole[ringing.used..];
    let creep = if rest_of_it.len() > ringing.settled {
        mean(&rest_of_it[rest_of_it.len() - ringing.settled..]) - ringing.steady
    } else {
        0.0
    };
    Ok(StepResponse {
        readings: StepReadings {
            voltage: height,
            steady_state: ringing.steady,
            peaks: ringing.peaks.iter().map(|peak| peak.displacement).collect(),
            period: ringing.period,
            frequency,
            static_gain: ringing.steady / height,
            resonance_gain: resonance_gain * (ringing.steady / height).signum(),
            initial_slope: 0.0,
        },
        peak_times: ringing.peaks.iter().map(|p| p.time + dt * index(jump.before)).collect(),
        before: jump.before,
        end: jump.end,
        cut: jump.end < u.len(),
        rest,
        samples_before: before.len(),
        noise,
        decays: dt * index(whole.len()) * ringing.decrement / ringing.period,
        creep,
        spectrum: spectrum.curve(1.0 / ringing.period),
    })
}

/// The first of the largest jumps of the drive, with the levels around it.
fn find_jump(u: &[f64]) -> Result<Jump> {
    let (low, high) = range(u);
    let span = high - low;
    let no_step = |why: &str| {
        Err(Error::Data(format!(
            "there is no step in the drive: {why}; expected a voltage that jumps and stays, with \
             at least one sample before the jump"
        )))
    };
    if u.len() < 2 || span <= 0.0 {
        return no_step(&format!("it is constant at {} V", shown(low)));
    }
    let moves: Vec<f64> = u.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let largest = moves.iter().fold(0.0, |most, step: &f64| f64::max(most, step.abs()));
    let at = moves.iter().position(|step| step.abs() >= largest).unwrap_or(0);
    let moving = |k: usize| moves[k] * moves[at].signum() > 0.02 * span;
    let mut before = at;
    while before > 0 && moving(before - 1) {
        before -= 1;
    }
    let mut after = at + 1;
    while after < moves.len() && moving(after) {
        after += 1;
    }
    let rough = (u[after] - u[before]).abs();
    let still = |k: usize| moves[k].abs() <= 0.1 * rough;
    let end = (after..moves.len()).find(|&k| !still(k)).map_or(u.len(), |k| k + 1);
    let begin = (0..before).rev().find(|&k| !still(k)).map_or(0, |k| k + 1);
    if end - after < PLATEAU {
        if end == u.len() && rough > 0.5 * span {
            return Err(Error::Data(format!(
                "the record is too short: {} samples behind the step, expected several periods \
                 of the ringing",
                end - after
            )));
        }
        return no_step("its largest change is part of a longer movement");
    }
    let levels = (mean(&u[begin..=before]), mean(&u[after..end]));
    let flat = |part: &[f64], level: f64| {
        part.iter().filter(|v| (**v - level).abs() <= 0.05 * rough).count() * 10 >= part.len() * 9
    };
    if !flat(&u[begin..=before], levels.0) || !flat(&u[after..end], levels.1) {
        return no_step("it keeps moving before or after its largest change");
    }
    Ok(Jump { before, after, end, levels, begin })
}

/// Standard deviation.
fn spread(values: &[f64]) -> f64 {
    let middle = mean(values);
    (values.iter().map(|v| (v - middle) * (v - middle)).sum::<f64>() / index(values.len())).sqrt()
}

/// Noise of a signal that moves: from the second differences of its last half, as if white.
fn jitter(values: &[f64]) -> f64 {
    let last = &values[values.len() / 2..];
    if last.len() < 3 {
        return 0.0;
    }
    let bends = last.windows(3).map(|w| w[2] - 2.0 * w[1] + w[0]);
    (bends.map(|bend| bend * bend).sum::<f64>() / (6.0 * index(last.len() - 2))).sqrt()
}
