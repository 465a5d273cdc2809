//! Numbers from bytes, such that many are plausible and each that is possible can come.

use piezotrack_core::models::{ParameterInfo, Values};

/// Numbers on which code turns.
const SPECIAL: [f64; 24] = [
    0.0,
    1.0,
    -0.0,
    -1.0,
    0.5,
    2.0,
    3.0,
    4.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    f64::EPSILON,
    1e100,
    -1e100,
    1e-100,
    1e300,
    1e-300,
    1e6,
    1e-6,
    4_294_967_295.0,
];

/// Bytes that are read from the front; zeros after their end.
#[derive(Clone, Copy, Debug)]
pub struct Bytes<'a>(pub &'a [u8]);

impl<'a> Bytes<'a> {
    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    /// One of `count` places.
    pub fn below(&mut self, count: usize) -> usize {
        usize::from(self.byte()) % count.max(1)
    }

    /// One of some values.
    pub fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }

    /// Yes or no.
    pub fn flag(&mut self) -> bool {
        self.byte() % 2 == 1
    }

    /// Whether there is anything left.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The rest as numbers of eight bytes.
    pub fn words(self) -> impl Iterator<Item = f64> + use<'a> {
        let (words, _) = self.0.as_chunks::<8>();
        words.iter().map(|word| f64::from_le_bytes(*word))
    }

    /// Any number: a special one, one of a usual size, or the bits themselves.
    pub fn number(&mut self) -> f64 {
        let kind = self.byte();
        match kind {
            0..32 => SPECIAL[usize::from(kind) % SPECIAL.len()],
            32..240 => {
                // Eight kinds for each decade from 1e-12 to 1e13; every other one in 13 below 0.
                let decade = i32::from(kind - 32) / 8 - 12;
                let sign = if kind % 8 == 7 { -1.0 } else { 1.0 };
                sign * (1.0 + f64::from(self.byte()) * (9.0 / 256.0)) * 10_f64.powi(decade)
            }
            240.. => f64::from_bits(u64::from_le_bytes(core::array::from_fn(|_| self.byte()))),
        }
    }

    /// A number near `usual` in most cases.
    pub fn near(&mut self, usual: f64) -> f64 {
        match self.byte() {
            kind @ 0..192 => usual * (0.25 + f64::from(kind) / 85.0),
            _ => self.number(),
        }
    }

    /// Up to `most` numbers, which rise from 0 or above in many cases, as thresholds do.
    pub fn numbers(&mut self, most: usize) -> Vec<f64> {
        let (rises, count) = (self.flag(), self.below(most + 1));
        let mut sum = 0.0;
        let next = |_| {
            let number = self.number();
            sum += number.abs();
            if rises { sum } else { number }
        };
        (0..count).map(next).collect()
    }

    /// Values of the parameters of a model, around published ones where there are any.
    pub fn values(&mut self, infos: &'static [ParameterInfo], usual: Option<&Values>) -> Values {
        let entries = infos.iter().map(|info| {
            // Any other exponent is integrated, in steps that take milliseconds in the worst case.
            if info.name == "exponent" && self.byte() < 250 {
                return vec![1.0];
            }
            let published = usual.map_or(&[][..], |values| values.list(info.name));
            if info.is_list {
                self.numbers(6)
            } else if info.is_optional && self.flag() {
                vec![]
            } else if let (Some(usual), false) =
                (published.first().copied().or(info.default), self.flag())
            {
                vec![self.near(usual)]
            } else {
                vec![self.number()]
            }
        });
        let named: Vec<_> = infos.iter().map(|info| info.name.to_owned()).zip(entries).collect();
        Values::named(infos, named).expect("each parameter once")
    }
}

/// The numbers of a state, as bits.
#[must_use]
pub fn bits(state: &impl piezotrack_control::Snapshot) -> Vec<u64> {
    let mut all = Vec::new();
    state.save(&mut |number| all.push(number.to_bits()));
    all
}
