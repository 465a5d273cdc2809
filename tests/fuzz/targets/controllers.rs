//! libFuzzer on [`piezotrack_fuzz::controllers`].
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    piezotrack_fuzz::controllers::run(data);
});
