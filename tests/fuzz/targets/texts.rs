//! libFuzzer on [`piezotrack_fuzz::texts`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    piezotrack_fuzz::texts::run(data);
});
