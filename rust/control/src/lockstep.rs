//! Controllers in lanes: several with a PID law, which step together with the bits of each by itself.
//!
//! Where all of them go on as usual, whether saturated or not, they step in lanes. Where one does not
//! (its first sample, a reading that is no measurement, an overflow), each is stepped by
//! [`Controller::step`].

use crate::controller::{Command, Controller, ControllerState};
use crate::feedback_law::Feedback;
use crate::filters::Filter;
use crate::number::{Number, Real};
use crate::pid::{PidState, SampledPid};
use crate::repetitive::{LanedRepetitive, Learner, Outcome, RepetitiveState};

/// Commands of controllers in lanes.
#[derive(Clone, Copy, Debug)]
pub struct LanedCommand<N> {
    /// The voltage for each actuator, V.
    pub volts: N,
    /// 1 where it was clipped, 0 elsewhere.
    pub saturated: N,
}

/// Steps controllers of any law one by one, each with the reading of its lane; the lanes that are
/// left get the command of the last one.
///
/// ```
/// use piezotrack_control::{Controller, Limits, Pid, step_each};
///
/// let limits = Limits::new(0.0, 75.0)?;
/// let controllers = [Controller::new(limits, Pid::xu_li_2010().at(0.02)?)];
/// let mut states = [controllers[0].rest([])?];
/// let command = step_each(&controllers, &mut states, 1e-6, 0.0, 0.5);
/// assert_eq!(command.volts, states[0].last().volts);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
pub fn step_each<F: Feedback<N::Lane>, L: AsMut<[N::Lane]>, N: Number>(
    controllers: &[Controller<F, N::Lane>],
    states: &mut [ControllerState<F::State, L, N::Lane>],
    reference: N::Lane,
    measured: N,
    feedforward: N::Lane,
) -> LanedCommand<N> {
    let mut volts = N::Lane::ZERO;
    let volts = measured.by_lane(|lane| {
        if let (Some(controller), Some(state)) = (controllers.get(lane), states.get_mut(lane)) {
            volts = controller.step(state, reference, measured.lane(lane), feedforward).volts;
        }
        volts
    });
    let mut saturated = N::Lane::ZERO;
    let saturated = measured.by_lane(|lane| {
        if let Some(state) = states.get(lane) {
            saturated = N::Lane::count(u32::from(state.last.saturated));
        }
        saturated
    });
    LanedCommand { volts, saturated }
}

type PidController<N> = Controller<SampledPid<<N as Number>::Lane>, <N as Number>::Lane>;
type PidControllerState<N, L> =
    ControllerState<PidState<<N as Number>::Lane>, L, <N as Number>::Lane>;

/// Controllers with a PID law, one in a lane, and their states.
///
/// ```
/// use piezotrack_control::{Controller, Limits, Lockstep, Pid};
///
/// let limits = Limits::new(0.0, 75.0)?;
/// let controllers = [Controller::new(limits, Pid::xu_li_2010().at(0.02)?)];
/// let (mut alone, mut states) = (controllers[0].rest([])?, [controllers[0].rest([])?]);
/// // A number is a vector of one lane.
/// let mut together = Lockstep::new(0.0, &controllers, &mut states, &mut []);
/// for measured in [0.0, 0.2e-6, f64::NAN, 0.3e-6, 0.4e-6] {
///     let command = together.step(1e-6, measured, 0.5);
///     assert_eq!(command.volts, controllers[0].step(&mut alone, 1e-6, measured, 0.5).volts);
/// }
/// together.settle();
/// assert_eq!(states[0], alone);
/// # Ok::<(), piezotrack_control::Error>(())
/// ```
#[derive(Debug)]
pub struct Lockstep<'a, N: Number, L> {
    controllers: &'a [PidController<N>],
    states: &'a mut [PidControllerState<N, L>],
    /// `None` where they step one by one only.
    gains: Option<Gains<N>>,
    /// Repetitive parts in lanes; `None` where they step one by one.
    repetitive: Option<LanedRepetitive<'a, N>>,
    /// Whether that is their state.
    repeating: bool,
    memory: Memory<N>,
    place: Place,
}

/// Where the states are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// In those of the controllers.
    Each,
    /// In those and in lanes.
    Both,
    /// In lanes; those of the controllers are old.
    Lanes,
}

/// Settings of controllers in lanes.
#[derive(Clone, Copy, Debug)]
struct Gains<N: Number> {
    pid: SampledPid<N>,
    filters: [Option<LanedFilter<N>>; 2],
    /// Lowest and highest voltage, V.
    limits: (N, N),
    /// Lowest and highest measurement, m.
    span: (N, N),
    /// Lowest and highest reference that all lanes accept, m.
    references: (N::Lane, N::Lane),
    /// Lowest and highest feedforward that all lanes accept as it is, V.
    feedforwards: (N::Lane, N::Lane),
    repeats: bool,
}

/// States of controllers in lanes that go on as usual.
#[derive(Clone, Copy, Debug)]
struct Memory<N: Number> {
    /// Output of the law, V, and its last errors, m.
    volts: N,
    errors: [N; 2],
    filters: [[N; 2]; 2],
    excess: N,
    unlearnt: N,
    /// The sample before.
    unclipped: N,
    command: N,
    repetitive: N,
    measured: N,
    feedforward: N::Lane,
}

impl<N: Number> Memory<N> {
    fn new(like: N) -> Self {
        let zero = like.like(0.0);
        Self {
            volts: zero,
            errors: [zero; 2],
            filters: [[zero; 2]; 2],
            excess: zero,
            unlearnt: zero,
            unclipped: zero,
            command: zero,
            repetitive: zero,
            measured: zero,
            feedforward: N::Lane::ZERO,
        }
    }
}

impl<N: Number> Gains<N> {
    /// `None` where there is no controller, or one that is told how far its stage can jump.
    fn new(like: N, controllers: &[PidController<N>]) -> Option<Self> {
        let last = controllers.last()?;
        let of = |lane: usize| controllers.get(lane).unwrap_or(last);
        let filter = |slot: usize| {
            let has = |one: &PidController<N>| one.filters.get(slot).copied().flatten();
            LanedFilter::new(like, |lane| has(of(lane)), controllers.iter().find_map(has))
        };
        let infinity = N::Lane::INFINITY;
        if controllers.iter().any(|one| one.span.max_jump < infinity) {
            return None;
        }
        let (mut references, mut feedforwards) = ((-infinity, infinity), (-infinity, infinity));
        for one in controllers {
            let (low, high) = one.span.references();
            references = (references.0.larger(low), references.1.smaller(high));
            let (low, high) = (one.limits.low(), one.limits.high());
            let (low, high) = (low - (high - low), high + (high - low));
            feedforwards = (feedforwards.0.larger(low), feedforwards.1.smaller(high));
        }
        Some(Self {
            pid: SampledPid::in_lanes(like, |lane| of(lane).feedback),
            filters: [filter(0), filter(1)],
            limits: (
                like.by_lane(|lane| of(lane).limits.low()),
                like.by_lane(|lane| of(lane).limits.high()),
            ),
            span: (
                like.by_lane(|lane| of(lane).span.low()),
                like.by_lane(|lane| of(lane).span.high()),
            ),
            references,
            feedforwards,
            repeats: controllers.iter().any(|one| one.repetitive.is_some()),
        })
    }
}

/// A filter in the lanes that have it.
#[derive(Clone, Copy, Debug)]
struct LanedFilter<N> {
    filter: Filter<N>,
    /// Below 0 in the lanes that have it.
    used: N,
}

impl<N: Number> LanedFilter<N> {
    /// `None` where no lane has it.
    fn new(
        like: N,
        of: impl Fn(usize) -> Option<Filter<N::Lane>>,
        any: Option<Filter<N::Lane>>,
    ) -> Option<Self> {
        let any = any?;
        let used = like.by_lane(|lane| match of(lane) {
            Some(_) => -N::Lane::of(1.0),
            None => N::Lane::ZERO,
        });
        Some(Self { filter: Filter::in_lanes(like, |lane| of(lane).unwrap_or(any)), used })
    }
}

impl<'a, N: Number, L: AsRef<[N::Lane]> + AsMut<[N::Lane]>> Lockstep<'a, N, L> {
    /// Entries that the delay lines of controllers need in lanes; 0 where these step one by one.
    #[must_use]
    pub fn room(controllers: &[PidController<N>]) -> usize {
        let first = controllers.first().and_then(|one| one.repetitive);
        let alike = |one: &PidController<N>| match (first, one.repetitive) {
            (Some(first), Some(part)) => first.is_shaped_like(&part),
            _ => false,
        };
        if controllers.iter().all(alike) { first.map_or(0, |part| part.length()) } else { 0 }
    }

    /// Takes controllers and their states for lanes of numbers like `like`, as many or fewer, and a
    /// delay line for all of them; where it has less than [`Self::room`], repetitive parts step one
    /// by one.
    pub fn new(
        like: N,
        controllers: &'a [PidController<N>],
        states: &'a mut [PidControllerState<N, L>],
        line: &'a mut [N],
    ) -> Self {
        let gains = Gains::new(like, controllers);
        let parts = |lane: usize| {
            let one = controllers.get(lane).or(controllers.last())?;
            Some((one.repetitive?, one.limits.high() - one.limits.low()))
        };
        let repetitive = LanedRepetitive::new(like, parts, line);
        let (memory, place) = (Memory::new(like), Place::Each);
        Self { controllers, states, gains, repetitive, repeating: false, memory, place }
    }

    /// One sample, as of [`Controller::step`]: all have the same reference (m) and feedforward (V).
    #[inline(always)]
    pub fn step(
        &mut self,
        reference: N::Lane,
        measured: N,
        feedforward: N::Lane,
    ) -> LanedCommand<N> {
        if self.place != Place::Each
            && let Some(command) = self.step_in_lanes(reference, measured, feedforward)
        {
            return command;
        }
        self.step_each(reference, measured, feedforward)
    }

    /// Writes what the lanes hold into the states of the controllers.
    pub fn settle(&mut self) {
        if self.place != Place::Lanes {
            return;
        }
        let Some(gains) = &self.gains else { return };
        if self.repeating
            && let Some(all) = &mut self.repetitive
        {
            all.settle(self.states);
        }
        let memory = &self.memory;
        for (lane, state) in self.states.iter_mut().enumerate() {
            let error = memory.errors[0].lane(lane);
            let volts = memory.volts.lane(lane);
            let excess = memory.excess.lane(lane);
            state.feedback = PidState { volts, errors: Some([error, memory.errors[1].lane(lane)]) };
            for (i, slot) in state.filters.iter_mut().enumerate() {
                if let Some(LanedFilter { used, .. }) = gains.filters[i] {
                    let has = used.lane(lane) < N::Lane::ZERO;
                    *slot = has.then(|| memory.filters[i].map(|sum| sum.lane(lane)));
                }
            }
            state.excess = excess;
            state.unlearnt = memory.unlearnt.lane(lane);
            state.last = Command {
                volts: memory.command.lane(lane),
                unclipped: memory.unclipped.lane(lane),
                feedforward: memory.feedforward,
                feedback: volts,
                repetitive: memory.repetitive.lane(lane),
                error,
                saturated: excess.abs() > N::Lane::ZERO,
                measurement_ok: true,
                reference_ok: true,
            };
            (state.readings.last, state.readings.since) = (memory.measured.lane(lane), 0);
        }
        self.place = Place::Both;
    }

    #[cold]
    #[inline(never)]
    fn step_each(
        &mut self,
        reference: N::Lane,
        measured: N,
        feedforward: N::Lane,
    ) -> LanedCommand<N> {
        self.settle();
        let command = step_each(self.controllers, self.states, reference, measured, feedforward);
        (self.place, self.repeating) = (Place::Each, false);
        if self.gains.is_some() && self.states.iter().all(goes_on) {
            self.load();
        }
        command
    }

    /// Reads the states of the controllers into the lanes.
    fn load(&mut self) {
        let Some(last) = self.states.last() else { return };
        let states = &*self.states;
        let of = |lane: usize| states.get(lane).unwrap_or(last);
        let memory = &mut self.memory;
        let like = memory.volts;
        memory.volts = like.by_lane(|lane| of(lane).feedback.volts);
        for (i, slot) in memory.errors.iter_mut().enumerate() {
            *slot = like.by_lane(|lane| of(lane).feedback.errors.unwrap_or_default()[i]);
        }
        for (i, slots) in memory.filters.iter_mut().enumerate() {
            for (j, slot) in slots.iter_mut().enumerate() {
                *slot = like.by_lane(|lane| of(lane).filters[i].unwrap_or_default()[j]);
            }
        }
        memory.excess = like.by_lane(|lane| of(lane).excess);
        memory.unlearnt = like.by_lane(|lane| of(lane).unlearnt);
        self.repeating = self.repetitive.as_mut().is_some_and(|all| all.load(self.states));
        self.place = Place::Both;
    }

    /// A sample in lanes; `None`, and nothing is changed, where one of them does not go on as usual.
    #[inline(always)]
    fn step_in_lanes(
        &mut self,
        reference: N::Lane,
        measured: N,
        feedforward: N::Lane,
    ) -> Option<LanedCommand<N>> {
        let gains = self.gains.as_ref()?;
        let memory = &mut self.memory;
        let asks = within(reference, gains.references) && within(feedforward, gains.feedforwards);
        // What each filter takes, and what comes out of the last.
        let mut values = [measured; 3];
        for (i, filter) in gains.filters.iter().enumerate() {
            values[i + 1] = match filter {
                Some(LanedFilter { filter, used }) => {
                    let output = filter.output(&memory.filters[i], values[i]);
                    used.where_negative(output, values[i])
                }
                None => values[i],
            };
        }
        let error = measured.each(reference) - values[2];
        let feedback = gains.pid.output(memory.volts, error, memory.errors, memory.excess);
        // Of such numbers no sum below overflows.
        let most = measured.each(N::Lane::HUGE);
        let usual = measured.all_within(gains.span.0, gains.span.1);
        if !(asks && usual && feedback.all_within(-most, most)) {
            return None;
        }
        let mut repetitive = measured.like(0.0);
        if gains.repeats {
            let mut found = None;
            if self.repeating
                && let Some(all) = &mut self.repetitive
            {
                found = all.step(memory.unlearnt, memory.excess, self.states);
                if found.is_none() {
                    all.settle(self.states);
                    self.repeating = false;
                }
            }
            repetitive = match found {
                Some(volts) => volts,
                None => learnt(self.controllers, self.states, memory.unlearnt, memory.excess),
            };
        }
        let unclipped = feedback + measured.each(feedforward) + repetitive;
        let volts = unclipped.larger(gains.limits.0).smaller(gains.limits.1);
        let excess = volts - unclipped;
        for (i, filter) in gains.filters.iter().enumerate() {
            if let Some(LanedFilter { filter, .. }) = filter {
                filter.remember(&mut memory.filters[i], values[i], values[i + 1]);
            }
        }
        // One by one: a whole memory would be built beside it and copied.
        memory.volts = feedback;
        memory.errors = [error, memory.errors[0]];
        memory.excess = excess;
        memory.unlearnt = error;
        memory.unclipped = unclipped;
        memory.command = volts;
        memory.repetitive = repetitive;
        memory.measured = measured;
        memory.feedforward = feedforward;
        self.place = Place::Lanes;
        let (yes, no) = (measured.like(1.0), measured.like(0.0));
        let saturated = excess.where_negative(yes, (-excess).where_negative(yes, no));
        Some(LanedCommand { volts, saturated })
    }
}

/// Whether a number is from a lowest to a highest; false for NaN.
#[inline(always)]
fn within<T: Real>(number: T, (low, high): (T, T)) -> bool {
    low <= number && number <= high
}

/// Whether the next sample may be one in lanes. It could be after one that was not as usual too, but
/// is then rarely.
fn goes_on<L, T: Real>(state: &ControllerState<PidState<T>, L, T>) -> bool {
    let last = state.last;
    let had = state.feedback.errors.is_some_and(|errors| errors[0] == last.error);
    // A state that was restored may hold any number.
    let usable = state.unlearnt.is_usable() && state.excess.is_usable();
    had && usable && !state.apart && last.measurement_ok && last.reference_ok
}

impl<L, T: Real> Learner<L, T> for ControllerState<PidState<T>, L, T> {
    fn part(&self) -> Option<&RepetitiveState<L, T>> {
        self.repetitive.as_ref()
    }

    fn part_mut(&mut self) -> Option<&mut RepetitiveState<L, T>> {
        self.repetitive.as_mut()
    }
}

/// Voltages of the repetitive parts, each stepped by itself, in its lane.
#[inline(always)]
fn learnt<N: Number, L: AsMut<[N::Lane]>>(
    controllers: &[PidController<N>],
    states: &mut [PidControllerState<N, L>],
    error: N,
    excess: N,
) -> N {
    let mut volts = N::Lane::ZERO;
    error.by_lane(|lane| {
        if let (Some(one), Some(state)) = (controllers.get(lane), states.get_mut(lane)) {
            let before = Outcome { error: error.lane(lane), excess: excess.lane(lane) };
            volts = match (&one.repetitive, &mut state.repetitive) {
                (Some(part), Some(memory)) => {
                    part.step(memory, before, one.limits.high() - one.limits.low())
                }
                _ => N::Lane::ZERO,
            };
        }
        volts
    })
}
