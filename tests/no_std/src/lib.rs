//! The control crate in a library without std, without an allocator: an axis that C calls, also on a
//! board.
#![no_std]

use core::panic::PanicInfo;

use piezotrack_control::pid::{PidState, SampledPid};
use piezotrack_control::{Controller, ControllerState, Limits, Pid, Span};

/// Controller and state of one axis.
struct Axis {
    controller: Controller<SampledPid>,
    state: ControllerState<PidState, [f64; 0]>,
}

static mut AXIS: Option<Axis> = None;

/// Begins: the PID of Xu and Li 2010 at 50 Hz, 0 to 75 V, -20 to 150 um. 0 where that cannot be.
#[unsafe(no_mangle)]
pub extern "C" fn axis_begin() -> i32 {
    let axis = || -> piezotrack_control::Result<Axis> {
        let pid = Pid::new(0.12e6, 0.009, 0.044, None)?.at(0.02)?;
        let mut controller = Controller::new(Limits::new(0.0, 75.0)?, pid);
        controller.span = Span::new(-2e-5, 1.5e-4)?;
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

#[panic_handler]
fn halt(_: &PanicInfo) -> ! {
    loop {}
}
