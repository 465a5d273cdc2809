//! libFuzzer on [`piezotrack_fuzz::checkpoints`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    piezotrack_fuzz::checkpoints::run(data);
});
