//! The copying transport is there for comparison: it carries the same bytes, and truly copies them.

use replica_tests::{Launch, said};

const SOURCE: &str = "ticks = 60\npoints = 30000";

#[test]
fn results_are_the_same_bytes_over_both_transports() {
    let files = ["shared", "copying"].map(|transport| {
        let launch = Launch::of_misbehaving(&format!("transport = \"{transport}\""), SOURCE, "");
        let output = launch.run();
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let shared = &launch.stage_summary("sink")["counters"]["bytes_in_shared_memory"];
        assert_eq!(shared.as_u64().is_some_and(|bytes| bytes > 0), transport == "shared", "{transport}: {shared}");
        launch.read("sink.txt")
    });
    assert!(files[0] == files[1], "the result shows how the messages have travelled");
}

#[test]
fn a_run_that_copies_goes_on_from_its_barriers_too() {
    let relay = "fault = \"panic\"\nat_tick = 23\nonce = \"struck\"";
    let copying = Launch::of_misbehaving("transport = \"copying\"", SOURCE, relay);
    let output = copying.run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(copying.summary()["total"]["restarts"], 1);
    let undisturbed = Launch::of_misbehaving("", SOURCE, "");
    assert_eq!(undisturbed.run().status.code(), Some(0));
    assert!(copying.read("sink.txt") == undisturbed.read("sink.txt"), "the result shows the panic");
}
