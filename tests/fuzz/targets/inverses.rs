//! libFuzzer on [`piezotrack_fuzz::inverses`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    piezotrack_fuzz::inverses::run(data);
});
