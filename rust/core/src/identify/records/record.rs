//! A measured record: the drive, and the displacement measured under it.

use std::ops::Range;

use super::thinned::Thinned;
use crate::error::{Error, Result, shown};
use crate::signal::{Drive, Hold, index, range};

/// A drive and the displacement measured under it.
#[derive(Clone, Debug)]
pub struct Record<'a> {
    /// The drive from the first sample kept, warm-up included.
    pub drive: Drive<'a>,
    /// Displacement at the same samples, m.
    pub y: &'a [f64],
    /// The samples that count.
    pub window: Range<usize>,
    /// How messages call it among several; empty where it is the only one.
    pub label: String,
    /// How much each of its samples counts beside those of other records.
    pub weight: f64,
    /// Samples whose displacement does not count, one entry for each; none where empty.
    pub left_out: &'a [bool],
}

impl<'a> Record<'a> {
    /// Checks that the record can tell anything.
    ///
    /// # Errors
    /// [`Error::Shape`] for unequal lengths, [`Error::Parameter`] for a bad `dt`,
    /// [`Error::Data`] for a constant drive, a dead sensor or too short a window.
    pub fn new(u: &'a [f64], y: &'a [f64], dt: f64, hold: Hold, start: usize) -> Result<Self> {
        let drive = Drive::new(u, dt, hold)?;
        if u.len() != y.len() {
            return Err(Error::Shape {
                name: "y".into(),
                found: format!("{} samples", y.len()),
                expected: format!("{}, as many as u", u.len()),
            });
        }
        let window = start.min(u.len())..u.len();
        if window.len() < 10 {
            return Err(Error::Data(format!(
                "the window has {} samples: expected at least 10",
                window.len()
            )));
        }
        let (low, high) = range(&u[window.clone()]);
        if low >= high {
            return Err(Error::Data(format!(
                "the drive is constant at {low} V in the window: expected a drive that moves \
                 the stage, up and down at least once"
            )));
        }
        let (low, high) = range(&y[window.clone()]);
        if low >= high {
            return Err(Error::Data(format!(
                "the displacement is constant at {low} m in the window while the drive moves: \
                 the sensor seems dead or not connected"
            )));
        }
        Ok(Self { drive, y, window, label: String::new(), weight: 1.0, left_out: &[] })
    }

    /// The record as one of several, with its name in messages and its weight beside the others.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a weight that is not finite and above 0.
    pub fn among(self, label: &str, weight: f64) -> Result<Self> {
        if weight > 0.0 && weight.is_finite() {
            return Ok(Self { label: label.into(), weight, ..self });
        }
        let expected = "a finite number above 0: leave out a record that is not to count";
        Err(Error::parameter("weight", shown(weight), expected).of(label))
    }

    /// The same without the displacement at some samples; an empty list for none.
    ///
    /// # Errors
    /// [`Error::Shape`] where there is not one entry for each sample, [`Error::Data`] where fewer
    /// than 10 samples are left.
    pub fn without(self, left_out: &'a [bool]) -> Result<Self> {
        if !left_out.is_empty() && left_out.len() != self.y.len() {
            return Err(Error::Shape {
                name: "left_out".into(),
                found: format!("{} samples", left_out.len()),
                expected: format!("{}, as many as u", self.y.len()),
            });
        }
        let record = Self { left_out, ..self };
        match record.samples() {
            0..10 => Err(Error::Data(format!(
                "the window has {} samples that count: expected at least 10",
                record.samples()
            ))),
            _ => Ok(record),
        }
    }

    /// The record with every so many of its samples.
    pub(in crate::identify) fn thinned<'b>(&self, few: &'b Thinned) -> Record<'b> {
        Record {
            drive: few.drive(&self.drive),
            y: &few.y,
            window: few.place(self.window.start)..few.y.len(),
            label: self.label.clone(),
            weight: self.weight * index(few.every),
            left_out: &few.left_out,
        }
    }

    /// Whether the displacement at a sample counts.
    #[inline]
    #[must_use]
    pub fn counts(&self, k: usize) -> bool {
        !self.left_out.get(k).is_some_and(|left_out| *left_out)
    }

    /// Number of samples in the window that count.
    #[must_use]
    pub fn samples(&self) -> usize {
        let left_out = self.left_out.iter().skip(self.window.start);
        self.window.len() - left_out.filter(|left_out| **left_out).count()
    }

    /// An error of this record among several.
    #[must_use]
    pub fn named(&self, error: Error) -> Error {
        error.of(&self.label)
    }

    /// Range of the displacement in the window, m.
    #[must_use]
    pub fn stroke(&self) -> f64 {
        let (low, high) = range(&self.y[self.window.clone()]);
        high - low
    }
}
