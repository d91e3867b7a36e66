//! Time spans of a drive, for messages to the operator.

use serde::{Deserialize, Serialize};

/// Largest number of spans that are listed.
const MAX_NAMED: usize = 5;

/// Spans in time order. Serializing it saves the state.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TimeSpans {
    /// First shot of the drive, ns.
    begin: Option<i64>,
    /// First and last shot of each span, ns; the last one may still grow.
    spans: Vec<(i64, i64)>,
}

impl TimeSpans {
    /// Sets the start of the drive to `stamp`, ns, if it is not set yet.
    pub fn begin_drive(&mut self, stamp: i64) {
        self.begin.get_or_insert(stamp);
    }

    /// Adds a span, or extends the last one if it ends at most `gap` ns earlier.
    pub fn add(&mut self, [begin, end]: [i64; 2], gap: i64) {
        match self.spans.last_mut().filter(|(_, last)| begin - gap <= *last) {
            Some((_, last)) => *last = end,
            None => self.spans.push((begin, end)),
        }
    }

    /// Total time of all spans, s.
    pub fn seconds(&self) -> f64 {
        self.spans.iter().map(|(begin, end)| (end - begin) as f64 * 1e-9).sum()
    }

    /// The longest spans in seconds of the drive, for the operator; empty if there is no span.
    pub fn describe(&self) -> String {
        let mut longest = self.spans.clone();
        longest.sort_by_key(|(begin, end)| (begin - end, *begin));
        let n_more = longest.len().saturating_sub(MAX_NAMED);
        longest.truncate(MAX_NAMED);
        longest.sort_unstable();
        let second = |stamp: i64| (stamp - self.begin.unwrap_or(stamp)) as f64 * 1e-9;
        let named: Vec<String> =
            longest.iter().map(|(begin, end)| format!("{:.1} to {:.1} s", second(*begin), second(*end))).collect();
        let more = if n_more > 0 { format!(" and {n_more} more") } else { String::new() };
        named.join(", ") + &more
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_with_a_short_pause_are_one_and_others_are_counted_without_their_pauses() {
        let mut spans = TimeSpans::default();
        spans.begin_drive(1_000_000_000);
        let s = |seconds: f64| (seconds * 1e9) as i64;
        for [begin, end] in [[2.0, 3.0], [3.5, 4.0], [6.0, 7.5]] {
            spans.add([s(begin), s(end)], s(1.0));
        }
        assert_eq!(spans.describe(), "1.0 to 3.0 s, 5.0 to 6.5 s");
        assert!((spans.seconds() - 3.5).abs() < 1e-9, "{}", spans.seconds());
    }
}
