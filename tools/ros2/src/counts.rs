//! Counts of received, lost and omitted messages of a topic.

use rustdds::GUID;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Kinds of reasons that are kept for a topic. Further kinds are counted only.
const MAX_KINDS: usize = 16;
/// Publishers of a topic whose messages are counted apart. The counts of the first are closed when there are more.
const MAX_PUBLISHERS: usize = 64;

/// Counts of a topic.
#[derive(Debug, Default)]
pub struct Counts {
    pub n_messages: u64,
    pub n_images: u64,
    pub n_lines: u64,
    pub n_packets: u64,
    /// Images that arrived while too many were waiting.
    pub n_dropped: u64,
    /// Data that could not be written or sent.
    pub n_unwritten: u64,
    pub n_unstamped: u64,
    /// Messages that were left out, by the kind of their reason.
    left_out: BTreeMap<String, u64>,
    n_left_out: u64,
}

impl Counts {
    /// Counts a message that is left out. Returns whether the reason is the first of its kind.
    pub fn leave_out(&mut self, reason: &str) -> bool {
        self.n_left_out += 1;
        // Reasons of a kind differ in their numbers.
        let kind: String = reason.chars().filter(|c| !c.is_ascii_digit()).collect();
        if let Some(n) = self.left_out.get_mut(&kind) {
            *n += 1;
            return false;
        }
        let is_named = self.left_out.len() < MAX_KINDS;
        if is_named {
            self.left_out.insert(kind, 1);
        }
        is_named
    }

    /// Whether everything that was received was written.
    pub fn is_complete(&self) -> bool {
        self.n_left_out == 0 && self.n_dropped == 0 && self.n_unwritten == 0
    }

    /// A line for the operator.
    pub fn summary(&self, n_lost: u64) -> String {
        let mut text = format!("{} messages", self.n_messages);
        for (n, what) in [
            (self.n_images, "images"),
            (self.n_lines, "lines"),
            (self.n_packets, "packets"),
            (self.n_unstamped, "messages without stamp, which get the time of reception"),
            (n_lost, "messages lost in transit"),
            (self.n_dropped, "images dropped: they arrived faster than they could be written"),
            (self.n_left_out, "messages left out"),
            (self.n_unwritten, "not written or sent"),
        ] {
            if n > 0 {
                // Writing to a string cannot fail.
                let _ = write!(text, ", {n} {what}");
            }
        }
        text
    }
}

/// Numbers of the messages of a publisher.
#[derive(Debug)]
struct Numbers {
    first: i64,
    last: i64,
    n: u64,
}

impl Numbers {
    fn n_lost(&self) -> u64 {
        (self.last.abs_diff(self.first) + 1).saturating_sub(self.n)
    }
}

/// Counts lost messages: every publisher numbers its messages.
#[derive(Debug, Default)]
pub struct Losses {
    by_publisher: BTreeMap<GUID, Numbers>,
    n_closed: u64,
}

impl Losses {
    pub fn add(&mut self, publisher: GUID, number: i64) {
        if let Some(numbers) = self.by_publisher.get_mut(&publisher) {
            numbers.first = numbers.first.min(number);
            numbers.last = numbers.last.max(number);
            numbers.n += 1;
            return;
        }
        if self.by_publisher.len() == MAX_PUBLISHERS
            && let Some((_, numbers)) = self.by_publisher.pop_first()
        {
            self.n_closed += numbers.n_lost();
        }
        self.by_publisher.insert(publisher, Numbers { first: number, last: number, n: 1 });
    }

    /// Messages between the first and the last of each publisher that were not received.
    pub fn n_lost(&self) -> u64 {
        self.n_closed + self.by_publisher.values().map(Numbers::n_lost).sum::<u64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_between_the_first_and_the_last_are_lost() {
        let mut losses = Losses::default();
        for number in [7, 9, 8, 12] {
            losses.add(GUID::GUID_UNKNOWN, number);
        }
        assert_eq!(losses.n_lost(), 2);
    }

    #[test]
    fn first_reason_of_each_kind_is_named() {
        let mut counts = Counts::default();
        assert!(counts.is_complete());
        assert!(counts.leave_out("data ends past the end of the message, which has 17 bytes"));
        assert!(!counts.leave_out("data ends past the end of the message, which has 18 bytes"));
        assert!(counts.leave_out("other"));
        assert_eq!(counts.summary(4), "0 messages, 4 messages lost in transit, 3 messages left out");
        let named = (0..100).filter(|n| counts.leave_out(&"x".repeat(*n))).count();
        assert_eq!(named, MAX_KINDS - 2);
        assert!(!counts.is_complete());
    }
}
