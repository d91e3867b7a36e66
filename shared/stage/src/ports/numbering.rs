//! Numbers of messages and ticks across the processes of a stage in a live run.

/// A stage that is restarted in a live run numbers its messages and ticks from a multiple of this: far more than its
/// predecessor can have published since its last heartbeat.
const STRIDE: u64 = 1000;

/// The first number of process `epoch` (1: the first restart), beyond all numbers that earlier processes may have used.
/// `reported` is the number after the last reported one; up to a stride more may have been used without a report. Each
/// process adds one stride, because it may have ended before its first report.
pub(crate) fn next_number(reported: u64, epoch: u32) -> u64 {
    (reported.div_ceil(STRIDE) + u64::from(epoch)) * STRIDE
}

#[cfg(test)]
mod tests {
    use super::next_number;

    #[test]
    fn restarted_process_uses_no_number_of_its_predecessors() {
        // The last report of the first process; then one bit for each process: whether it reported after its messages.
        for first_reported in [0, 1, 299, 300, 301, 999, 1000, 1001, 5998] {
            for reports in 0..1_u32 << 8 {
                let mut reported = first_reported;
                let mut used = first_reported + 700;
                for epoch in 1..=8 {
                    let first = next_number(reported, epoch);
                    assert!(
                        first > used,
                        "{first} after {used}, {first_reported} reported, process {epoch} of {reports:08b}"
                    );
                    used = first + 700;
                    if reports >> (epoch - 1) & 1 == 1 {
                        reported = first + 300;
                    }
                }
            }
        }
    }
}
