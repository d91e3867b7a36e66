//! How a step reads and writes messages.

use crate::ports::{SharedOutput, TickedOutput};
use crate::{Bytes, StepError, next_message};
use messages::{Envelope, Message, Pod, pod};
use std::any::Any;
use std::collections::BTreeMap;

/// Notes of a stage: the heartbeat that carries them has 64 KiB, and nobody reads more.
const MAX_NOTES: usize = 32;
const MAX_NOTE_CHARS: usize = 300;

/// A message that the stage may read, and keep for later steps (at most [`Message::BORROWED`] at a time).
pub struct Received<T: Message>(Source<T>);

enum Source<T: Message> {
    /// In shared memory, where its producer wrote it.
    Shared(ipc::Received<T>),
    /// In memory of this process: from a saved state or a test.
    Owned { envelope: Envelope, header: Box<T::Header>, rows: Vec<T::Row> },
}

impl<T: Message> Received<T> {
    pub(crate) fn owned(envelope: Envelope, header: T::Header, rows: Vec<T::Row>) -> Self {
        Self(Source::Owned { envelope, header: Box::new(header), rows })
    }
    pub(crate) fn shared(message: ipc::Received<T>) -> Self {
        Self(Source::Shared(message))
    }
    fn envelope(&self) -> &Envelope {
        match &self.0 {
            Source::Shared(message) => message.envelope(),
            Source::Owned { envelope, .. } => envelope,
        }
    }
    /// Number of the message on its topic; on a column, of the submap.
    pub fn seq(&self) -> u64 {
        self.envelope().seq
    }
    /// Nanoseconds since the Unix epoch.
    pub fn stamp(&self) -> i64 {
        self.envelope().stamp
    }
    /// The fixed part.
    pub fn header(&self) -> &T::Header {
        match &self.0 {
            Source::Shared(message) => message.header(),
            Source::Owned { header, .. } => header,
        }
    }
    /// The rows, in place.
    pub fn rows(&self) -> &[T::Row] {
        match &self.0 {
            Source::Shared(message) => message.rows(),
            Source::Owned { rows, .. } => rows,
        }
    }
    /// A copy of the whole message as bytes, for [`crate::Stage::save`].
    pub fn to_bytes(&self) -> Bytes {
        Bytes(self.parts().concat())
    }
    /// Envelope, header and rows, in place.
    pub(crate) fn parts(&self) -> [&[u8]; 3] {
        let (envelope, header) = (std::slice::from_ref(self.envelope()), std::slice::from_ref(self.header()));
        [pod::bytes_from_rows(envelope), pod::bytes_from_rows(header), pod::bytes_from_rows(self.rows())]
    }
    /// The inverse of [`Received::to_bytes`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StepError> {
        let mut rest = bytes;
        let message = next_message(&mut rest)?;
        if rest.is_empty() {
            return Ok(message);
        }
        Err(StepError::data(format!("saved {} message: {} bytes follow its rows", T::TOPIC, rest.len())))
    }
}

/// All messages of one tick.
#[derive(Default)]
pub struct Inputs {
    pub(crate) by_topic: BTreeMap<&'static str, Box<dyn Any>>,
}

impl Inputs {
    /// The tick's messages of `T` in the order they were published; empty if there are none (any more).
    pub fn take<T: Message>(&mut self) -> Vec<Received<T>> {
        self.by_topic
            .get_mut(T::TOPIC)
            .and_then(|messages| messages.downcast_mut::<Vec<Received<T>>>())
            .map(std::mem::take)
            .unwrap_or_default()
    }
    pub(crate) fn push<T: Message>(&mut self, message: Received<T>) {
        let messages = self.by_topic.entry(T::TOPIC).or_insert_with(|| Box::new(Vec::<Received<T>>::new()));
        if let Some(messages) = messages.downcast_mut::<Vec<Received<T>>>() {
            messages.push(message);
        }
    }
}

/// A message under construction, in the slot from which its consumers will read it. May be kept over several steps.
pub struct Loan<T: Message>(Slot<T>);

enum Slot<T: Message> {
    Shared(ipc::Loan<T>),
    Owned { capacity: usize, header: Box<T::Header>, rows: Vec<T::Row> },
}

impl<T: Message> Loan<T> {
    fn owned(capacity: usize) -> Self {
        Self(Slot::Owned { capacity, header: Box::default(), rows: Vec::new() })
    }
    pub(crate) fn shared(loan: ipc::Loan<T>) -> Self {
        Self(Slot::Shared(loan))
    }
    pub(crate) fn into_shared(self) -> Option<ipc::Loan<T>> {
        match self.0 {
            Slot::Shared(loan) => Some(loan),
            Slot::Owned { .. } => None,
        }
    }
    /// Rows that fit.
    pub fn capacity(&self) -> usize {
        match &self.0 {
            Slot::Shared(loan) => loan.capacity(),
            Slot::Owned { capacity, .. } => *capacity,
        }
    }
    /// Rows written so far.
    pub fn rows(&self) -> &[T::Row] {
        match &self.0 {
            Slot::Shared(loan) => loan.rows(),
            Slot::Owned { rows, .. } => rows,
        }
    }
    /// The fixed part, zero at first.
    pub fn header_mut(&mut self) -> &mut T::Header {
        match &mut self.0 {
            Slot::Shared(loan) => loan.header_mut(),
            Slot::Owned { header, .. } => header,
        }
    }
    /// Appends `n` zeroed rows and lends them for writing. `None` if they do not fit.
    pub fn grow(&mut self, n: usize) -> Option<&mut [T::Row]> {
        match &mut self.0 {
            Slot::Shared(loan) => loan.grow(n),
            Slot::Owned { capacity, rows, .. } => {
                let start = rows.len();
                if n > *capacity - start {
                    return None;
                }
                rows.resize(start + n, T::Row::zeroed());
                Some(&mut rows[start..])
            }
        }
    }
    /// Appends `n` rows of whatever content and lends them for writing. Every one must be written, or the result depends on
    /// what stood there before; it costs half of [`Loan::grow`]. `None` if they do not fit.
    pub fn grow_unset(&mut self, n: usize) -> Option<&mut [T::Row]> {
        if matches!(self.0, Slot::Owned { .. }) {
            return self.grow(n);
        }
        let Slot::Shared(loan) = &mut self.0 else { return None };
        loan.grow_unset(n)
    }
    /// Appends copies of `new_rows`. `None` if they do not fit.
    #[must_use = "rows that do not fit are not written"]
    pub fn extend_from_slice(&mut self, new_rows: &[T::Row]) -> Option<()> {
        if let Slot::Shared(loan) = &mut self.0 {
            return loan.extend_from_slice(new_rows);
        }
        self.grow(new_rows.len())?.copy_from_slice(new_rows);
        Some(())
    }
}

/// Where a step's results go.
#[derive(Default)]
pub struct Outputs {
    pub(crate) by_topic: BTreeMap<&'static str, Box<dyn AnyOutput>>,
    pub(crate) counters: BTreeMap<String, u64>,
    pub(crate) notes: Vec<String>,
    pub(crate) drive_time: Option<i64>,
    pub(crate) progress: Option<f64>,
    /// Of the process, if there is one.
    pub(crate) pulse: Option<std::sync::Arc<crate::health::Pulse>>,
}

impl Outputs {
    fn port<T: Message>(&mut self) -> Result<&mut Box<dyn AnyOutput>, StepError> {
        self.by_topic
            .get_mut(T::TOPIC)
            .ok_or_else(|| StepError::Contract(format!("topic {} is not among the stage's outputs", T::TOPIC)))
    }

    /// A slot for at most `capacity` rows. Memory that is never written is never used.
    pub fn loan<T: Message>(&mut self, capacity: usize) -> Result<Loan<T>, StepError> {
        let output = self.port::<T>()?.as_any();
        if let Some(shared) = output.downcast_mut::<SharedOutput<T>>() {
            return Ok(Loan::shared(shared.loan(capacity)?));
        }
        if output.is::<MemoryOutput<T>>() {
            return Ok(Loan::owned(capacity));
        }
        Err(StepError::Contract(format!("topic {} has another type", T::TOPIC)))
    }

    /// Publishes the loan as the topic's next message. Waits while a consumer's queue is full.
    pub fn publish<T: Message>(&mut self, loan: Loan<T>, stamp: i64) -> Result<(), StepError> {
        self.publish_as(loan, stamp, None)
    }

    /// Publishes a column of submap `seq`. Columns come in the order of submaps, one for each; live, for each that came.
    pub fn publish_column<T: Message>(&mut self, loan: Loan<T>, stamp: i64, seq: u64) -> Result<(), StepError> {
        self.publish_as(loan, stamp, Some(seq))
    }

    fn publish_as<T: Message>(&mut self, loan: Loan<T>, stamp: i64, seq: Option<u64>) -> Result<(), StepError> {
        let output = self.port::<T>()?;
        if let Some(seq) = seq {
            // Taken up from an older state, a stage comes to submaps again that the process before it has done.
            if !output.skip_to(seq) {
                self.count("columns_published_before", 1);
                return Ok(());
            }
        }
        let next = output.next_seq();
        if let Some(seq) = seq
            && seq != next
        {
            return Err(StepError::Contract(format!(
                "{} for submap {seq} published when that of {next} was due",
                T::TOPIC
            )));
        }
        let output = output.as_any();
        if let Some(shared) = output.downcast_mut::<SharedOutput<T>>() {
            return shared.publish(loan, stamp);
        }
        if let (Some(memory), Slot::Owned { header, rows, .. }) = (output.downcast_mut::<MemoryOutput<T>>(), loan.0) {
            let envelope = Envelope { seq: next, stamp, len: rows.len() as u32, ..Envelope::default() };
            memory.published.push(Received::owned(envelope, *header, rows));
            memory.next_seq += 1;
            return Ok(());
        }
        Err(StepError::Contract(format!("topic {} has another type", T::TOPIC)))
    }

    /// Says that something got done in a step that takes long: the time after which it stalls begins anew.
    pub fn mark_progress(&self) {
        if let Some(pulse) = &self.pulse {
            pulse.mark_progress();
        }
    }

    /// Adds to a named counter of the run summary: what was skipped, lost, masked, unseen.
    pub fn count(&mut self, name: &'static str, n: u64) {
        match self.counters.get_mut(name) {
            Some(count) => *count += n,
            None => drop(self.counters.insert(name.to_owned(), n)),
        }
    }

    /// Says something to the operator, once per distinct text. The first 32 texts are kept, up to 300 characters each.
    pub fn note(&mut self, text: impl Into<String>) {
        let text: String = text.into().chars().take(MAX_NOTE_CHARS).collect();
        if self.notes.contains(&text) {
            return;
        }
        if self.notes.len() < MAX_NOTES {
            self.notes.push(text);
        } else {
            self.count("notes_left_out", 1);
        }
    }

    /// Sources only: the drive's time at this tick, from which barriers and rates are reckoned.
    pub fn set_drive_time(&mut self, stamp: i64) {
        self.drive_time = Some(stamp);
    }

    /// Sources only: share of the drive that has been read, 0 to 1.
    pub fn set_progress(&mut self, share: f64) {
        self.progress = Some(share.clamp(0.0, 1.0));
    }
}

/// An output whose type is known to the step alone.
pub(crate) trait AnyOutput {
    fn as_any(&mut self) -> &mut dyn Any;
    fn next_seq(&self) -> u64;
    /// Live: columns are numbered by the submaps that came, whatever was due. `false` if this one has been published.
    fn skip_to(&mut self, _seq: u64) -> bool {
        true
    }
    /// Hands over what was published and is kept in memory: envelope, header, rows.
    fn take_published(&mut self, _take: &mut PublishedSink<'_>) -> Result<(), StepError> {
        Ok(())
    }
    /// What the runner needs of an output in shared memory.
    fn ticked(&mut self) -> Option<&mut dyn TickedOutput> {
        None
    }
}

/// Takes over a message: envelope, header, rows.
pub(crate) type PublishedSink<'a> = dyn FnMut(&Envelope, &[u8], &[u8]) -> Result<(), StepError> + 'a;

/// Puts a message that was kept as bytes among the inputs.
pub(crate) fn push_bytes<T: Message>(inputs: &mut Inputs, bytes: &[u8]) -> Result<(), StepError> {
    inputs.push::<T>(Received::from_bytes(bytes)?);
    Ok(())
}

/// Keeps what was published, for tests and for a stage alone.
pub(crate) struct MemoryOutput<T: Message> {
    pub(crate) next_seq: u64,
    pub(crate) published: Vec<Received<T>>,
}

pub(crate) fn memory_output<T: Message>() -> Box<dyn AnyOutput> {
    Box::new(MemoryOutput::<T> { next_seq: 0, published: Vec::new() })
}

impl<T: Message> AnyOutput for MemoryOutput<T> {
    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
    fn next_seq(&self) -> u64 {
        self.next_seq
    }
    fn take_published(&mut self, take: &mut PublishedSink<'_>) -> Result<(), StepError> {
        // More would not fit its consumers' queues in a run.
        if self.published.len() > T::QUEUE {
            return Err(StepError::Contract(format!("{}: more than {} messages in one tick", T::TOPIC, T::QUEUE)));
        }
        for message in self.published.drain(..) {
            let header = pod::bytes_from_rows(std::slice::from_ref(message.header()));
            take(message.envelope(), header, pod::bytes_from_rows(message.rows()))?;
        }
        Ok(())
    }
}
