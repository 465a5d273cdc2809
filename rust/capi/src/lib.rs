//! The controllers and inverses of piezotrack for C, C++ and whatever calls a C library.
//!
//! A controller is made from a `piezotrack_settings` and stepped once in each sampling interval. A
//! step does not allocate, and gives the bits of the same controller in Python and Rust. Several
//! threads may each have controllers of their own; one controller belongs to one thread at a time.
//!
//! `include/piezotrack.h` is written from these files by `make c-header`; a test compares it.

mod running;
mod settings;

use core::ffi::c_char;
use core::ptr;
use std::panic::{AssertUnwindSafe, catch_unwind};

use piezotrack_core::{Error, Result};

use running::Running;
pub use settings::{Numbers, Settings};

/// A controller at work: its settings, and the state of all of its parts.
pub struct Controller(Running);

/// The command of a sample, with its parts.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct Command {
    /// The voltage for the actuator, within the limits, V.
    pub volts: f64,
    /// The voltage before it was clipped, V.
    pub unclipped: f64,
    /// Its feedforward part, V.
    pub feedforward: f64,
    /// Its feedback part, V.
    pub feedback: f64,
    /// Its repetitive part, V.
    pub repetitive: f64,
    /// Tracking error, m.
    pub error: f64,
    /// Whether the voltage was clipped.
    pub saturated: bool,
    /// False where the reading was not finite, outside the span, or a jump too far.
    pub measurement_ok: bool,
    /// False where the reference or the feedforward was not finite, or far outside.
    pub reference_ok: bool,
}

/// Number of readings that were no measurements, since the start or the last reset.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct Refused {
    /// NaN or infinite.
    pub not_finite: u32,
    /// Outside of the span.
    pub outside: u32,
    /// Further from the last valid reading than the settings allow.
    pub jumps: u32,
}

/// The version of the library.
#[unsafe(no_mangle)]
pub extern "C" fn piezotrack_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Makes a controller that begins at 0 V, and NULL where it cannot: `message`, of `room` bytes,
/// then has a sentence that names the setting, its value and what was expected. It is "" otherwise;
/// it may be NULL. The settings are copied.
///
/// # Safety
/// Each pointer of `settings` is NULL, points to as many elements as the count beside it says, or
/// to a text that ends with 0; `message` is NULL or has `room` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_new(
    settings: *const Settings,
    message: *mut c_char,
    room: usize,
) -> *mut Controller {
    let make = || -> Result<Running> {
        // SAFETY: as the caller promises.
        let settings = unsafe { settings.as_ref() }
            .ok_or_else(|| Error::parameter("settings", "NULL", "a piezotrack_settings"))?;
        let (parts, feedforward) = unsafe { settings::parts(settings) }?;
        Running::new(&parts, feedforward.as_ref())
    };
    let made = catch_unwind(AssertUnwindSafe(make));
    let text = match &made {
        Ok(Ok(_)) => String::new(),
        Ok(Err(error)) => error.to_string(),
        Err(_) => "the settings cannot be used: a fault of the library".into(),
    };
    // SAFETY: as the caller promises.
    unsafe { write(&text, message, room) };
    match made {
        Ok(Ok(running)) => Box::into_raw(Box::new(Controller(running))),
        _ => ptr::null_mut(),
    }
}

/// Frees a controller; nothing for NULL.
///
/// # Safety
/// `controller` is NULL or from `piezotrack_new`, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_free(controller: *mut Controller) {
    if !controller.is_null() {
        // SAFETY: it came from a box, and is the caller's to give up.
        drop(unsafe { Box::from_raw(controller) });
    }
}

/// The voltage of a sample, V: once in each sampling interval. `reference` is the displacement to
/// be followed and `next` the same one sample ahead (NAN where it is not known), `measured` the
/// reading, all in m. The feedforward is the inverse of the settings, 0 V without one.
///
/// A reading or a reference that cannot be used changes neither the command nor what is learnt. NAN
/// for NULL.
///
/// # Safety
/// `controller` is NULL or from `piezotrack_new`, and no other thread uses it meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_step(
    controller: *mut Controller,
    reference: f64,
    next: f64,
    measured: f64,
) -> f64 {
    let next = (!next.is_nan()).then_some(next);
    // SAFETY: as the caller promises.
    unsafe { controller.as_mut() }.map_or(f64::NAN, |one| one.0.step(reference, next, measured))
}

/// The same with a feedforward of your own, as from a table, V; the inverse is not asked.
///
/// # Safety
/// As of `piezotrack_step`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_step_given(
    controller: *mut Controller,
    reference: f64,
    measured: f64,
    feedforward: f64,
) -> f64 {
    // SAFETY: as the caller promises.
    unsafe { controller.as_mut() }
        .map_or(f64::NAN, |one| one.0.step_given(reference, measured, feedforward))
}

/// Begins anew without a bump at the voltage that is there, V. False where that is outside of the
/// limits, and for NULL.
///
/// # Safety
/// As of `piezotrack_step`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_start(controller: *mut Controller, present: f64) -> bool {
    // SAFETY: as the caller promises.
    unsafe { controller.as_mut() }.is_some_and(|one| one.0.start(present).is_ok())
}

/// Reports the voltage that the amplifier in fact gave for the last command, V, where that is
/// another: for the antiwindup. False where it is not finite, and for NULL.
///
/// # Safety
/// As of `piezotrack_step`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_applied(controller: *mut Controller, volts: f64) -> bool {
    // SAFETY: as the caller promises.
    unsafe { controller.as_mut() }.is_some_and(|one| one.0.applied(volts).is_ok())
}

/// Forgets errors, readings, hysteresis and what was learnt, and goes on from the voltage that is
/// there.
///
/// # Safety
/// As of `piezotrack_step`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_reset(controller: *mut Controller) {
    // SAFETY: as the caller promises.
    if let Some(one) = unsafe { controller.as_mut() } {
        one.0.reset();
    }
}

/// The last command with its parts; zeros for NULL.
///
/// # Safety
/// As of `piezotrack_step`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_last(controller: *const Controller) -> Command {
    // SAFETY: as the caller promises.
    unsafe { controller.as_ref() }.map_or_else(Command::default, |one| {
        let last = one.0.last();
        Command {
            volts: last.volts,
            unclipped: last.unclipped,
            feedforward: last.feedforward,
            feedback: last.feedback,
            repetitive: last.repetitive,
            error: last.error,
            saturated: last.saturated,
            measurement_ok: last.measurement_ok,
            reference_ok: last.reference_ok,
        }
    })
}

/// Number of readings that were no measurements; zeros for NULL.
///
/// # Safety
/// As of `piezotrack_step`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn piezotrack_refused(controller: *const Controller) -> Refused {
    // SAFETY: as the caller promises.
    unsafe { controller.as_ref() }.map_or_else(Refused::default, |one| {
        let refused = one.0.refused();
        Refused { not_finite: refused.not_finite, outside: refused.outside, jumps: refused.jumps }
    })
}

/// Writes a text and a 0 into `room` bytes, cut where it is too long.
///
/// # Safety
/// `message` is NULL or has `room` bytes.
unsafe fn write(text: &str, message: *mut c_char, room: usize) {
    if message.is_null() || room == 0 {
        return;
    }
    let mut length = text.len().min(room - 1);
    while !text.is_char_boundary(length) {
        length -= 1;
    }
    // SAFETY: length and the 0 are within the room.
    unsafe {
        ptr::copy_nonoverlapping(text.as_ptr(), message.cast(), length);
        message.add(length).write(0);
    }
}
