//! Numbers of messages and ticks across the processes of a stage in a live run.

/// A stage that is started anew in a live run numbers its messages and ticks on from a multiple of this: far more than can have
/// been published since the last heartbeat of the process before it.
const STRIDE: u64 = 1000;

/// The number with which the process `epoch` (1: the first to follow another) begins, so that it gives none that one before it may
/// have given. `heard` is behind the last that was heard of, with up to a stride unheard of behind it; one stride more for each
/// process, because any of them may have died before its first was heard of.
pub(crate) fn beyond(heard: u64, epoch: u32) -> u64 {
    (heard.div_ceil(STRIDE) + u64::from(epoch)) * STRIDE
}

#[cfg(test)]
mod tests {
    use super::beyond;

    #[test]
    fn no_process_gives_a_number_that_one_before_it_gave() {
        // What the first one was heard of, and then of each whether it was heard of after its messages, one bit for each.
        for first_heard in [0, 1, 299, 300, 301, 999, 1000, 1001, 5998] {
            for heard_of in 0..1_u32 << 8 {
                let (mut heard, mut given) = (first_heard, first_heard + 700);
                for epoch in 1..=8 {
                    let first = beyond(heard, epoch);
                    assert!(
                        first > given,
                        "{first} after {given}, {first_heard} heard, process {epoch} of {heard_of:08b}"
                    );
                    given = first + 700;
                    if heard_of >> (epoch - 1) & 1 == 1 {
                        heard = first + 300;
                    }
                }
            }
        }
    }
}
