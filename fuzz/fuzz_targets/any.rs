//! The target with the name of the binary.

#![no_main]

use std::sync::LazyLock;

/// The function to fuzz.
static TARGET: LazyLock<fn(&[u8])> = LazyLock::new(|| {
    // The hook of libfuzzer-sys aborts at any panic. A panic that the target catches is no finding; others abort without the hook, too.
    drop(std::panic::take_hook());
    fuzz_targets::target(env!("CARGO_BIN_NAME")).expect("a target has the name of its binary")
});

libfuzzer_sys::fuzz_target!(|data: &[u8]| (*TARGET)(data));
