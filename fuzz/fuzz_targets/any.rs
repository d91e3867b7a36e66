//! The target with the name of the binary.

#![no_main]

use cap::Cap;
use fuzz_targets::memory_limit;
use std::alloc::System;
use std::sync::Once;

/// The function to fuzz. A constant, so that the binary has no other: libFuzzer examines the counters of the whole
/// binary after each call.
const TARGET: fn(&[u8]) = match fuzz_targets::target(env!("CARGO_BIN_NAME")) {
    Some(target) => target,
    None => panic!("a target has the name of its binary"),
};

/// libFuzzer's own limits detect memory only with a sanitizer, or once it is written.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    static HOOK: Once = Once::new();
    // The hook of libfuzzer-sys aborts at any panic. A panic that the target catches is not a finding; other panics
    // also abort without the hook.
    HOOK.call_once(|| drop(std::panic::take_hook()));
    // An allocation beyond the limit fails, which aborts the process unless the reader handles it.
    let _ = MEMORY.set_limit(MEMORY.allocated() + memory_limit(data));
    TARGET(data);
    let _ = MEMORY.set_limit(usize::MAX);
});
