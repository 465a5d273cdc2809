//! The second-order Dahl operator with b0 other than 0: dry friction at reversals.
//!
//! ```text
//! M x'' + D x' + K x = T u - Fh,   Fh = b1 q1 + sgn(x') b0 q2
//! ```
//!
//! Xu and Li 2010, equations (2), (7) and (8), doi 10.1115/1.4001712. At a reversal the term
//! b0 q2 changes sign at once. Where b0 q2 > 0 it is a dry friction, set-valued at rest: the
//! stage sticks while the other forces are smaller (Filippov 1988, doi
//! 10.1007/978-94-015-7793-9). Where b0 q2 < 0 it acts along the motion, and from rest under a
//! smaller force the solution is not unique: the simulation continues in the present direction or,
//! from rest, along the force, and marks the state as not unique.
//!
//! Reversals, sticking and breaking away are located inside the step, each lane by itself.

use piezotrack_control::Number;
use piezotrack_control::cubic_motion::CubicVelocity;
use piezotrack_control::hysteresis::{Dahl, DahlBranch, DahlState, Operator};

use super::equilibrium;
use super::feedback_coupling::{Prediction, correct, predict, sign};
use super::propagator::Propagator;
use super::stepping_loop::TERMS;
use super::traits::{Coupling, FeedbackState};

/// Legs of one step between reversals, at most: more wait for the next step.
const LEGS: usize = 4;

/// Corrections of the time of a reversal, at most. The cubic is far off where the velocity settles
/// within a small part of the step: with much damping, just after a sample.
const CORRECTIONS: usize = 4;

/// Share of the leg by which that time may be off without them: what is left is made up for.
const TIMELY: f64 = 0.01;

/// Share of the forces by which the limit of sticking is widened, against rounding.
const SLACK: f64 = 1e-12;

/// A Dahl stage with dry friction over one step.
#[derive(Clone, Copy, Debug)]
pub struct FrictionCoupling<N> {
    /// The linear part over the whole step.
    linear: Propagator<N>,
    /// 1/M, D/M, K/M in units of the step.
    rates: [N; 3],
    halvings: u32,
    stiffness: N,
    sliding: SlidingOperator<N>,
}

/// The parameters of a stage with friction, SI.
#[derive(Clone, Copy, Debug)]
pub struct FrictionParameters<N> {
    /// M, D and K.
    pub mechanics: [N; 3],
    /// a1, a2 and up.
    pub operator: [N; 3],
    /// b1, N/m^2.
    pub b1: N,
    /// b0, N/m.
    pub b0: N,
}

impl<N: Number> FrictionParameters<N> {
    /// State of the operator for a velocity with the sign of `w`; at rest where `w` is 0.
    #[inline(always)]
    pub fn memory(&self, w: N, operator: DahlState<N>) -> FrictionMemory<N> {
        self.sliding().memory(w, operator)
    }

    /// Equilibrium under a force, N, that is approached slowly: without the dry friction, in the
    /// middle of the forces under which the stage sticks.
    #[inline(always)]
    pub fn approach(&self, from: (N, FrictionMemory<N>), force: N) -> (N, FrictionMemory<N>) {
        let zero = force.like(0.0);
        let smooth = SlidingOperator { b0: zero, ..self.sliding() };
        let [_, _, stiffness] = self.mechanics;
        let (x, operator) =
            equilibrium::feedback(&smooth, stiffness, (from.0, from.1.operator), force);
        (x, self.memory(zero, operator))
    }

    #[inline(always)]
    fn sliding(&self) -> SlidingOperator<N> {
        let [a1, a2, up] = self.operator;
        let dahl = Dahl { a1, a2, gain: up };
        SlidingOperator { dahl, b1: self.b1, b0: self.b0, direction: self.b1.like(1.0) }
    }
}

/// State of the operator with friction.
#[derive(Clone, Copy, Debug)]
pub struct FrictionMemory<N> {
    /// q1 and q2.
    pub operator: DahlState<N>,
    /// Direction of motion, +1 or -1; 0 where the stage sticks.
    pub direction: N,
    /// Hysteresis force Fh, N.
    pub force: N,
    /// Above 0 once rest was not unique.
    pub doubt: N,
}

/// The operator in motion in one direction.
#[derive(Clone, Copy, Debug)]
struct SlidingOperator<N> {
    /// The operator with q1 for a force.
    dahl: Dahl<N, TERMS>,
    b1: N,
    b0: N,
    /// +1 or -1.
    direction: N,
}

impl<N: Number> Operator<N> for SlidingOperator<N> {
    type State = DahlState<N>;
    type Branch = DahlBranch<N, TERMS>;

    #[inline(always)]
    fn rest(&self) -> DahlState<N> {
        self.dahl.rest()
    }

    /// b1 q1 + sgn(x') b0 q2, and its slope along the path.
    #[inline(always)]
    fn output(&self, state: &DahlState<N>) -> (N, N) {
        let (q1, q2) = (state.force, state.slope);
        let decay = -(self.direction * self.dahl.a1);
        let bend = (-self.dahl.a2).mul_add(q1, decay.mul_add(q2, self.dahl.gain));
        let friction = self.direction * self.b0;
        (self.b1.mul_add(q1, friction * q2), self.b1.mul_add(q2, friction * bend))
    }

    #[inline(always)]
    fn branch(&self, state: &DahlState<N>, direction: N) -> DahlBranch<N, TERMS> {
        self.dahl.branch(state, direction)
    }

    #[inline(always)]
    fn along(&self, branch: &DahlBranch<N, TERMS>, distance: N) -> DahlState<N> {
        self.dahl.along(branch, distance)
    }
}

impl<N: Number> SlidingOperator<N> {
    #[inline(always)]
    fn memory(self, w: N, operator: DahlState<N>) -> FrictionMemory<N> {
        let zero = w.like(0.0);
        let direction = w.where_negative(w.like(-1.0), (-w).where_negative(w.like(1.0), zero));
        let force = Self { direction, ..self }.output(&operator).0;
        FrictionMemory { operator, direction, force, doubt: zero }
    }
}

type State<N> = FeedbackState<N, FrictionMemory<N>>;

/// Progress of the lanes through one step, in legs between reversals.
struct StepProgress<N> {
    state: State<N>,
    /// Part of the step that is done.
    passed: N,
}

/// A leg in motion: its end, and the branch of the operator.
struct Slide<N> {
    x: N,
    /// Velocity times the length of the leg, m.
    w: N,
    branch: DahlBranch<N, TERMS>,
}

impl<N: Number> FrictionCoupling<N> {
    /// Precomputes what depends only on the parameters, for steps of `step` seconds.
    #[inline(always)]
    pub fn new(of: FrictionParameters<N>, step: f64, halvings: u32) -> Self {
        let [mass, damping, stiffness] = of.mechanics;
        let inverse = mass.like(1.0) / mass;
        let h = mass.like(step);
        let (damped, sprung) = (damping * inverse, stiffness * inverse);
        Self {
            linear: Propagator::new(inverse, damped, sprung, step, halvings),
            rates: [inverse * h * h, damped * h, sprung * h * h],
            halvings,
            stiffness,
            sliding: of.sliding(),
        }
    }

    /// The state at a displacement, at rest where `w` is 0.
    #[inline(always)]
    pub fn start(&self, x: N, w: N, operator: DahlState<N>) -> State<N> {
        FeedbackState { x, w, memory: self.sliding.memory(w, operator) }
    }

    #[inline(always)]
    fn moving(&self, direction: N) -> SlidingOperator<N> {
        SlidingOperator { direction, ..self.sliding }
    }

    /// b1 q1 + K x, the forces that do not depend on the direction.
    #[inline(always)]
    fn spring(&self, x: N, operator: &DahlState<N>) -> N {
        self.sliding.b1.mul_add(operator.force, self.stiffness * x)
    }

    /// Largest force without breaking away, N: b0 q2; below 0 where it acts along the motion.
    #[inline(always)]
    fn grip(&self, operator: &DahlState<N>, force: N) -> N {
        let grip = self.sliding.b0 * operator.slope;
        grip.where_negative(grip, magnitude(force).mul_add(force.like(SLACK), grip))
    }

    /// A leg without a reversal, under a force that goes from `drive` to `drive + rise`.
    #[inline(always)]
    fn slide(
        &self,
        linear: &Propagator<N>,
        state: &State<N>,
        direction: N,
        drive: N,
        rise: N,
    ) -> Slide<N> {
        let operator = self.moving(direction);
        let from = FeedbackState { x: state.x, w: state.w, memory: state.memory.operator };
        let branch = operator.branch(&from.memory, direction);
        let ahead: Prediction<N> = predict(linear, &operator, &from, drive, rise);
        let (x, w) = correct(linear, &operator, &branch, &ahead, from.x);
        Slide { x, w, branch }
    }

    /// The linear part over a part of the step, each lane its own.
    #[inline(always)]
    fn part(&self, length: N) -> Propagator<N> {
        let [inverse, damping, stiffness] = self.rates;
        let square = length * length;
        Propagator::new(inverse * square, damping * length, stiffness * square, 1.0, self.halvings)
    }

    /// The next leg of every lane: to its reversal, to where it breaks away, or to the end.
    #[inline(always)]
    fn leg(&self, progress: &StepProgress<N>, drive: N, rise: N, last: bool) -> StepProgress<N> {
        let at = &progress.state;
        let memory = &at.memory;
        let (zero, one) = (drive.like(0.0), drive.like(1.0));
        let left = one - progress.passed;
        let now = rise.mul_add(progress.passed, drive);
        let held = drive.like(0.5) - memory.direction * memory.direction;

        // Lanes at rest: how long they stick, and in which direction they break away.
        let pull = now - self.spring(at.x, &memory.operator);
        let grip = self.grip(&memory.operator, now);
        let over = grip - magnitude(pull);
        let heading = (-(pull * pull)).where_negative(pull, rise);
        let wait = (grip - sign(rise) * pull) / magnitude(rise);
        let wait = over.where_negative(zero, wait);
        let wait = (-(heading * heading)).where_negative(wait, one + one);
        let leaves = (-held).where_negative(wait - left, one);
        let onward = over.where_negative(sign(heading), sign(rise));

        // Lanes in motion: the whole rest of the step first, then up to the reversal.
        let direction = sign(memory.direction);
        let slide = |length: N| {
            let scaled = FeedbackState { w: at.w * length, ..*at };
            (scaled, self.slide(&self.part(length), &scaled, direction, now, rise * length))
        };
        let (from, whole) = slide(left);
        let turns = reverses(direction, &from, whole.x, whole.w);
        let turns = if last { one } else { held.where_negative(turns, one) };
        let fraction = turning_fraction(direction, &from, whole.x, whole.w);
        let mut length = turns.where_negative(fraction * left, left);
        let (_, mut part) = slide(length);
        let sliding = self.moving(direction);
        let velocity = |part: &Slide<N>, length: N| {
            (drive.like(1e-12) - length).where_negative(part.w / length, at.w)
        };
        // Time until the velocity is 0 at the present acceleration.
        let rests_in = |x: N, w: N, operator: &DahlState<N>, force: N| {
            let net = force - sliding.output(operator).0 - self.stiffness * x;
            -(w / (-self.rates[1]).mul_add(w, net * self.rates[0]))
        };
        let early = rests_in(at.x, at.w, &memory.operator, now);
        let early = early.where_negative(zero, (left - early).where_negative(left, early));
        for _ in 0..CORRECTIONS {
            let there = sliding.along(&part.branch, part.x - at.x);
            let w = velocity(&part, length);
            let late = rests_in(part.x, w, &there, rise.mul_add(length, now));
            let timely = length.mul_add(drive.like(TIMELY), -magnitude(late));
            let timely = turns.where_negative(timely, one);
            if !timely.any_negative() {
                break;
            }
            // From the start of the leg where this leads out of it.
            let next = length + late;
            let next = (left - next).where_negative(early, next.where_negative(early, next));
            length = timely.where_negative(next, length);
            part = slide(length).1;
        }
        let w = velocity(&part, length);

        // What velocity the reversal is off by is made up for in its time.
        let there = sliding.along(&part.branch, part.x - at.x);
        let late = rests_in(part.x, w, &there, rise.mul_add(length, now));
        let late = (magnitude(late) - length * drive.like(0.1)).where_negative(late, zero);
        let late = turns.where_negative(late, zero);
        let x = (w * late).mul_add(drive.like(0.5), part.x);
        let stop = progress.passed + length + late;
        let stop = turns.where_negative((stop - one).where_negative(stop, one), one);
        let there = sliding.along(&part.branch, x - at.x);

        // After a reversal: sticking, backward motion or, where both are possible, as before.
        let turned_pull = rise.mul_add(stop, drive) - self.spring(x, &there);
        let turned_grip = self.grip(&there, now);
        let turned_over = turned_grip - magnitude(turned_pull);
        let unsure = magnitude(turned_pull) + turned_grip;
        let stays = unsure.where_negative(memory.direction, sign(turned_pull));
        let after = turned_over.where_negative(stays, zero);
        let end_w = (direction * w).where_negative(zero, w);

        let moved = FrictionMemory {
            operator: there,
            direction: turns.where_negative(after, memory.direction),
            force: memory.force,
            doubt: memory.doubt + turns.where_negative(unsure.where_negative(one, zero), zero),
        };
        let unsure = magnitude(pull) + grip;
        let rested = FrictionMemory {
            direction: leaves.where_negative(onward, zero),
            doubt: memory.doubt + unsure.where_negative(one, zero),
            ..*memory
        };
        let moving = FeedbackState { x, w: turns.where_negative(zero, end_w), memory: moved };
        let resting = FeedbackState { x: at.x, w: zero, memory: rested };
        let waited = leaves.where_negative(progress.passed + wait, one);
        StepProgress {
            state: choose(held, &moving, &resting),
            passed: held.where_negative(stop, waited),
        }
    }
}

impl<N: Number> Coupling<N> for FrictionCoupling<N> {
    type Memory = FrictionMemory<N>;

    #[inline(always)]
    fn step(&self, state: &State<N>, drive: N, rise: N) -> State<N> {
        let memory = &state.memory;
        // Below 0 for lanes in motion.
        let held = drive.like(0.5) - memory.direction * memory.direction;
        let direction = sign(memory.direction);
        let slide = self.slide(&self.linear, state, direction, drive, rise);
        let pull = drive - self.spring(state.x, &memory.operator);
        let grip = self.grip(&memory.operator, drive);
        let (first, second) = (grip - magnitude(pull), grip - magnitude(pull + rise));
        let sticks = (second - first).where_negative(second, first);
        let turns = reverses(direction, state, slide.x, slide.w);
        let calm = held.where_negative(turns, sticks);

        let sliding = self.moving(direction);
        let operator = sliding.along(&slide.branch, slide.x - state.x);
        let moved = FrictionMemory { operator, ..*memory };
        let moving = FeedbackState { x: slide.x, w: slide.w, memory: moved };
        let mut end = choose(held, &moving, state);
        if calm.any_negative() {
            let mut progress = StepProgress { state: *state, passed: drive.like(0.0) };
            for leg in 1..=LEGS {
                let left = progress.passed - drive.like(1.0);
                if !left.any_negative() {
                    break;
                }
                let next = self.leg(&progress, drive, rise, leg == LEGS);
                progress = StepProgress {
                    state: choose(left, &next.state, &progress.state),
                    passed: left.where_negative(next.passed, progress.passed),
                };
            }
            // Lanes without an event keep the result that they have on their own.
            end = choose(calm, &progress.state, &end);
        }
        let memory = &end.memory;
        let pull = drive + rise - self.stiffness * end.x;
        let held = drive.like(0.5) - memory.direction * memory.direction;
        let force = self.moving(memory.direction).output(&memory.operator).0;
        end.memory.force = held.where_negative(force, pull);
        end
    }
}

/// `yes` in the lanes where `which < 0`, `no` in the others.
#[inline(always)]
fn choose<N: Number>(which: N, yes: &State<N>, no: &State<N>) -> State<N> {
    let pick = |yes: N, no: N| which.where_negative(yes, no);
    let (a, b) = (&yes.memory, &no.memory);
    FeedbackState {
        x: pick(yes.x, no.x),
        w: pick(yes.w, no.w),
        memory: FrictionMemory {
            operator: DahlState {
                force: pick(a.operator.force, b.operator.force),
                slope: pick(a.operator.slope, b.operator.slope),
            },
            direction: pick(a.direction, b.direction),
            force: pick(a.force, b.force),
            doubt: pick(a.doubt, b.doubt),
        },
    }
}

#[inline(always)]
fn magnitude<N: Number>(value: N) -> N {
    value.where_negative(-value, value)
}

/// Below 0 where a leg along `direction` ends against it, or goes back in between.
#[inline(always)]
fn reverses<N: Number, M>(direction: N, from: &FeedbackState<N, M>, x: N, w: N) -> N {
    let end = direction * w;
    end.where_negative(end, CubicVelocity::along(direction, [from.x, from.w], [x, w]).dips())
}

/// Part of a leg along `direction` after which its velocity first passes zero, on the cubic
/// through displacement and velocity at both ends.
#[inline(always)]
fn turning_fraction<N: Number, M>(direction: N, from: &FeedbackState<N, M>, x: N, w: N) -> N {
    let CubicVelocity { a, b, c, .. } = CubicVelocity::along(direction, [from.x, from.w], [x, w]);
    let square = b.mul_add(b, -((a * c) * a.like(4.0)));
    let root = square.where_negative(a.like(0.0), square).sqrt();
    // Each form where it does not cancel.
    let falling = (c + c) / (root - b);
    let rising = -((b + root) / (a + a));
    let part = (-b).where_negative(rising, falling);
    // Within the leg, and 0 where there is no telling.
    let part = part.where_negative(a.like(0.0), part);
    let beyond = (a.like(1.0) - part).where_negative(a.like(1.0), part);
    (beyond - a.like(2.0)).where_negative(beyond, a.like(0.0))
}
