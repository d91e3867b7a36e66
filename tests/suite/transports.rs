//! The copying transport exists for comparison: it carries the same bytes, and really copies them.

use replica_tests::{Launch, output_text, undisturbed};

const SOURCE: &str = "ticks = 60\npoints = 30000";

#[test]
fn results_are_equal_over_both_transports() {
    let files = ["shared", "copying"].map(|transport| {
        let launch = Launch::of_misbehaving(&format!("transport = \"{transport}\""), SOURCE, "");
        let output = launch.run();
        assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
        let shared = &launch.stage_summary("sink")["counters"]["bytes_in_shared_memory"];
        assert_eq!(shared.as_u64().is_some_and(|bytes| bytes > 0), transport == "shared", "{transport}: {shared}");
        launch.read("sink.txt")
    });
    assert!(files[0] == files[1], "the transport changed the result");
}

#[test]
fn copying_run_restarts_from_its_barriers() {
    let relay = "fault = \"panic\"\nat_tick = 23\nonce = \"struck\"";
    let copying = Launch::of_misbehaving("transport = \"copying\"", SOURCE, relay);
    let output = copying.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    assert_eq!(copying.summary()["total"]["restarts"], 1);
    assert!(copying.read("sink.txt") == undisturbed(SOURCE, ""), "the panic changed the result");
}
