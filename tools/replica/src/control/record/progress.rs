//! Progress of the recording of each topic.

/// Progress of one topic. It is kept across restarts of the run.
#[derive(Debug)]
pub struct Progress {
    pub(super) name: String,
    /// The next tick to write. `None` before the first tick was received.
    pub(super) next_tick: Option<u64>,
    /// Sequence number of the next message to write.
    pub(super) next_seq: u64,
    pub(super) n_messages: u64,
    pub(super) n_rows: u64,
    pub(super) n_dropped: u64,
    /// Whether a tick has been written.
    pub(super) begun: bool,
    pub(super) ended: bool,
}

impl Progress {
    /// No progress yet.
    pub fn new(name: String) -> Self {
        let next_tick = None;
        let next_seq = 0;
        let n_messages = 0;
        let n_rows = 0;
        let n_dropped = 0;
        Self { name, next_tick, next_seq, n_messages, n_rows, n_dropped, begun: false, ended: false }
    }
    /// Name of the topic.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// The next tick to write, once it is known.
    pub fn next_tick(&self) -> Option<u64> {
        self.next_tick
    }
    /// Messages and ticks that were dropped.
    pub fn n_dropped(&self) -> u64 {
        self.n_dropped
    }
    /// Whether the last tick is written.
    pub fn ended(&self) -> bool {
        self.ended
    }
    /// Sets the first tick to write. Ignored once a tick is written.
    pub fn start_at(&mut self, tick: u64) {
        if !self.begun {
            self.next_tick = Some(tick);
        }
    }
}

impl std::fmt::Display for Progress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {} messages, {} rows", self.name, self.n_messages, self.n_rows)?;
        if self.n_dropped > 0 {
            write!(f, ", {} dropped", self.n_dropped)?;
        }
        Ok(())
    }
}
