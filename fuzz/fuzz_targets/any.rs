//! The target with the name of the binary.

#![no_main]

use cap::Cap;
use std::alloc::System;
use std::sync::LazyLock;

/// The function to fuzz.
static TARGET: LazyLock<fn(&[u8])> = LazyLock::new(|| {
    // The hook of libfuzzer-sys aborts at any panic. A panic that the target catches is no finding; others abort without the hook, too.
    drop(std::panic::take_hook());
    fuzz_targets::target(env!("CARGO_BIN_NAME")).expect("a target has the name of its binary")
});

/// libFuzzer's own limits see memory only with a sanitizer, or once it is written.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let target = *TARGET;
    // An allocation beyond the limit fails, which aborts the process unless the reader handles it.
    let _ = MEMORY.set_limit(MEMORY.allocated() + fuzz_targets::memory_limit(data));
    target(data);
    let _ = MEMORY.set_limit(usize::MAX);
});
