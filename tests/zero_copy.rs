//! Points are written once and read in place: in the processes of a run, every row that a stage reads lies in the mapped
//! memory of the run. (That the address is the one that was written to is tested within one process: shared/ipc/tests.)

use replica_tests::{Launch, said};

#[test]
fn all_rows_are_read_in_shared_memory() {
    let launch = Launch::of_misbehaving("", "ticks = 20\npoints = 50000", "");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let relay = launch.stage_summary("relay");
    assert_eq!(relay["counters"]["rows"], 20 * 50_000);
    assert_eq!(relay["counters"]["rows_in_shared_memory"], 20 * 50_000);
    let sink = launch.stage_summary("sink");
    let bytes_per_point = 20 + 2;
    assert_eq!(sink["counters"]["bytes"], 20 * 50_000 * bytes_per_point);
    assert_eq!(sink["counters"]["bytes_in_shared_memory"], 20 * 50_000 * bytes_per_point);
}
