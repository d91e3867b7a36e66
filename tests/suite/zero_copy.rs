//! Points are written once and read in place: every row that a stage reads is in the shared memory of the run. (Tests
//! of shared/ipc check within one process that it is the address that was written to.)

use replica_tests::{Launch, output_text};

#[test]
fn rows_are_read_in_shared_memory() {
    let launch = Launch::misbehaving("", "ticks = 20\npoints = 50000", "");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let relay = launch.stage_summary("relay");
    assert_eq!(relay["counters"]["rows"], 20 * 50_000);
    assert_eq!(relay["counters"]["rows_in_shared_memory"], 20 * 50_000);
    let sink = launch.stage_summary("sink");
    let bytes_per_point = 20 + 2;
    assert_eq!(sink["counters"]["bytes"], 20 * 50_000 * bytes_per_point);
    assert_eq!(sink["counters"]["bytes_in_shared_memory"], 20 * 50_000 * bytes_per_point);
}
