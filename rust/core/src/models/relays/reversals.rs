//! The memory of a Preisach operator: the reversals of its input that nothing has wiped out.
//!
//! Minima and maxima alternate, and each pair lies within the one before it. A new maximum wipes
//! out those below it together with their minima, and a new minimum those above it: the wiping-out
//! property of Mayergoyz 1986, Physical Review Letters 56, 1518-1521, doi
//! 10.1103/PhysRevLett.56.1518.

use piezotrack_control::Snapshot;

/// Most reversals that are remembered.
///
/// Within a loop beyond them the output goes to and fro on one branch: its hysteresis, which is
/// that of the innermost of more than 30 loops within each other, is left out.
pub const MOST_REVERSALS: usize = 64;

/// Reversals, V, and the present place of the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reversals {
    /// Minima at even places and maxima at odd ones. The first is the lowest level.
    turns: [f64; MOST_REVERSALS],
    /// How many there are, 1 at least.
    count: u32,
    /// Where the input stands, V.
    place: f64,
}

impl Reversals {
    /// After a rise from `lowest` to `place`.
    #[must_use]
    pub(in crate::models) fn rise(lowest: f64, place: f64) -> Self {
        let mut turns = [0.0; MOST_REVERSALS];
        turns[0] = lowest;
        Self { turns, count: 1, place }
    }

    /// How many there are.
    fn len(&self) -> usize {
        (self.count as usize).clamp(1, MOST_REVERSALS)
    }

    /// All of them, from the lowest level on.
    #[must_use]
    pub fn turns(&self) -> &[f64] {
        &self.turns[..self.len()]
    }

    /// The last one.
    #[inline]
    fn last(&self) -> f64 {
        self.turns[self.len() - 1]
    }

    /// Where the input stands, V.
    #[must_use]
    pub fn place(&self) -> f64 {
        self.place
    }

    /// Whether the branch in use is a rising one.
    #[inline]
    fn rises(&self) -> bool {
        self.len() % 2 == 1
    }

    /// The reversal that a rise or a fall from here begins at: the last one, or here.
    #[inline]
    pub(in crate::models) fn beginning(&self, rises: bool) -> f64 {
        let full = self.len() == MOST_REVERSALS;
        if full || rises == self.rises() { self.last() } else { self.place }
    }

    /// Where a rise or a fall from here reaches the reversal that it wipes out next, or infinity.
    #[inline]
    pub(in crate::models) fn wiped_at(&self, rises: bool) -> f64 {
        // The other way leads back to where this branch began.
        let back = if rises == self.rises() { 2 } else { 1 };
        match self.len().checked_sub(back) {
            // There is nothing above the first rise, and the lowest level is an end in itself.
            Some(k) if k > 0 => self.turns[k],
            _ if rises => f64::INFINITY,
            _ => f64::NEG_INFINITY,
        }
    }

    /// The input goes straight to `place`, which is within the levels.
    #[inline]
    pub(in crate::models) fn follow(&mut self, place: f64) {
        let rises = place > self.place;
        if !rises && place >= self.place {
            return;
        }
        let mut count = self.len();
        let beyond = |turn: f64| if rises { place >= turn } else { place <= turn };
        if rises != self.rises() {
            if count < MOST_REVERSALS {
                self.turns[count] = self.place;
                count += 1;
            } else if beyond(self.last()) {
                count -= 1;
            } else {
                self.place = place;
                return;
            }
        }
        // The opposite of the last one is the one before it.
        while count > 1 && beyond(self.turns[count - 2]) {
            // Nothing lies below the lowest level.
            count = count.saturating_sub(2).max(1);
        }
        self.place = place;
        #[expect(clippy::cast_possible_truncation, reason = "at most MOST_REVERSALS")]
        {
            self.count = count as u32;
        }
    }

    /// The reversals after the lowest level.
    #[must_use]
    pub(in crate::models) fn memory(&self) -> Vec<f64> {
        self.turns()[1..].to_vec()
    }

    /// Those of a memory, the input at the last one; `None` where a list is none: too long, or a
    /// reversal not within the two before it.
    #[must_use]
    pub(in crate::models) fn recalled(
        (lowest, highest): (f64, f64),
        memory: &[f64],
    ) -> Option<Self> {
        let mut reversals = Self::rise(lowest, lowest);
        if memory.len() >= MOST_REVERSALS {
            return None;
        }
        let (mut low, mut high) = (lowest, highest);
        for (k, turn) in memory.iter().enumerate() {
            // Not so where it is not a number.
            if !(low <= *turn && *turn <= high) {
                return None;
            }
            let bound = if k % 2 == 0 { &mut high } else { &mut low };
            *bound = *turn;
            reversals.turns[k + 1] = *turn;
            reversals.count += 1;
        }
        reversals.place = reversals.last();
        Some(reversals)
    }
}

impl Snapshot for Reversals {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        self.turns.save(write);
        self.count.save(write);
        self.place.save(write);
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        self.turns.load(read)?;
        self.count.load(read)?;
        let used = 1..=MOST_REVERSALS;
        used.contains(&usize::try_from(self.count).ok()?).then_some(())?;
        self.place.load(read)
    }
}
