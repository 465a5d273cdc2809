//! Equilibrium of a stage under a drive that goes slowly from one voltage to another.
//!
//! An operator does not depend on time, so the way into an equilibrium is a path of the
//! displacement alone: the mechanics only add the spring.

use piezotrack_control::Number;
use piezotrack_control::hysteresis::Operator;

use super::feedback_coupling::sign;
use super::input_coupling::InputMemory;

/// Parts of the way, each one step of Newton's method.
const STEPS: usize = 64;

/// Longest step as a share of the way that the spring alone would allow: series of operators are
/// summed to few terms.
const LONGEST: f64 = 1.0 / 24.0;

/// The displacement at which `K x + F(x) = force`, from the state `from` on, and the memory of an
/// operator in feedback there.
#[inline(always)]
pub fn feedback<N: Number, O: Operator<N>>(
    operator: &O,
    stiffness: N,
    from: (N, O::State),
    force: N,
) -> (N, O::State) {
    let (mut x, mut memory) = from;
    let left = |x: N, memory: &O::State| {
        let (hysteresis, slope) = operator.output(memory);
        (force - stiffness.mul_add(x, hysteresis), slope)
    };
    let start = left(x, &memory).0;
    let direction = sign(start);
    let longest = direction * start / stiffness * stiffness.like(LONGEST);
    for _ in 0..STEPS {
        let (rest, slope) = left(x, &memory);
        let tangent = stiffness + slope;
        let whole = rest / tangent;
        // Where the tangent falls there is no equilibrium near: on, in the direction of the force.
        let step = (-tangent).where_negative(whole, rest / stiffness);
        let step = (step - longest).where_negative(step, longest);
        let step = (-step - longest).where_negative(step, -longest);
        memory = operator.along(&operator.branch(&memory, direction), step);
        x = x + step;
    }
    (x, memory)
}

/// The displacement `d u - h` at `volts`, from the memory `from` on, and the memory of an operator
/// at the input there.
#[inline(always)]
pub fn input<N: Number, O: Operator<N>>(
    operator: &O,
    gain: N,
    from: &InputMemory<N, O::State>,
    volts: N,
) -> (N, InputMemory<N, O::State>) {
    let gap = volts - from.input;
    let branch = operator.branch(&from.operator, sign(gap));
    let memory = operator.along(&branch, gap);
    let x = gain.mul_add(volts, -operator.output(&memory).0);
    (x, InputMemory { operator: memory, input: volts, rise: volts.like(0.0) })
}
