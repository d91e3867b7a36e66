//! The outputs of a step.

use crate::StepError;
use doubts::Doubt;
use ipc::{Loan, Received};
use messages::{Envelope, Message, TickRow};
use run::health::{Pulse, ReportedDoubt, Traffic};
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest number of notes of a stage: the heartbeat that carries them has 64 KiB, and an operator reads no more.
const MAX_NOTES: usize = 32;
const MAX_NOTE_CHARS: usize = 300;
/// Largest number of doubts of a stage, for the same reasons.
const MAX_DOUBTS: usize = 16;

/// The destination of a step's results.
#[derive(Default)]
pub struct Outputs {
    pub(crate) by_topic: BTreeMap<&'static str, Box<dyn AnyOutput>>,
    pub(crate) counters: BTreeMap<String, u64>,
    pub(crate) notes: Vec<String>,
    pub(crate) doubts: Vec<ReportedDoubt>,
    pub(crate) drive_time: Option<i64>,
    pub(crate) progress: Option<f64>,
    /// Pulse of the process, if there is one.
    pub(crate) pulse: Option<Arc<Pulse>>,
}

impl Outputs {
    pub(crate) fn output<T: Message>(&mut self, port: &str) -> Result<&mut dyn Output<T>, StepError> {
        let output = self
            .by_topic
            .get_mut(port)
            .ok_or_else(|| StepError::contract(format!("topic {port} is not among the stage's outputs")))?;
        match output.as_any().downcast_mut::<TypedOutput<T>>() {
            Some(output) => Ok(&mut *output.0),
            None => Err(StepError::contract(format!("topic {port} has another type"))),
        }
    }

    /// A slot for at most `capacity` rows. Memory that is never written is never used.
    pub fn loan<T: Message>(&mut self, capacity: usize) -> Result<Loan<T>, StepError> {
        self.output::<T>(T::TOPIC)?.loan(capacity)
    }

    /// Publishes the loan as the topic's next message. Waits while a consumer's queue is full. A number in the header,
    /// or in a row of poses, that is not finite is an error of this stage.
    pub fn publish<T: Message>(&mut self, loan: Loan<T>, stamp: i64) -> Result<(), StepError> {
        self.publish_on(T::TOPIC, loan, stamp, None)
    }

    /// Publishes one message with these rows and an empty header; no message without rows.
    pub fn publish_rows<T: Message>(
        &mut self,
        rows: &[T::Row],
        stamp: impl Fn(&T::Row) -> i64,
    ) -> Result<(), StepError> {
        let Some(first) = rows.first() else { return Ok(()) };
        let stamp = stamp(first);
        let mut loan = self.loan::<T>(rows.len())?;
        loan.grow_unset(rows.len())?.copy_from_slice(rows);
        self.publish(loan, stamp)
    }

    /// [`Outputs::publish_column`] with a copy of the rows.
    pub fn publish_column_rows<T: Message>(
        &mut self,
        header: T::Header,
        rows: &[T::Row],
        stamp: i64,
        seq: u64,
    ) -> Result<(), StepError> {
        let mut loan = self.loan::<T>(rows.len())?;
        *loan.header_mut() = header;
        loan.extend_from_slice(rows)?;
        self.publish_column(loan, stamp, seq)
    }

    /// Publishes a column of submap `seq`. Columns are published in the order of submaps, one for each; live, one for each
    /// submap that has arrived.
    pub fn publish_column<T: Message>(&mut self, loan: Loan<T>, stamp: i64, seq: u64) -> Result<(), StepError> {
        self.publish_on(T::TOPIC, loan, stamp, Some(seq))
    }

    /// Publishes on a port. With `seq`, the message is the column of this submap.
    pub(crate) fn publish_on<T: Message>(
        &mut self,
        port: &str,
        mut loan: Loan<T>,
        stamp: i64,
        seq: Option<u64>,
    ) -> Result<(), StepError> {
        let checked =
            messages::check_header::<T>(loan.header_mut()).and_then(|()| messages::check_rows::<T>(loan.rows()));
        checked
            .map_err(|fault| StepError::from(fault).at("this stage computed a message that must not be published"))?;
        let output = self.output::<T>(port)?;
        if let Some(seq) = seq {
            // After a restart from an older state, a stage again processes submaps that its predecessor published.
            if !output.skip_to(seq) {
                self.count("columns_published_before", 1);
                return Ok(());
            }
            let next = output.next_seq();
            if seq != next {
                let text = format!("{port} for submap {seq} published, but submap {next} was due");
                return Err(StepError::contract(text));
            }
        }
        output.publish(loan, stamp)
    }

    /// Reports progress within a long step: restarts the time after which the step counts as stalled.
    pub fn mark_progress(&self) {
        if let Some(pulse) = &self.pulse {
            pulse.mark_progress();
        }
    }

    /// Adds to a named counter of the run summary: items skipped, lost, masked or unseen.
    pub fn count(&mut self, name: &str, n: u64) {
        match self.counters.get_mut(name) {
            Some(count) => *count += n,
            None => drop(self.counters.insert(name.to_owned(), n)),
        }
    }

    /// Adds to several counters; zeros are left out.
    pub fn count_all<N: AsRef<str>>(&mut self, counters: impl IntoIterator<Item = (N, u64)>) {
        for (name, n) in counters.into_iter().filter(|(_, n)| *n > 0) {
            self.count(name.as_ref(), n);
        }
    }

    /// The value of a counter; 0 if nothing was counted. Counters are kept over restarts.
    pub fn counted(&self, name: &str) -> u64 {
        self.counters.get(name).copied().unwrap_or_default()
    }

    /// Reports a text to the operator, once per distinct text: in the log, the heartbeat and the run summary. The first 32
    /// texts are kept, up to 300 characters each.
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

    /// Reports that results should not be relied on as they are. `name` is in snake case; a later call with the same name
    /// replaces the doubt, so a stage may report a share that grows. `size` is in the unit that the text states. The text
    /// says what is doubtful, its size, the limit that it exceeds and what to do. The run ends with exit code 3.
    ///
    /// The first 16 doubts are kept, with up to 300 characters each.
    pub fn doubt(&mut self, name: &str, size: f64, text: impl Into<String>) {
        let text = text.into().chars().take(MAX_NOTE_CHARS).collect();
        let doubt = ReportedDoubt { name: name.to_owned(), size, text };
        match self.doubts.iter().position(|known| known.name == name) {
            Some(index) => self.doubts[index] = doubt,
            None if self.doubts.len() < MAX_DOUBTS => self.doubts.push(doubt),
            None => self.count("doubts_left_out", 1),
        }
    }

    /// Reports a doubt of the project's own stages: see [`doubt`](Self::doubt).
    pub fn report_doubt(&mut self, doubt: &Doubt) {
        self.doubt(&doubt.name(), doubt.size(), doubt.to_string());
    }

    /// Withdraws the doubt `name`, if there is one.
    pub fn withdraw_doubt(&mut self, name: &str) {
        self.doubts.retain(|doubt| doubt.name != name);
    }

    /// Sources only: the drive's time at this tick. Barriers and rates depend on it.
    pub fn set_drive_time(&mut self, stamp: i64) {
        self.drive_time = Some(stamp);
    }

    /// Sources only: share of the drive that has been read, 0 to 1.
    pub fn set_progress(&mut self, share: f64) {
        self.progress = Some(share.clamp(0.0, 1.0));
    }
}

/// An output of the topic of `T`.
pub(crate) trait Output<T: Message> {
    fn loan(&self, capacity: usize) -> Result<Loan<T>, StepError>;
    fn publish(&mut self, loan: Loan<T>, stamp: i64) -> Result<(), StepError>;
    fn next_seq(&self) -> u64;
    /// Live: columns are numbered by the submaps that arrived. `false` if this one has been published.
    fn skip_to(&mut self, _seq: u64) -> bool {
        true
    }
    /// Hands over what was published and is kept in memory.
    fn take_published(&mut self, _take: &mut PublishedSink<'_>) -> Result<(), StepError> {
        Ok(())
    }
    /// Hands over the published messages, typed.
    fn take_messages(&mut self) -> Vec<Received<T>> {
        Vec::new()
    }
    /// The view of the runner, for an output in shared memory.
    fn ticked(&mut self) -> Option<&mut dyn TickedOutput> {
        None
    }
}

/// An output from the runner's point of view.
pub(crate) trait TickedOutput {
    fn topic(&self) -> &str;
    /// Whether all consumers are connected.
    fn connect(&self) -> Result<bool, StepError>;
    /// Publishes that the tick is complete.
    fn publish_tick(&mut self, row: TickRow) -> Result<(), StepError>;
    /// Whether consumers have taken everything.
    fn is_drained(&mut self) -> Result<bool, StepError>;
    /// Continues the numbers of messages published before this process started.
    fn resume(&mut self, published: Traffic);
    fn traffic(&self) -> Traffic;
    /// Updates the number of messages that wait for a consumer in the heartbeat.
    fn note_waiting(&mut self) -> Result<(), StepError>;
}

/// An output whose type is available only in the step: a [`TypedOutput`].
pub(crate) trait AnyOutput {
    fn as_any(&mut self) -> &mut dyn Any;
    /// See [`Output::take_published`].
    fn take_published(&mut self, take: &mut PublishedSink<'_>) -> Result<(), StepError>;
    /// See [`Output::ticked`].
    fn ticked(&mut self) -> Option<&mut dyn TickedOutput>;
}

/// Takes over a message: envelope, the submap of a column if only the run on another host can check it, header, rows.
pub(crate) type PublishedSink<'a> = dyn FnMut(&Envelope, Option<u64>, &[u8], &[u8]) -> Result<(), StepError> + 'a;

/// The implementation of [`AnyOutput`].
pub(crate) struct TypedOutput<T: Message>(pub(crate) Box<dyn Output<T>>);

impl<T: Message> AnyOutput for TypedOutput<T> {
    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
    fn take_published(&mut self, take: &mut PublishedSink<'_>) -> Result<(), StepError> {
        self.0.take_published(take)
    }
    fn ticked(&mut self) -> Option<&mut dyn TickedOutput> {
        self.0.ticked()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory_output::memory_output;
    use messages::{StampedPose, SubmapTopic, TrajectoryTopic};

    fn outputs() -> Outputs {
        let mut outputs = Outputs::default();
        outputs.by_topic.insert(SubmapTopic::TOPIC, memory_output::<SubmapTopic>());
        outputs.by_topic.insert(TrajectoryTopic::TOPIC, memory_output::<TrajectoryTopic>());
        outputs
    }

    #[test]
    fn header_with_nan_is_a_fault_of_the_stage_that_publishes_it() {
        let mut outputs = outputs();
        let mut loan = outputs.loan::<SubmapTopic>(0).expect("a loan");
        loan.header_mut().max[2] = f32::NAN;
        let error = outputs.publish(loan, 0).expect_err("refused");
        assert!(matches!(error, StepError::Contract(_)), "{error}");
        assert!(
            error.to_string().contains("this stage computed") && error.to_string().contains("submap: header max[2]")
        );
    }

    #[test]
    fn pose_that_is_not_finite_is_not_published() {
        let mut outputs = outputs();
        let mut publish = |x: f64| {
            let mut loan = outputs.loan::<TrajectoryTopic>(2).expect("a loan");
            let mut rows = [StampedPose::default(); 2];
            rows[1].odom_from_body.translation[0] = x;
            loan.extend_from_slice(&rows).expect("room");
            outputs.publish(loan, 0)
        };
        assert!(publish(1e6).is_ok());
        let error = publish(f64::INFINITY).expect_err("refused").to_string();
        assert!(error.contains("trajectory: row 1 odom_from_body.translation[0] is inf"), "{error}");
    }

    #[test]
    fn doubt_of_the_same_name_replaces_the_one_before() {
        let mut outputs = Outputs::default();
        outputs.doubt("few", 0.5, "half");
        outputs.doubt("few", 0.25, "a quarter");
        outputs.count("points", 3);
        assert_eq!((outputs.doubts.len(), outputs.doubts[0].size, outputs.counted("points")), (1, 0.25, 3));
        outputs.withdraw_doubt("few");
        assert!(outputs.doubts.is_empty() && outputs.counted("lines") == 0);
    }
}
