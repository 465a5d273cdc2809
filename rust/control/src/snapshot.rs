//! States as plain numbers: to keep a running controller over a restart, or to send it elsewhere.
//!
//! A state is written as a sequence of numbers and read back into a state of the same
//! configuration, bit for bit.
//!
//! ```
//! use piezotrack_control::{Controller, Limits, Pid, Snapshot};
//!
//! let controller = Controller::new(Limits::new(0.0, 75.0)?, Pid::xu_li_2010().at(0.02)?);
//! let mut running = controller.rest([])?;
//! controller.step(&mut running, 1e-6, 0.0, 0.0);
//!
//! let (mut kept, mut count) = ([0.0; 64], 0);
//! running.save(&mut |number| {
//!     kept[count] = number;
//!     count += 1;
//! });
//! let mut numbers = kept.iter().copied();
//! let mut restored = controller.rest([])?;
//! assert!(restored.load(&mut || numbers.next()).is_some());
//! assert_eq!(restored, running);
//! # Ok::<(), piezotrack_control::Error>(())
//! ```

/// A state that can be written as numbers and read back.
pub trait Snapshot {
    /// Passes the numbers to `write`, one after the other.
    fn save(&self, write: &mut dyn FnMut(f64));

    /// Takes the numbers from `read` into a state of the same configuration; `None` where one is
    /// missing or cannot be, and the state is of no use then.
    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()>;
}

/// Implements [`Snapshot`] for a struct, field by field: `snapshot!(State { x, y })`, or
/// `snapshot!([S: Snapshot, const N: usize] State<S, N> { inner, numbers })`.
#[macro_export]
macro_rules! snapshot {
    ($state:ident { $($field:ident),* $(,)? }) => {
        $crate::snapshot!([] $state { $($field),* });
    };
    ([$($bounds:tt)*] $state:ty { $($field:ident),* $(,)? }) => {
        impl<$($bounds)*> $crate::Snapshot for $state {
            fn save(&self, write: &mut dyn FnMut(f64)) {
                $($crate::Snapshot::save(&self.$field, write);)*
            }

            fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
                $($crate::Snapshot::load(&mut self.$field, read)?;)*
                Some(())
            }
        }
    };
}

impl Snapshot for f64 {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        write(*self);
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        *self = read()?;
        Some(())
    }
}

/// Written as the same number in `f64`; one that is none of an `f32` is not read.
impl Snapshot for f32 {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        write(f64::from(*self));
    }

    #[expect(clippy::cast_possible_truncation, reason = "checked")]
    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        let number = read()?;
        let cast = number as Self;
        let same = f64::from(cast).to_bits() == number.to_bits() || number.is_nan();
        *self = same.then_some(cast)?;
        Some(())
    }
}

impl Snapshot for u32 {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        write(f64::from(*self));
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        let number = read()?;
        let whole = (0.0..=f64::from(Self::MAX)).contains(&number).then_some(number as Self)?;
        // Nothing was cut off.
        *self = (f64::from(whole).to_bits() == number.to_bits()).then_some(whole)?;
        Some(())
    }
}

impl Snapshot for bool {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        u32::from(*self).save(write);
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        let mut number = 0_u32;
        number.load(read)?;
        *self = (number < 2).then_some(number == 1)?;
        Some(())
    }
}

impl Snapshot for () {
    fn save(&self, _write: &mut dyn FnMut(f64)) {}

    fn load(&mut self, _read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        Some(())
    }
}

impl<T: Snapshot, const N: usize> Snapshot for [T; N] {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        for one in self {
            one.save(write);
        }
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        self.iter_mut().try_for_each(|one| one.load(read))
    }
}

impl<T: Snapshot + Default> Snapshot for Option<T> {
    fn save(&self, write: &mut dyn FnMut(f64)) {
        self.is_some().save(write);
        if let Some(one) = self {
            one.save(write);
        }
    }

    fn load(&mut self, read: &mut dyn FnMut() -> Option<f64>) -> Option<()> {
        let mut some = false;
        some.load(read)?;
        *self = some.then(T::default);
        self.iter_mut().try_for_each(|one| one.load(read))
    }
}
