//! libFuzzer on [`piezotrack_fuzz::stages`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    piezotrack_fuzz::stages::run(data);
});
