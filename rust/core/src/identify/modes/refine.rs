//! Descent of modal terms to the least misfit: Gauss-Newton with damped steps.

use super::derivatives::{NormalEquations, unknowns};
use super::factors::{Factors, scale_matrix};
use super::responses::ModalFit;
use super::terms::{ModalTerms, angle, length, pole};
use crate::error::{Error, Result};
use crate::math::{C, room};
use crate::signal::Stop;

/// Damping at the start, the least, and factors after a step that helped and one that did not.
const DAMPING: f64 = 1e-3;
const LEAST: f64 = 1e-8;
const DOWN: f64 = 0.2;
const UP: f64 = 10.0;

/// Dampings that are tried for a step.
const TRIES: usize = 14;

/// Largest step of the logarithm of a decay, and of an angle in decays.
const DECAY: f64 = 0.7;
const TURN: f64 = 2.0;

/// Least price of a step of a pole by its scale, relative to the misfit: poles that the
/// response does not show stay where they are.
const HELD: f64 = 1e-6;

/// Scale of a departure: of the logarithm of a decay, and of b and c relative to their size; that
/// of an angle is the decay.
const FREE: f64 = 0.3;

/// Where a descent ends, and what a departure from its start costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent {
    /// Most steps.
    pub steps: usize,
    /// Relative reduction of the misfit below which it ends.
    pub tolerance: f64,
    /// Price of a departure from the start by its scale, in the unit of the misfit: directions that
    /// the response does not show stay there, so that the modes remain the same ones.
    pub held: f64,
}

impl Descent {
    /// The descent at the end of a fit, with a price of a departure.
    ///
    /// # Errors
    /// [`Error::Parameter`] where the price is negative.
    pub fn last(held: f64) -> Result<Self> {
        if !(held.is_finite() && held >= 0.0) {
            return Err(Error::parameter("held", held, "a finite number, 0 or more"));
        }
        Ok(Self { steps: 40, tolerance: 1e-5, held })
    }
}

/// Terms with what they leave.
pub(super) struct Refined {
    pub terms: ModalTerms,
    pub misfit: f64,
    pub error: Vec<f64>,
}

impl ModalFit {
    /// Descends from some terms; the result is balanced. Where `stop` says so, it ends early.
    ///
    /// # Errors
    /// [`Error::Shape`] where the terms have other numbers of drives or sensors; [`Error::Memory`].
    pub fn refine(
        &self,
        terms: &ModalTerms,
        descent: Descent,
        stop: Stop<'_>,
    ) -> Result<ModalTerms> {
        self.check(terms)?;
        Ok(self.refined(terms, descent, stop)?.terms)
    }

    pub(super) fn refined(
        &self,
        terms: &ModalTerms,
        descent: Descent,
        stop: Stop<'_>,
    ) -> Result<Refined> {
        let start = terms.balanced();
        let (misfit, error) = self.rest(&start)?;
        let mut at = Refined { terms: start.clone(), misfit, error };
        let mut damping = DAMPING;
        for _ in 0..descent.steps {
            if stop() {
                break;
            }
            let held = |terms: &ModalTerms| departure(&start, terms, descent.held);
            let step = Step::new(self, &at, &held(&at.terms), descent.held)?;
            let Some((next, total)) = self.descend(&at, &step, &held, &mut damping, stop)? else {
                break;
            };
            let gained = (step.before - total) / step.before;
            at = Refined { terms: next.terms.balanced(), ..next };
            damping = (DOWN * damping).max(LEAST);
            if gained < descent.tolerance {
                break;
            }
        }
        Ok(at)
    }

    /// The first of several dampings with which a step helps, and the misfit with all prices.
    fn descend(
        &self,
        at: &Refined,
        step: &Step,
        held: &dyn Fn(&ModalTerms) -> Departure,
        damping: &mut f64,
        stop: Stop<'_>,
    ) -> Result<Option<(Refined, f64)>> {
        for _ in 0..TRIES {
            if stop() {
                return Ok(None);
            }
            let terms = self.moved(&at.terms, &step.damped(*damping)?);
            let (misfit, error) = self.rest(&terms)?;
            let total = misfit + held(&terms).price;
            if total < step.before {
                return Ok(Some((Refined { terms, misfit, error }, total)));
            }
            *damping *= UP;
        }
        Ok(None)
    }

    /// Terms after a step of all unknowns, those of the poles limited.
    fn moved(&self, terms: &ModalTerms, step: &[f64]) -> ModalTerms {
        let modes = terms.poles.len();
        let (slower, rest) = step.split_at(modes);
        let (turned, rest) = rest.split_at(modes);
        let (outputs, rest) = rest.split_at(2 * terms.outputs.len());
        let (inputs, direct) = rest.split_at(2 * terms.inputs.len());
        let mut found = terms.clone();
        for (mode, decay) in terms.decays().into_iter().enumerate() {
            let reach = TURN * decay;
            let angle = angle(terms.poles[mode]) + turned[mode].max(-reach).min(reach);
            let decay = decay * libm::exp(slower[mode].clamp(-DECAY, DECAY));
            found.poles[mode] = pole(decay.max(self.narrowest(angle)), angle);
        }
        for (numbers, step) in [(&mut found.outputs, outputs), (&mut found.inputs, inputs)] {
            let (real, imaginary) = step.split_at(numbers.len());
            for (number, (real, imaginary)) in numbers.iter_mut().zip(real.iter().zip(imaginary)) {
                *number += C::new(*real, *imaginary);
            }
        }
        for (entry, step) in found.direct.iter_mut().zip(direct) {
            *entry += step;
        }
        found
    }
}

/// Scaled normal equations of a step.
struct Step {
    matrix: Vec<f64>,
    slope: Vec<f64>,
    scale: Vec<f64>,
    /// Misfit with all prices before the step.
    before: f64,
}

impl Step {
    fn new(fit: &ModalFit, at: &Refined, from: &Departure, held: f64) -> Result<Self> {
        let NormalEquations { mut matrix, mut slope } =
            fit.normal_equations(&at.terms, &at.error)?;
        let (count, modes) = (slope.len(), at.terms.poles.len());
        for (k, (distance, size)) in from.distances.iter().zip(&from.sizes).enumerate() {
            matrix[k * count + k] += held / (size * size);
            slope[k] -= held * distance / (size * size);
        }
        let decays = at.terms.decays();
        let mut scale = room("the scales", count)?;
        for k in 0..count {
            let least = match (k / modes.max(1), decays.get(k % modes.max(1))) {
                (0, _) => HELD * at.misfit,
                (1, Some(decay)) => HELD * at.misfit / (decay * decay),
                _ => 0.0,
            };
            let size = libm::sqrt(matrix[k * count + k] + least);
            scale.push(if size > 0.0 { size } else { 1.0 });
        }
        scale_matrix(&mut matrix, &scale);
        for (value, by) in slope.iter_mut().zip(&scale) {
            *value /= by;
        }
        Ok(Self { matrix, slope, scale, before: at.misfit + from.price })
    }

    /// The step of all unknowns with some damping.
    fn damped(&self, damping: f64) -> Result<Vec<f64>> {
        let count = self.slope.len();
        let mut matrix = room("the normal equations", self.matrix.len())?;
        matrix.extend_from_slice(&self.matrix);
        for k in 0..count {
            matrix[k * count + k] += damping;
        }
        let mut step = Factors::new(&matrix, count, 0.0)?.solve(&self.slope);
        for (value, by) in step.iter_mut().zip(&self.scale) {
            *value /= by;
        }
        Ok(step)
    }
}

/// How far unknowns are from a start.
struct Departure {
    distances: Vec<f64>,
    sizes: Vec<f64>,
    /// Price of a departure by its scale.
    price: f64,
}

/// How far terms are from a start, all unknowns but D; nothing where it costs nothing.
fn departure(start: &ModalTerms, terms: &ModalTerms, held: f64) -> Departure {
    let mut found = Departure { distances: Vec::new(), sizes: Vec::new(), price: 0.0 };
    if held <= 0.0 {
        return found;
    }
    let count = unknowns(terms);
    found.distances.reserve(count);
    found.sizes.reserve(count);
    let aligned = start.turned(terms);
    let mut add = |distance: f64, size: f64| {
        found.distances.push(distance);
        found.sizes.push(size);
    };
    let decays = start.decays();
    for (own, decay) in terms.decays().iter().zip(&decays) {
        add(libm::log(own / decay), FREE);
    }
    for ((own, old), decay) in terms.poles.iter().zip(&start.poles).zip(&decays) {
        add(angle(own * old.conj()), *decay);
    }
    let both = [
        (&terms.outputs, &aligned.outputs, terms.sensors),
        (&terms.inputs, &aligned.inputs, terms.drives),
    ];
    for (own, old, width) in both {
        for part in [|number: C| number.re, |number: C| number.im] {
            for (own, old) in own.chunks_exact(width).zip(old.chunks_exact(width)) {
                let size = FREE * length(old);
                for (own, old) in own.iter().zip(old) {
                    add(part(own - old), size);
                }
            }
        }
    }
    for (distance, size) in found.distances.iter().zip(&found.sizes) {
        let share = distance / size;
        found.price += held * (share * share);
    }
    found
}
