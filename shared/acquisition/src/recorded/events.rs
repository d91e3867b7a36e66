//! Stamped items, taken tick by tick.

/// A list in order of time, and the read position.
#[derive(Debug)]
pub(crate) struct Events<T> {
    events: Vec<T>,
    stamp_of: fn(&T) -> i64,
    next: usize,
}

impl<T> Events<T> {
    /// A list at its start. `events` must be sorted by stamp.
    pub(crate) fn new(events: Vec<T>, stamp_of: fn(&T) -> i64) -> Self {
        Self { events, stamp_of, next: 0 }
    }

    /// Index of the next event, for the saved state.
    pub(crate) fn position(&self) -> u64 {
        self.next as u64
    }

    /// Continues at a saved position. `false` if the list is shorter.
    pub(crate) fn resume(&mut self, position: u64) -> bool {
        self.next = position as usize;
        self.next <= self.events.len()
    }

    /// Skips the events before `begin` and returns their number.
    pub(crate) fn skip_before(&mut self, begin: i64) -> u64 {
        let first = self.next;
        self.next = self.next.max(self.events.partition_point(|event| (self.stamp_of)(event) < begin));
        (self.next - first) as u64
    }

    /// Takes the next events before `end`, at most `limit` of them; the others stay for the next call.
    pub(crate) fn take_before(&mut self, end: i64, limit: usize) -> &[T] {
        let first = self.next;
        let due = self.events.partition_point(|event| (self.stamp_of)(event) < end);
        self.next = due.min(first.saturating_add(limit)).max(first);
        &self.events[first..self.next]
    }

    /// Number of events left.
    pub(crate) fn n_left(&self) -> u64 {
        (self.events.len() - self.next.min(self.events.len())) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_event_comes_once_and_in_its_tick() {
        let mut events = Events::new(vec![1, 5, 5, 9, 20, 21, 22, 23], |stamp| *stamp);
        assert_eq!(events.skip_before(5), 1);
        assert_eq!(events.take_before(5, 9), [] as [i64; 0]);
        assert_eq!(events.take_before(10, 9), [5, 5, 9]);
        assert_eq!(events.take_before(24, 3), [20, 21, 22]);
        let position = events.position();
        assert_eq!(events.take_before(24, 3), [23]);
        assert!(events.resume(position));
        assert_eq!((events.n_left(), events.take_before(30, 9).len(), events.n_left()), (1, 1, 0));
        assert!(!events.resume(9));
    }
}
