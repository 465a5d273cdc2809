//! The control crate in a library without std, without an allocator.
#![no_std]

use core::panic::PanicInfo;

// Linked whole, whatever its names are: what is checked is a property of all crates together.
use piezotrack_control as _;

#[panic_handler]
fn halt(_: &PanicInfo) -> ! {
    loop {}
}
