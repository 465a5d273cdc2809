//! The header of the C library, written from its functions.
#![cfg(test)]

use std::path::Path;
use std::{env, fs};

/// `make c-header` sets `WRITE`, which writes the header in place of comparing it.
#[test]
fn the_header_is_that_of_the_functions() {
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rust/capi");
    let config = cbindgen::Config::from_file(library.join("cbindgen.toml")).unwrap();
    let mut text = Vec::new();
    let sources = cbindgen::Builder::new()
        .with_config(config)
        .with_src(library.join("src/lib.rs"))
        .with_src(library.join("src/settings.rs"));
    sources.generate().unwrap().write(&mut text);
    let (text, path) = (String::from_utf8(text).unwrap(), library.join("include/piezotrack.h"));
    if env::var_os("WRITE").is_some() {
        fs::write(&path, &text).unwrap();
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == text, "rust/capi/include/piezotrack.h is out of date: make c-header");
}
