//! The control crate in a library without std, without an allocator: an axis that C calls, also on a
//! board.
#![no_std]

mod parts;

use core::panic::PanicInfo;

use piezotrack_control::pid::{PidState, SampledPid};
use piezotrack_control::{
    Cast, Controller, ControllerState, Filter, Limits, Pid, Repetitive, Result, Smoothing, Span,
};

/// Controller and state of one axis.
struct Axis {
    controller: Controller<SampledPid>,
    state: ControllerState<PidState, [f64; 0]>,
}

static mut AXIS: Option<Axis> = None;

/// Entries of the delay line of the axis in single precision.
const ROOM: usize = Repetitive::room(PERIOD as usize);
/// Period that it learns, samples.
const PERIOD: u32 = 250;

/// Controller and state of an axis in single precision, with a filter and a repetitive part.
struct Single {
    controller: Controller<SampledPid<f32>, f32>,
    state: ControllerState<PidState<f32>, [f32; ROOM], f32>,
}

static mut SINGLE: Option<Single> = None;

fn double_precision() -> Result<Controller<SampledPid>> {
    let pid = Pid::new(0.12e6, 0.009, 0.044, None)?.at(0.02)?;
    let mut controller = Controller::new(Limits::new(0.0, 75.0)?, pid);
    controller.span = Span::new(-2e-5, 1.5e-4)?;
    Ok(controller)
}

/// Begins: the PID of Xu and Li 2010 at 50 Hz, 0 to 75 V, -20 to 150 um. 0 where that cannot be.
#[unsafe(no_mangle)]
pub extern "C" fn axis_begin() -> i32 {
    let axis = || -> Result<Axis> {
        let controller = double_precision()?;
        let state = controller.rest([])?;
        Ok(Axis { controller, state })
    };
    let axis = axis().ok();
    let begun = i32::from(axis.is_some());
    // SAFETY: one context calls the functions of this file.
    unsafe { AXIS = axis };
    begun
}

fn axis() -> Option<&'static mut Axis> {
    // SAFETY: as above; no function keeps the reference.
    unsafe { (*(&raw mut AXIS)).as_mut() }
}

/// The voltage for reference and measurement (m), and a feedforward (V); 0 before the beginning.
#[unsafe(no_mangle)]
pub extern "C" fn axis_volts(reference: f64, measured: f64, feedforward: f64) -> f64 {
    axis().map_or(0.0, |one| {
        one.controller.step(&mut one.state, reference, measured, feedforward).volts
    })
}

/// Takes what the amplifier gave, V.
#[unsafe(no_mangle)]
pub extern "C" fn axis_gave(volts: f64) {
    if let Some(one) = axis() {
        let _ = one.controller.applied(&mut one.state, volts);
    }
}

/// Forgets errors and readings.
#[unsafe(no_mangle)]
pub extern "C" fn axis_forget() {
    if let Some(one) = axis() {
        one.controller.reset(&mut one.state);
    }
}

/// Begins in single precision: the same PID, a low-pass of 10 Hz, and a repetitive part for 5 s. 0
/// where that cannot be.
#[unsafe(no_mangle)]
pub extern "C" fn single_begin() -> i32 {
    let axis = || -> Result<Single> {
        let mut controller = double_precision()?;
        controller.filters[0] = Some(Filter::low_pass(10.0, 0.02)?);
        let smoothing = Smoothing::ZeroPhase { order: 2 };
        let learner = Repetitive::new(0.02 * f64::from(PERIOD), smoothing, 0.1)?;
        controller.repetitive = Some(learner.at(0.02)?);
        let controller = controller.cast::<f32>()?;
        let state = controller.rest([0.0; ROOM])?;
        Ok(Single { controller, state })
    };
    let axis = axis().ok();
    let begun = i32::from(axis.is_some());
    // SAFETY: one context calls the functions of this file.
    unsafe { SINGLE = axis };
    begun
}

fn single() -> Option<&'static mut Single> {
    // SAFETY: as above; no function keeps the reference.
    unsafe { (*(&raw mut SINGLE)).as_mut() }
}

/// The voltage of the axis in single precision; see [`axis_volts`].
#[unsafe(no_mangle)]
pub extern "C" fn single_volts(reference: f32, measured: f32, feedforward: f32) -> f32 {
    single().map_or(0.0, |one| {
        one.controller.step(&mut one.state, reference, measured, feedforward).volts
    })
}

/// Takes what the amplifier gave, V.
#[unsafe(no_mangle)]
pub extern "C" fn single_gave(volts: f32) {
    if let Some(one) = single() {
        let _ = one.controller.applied(&mut one.state, volts);
    }
}

/// Forgets errors, readings and what was learnt.
#[unsafe(no_mangle)]
pub extern "C" fn single_forget() {
    if let Some(one) = single() {
        one.controller.reset(&mut one.state);
    }
}

#[panic_handler]
fn halt(_: &PanicInfo) -> ! {
    loop {}
}
